"""What a study of reachability found: for every start, for every terrain, and altogether."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any, Literal, Self

import numpy as np

from lpet_sim.evaluation.statistics import Interval, pass_rate
from lpet_sim.planning.clearance import Point
from lpet_sim.planning.path_measures import PathMeasures
from lpet_sim.planning.reach_spec import case_key
from lpet_sim.recording.arrays import Array

Outcome = Literal["reachable", "unreachable", "undecided"]

PERSEVERANCE_LENGTH_RATIO = 1.46
"""What Perseverance drove through Snowdrift Peak: 759 m for 520 m straight [seen]."""


@dataclass(frozen=True)
class StartResult:
    """What was found for one start.

    Attributes:
        start_m: Where the rover stands [m].
        outcome: Reachable: a way was found. Unreachable: even the disc that the body covers at
            every heading cannot get there. Undecided: neither.
        reason: Why it is not reachable; empty where it is.
        found_by: ``map``: the wave over the nodes where the rover can turn; ``ompl``: the planner,
            asked where the wave does not come, and for all curves; empty where there is none.
        path_m: The way: corners (x, y) of straights with turns on the spot, or, with limited
            curvature, poses (x, y, heading) along it [m, rad].
        length_m: Length of the way [m]; 0 where there is none.
        measures: What makes the way hard to drive; None where there is none.
    """

    start_m: Point
    outcome: Outcome
    reason: str = ""
    found_by: str = ""
    path_m: tuple[tuple[float, ...], ...] = ()
    length_m: float = 0.0
    measures: PathMeasures | None = None

    @property
    def path(self) -> Array:
        """The way as an array, Shape (n, 2) or (n, 3)."""
        return np.array(self.path_m, dtype=np.float64)

    @property
    def length_ratio(self) -> float:
        """Length over the straight distance between the ends of the way; NaN without one."""
        straight = math.dist(self.path_m[0][:2], self.path_m[-1][:2]) if self.path_m else 0.0
        return self.length_m / straight if straight > 0 else math.nan

    @classmethod
    def from_mapping(cls, mapping: dict[str, Any]) -> Self:
        """Build it from what `to_mapping` gave."""
        path = tuple(tuple(row) for row in mapping["path_m"])
        known = mapping["measures"]
        measures = None if known is None else PathMeasures(**known)
        start = tuple(mapping["start_m"])
        return cls(**(mapping | {"start_m": start, "path_m": path, "measures": measures}))

    def to_mapping(self) -> dict[str, Any]:
        """Give it as plain values; places to a tenth of a millimetre or better."""
        return asdict(self)


@dataclass(frozen=True)
class TerrainResult:
    """What was found on one terrain.

    Attributes:
        abundance: Fraction of the ground covered by rocks before the factor, or NaN.
        factor: The paper's K.
        index: Which of the terrains with this abundance and factor.
        seed: Seed of the terrain.
        cpu_s: Processor time spent, the terrain's making included [s].
        starts: What was found for each start.
    """

    abundance: float
    factor: float
    index: int
    seed: int
    cpu_s: float
    starts: tuple[StartResult, ...]

    @property
    def key(self) -> str:
        """Name of the terrain's file, as of its case."""
        return case_key(self.abundance, self.factor, self.index)

    @classmethod
    def from_mapping(cls, mapping: dict[str, Any]) -> Self:
        """Build it from what `to_mapping` gave."""
        starts = tuple(StartResult.from_mapping(one) for one in mapping["starts"])
        abundance = mapping["abundance"]
        known = math.nan if abundance is None else abundance
        return cls(**(mapping | {"abundance": known, "starts": starts}))

    def to_mapping(self) -> dict[str, Any]:
        """Give it as plain values that JSON knows."""
        abundance = None if math.isnan(self.abundance) else self.abundance
        return asdict(self) | {"abundance": abundance}


