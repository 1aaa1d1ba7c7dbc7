"""Which ways are the worst to drive, and those saved as traverses that ``lpet simulate`` drives."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.planning.clearance import Point
from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.planning.reach_result import ReachabilityReport, StartResult
from lpet_sim.planning.reach_spec import Case, ReachSpec, cases_of
from lpet_sim.rover.spec import DriveSpec

_SHARP_M = 0.02  # as `route._SHARP_M`: no side is left there to round a corner in
_CORNER_CUT_M = 0.15
LENGTH_MIN_M = 5.0
"""Ways that are shorter are not ranked [m]."""


@dataclass(frozen=True)
class WorstPath:
    """A way and how hard it is among others.

    Attributes:
        case: Terrain that it was found on.
        number: Which start of its terrain it leads from.
        start: What was found for the start.
        score: Mean over the measures of the share of ways that are not worse, 0 to 1.
    """

    case: Case
    number: int
    start: StartResult
    score: float


def rank_worst(report: ReachabilityReport, spec: ReachSpec) -> list[WorstPath]:
    """Rank all ways of a study, the worst first.

    Each measure ranks the ways; a way's score is its mean rank. So no weights between metres and
    radians have to be chosen, and a way is bad that is bad in many respects.

    Args:
        report: What the study found.
        spec: The study.
    """
    cases = {(case.key): case for case in cases_of(spec, report.seed)}
    ways = [
        (cases[terrain.key], number, start)
        for terrain in report.terrains
        for number, start in enumerate(terrain.starts)
        if start.length_m >= LENGTH_MIN_M and start.measures is not None
    ]
    if not ways:
        return []
    hard = np.stack([way[2].measures.hardness() for way in ways if way[2].measures])
    # Columns one by one: all pairs of many ways at once would be a large array.
    shares = [np.searchsorted(np.sort(one), one, side="right") / len(one) for one in hard.T]
    scores = np.mean(shares, axis=0)
    ranked = [WorstPath(*way, float(score)) for way, score in zip(ways, scores, strict=True)]
    return sorted(ranked, key=lambda way: -way.score)


def traverse_mapping(way: StartResult, case: Case, mobility: MobilitySpec) -> dict[str, Any]:
    """Give a way as a traverse, with a turn on the spot at every corner of a way of straights.

    Args:
        way: The way.
        case: The terrain that it was found on.
        mobility: Of the rover.

    Returns:
        What `TraverseSpec` is read from; to be driven with the case's seed. No images are taken.
    """
    drive = DriveSpec(
        waypoints_m=_waypoints(way),
        corner_cut_m=_CORNER_CUT_M,
        min_turn_radius_m=max(1.0, 0.9 * mobility.turn_radius_m),
    )
    return {
        "name": f"worst_{case.key}",
        "terrain": case.terrain.to_mapping(),
        "drive": {
            "waypoints_m": [list(xy) for xy in drive.waypoints_m],
            "corner_cut_m": drive.corner_cut_m,
            "min_turn_radius_m": drive.min_turn_radius_m,
        },
        "route": None,
        "images": None,
    }


def drives_forwards(way: StartResult) -> bool:
    """Tell whether a way has no stretch backwards, which the drive of a traverse cannot do."""
    path = way.path
    if path.shape[1] == 2:
        return True
    step = np.diff(path[:, :2], axis=0)
    ahead = np.column_stack([np.cos(path[:-1, 2]), np.sin(path[:-1, 2])])
    return bool(np.all(np.sum(step * ahead, axis=1) >= -1e-6))


def save_worst(
    worst: Sequence[WorstPath], mobility: MobilitySpec, folder: Path, count: int = 5
) -> list[Path]:
    """Save the worst ways as traverses.

    Args:
        worst: Ranked ways; those with stretches backwards are passed over.
        mobility: Of the rover.
        folder: Where to write.
        count: How many at most.

    Returns:
        The files; a comment at the head of each says with which seed to drive it.
    """
    output_folder(folder)
    driven = [way for way in worst if drives_forwards(way.start)][:count]
    return [_save(way, rank, mobility, folder) for rank, way in enumerate(driven, 1)]


def _save(way: WorstPath, rank: int, mobility: MobilitySpec, folder: Path) -> Path:
    path = folder / f"worst{rank}_seed{way.case.seed}.yaml"
    head = (
        f"# Start {way.number} of terrain {way.case.key}, score {way.score:.3f}. Drive it by\n"
        f"#   lpet simulate {path.name} --seed {way.case.seed}\n"
    )
    mapping = traverse_mapping(way.start, way.case, mobility)
    with whole_file(path) as temporary:
        temporary.write_text(head + yaml.safe_dump(mapping, sort_keys=False))
    return path


def _waypoints(way: StartResult) -> tuple[Point, ...]:
    """Put a waypoint just before each corner, so that the rover turns on the spot there."""
    xy = [(float(x), float(y)) for x, y in way.path[:, :2]]
    if way.path.shape[1] == 3:
        return tuple(xy)
    points = xy[:1]
    for before, corner in pairwise(xy):
        if corner != xy[-1]:
            share = min(_SHARP_M / math.dist(before, corner), 0.5)
            points.append(
                (
                    corner[0] + share * (before[0] - corner[0]),
                    corner[1] + share * (before[1] - corner[1]),
                )
            )
        points.append(corner)
    return tuple(points)
