"""What makes a way hard to drive: its curves, its length, the slopes and the rocks beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lpet_sim.planning.clearance import Ground
from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box

_SPACING_M = 0.25
_TURN_RAD = math.radians(10.0)
_NEAR_M = 3.0


@dataclass(frozen=True)
class PathMeasures:
    """What makes a way hard to drive; of each number more is worse, but for the clearance.

    Attributes:
        curves_per_100m: Changes of heading by 10 deg or more for each 100 m of way.
        tightness_rad_per_m: Sum of all changes of heading over the length [rad/m].
        length_ratio: Length over the straight distance between the ends.
        slope_rad: 95th percentile of the steepness of the ground along the way [rad].
        roll_rad: 95th percentile of the steepness across the heading [rad].
        clearance_m: Mean distance from the way to the nearest corner of a rock that is not driven
            over, counted up to 3 m [m].
    """

    curves_per_100m: float
    tightness_rad_per_m: float
    length_ratio: float
    slope_rad: float
    roll_rad: float
    clearance_m: float

    def hardness(self) -> Array:
        """Give the measures so that of each more is worse, Shape (6,)."""
        return np.array(
            [
                self.curves_per_100m,
                self.tightness_rad_per_m,
                self.length_ratio,
                self.slope_rad,
                self.roll_rad,
                -self.clearance_m,
            ]
        )


def measure_path(path: Array, ground: Ground, mobility: MobilitySpec) -> PathMeasures:
    """Measure how hard a way is.

    Args:
        path: Corners or poses, Shape (n, 2) or (n, 3).
        ground: The terrain.
        mobility: What ground is to the rover.
    """
    xy, heading = _along(path[:, :2])
    turns = np.abs(_turns(path))
    length = float(np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1).sum())
    slope, roll = _slopes(ground, xy, heading, mobility.slope_scale_m)
    straight = math.dist(path[0, :2], path[-1, :2])
    return PathMeasures(
        curves_per_100m=100.0 * _curves(turns, path.shape[1] == 3) / length,
        tightness_rad_per_m=float(turns.sum()) / length,
        length_ratio=length / straight,
        slope_rad=float(np.quantile(np.arctan(slope), 0.95)),
        roll_rad=float(np.quantile(np.arctan(roll), 0.95)),
        clearance_m=_clearance(ground, xy, mobility),
    )


def _turns(path: Array) -> Array:
    """Give the changes of heading along a way [rad]."""
    step = np.diff(path[:, :2], axis=0)
    heading = path[:, 2] if path.shape[1] == 3 else np.arctan2(step[:, 1], step[:, 0])
    return np.asarray((np.diff(heading) + np.pi) % (2 * np.pi) - np.pi)


def _curves(turns: Array, bent: bool) -> float:
    """Count the curves: corners, or stretches of arc between straights."""
    if not bent:
        return float(np.sum(turns >= _TURN_RAD))
    turning = np.concatenate([[False], turns > 1e-3])
    return float(np.sum(turning[1:] & ~turning[:-1]))


def _along(corners: Array) -> tuple[Array, Array]:
    """Give points along a polyline and the headings there."""
    step = np.diff(corners, axis=0)
    length = np.linalg.norm(step, axis=1)
    s = np.concatenate([[0.0], np.cumsum(length)])
    at = np.arange(0.0, s[-1], _SPACING_M)
    xy = np.column_stack([np.interp(at, s, corners[:, axis]) for axis in (0, 1)])
    side = np.clip(np.searchsorted(s, at, side="right") - 1, 0, len(length) - 1)
    return xy, np.arctan2(step[side, 1], step[side, 0])


def _slopes(ground: Ground, xy: Array, heading: Array, scale_m: float) -> tuple[Array, Array]:
    """Give steepness, and steepness across the heading, on a lattice of half the scale."""
    step = scale_m / 2
    low = np.floor(xy.min(axis=0) / step).astype(int) - 2
    size = np.ceil(xy.max(axis=0) / step).astype(int) + 3 - low
    z = ground.patch(int(low[0]), int(low[1]), (int(size[1]), int(size[0])), step)
    column, row = (np.rint(xy / step).astype(int) - low).T
    gy, gx = (np.asarray(slope)[row, column] for slope in np.gradient(z, step))
    return np.hypot(gx, gy), np.abs(gy * np.cos(heading) - gx * np.sin(heading))


def _clearance(ground: Ground, xy: Array, mobility: MobilitySpec) -> float:
    """Give the mean distance to the corners of rocks that are not driven over."""
    box = Box(*(xy.min(axis=0) - 2 * _NEAR_M), *(xy.max(axis=0) + 2 * _NEAR_M))
    rocks = ground.rocks(box, mobility.climb_height_m)
    outlines = rocks.select(rocks.height_m > mobility.climb_height_m).outlines()
    if not outlines:
        return _NEAR_M
    away = cKDTree(np.concatenate(outlines)).query(xy)[0]
    return float(np.minimum(away, _NEAR_M).mean())
