"""How far every place is from what the rover cannot drive over, on a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field
from scipy import ndimage

from lpet_sim.errors import PlanningError
from lpet_sim.recording.arrays import Array
from lpet_sim.spec import Spec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks

Point = tuple[float, float]
Bools = NDArray[np.bool_]

# About 2 GB while the distances are made.
_NODES_MAX = 50_000_000


class Ground(Protocol):
    """What planning needs of a terrain."""

    @property
    def drivable(self) -> Box | None:
        """Where a rover may drive; None: everywhere."""
        ...

    def patch(self, x0: int, y0: int, shape: tuple[int, int], cell_m: float) -> Array:
        """Give heights at nodes [m], Shape (ny, nx)."""
        ...

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> Rocks:
        """Give the rocks of a box."""
        ...


class RouteSpec(Spec):
    """What a route keeps clear of, and how hard the planner looks.

    Attributes:
        clearance_m: Least distance of the driven path from an obstacle [m]: half the track of an
            ExoMars-class rover and half a wheel, 0.66 m [recalled], and what the path follower may
            be off by.
        corner_cut_m: How far the drive may round a corner [m], and how much further than the
            clearance the corners stay away; both sum to 0.90 m, the rover's radius in a turn on
            the spot [recalled]. To be ``DriveSpec.corner_cut_m`` too.
        min_turn_radius_m: Tightest arc of the drive [m]. To be ``DriveSpec.min_turn_radius_m`` too.
        obstacle_height_m: A higher rock is an obstacle [m]; about a wheel's radius (assumption).
        max_slope_rad: Steeper ground is an obstacle [rad]; 20 deg, where MER's wheels slip by more
            than 90 % on loose sand [recalled].
        slope_scale_m: Length over which the slope is measured [m]; about the rover's.
        cell_m: Cell of the clearance grid [m].
        margin_m: How far beyond start and goal the route may lead [m].
        iterations: Iterations of the planner; more give a shorter route. Where they find none, up
            to eight times as many are spent.
        stride_m: Longest branch of the planner's tree [m].
    """

    clearance_m: float = Field(default=0.75, gt=0)
    corner_cut_m: float = Field(default=0.15, gt=0)
    min_turn_radius_m: float = Field(default=1.5, ge=1)
    obstacle_height_m: float = Field(default=0.15, gt=0)
    max_slope_rad: float = Field(default=math.radians(20.0), gt=0, lt=1.5)
    slope_scale_m: float = Field(default=1.2, gt=0)
    cell_m: float = Field(default=0.05, gt=0, le=0.5)
    margin_m: float = Field(default=10.0, ge=0)
    iterations: int = Field(default=16000, gt=0)
    stride_m: float = Field(default=3.0, gt=0)

    @property
    def grid_error_m(self) -> float:
        """What a distance looked up on the grid may be off by [m]: half a diagonal at each end."""
        return math.sqrt(2) * self.cell_m

    @property
    def needed_m(self) -> float:
        """Distance that the route keeps on the grid [m]."""
        return self.clearance_m + self.corner_cut_m + self.grid_error_m


@dataclass(frozen=True, eq=False)
class ClearanceMap:
    """Distances to the nearest obstacle on a grid of nodes.

    Attributes:
        x0: Index of the first column: node (i, j) is at ``((x0 + j), (y0 + i)) * cell_m``.
        y0: Index of the first row.
        cell_m: Distance of the nodes [m].
        distance_m: Distance to the nearest obstacle [m], Shape (ny, nx).
        free: Where the rover's centre may be, Shape (ny, nx).
        region: Number of the connected free region, 0 where it is not free, Shape (ny, nx).
    """

    x0: int
    y0: int
    cell_m: float
    distance_m: Array
    free: Bools
    region: NDArray[np.int32]

    def node(self, xy: Point) -> tuple[int, int]:
        """Give row and column of the node nearest to a point within the map."""
        return round(xy[1] / self.cell_m) - self.y0, round(xy[0] / self.cell_m) - self.x0

    def distance_at(self, xy: Array) -> Array:
        """Give the distance to the nearest obstacle at points within the map [m], Shape (n,)."""
        columns, rows = (np.rint(xy / self.cell_m).astype(int) - [self.x0, self.y0]).T
        return np.asarray(self.distance_m[rows, columns])

    def is_clear(self, a: Point, b: Point) -> bool:
        """Tell whether the straight way between two points is free."""
        return bool(_is_clear(self.free, self.x0, self.y0, self.cell_m, *a, *b))

    def nearest_free(self, xy: Point) -> Point | None:
        """Give the free node nearest to a point, None where the map has none."""
        rows, columns = np.nonzero(self.free)
        if not len(rows):
            return None
        x, y = (columns + self.x0) * self.cell_m, (rows + self.y0) * self.cell_m
        nearest = int(np.argmin(np.hypot(x - xy[0], y - xy[1])))
        return float(x[nearest]), float(y[nearest])


def map_clearance(terrain: Ground, box: Box, spec: RouteSpec) -> ClearanceMap:
    """Map the distance to rocks that are too high, ground too steep, and the terrain's edge.

    Args:
        terrain: The terrain.
        box: What to map; obstacles just outside count too.
        spec: What an obstacle is.

    Raises:
        PlanningError: The box is too large to be mapped as finely as asked.
    """
    cell = spec.cell_m
    wide = box.grown(spec.needed_m + cell)
    x0, y0 = math.floor(wide.x_min / cell), math.floor(wide.y_min / cell)
    nx, ny = (math.ceil(wide.x_max / cell) - x0 + 1, math.ceil(wide.y_max / cell) - y0 + 1)
    _check_size(nx, ny, spec)
    x, y = _nodes(x0, nx, cell), _nodes(y0, ny, cell)
    blocked = _outside(terrain.drivable, x, y) | _steep(terrain, x, y, spec)
    _mark_rocks(blocked, terrain.rocks(wide.grown(2.0)), x, y, spec.obstacle_height_m)
    distance_m = np.full(blocked.shape, np.inf)
    if blocked.any():
        distance_m = np.asarray(ndimage.distance_transform_edt(~blocked)) * cell
    free = (distance_m >= spec.needed_m) & _inside(box, x, y)
    region = np.asarray(ndimage.label(free)[0], dtype=np.int32)
    return ClearanceMap(x0, y0, cell, distance_m, free, region)


def _check_size(nx: int, ny: int, spec: RouteSpec) -> None:
    if nx * ny > _NODES_MAX:
        side_m = math.sqrt(_NODES_MAX) * spec.cell_m
        raise PlanningError(
            f"a route over {nx * spec.cell_m:.0f} x {ny * spec.cell_m:.0f} m is too far to plan at "
            f"once with route.cell_m {spec.cell_m:g}, up to {side_m:.0f} x {side_m:.0f} m is "
            "possible: put waypoints between, take a larger cell, or none (route: null)"
        )


def _nodes(first: int, count: int, cell_m: float) -> Array:
    return np.asarray((first + np.arange(count)) * cell_m, dtype=np.float64)


def _inside(box: Box, x: Array, y: Array) -> Bools:
    in_x, in_y = (x >= box.x_min) & (x <= box.x_max), (y >= box.y_min) & (y <= box.y_max)
    return np.asarray(in_y[:, None] & in_x[None, :])


def _outside(drivable: Box | None, x: Array, y: Array) -> Bools:
    if drivable is None:
        return np.zeros((len(y), len(x)), dtype=bool)
    return ~_inside(drivable, x, y)


def _steep(terrain: Ground, x: Array, y: Array, spec: RouteSpec) -> Bools:
    """Find steep nodes by central differences over ``slope_scale_m``, on a grid of half of it."""
    step = spec.slope_scale_m / 2
    x0, y0 = math.floor(x[0] / step) - 1, math.floor(y[0] / step) - 1
    shape = (math.ceil(y[-1] / step) + 2 - y0, math.ceil(x[-1] / step) + 2 - x0)
    dz_dy, dz_dx = np.gradient(terrain.patch(x0, y0, shape, step), step)
    rows = np.rint(y / step).astype(int) - y0
    columns = np.rint(x / step).astype(int) - x0
    steep = np.hypot(dz_dx, dz_dy) > math.tan(spec.max_slope_rad)
    return np.asarray(steep[np.ix_(rows, columns)])


def _mark_rocks(blocked: Bools, rocks: Rocks, x: Array, y: Array, height_m: float) -> None:
    """Block the nodes within the reach of every rock that is too high, and the one nearest to it.

    The reach is that of the rock's longer axis, so the mark is never smaller than its outline.
    """
    high = np.flatnonzero(rocks.height_m > height_m)
    for k, reach in zip(high, rocks.reach_m[high], strict=True):
        cx, cy = rocks.p_world_rock[k, :2]
        rows = slice(*np.searchsorted(y, [cy - reach, cy + reach]))
        columns = slice(*np.searchsorted(x, [cx - reach, cx + reach]))
        near = np.hypot(x[None, columns] - cx, y[rows, None] - cy) <= reach
        blocked[rows, columns] |= near
        row, column = int(np.argmin(np.abs(y - cy))), int(np.argmin(np.abs(x - cx)))
        blocked[row, column] = True


@njit(cache=True)
def _is_clear(
    free: Bools, x0: int, y0: int, cell: float, ax: float, ay: float, bx: float, by: float
) -> bool:
    """Look up the node nearest to every half cell of the way, both ends included."""
    steps = math.ceil(2.0 * math.hypot(bx - ax, by - ay) / cell) + 1
    for k in range(steps + 1):
        x, y = ax + (bx - ax) * k / steps, ay + (by - ay) * k / steps
        column, row = round(x / cell) - x0, round(y / cell) - y0
        if row < 0 or column < 0 or row >= free.shape[0] or column >= free.shape[1]:
            return False
        if not free[row, column]:
            return False
    return True
