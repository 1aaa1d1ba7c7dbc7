"""What a study of goal reachability is: ground, goal, starts, rover, and what varies."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

from lpet_sim.errors import SpecError
from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.rng import stream
from lpet_sim.spec import Spec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.load import named_terrain, terrain_beside
from lpet_sim.terrain.rock_spec import RockAbundanceSpec
from lpet_sim.terrain.spec import TerrainSpec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Place = tuple[float, float]


class SearchSpec(Spec):
    """How hard the planner looks for a way.

    Attributes:
        iterations: Iterations of RRT-Connect for each start. A choice: some 0.1 s where it fails.
        stride_m: Longest branch of its trees [m]. A choice, about the free way between rocks.
    """

    iterations: Annotated[int, Field(gt=0)] = 20_000
    stride_m: Positive = 12.0


class ReachSpec(Spec):
    """Whether a rover can get to a goal, over random terrains and random starts.

    Each terrain is a square about the world's origin, which the rover's origin does not leave.

    Attributes:
        name: What the study is called.
        terrain: The ground, or the name of a preset, or the path of a YAML file.
        size_m: Side of the square [m].
        goal_m: The goal, (x, y) in the world [m].
        goal_radius_m: The goal counts as reached within this distance [m]; 0: at the very place.
        starts_m: Starts that are given [m]; they come before the random ones.
        starts: Number of random starts on each terrain.
        start_distances_m: Ring about the goal that random starts are drawn from, least and largest
            distance [m]; None: the whole square.
        starts_stand: Whether random starts are drawn among the places where the rover can stand and
            turn; else anywhere, and one in a rock counts as a start that does not reach the goal.
        terrains: Number of terrains for each abundance and factor.
        rock_factors: The paper's K: the numbers of rocks are multiplied by each of these in turn.
        abundances: Fractions of the ground covered by rocks, in place of the terrain's own, each in
            turn; empty: the terrain's own.
        mobility: What ground is to the rover.
        cell_m: Distance of the map's nodes [m]. Finer ones leave less undecided.
        search: How hard the planner looks.
    """

    name: str = "reach"
    terrain: Annotated[TerrainSpec, BeforeValidator(named_terrain)]
    size_m: Annotated[float, Field(ge=5.0, le=1000.0)] = 200.0
    goal_m: Place
    goal_radius_m: NotNegative = 3.0
    starts_m: tuple[Place, ...] = ()
    starts: Annotated[int, Field(ge=0)] = 100
    start_distances_m: tuple[NotNegative, Positive] | None = None
    starts_stand: bool = True
    terrains: Annotated[int, Field(gt=0)] = 1
    rock_factors: Annotated[tuple[Positive, ...], Field(min_length=1)] = (1.0,)
    abundances: tuple[Positive, ...] = ()
    mobility: MobilitySpec = MobilitySpec()
    cell_m: Annotated[float, Field(ge=0.01, le=0.5)] = 0.1
    search: SearchSpec = SearchSpec()

    @classmethod
    def files_beside(cls, mapping: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Find the files of terrain and soils."""
        if "terrain" not in mapping:
            return mapping
        return mapping | {"terrain": terrain_beside(mapping["terrain"], folder)}

    @property
    def box(self) -> Box:
        """The square [m]."""
        return Box.around(0.0, 0.0, self.size_m / 2)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        for what, places in (("goal_m", [self.goal_m]), ("starts_m", self.starts_m)):
            for xy in places:
                _check_inside(what, xy, self.size_m / 2)
        if not (self.starts or self.starts_m):
            raise ValueError("there is no start: give starts_m, or a number of starts above 0")
        if self.start_distances_m is not None:
            _check_ring(self.start_distances_m, self.goal_m, self.size_m / 2)
        if 2 * self.cell_m > self.mobility.slope_scale_m:
            raise ValueError(
                f"cell_m may be at most half of mobility.slope_scale_m, "
                f"{self.mobility.slope_scale_m / 2:g}"
            )
        return self

    @model_validator(mode="after")
    def _rocks_vary(self) -> Self:
        varied = [name for name in ("rock_factors", "abundances") if self._is_varied(name)]
        if varied and self.terrain.rocks is None:
            raise ValueError(
                f"{varied[0]} cannot vary the rocks of a terrain without rocks; give it rocks, or "
                "leave it out"
            )
        if self.abundances and not isinstance(self.terrain.rocks, RockAbundanceSpec):
            raise ValueError("abundances need a terrain whose rocks are of kind abundance")
        return self

    def _is_varied(self, name: str) -> bool:
        return bool(getattr(self, name)) and getattr(self, name) != (1.0,)