@dataclass(frozen=True)
class RateResult:
    """How often the goal was reached with one abundance and factor.

    Attributes:
        abundance: Fraction of the ground covered by rocks before the factor, or NaN.
        factor: The paper's K.
        terrains: Number of terrains.
        starts: Number of starts on all of them.
        reachable: Share of the starts from which a way was found, with its Clopper-Pearson interval
            over the starts. Starts on one terrain are not independent: with few terrains the
            interval is too narrow, and `terrain_low` and `terrain_high` tell.
        terrain_low: Smallest share reachable on any of the terrains.
        terrain_high: Largest share reachable on any of the terrains.
        undecided: Share that is neither reachable nor unreachable.
        length_ratio: Median, mean and largest ratio of length to straight distance, or NaN.
        reasons: How often each reason for no way occurred.
    """

    abundance: float
    factor: float
    terrains: int
    starts: int
    reachable: Interval
    terrain_low: float
    terrain_high: float
    undecided: float
    length_ratio: tuple[float, float, float]
    reasons: dict[str, int]

    @classmethod
    def of(cls, terrains: list[TerrainResult]) -> Self:
        """Count what was found on terrains of one abundance and factor."""
        starts = [start for terrain in terrains for start in terrain.starts]
        found = sum(start.outcome == "reachable" for start in starts)
        shares = [_share(terrain.starts, "reachable") for terrain in terrains]
        return cls(
            abundance=terrains[0].abundance,
            factor=terrains[0].factor,
            terrains=len(terrains),
            starts=len(starts),
            reachable=pass_rate(found, len(starts)),
            terrain_low=min(shares),
            terrain_high=max(shares),
            undecided=_share(tuple(starts), "undecided"),
            length_ratio=_ratios(starts),
            reasons=dict(Counter(start.reason for start in starts if start.reason).most_common()),
        )

    @property
    def unreachable(self) -> float:
        """Share of the starts from which the goal cannot be reached."""
        return max(1.0 - self.reachable.value - self.undecided, 0.0)


def _share(starts: tuple[StartResult, ...], outcome: Outcome) -> float:
    return sum(start.outcome == outcome for start in starts) / len(starts)


def _ratios(starts: list[StartResult]) -> tuple[float, float, float]:
    known = [r for start in starts if not math.isnan(r := start.length_ratio)]
    if not known:
        return math.nan, math.nan, math.nan
    return float(np.median(known)), float(np.mean(known)), max(known)


@dataclass(frozen=True)
class ReachabilityReport:
    """What a study found.

    Attributes:
        name: The study's name.
        seed: Its seed.
        cell_m: Resolution of the maps [m].
        terrains: What was found on each terrain.
    """

    name: str
    seed: int
    cell_m: float
    terrains: tuple[TerrainResult, ...]

    @property
    def rates(self) -> tuple[RateResult, ...]:
        """Rates for each abundance and factor, in the order of the study."""
        groups: dict[tuple[str, float], list[TerrainResult]] = {}
        for terrain in self.terrains:
            groups.setdefault((f"{terrain.abundance:g}", terrain.factor), []).append(terrain)
        return tuple(RateResult.of(group) for group in groups.values())

    @property
    def undecided(self) -> float:
        """Share of all starts that is undecided."""
        starts = [start for terrain in self.terrains for start in terrain.starts]
        return _share(tuple(starts), "undecided")

    @property
    def cpu_s(self) -> float:
        """Processor time of all terrains [s]."""
        return sum(terrain.cpu_s for terrain in self.terrains)

    def to_mapping(self) -> dict[str, Any]:
        """Give the rates and the terrains without their ways as plain values that JSON knows."""
        rates = [_plain(asdict(rate) | {"unreachable": rate.unreachable}) for rate in self.rates]
        return {
            "name": self.name,
            "seed": self.seed,
            "cell_m": self.cell_m,
            "undecided": self.undecided,
            "cpu_s": self.cpu_s,
            "length_ratio_perseverance": PERSEVERANCE_LENGTH_RATIO,
            "rates": rates,
        }


def _plain(value: Any) -> Any:
    """Put null in place of what is no number, which JSON does not know."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
