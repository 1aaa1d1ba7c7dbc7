"""What others measured: the wheels of their tests, and their curves of slip over slope."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from lpet_sim.soil.spec import Fraction, NotNegative, Positive, WheelSpec
from lpet_sim.spec import Spec


class ReferenceWheelSpec(WheelSpec):
    """A wheel that was tested, with its test.

    Attributes:
        name: What it is called.
        source: Where each number comes from.
        load_n: Load on the wheel in the test.
        gravity_mps2: Gravity of the test.
    """

    name: Annotated[str, Field(min_length=1)]
    source: Annotated[str, Field(min_length=1)]
    load_n: Positive
    gravity_mps2: Positive = 9.81

    def bare(self) -> WheelSpec:
        """Give the wheel without its test."""
        return WheelSpec.model_validate(self.model_dump(include=set(WheelSpec.model_fields)))


class PublishedCurve(Spec):
    """Slip of a rover over the slope it climbs, as published.

    Attributes:
        label: What the legend calls it.
        source: Where it comes from, and how well it is known.
        soils: Names of the library's soils that it is to be drawn beside.
        slope_rad: Slopes.
        slip: Slip on each.
        slip_tolerance: Half the spread between tests or within the published range, at each.
        upper_bound: Whether the points only say that slip was below them.
    """

    label: Annotated[str, Field(min_length=1)]
    source: Annotated[str, Field(min_length=1)]
    soils: Annotated[tuple[str, ...], Field(min_length=1)]
    slope_rad: Annotated[tuple[float, ...], Field(min_length=1)]
    slip: tuple[Fraction, ...]
    slip_tolerance: tuple[NotNegative, ...] | None = None
    upper_bound: bool = False

    @model_validator(mode="after")
    def _columns(self) -> Self:
        columns = [self.slope_rad, self.slip, self.slip_tolerance or self.slip]
        if len({len(column) for column in columns}) > 1:
            raise ValueError("slope_rad, slip and slip_tolerance must have the same length")
        return self
