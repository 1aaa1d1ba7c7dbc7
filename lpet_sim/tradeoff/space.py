"""The space of sensors: values or a range for each parameter, and how candidates are drawn."""

from __future__ import annotations

import math
from collections.abc import Mapping
from itertools import product
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, model_validator
from scipy.stats import qmc

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.spec import Spec
from lpet_sim.tradeoff.candidate import PARAMETERS, Candidate, Grade

GRID_MAX = 200_000
"""Most candidates of a full grid: they would take hours."""


def _as_axis(value: object) -> object:
    """Let a single number, and a list, stand for an axis of these values."""
    if isinstance(value, int | float):
        return {"values": [value]}
    return {"values": value} if isinstance(value, list | tuple) else value


def _as_grades(value: object) -> object:
    return (value,) if isinstance(value, str) else value


class AxisSpec(Spec):
    """What a parameter may be: some values, or all between two.

    Attributes:
        values: The values.
        low: Lower end of a range.
        high: Its upper end.
        count: Values that a grid, and a curve of the sensitivity, takes of a range.
    """

    values: tuple[float, ...] = ()
    low: float | None = None
    high: float | None = None
    count: Annotated[int, Field(ge=2, le=100)] = 5

    @model_validator(mode="after")
    def _is_something(self) -> Self:
        ends = (self.low is not None) + (self.high is not None)
        if bool(self.values) == bool(ends) or ends == 1:
            raise ValueError("is empty: give a number, a list of numbers, or both low and high")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"the range is empty: low {self.low:g} is not below {self.high:g}")
        return self

    @property
    def limits(self) -> tuple[float, float]:
        """The least and the greatest value."""
        ends = self.values or (self.low or 0.0, self.high or 0.0)
        return min(ends), max(ends)

    def grid(self) -> tuple[float, ...]:
        """Give the values, or equally spaced ones of the range."""
        low, high = self.limits
        return self.values or tuple(float(x) for x in np.linspace(low, high, self.count))

    def at(self, share: Array) -> Array:
        """Give the values at shares in [0, 1), evenly over the range or over the list."""
        low, high = self.limits
        if not self.values:
            return low + (high - low) * share
        index = np.minimum((share * len(self.values)).astype(np.int64), len(self.values) - 1)
        return np.asarray(self.values)[index]


Axis = Annotated[AxisSpec, BeforeValidator(_as_axis)]
Grades = Annotated[tuple[Grade, ...], BeforeValidator(_as_grades)]


def _single(name: str) -> AxisSpec:
    return AxisSpec(values=(float(Candidate.model_fields[name].default),))


class SensorSpaceSpec(Spec):
    """The sensors to choose from: each parameter a number, a list, or ``{low, high, count}``.

    What is not given is that of the default camera. The fields are those of `Candidate`.

    Attributes:
        field_of_view_rad: Horizontal field of view.
        resolution_px: Width of an image.
        baseline_m: Distance between the eyes.
        mast_height_m: Height of the eyes above flat ground.
        depression_rad: Angle of the optical axes below the horizon.
        image_interval_m: Distance driven between image pairs.
        matching_sigma_px: Noise of a sighting's image coordinate, 1 sigma.
        imu: Grades of inertial units.
        aspect: Height of an image over its width, the same for all.
    """

    field_of_view_rad: Axis = Field(default_factory=lambda: _single("field_of_view_rad"))
    resolution_px: Axis = Field(default_factory=lambda: _single("resolution_px"))
    baseline_m: Axis = Field(default_factory=lambda: _single("baseline_m"))
    mast_height_m: Axis = Field(default_factory=lambda: _single("mast_height_m"))
    depression_rad: Axis = Field(default_factory=lambda: _single("depression_rad"))
    image_interval_m: Axis = Field(default_factory=lambda: _single("image_interval_m"))
    matching_sigma_px: Axis = Field(default_factory=lambda: _single("matching_sigma_px"))
    imu: Grades = ("ln200",)
    aspect: Annotated[float, Field(gt=0.1, le=4.0)] = 1.0

    @model_validator(mode="after")
    def _is_possible(self) -> Self:
        if not self.imu:
            raise ValueError("imu is empty: give at least one grade")
        for end in (0, 1):
            ends = {name: self.axis(name).limits[end] for name in PARAMETERS[:-1]}
            try:
                self.candidate({**ends, "imu": self.imu[0]})
            except ValidationError as error:
                problem = error.errors(include_url=False)[0]
                raise ValueError(f"'{problem['loc'][0]}': {problem['msg']}") from None
        return self

    def axis(self, name: str) -> AxisSpec:
        """Give the axis of a parameter that is a number."""
        axis: AxisSpec = getattr(self, name)
        return axis

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameters that have more than one value, in the order of tables."""
        numbers = [n for n in PARAMETERS[:-1] if self.axis(n).limits[0] < self.axis(n).limits[1]]
        return (*numbers, *(("imu",) if len(set(self.imu)) > 1 else ()))

    def candidate(self, values: Mapping[str, Any]) -> Candidate:
        """Make a candidate from values by the names of the parameters."""
        width = round(float(values["resolution_px"]))
        return Candidate.model_validate({**values, "resolution_px": width, "aspect": self.aspect})

    def choices(self, name: str) -> tuple[Any, ...]:
        """Give the values of a parameter for a grid or a curve."""
        return self.imu if name == "imu" else self.axis(name).grid()

    @property
    def grid_size(self) -> int:
        """How many candidates the full grid has."""
        return math.prod(len(self.choices(name)) for name in PARAMETERS)


class SamplingSpec(Spec):
    """How candidates are drawn from the space.

    Attributes:
        kind: ``latin_hypercube``, or ``grid`` for every combination.
        count: Candidates of the hypercube.
    """

    kind: Literal["latin_hypercube", "grid"] = "latin_hypercube"
    count: Annotated[int, Field(ge=2, le=GRID_MAX)] = 256


def draw_candidates(
    space: SensorSpaceSpec, sampling: SamplingSpec, seed: int
) -> tuple[Candidate, ...]:
    """Draw the candidates: the grid, or a Latin hypercube over the parameters.

    Args:
        space: What there is to choose from.
        sampling: How to draw; a space without choice has one candidate either way.
        seed: Of the hypercube; the grid has none.

    Raises:
        SpecError: The grid is too large.
    """
    if sampling.kind == "grid":
        return _grid(space)
    if not space.varied:
        return (space.candidate({name: space.choices(name)[0] for name in PARAMETERS}),)
    rng = stream(seed, "tradeoff", "latin_hypercube")
    shares = qmc.LatinHypercube(len(PARAMETERS), rng=rng).random(sampling.count)
    columns: dict[str, Any] = {
        name: space.axis(name).at(shares[:, i]) for i, name in enumerate(PARAMETERS[:-1])
    }
    index = np.minimum((shares[:, -1] * len(space.imu)).astype(np.int64), len(space.imu) - 1)
    columns["imu"] = [space.imu[i] for i in index]
    rows = zip(*columns.values(), strict=True)
    return tuple(space.candidate(dict(zip(PARAMETERS, row, strict=True))) for row in rows)


def _grid(space: SensorSpaceSpec) -> tuple[Candidate, ...]:
    if space.grid_size > GRID_MAX:
        raise SpecError(
            f"the grid has {space.grid_size} candidates, more than {GRID_MAX}: give fewer values, "
            "or take sampling.kind latin_hypercube"
        )
    combinations = product(*(space.choices(name) for name in PARAMETERS))
    return tuple(space.candidate(dict(zip(PARAMETERS, row, strict=True))) for row in combinations)