def _check_inside(what: str, xy: Place, half_m: float) -> None:
    if max(abs(xy[0]), abs(xy[1])) > half_m:
        raise ValueError(
            f"{what} holds ({xy[0]:g}, {xy[1]:g}) m, outside the square; both numbers must lie "
            f"within +-{half_m:g}"
        )


def _check_ring(ring: tuple[float, float], goal: Place, half_m: float) -> None:
    if ring[0] >= ring[1]:
        raise ValueError(
            f"start_distances_m must be two distances in order, not {ring[0]:g} and {ring[1]:g}"
        )
    farthest = math.hypot(abs(goal[0]) + half_m, abs(goal[1]) + half_m)
    if ring[0] >= farthest:
        raise ValueError(
            f"start_distances_m begins at {ring[0]:g} m, but no place of the square is farther "
            f"than {farthest:.1f} m from the goal"
        )


@dataclass(frozen=True)
class Case:
    """One terrain of a study.

    Attributes:
        abundance: Fraction of the ground covered by rocks before the factor; NaN where the rocks
            are a table or there are none.
        factor: What the number of rocks is multiplied by, the paper's K.
        index: Which of the terrains with this abundance and factor.
        seed: Seed of the terrain, its starts and searches; the same for every abundance and
            factor.
        terrain: The terrain.
    """

    abundance: float
    factor: float
    index: int
    seed: int
    terrain: TerrainSpec

    @property
    def key(self) -> str:
        """Name of the case's file."""
        return case_key(self.abundance, self.factor, self.index)


def case_key(abundance: float, factor: float, index: int) -> str:
    """Give the name of a terrain's file from what it is among the terrains of a study."""
    rocks = "own" if math.isnan(abundance) else f"k{abundance:g}"
    return f"{rocks}_K{factor:g}_{index:04d}"


def terrain_seed(seed: int, index: int) -> int:
    """Give the seed of a study's terrain: with it ``lpet simulate`` builds the same ground."""
    return int(stream(seed, "reach", "terrain", index).integers(1, 2**31))


def cases_of(spec: ReachSpec, seed: int) -> tuple[Case, ...]:
    """Lay out all terrains of a study.

    Args:
        spec: The study.
        seed: Any integer.

    Raises:
        SpecError: A terrain's rocks cannot be multiplied so.
    """
    rocks = spec.terrain.rocks
    own = rocks.k if isinstance(rocks, RockAbundanceSpec) else math.nan
    varied = product(spec.abundances or (own,), spec.rock_factors, range(spec.terrains))
    return tuple(
        Case(k, factor, index, terrain_seed(seed, index), _with_rocks(spec.terrain, k, factor))
        for k, factor, index in varied
    )


def _with_rocks(terrain: TerrainSpec, k: float, factor: float) -> TerrainSpec:
    if terrain.rocks is None:
        return terrain
    changed: dict[str, Any] = terrain.rocks.to_mapping()
    changed["number_multiplier"] *= factor
    if not math.isnan(k):
        changed["k"] = k
    try:
        rocks = type(terrain.rocks).from_mapping(changed, "the terrain's rocks")
    except SpecError as error:
        raise SpecError(f"with the factor {factor:g} {error}") from None
    return terrain.model_copy(update={"rocks": rocks})
