"""What a rover's body sweeps along a way, against the outlines of rocks: no map, no distances.

Written apart from the planner, with other means: every centimetre of the way the body is set down
as a rectangle, and each rock's polygon is tried for an axis that separates the two.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, label

from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.planning.reach_spec import ReachSpec
from lpet_sim.terrain.rocks import Rocks

Array = NDArray[np.float64]
_STEP_M = 0.01


@dataclass(frozen=True)
class Rectangle:
    """A rectangle in the axes of the body [m]."""

    x_min: float
    x_max: float
    y_min: float
    y_max: float

    @property
    def corners(self) -> Array:
        """Corners, Shape (4, 2)."""
        x, y = (self.x_min, self.x_max), (self.y_min, self.y_max)
        return np.array([(x[0], y[0]), (x[1], y[0]), (x[1], y[1]), (x[0], y[1])])


def rectangles_of(spec: MobilitySpec) -> tuple[list[Rectangle], list[Rectangle]]:
    """Give what obstacles, and what rocks between the wheels, must stay clear of."""
    m = spec.margin_m
    rear, front = -spec.rear_m - m, spec.front_m + m
    outer, inner = spec.half_width_m + m, spec.half_width_m - spec.wheel_width_m - m
    body = [Rectangle(rear, front, -outer, outer)]
    return body, [Rectangle(rear, front, -outer, -inner), Rectangle(rear, front, inner, outer)]


def poses_along(path: Array, reach_m: float) -> Array:
    """Set the rover down every centimetre of a way; where it turns, every centimetre of its rim.

    Args:
        path: Corners of straights with turns on the spot, or poses along a curve, (n, 2) or (n, 3).
        reach_m: Farthest point of the body from its origin [m].

    Returns:
        Poses (x, y, heading), Shape (n, 3).
    """
    if path.shape[1] == 3:
        return _between(path, np.unwrap(path[:, 2]), reach_m)
    step = np.diff(path, axis=0)
    heading = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    # Every corner twice: as the end of one side, and as the beginning of the next.
    xy = np.repeat(path, 2, axis=0)[1:-1]
    return _between(xy, np.repeat(heading, 2), reach_m)


def _between(xy: Array, heading: Array, reach_m: float) -> Array:
    rows = []
    for k in range(len(xy) - 1):
        moved = math.dist(xy[k, :2], xy[k + 1, :2]) + reach_m * abs(heading[k + 1] - heading[k])
        share = np.linspace(0.0, 1.0, max(2, math.ceil(moved / _STEP_M) + 1))[:, None]
        ends = np.array([[*xy[k, :2], heading[k]], [*xy[k + 1, :2], heading[k + 1]]])
        rows.append(ends[0] + share * (ends[1] - ends[0]))
    return np.concatenate(rows)


def touched(path: Array, rocks: Rocks, spec: MobilitySpec) -> list[str]:
    """Name the rocks that the rover touches with what it must not, along a way.

    Args:
        path: The way, Shape (n, 2) or (n, 3).
        rocks: All rocks near it.
        spec: What a rock is to the rover.
    """
    reach = math.hypot(max(spec.front_m, spec.rear_m) + spec.margin_m, spec.half_width_m + 1.0)
    poses = poses_along(path, reach)
    body, wheels = rectangles_of(spec)
    found = []
    for outline, centre, height, far in zip(
        rocks.outlines(), rocks.p_world_rock, rocks.height_m, rocks.reach_m, strict=True
    ):
        if height <= spec.climb_height_m:
            continue
        # The whole width of a rock, however it lies, must fit between the wheels.
        fits = height <= spec.belly_height_m and 2.0 * far <= spec.straddle_width_m
        close = np.linalg.norm(poses[:, :2] - centre[:2], axis=1) <= reach + far
        if close.any() and any(
            _overlaps(poses[close], outline, one) for one in (wheels if fits else body)
        ):
            found.append(f"a rock {height:.2f} m high at ({centre[0]:.2f}, {centre[1]:.2f}) m")
    return found


def _overlaps(poses: Array, outline: Array, rectangle: Rectangle) -> bool:
    """Tell whether a convex polygon overlaps the rectangle at any of the poses."""
    cos, sin = np.cos(poses[:, 2])[:, None], np.sin(poses[:, 2])[:, None]
    off = outline[None] - poses[:, None, :2]
    # The polygon in the axes of the body, Shape (poses, corners).
    x, y = cos * off[..., 0] + sin * off[..., 1], cos * off[..., 1] - sin * off[..., 0]
    apart = (x.max(1) <= rectangle.x_min) | (x.min(1) >= rectangle.x_max)
    apart |= (y.max(1) <= rectangle.y_min) | (y.min(1) >= rectangle.y_max)
    for k in range(len(outline)):
        after = (k + 1) % len(outline)
        # The outward normal of a side of a polygon that runs counter-clockwise.
        nx, ny = (y[:, after] - y[:, k])[:, None], (x[:, k] - x[:, after])[:, None]
        limit = nx[:, 0] * x[:, k] + ny[:, 0] * y[:, k]
        nearest = (nx * rectangle.corners[:, 0] + ny * rectangle.corners[:, 1]).min(axis=1)
        apart |= nearest >= limit
    return bool(np.any(~apart))


def disc_gets_there(start: tuple[float, float], rocks: Rocks, spec: ReachSpec) -> bool:
    """Tell whether a disc a little larger than the inscribed one gets from a start to the goal.

    Rocks alone count. Over a picture of the outlines with pixels of 2 cm; the disc is larger by 4
    cm, which is more than what the pixels may be off by, so that a way of its own proves that the
    inscribed disc has one.

    Args:
        start: Where the disc begins [m].
        rocks: All rocks near the square.
        spec: The study.
    """
    mobility, pixel = spec.mobility, 0.02
    fits = (rocks.height_m <= mobility.belly_height_m) & (
        2.0 * rocks.reach_m <= mobility.straddle_width_m
    )
    # Rocks beyond the edge count, but the disc's middle does not go there.
    beyond = math.ceil(2.0 / pixel)
    x = spec.box.x_min + pixel * np.arange(-beyond, round(spec.size_m / pixel) + beyond + 1)
    blocked = np.zeros((len(x), len(x)), dtype=bool)
    for outline in rocks.select((rocks.height_m > mobility.climb_height_m) & ~fits).outlines():
        _fill(blocked, outline, x)
    away = distance_transform_edt(~blocked) * pixel if blocked.any() else np.full(blocked.shape, 99)
    reach = min(mobility.front_m, mobility.rear_m, mobility.half_width_m) + mobility.margin_m
    inside = np.abs(x) <= spec.size_m / 2 + 1e-9
    free = (away >= reach + 0.04) & inside[None] & inside[:, None]
    region, _ = label(free, np.ones((3, 3)))
    row, column = (round((value - x[0]) / pixel) for value in (start[1], start[0]))
    goal = np.hypot(x[None] - spec.goal_m[0], x[:, None] - spec.goal_m[1]) <= spec.goal_radius_m
    here = region[row, column]
    return bool(here > 0 and np.any(region[goal] == here))


def _fill(blocked: NDArray[np.bool_], outline: Array, x: Array) -> None:
    """Mark the pixels within a convex outline; the square's axes have the same pixels."""
    columns, rows = (
        slice(*np.searchsorted(x, [outline[:, axis].min(), outline[:, axis].max()]))
        for axis in (0, 1)
    )
    px, py = np.meshgrid(x[columns], x[rows])
    inside = np.ones(px.shape, dtype=bool)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        inside &= (b[0] - a[0]) * (py - a[1]) - (b[1] - a[1]) * (px - a[0]) >= 0
    blocked[rows, columns] |= inside
