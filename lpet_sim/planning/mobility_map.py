"""A map of where a rover may stand and drive: exact distances to rocks, and slopes.

Distances are those to the outlines themselves, worked out at nodes, so that a look-up between the
nodes is bounded on both sides: a distance changes no faster than the point moves. From this follow
two sets of nodes. On `MobilityMap.sure` the rover surely can stand and turn on the spot, and go
from node to node. Whatever way the rover may have, the nodes nearest to it lie on
`MobilityMap.possible`, so what that set keeps apart no rover of this size can join.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lpet_sim.errors import PlanningError
from lpet_sim.planning.clearance import Ground, Point
from lpet_sim.planning.mobility import MobilitySpec, kinds_of
from lpet_sim.planning.mobility_kernels import (
    Floats,
    can_drive,
    can_turn,
    room_at,
    stamp_polygons,
)
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import HEIGHT_RATIO

Bools = NDArray[np.bool_]

CAP_M = 2.0
"""Distances are worked out up to this beyond the rover's circle [m]."""

_ROCK_REACH_M = 2.5  # of a rock 2.5 m long; see `rocks._REACH_OVER_DIAMETER`
_NODES_MAX = 40_000_000
_LATTICE_PER_SCALE = 2
_AROUND = np.ones((3, 3), dtype=bool)


@dataclass(frozen=True, eq=False)
class MobilityMap:
    """Distances to rocks and slopes of the ground of a box.

    Attributes:
        box: What is mapped [m]; the rover's origin stays in it.
        mobility: What ground is to the rover.
        grid: First column and row of the nodes, and their distance [m], Shape (3,): node (i, j) is
            at ``(grid[0] + j, grid[1] + i) * grid[2]``.
        obstacle_m: Distances to obstacles, up to a cap [m], Shape (ny, nx).
        straddle_m: Distances to rocks that may be straddled, up to a cap [m], Shape (ny, nx).
        lattice: As ``grid``, of the slopes.
        gradient: Slopes (dz/dx, dz/dy), infinite where the ground may not be driven on; each holds
            for the square about its node, Shape (my, mx, 2).
    """

    box: Box
    mobility: MobilitySpec
    grid: Array
    obstacle_m: Floats
    straddle_m: Floats
    lattice: Array
    gradient: Floats

    @property
    def cell_m(self) -> float:
        """Distance of the nodes [m]."""
        return float(self.grid[2])

    @property
    def layers(self) -> tuple[Floats, Floats, Floats, Array, Array, Array]:
        """What the compiled checks take first."""
        return (
            self.obstacle_m,
            self.straddle_m,
            self.gradient,
            self.grid,
            self.lattice,
            self._needs,
        )

    def can_turn(self, xy: Point) -> bool:
        """Tell whether the rover surely can stand at a point and turn on the spot."""
        return bool(can_turn(*self.layers, *xy))

    def can_drive(self, a: Point, b: Point) -> bool:
        """Tell whether it surely can drive straight between two points that it can turn at."""
        return bool(can_drive(*self.layers, *a, *b))

    def room_at(self, pose: tuple[float, float, float], slack_m: float) -> float:
        """Tell how far it surely can move on from (x, y, heading); -1 where it cannot stand."""
        return float(room_at(*self.layers, self._body, self._tracks, slack_m, *pose))

    @cached_property
    def steepness(self) -> Floats:
        """Slope at every node, Shape (ny, nx)."""
        rows, columns = (
            np.clip(
                np.floor(nodes / self.lattice[2] + 0.5).astype(int) - int(self.lattice[axis]),
                0,
                self.gradient.shape[1 - axis] - 1,
            )
            for axis, nodes in ((1, self.y), (0, self.x))
        )
        size = np.hypot(self.gradient[..., 0], self.gradient[..., 1])
        return np.asarray(size[np.ix_(rows, columns)])

    @property
    def x(self) -> Array:
        """Of the columns [m], Shape (nx,)."""
        return (self.grid[0] + np.arange(self.obstacle_m.shape[1])) * self.cell_m

    @property
    def y(self) -> Array:
        """Of the rows [m], Shape (ny,)."""
        return (self.grid[1] + np.arange(self.obstacle_m.shape[0])) * self.cell_m

    @cached_property
    def sure(self) -> Bools:
        """Nodes at which the rover surely can turn, and between which it can go, (ny, nx)."""
        spec = self.mobility
        # From a node to its neighbour no point is further than half a diagonal from one of them.
        along = spec.half_kept_m + self.cell_m / math.sqrt(2)
        needed = max(spec.circumscribed_m, along) + 1e-5
        level = math.tan(min(spec.max_slope_rad, spec.max_roll_rad))
        # Between nodes the slope may be that of a neighbour's square.
        steep = ndimage.binary_dilation(self.steepness > level, _AROUND)
        return np.asarray(
            (self.obstacle_m >= needed) & (self.straddle_m >= needed) & ~steep, dtype=bool
        )

    def possible_over(self, rocks: bool = True, slope: bool = True) -> Bools:
        """Give the nodes nearest to which the rover's origin may be, Shape (ny, nx).

        Args:
            rocks: Whether rocks count.
            slope: Whether slopes count; where the ground may not be driven on always does.
        """
        steepest = math.tan(self.mobility.max_slope_rad) if slope else 1e9
        free = np.asarray(ndimage.binary_dilation(self.steepness <= steepest, _AROUND))
        if rocks:
            needed = self.mobility.inscribed_m - self.cell_m / math.sqrt(2) - 1e-5
            free &= self.obstacle_m >= needed
        return free

    @cached_property
    def possible(self) -> Bools:
        """Nodes nearest to which the rover's origin may be, at some heading, Shape (ny, nx)."""
        return self.possible_over()

    @cached_property
    def sure_region(self) -> NDArray[np.int32]:
        """Number of the connected part of `sure`, 0 off it, Shape (ny, nx)."""
        return regions(self.sure)

    @cached_property
    def possible_region(self) -> NDArray[np.int32]:
        """Number of the connected part of `possible`, 0 off it, Shape (ny, nx)."""
        return regions(self.possible)

    @cached_property
    def _needs(self) -> Array:
        return self.mobility.needs()

    @cached_property
    def _body(self) -> Array:
        return self.mobility.body_discs()

    @cached_property
    def _tracks(self) -> Array:
        return self.mobility.track_discs()

    def node(self, xy: Point) -> tuple[int, int]:
        """Give row and column of the node nearest to a point, held to the map."""
        row, column = (
            min(max(round(xy[axis] / self.cell_m) - int(self.grid[axis]), 0), count - 1)
            for axis, count in ((1, len(self.y)), (0, len(self.x)))
        )
        return row, column

    def nodes_within(self, xy: Point, radius_m: float) -> tuple[Ints, Ints]:
        """Give rows and columns of the nodes within a radius of a point, the nearest first.

        The node nearest to the point is among them, whatever the radius.
        """
        row, column = self.node(xy)
        reach = math.ceil(radius_m / self.cell_m) + 1
        rows = np.arange(max(row - reach, 0), min(row + reach + 1, len(self.y)))
        columns = np.arange(max(column - reach, 0), min(column + reach + 1, len(self.x)))
        away = np.hypot(self.x[None, columns] - xy[0], self.y[rows, None] - xy[1])
        near = (away <= radius_m) | ((rows[:, None] == row) & (columns[None] == column))
        i, j = np.nonzero(near)
        order = np.argsort(away[i, j], kind="stable")
        return rows[i[order]], columns[j[order]]

    def point(self, row: int, column: int) -> Point:
        """Give the place of a node [m]."""
        return float(self.x[column]), float(self.y[row])


def regions(free: Bools) -> NDArray[np.int32]:
    """Number the connected parts of a set of nodes, diagonal steps included."""
    return np.asarray(ndimage.label(free, _AROUND)[0], dtype=np.int32)


def map_mobility(terrain: Ground, box: Box, mobility: MobilitySpec, cell_m: float) -> MobilityMap:
    """Map a box of a terrain: once for all that is asked of it.

    Args:
        terrain: The terrain.
        box: What to map; rocks just outside count too.
        mobility: What ground is to the rover.
        cell_m: Distance of the nodes [m].

    Raises:
        PlanningError: The box is too large to be mapped as finely as asked.
    """
    wide = box.grown(mobility.circumscribed_m + 2 * cell_m)
    grid, shape = _grid(wide, cell_m)
    _check_size(shape, cell_m)
    cap = mobility.circumscribed_m + CAP_M
    outlines = _outlines(terrain, wide.grown(cap + _ROCK_REACH_M), mobility)
    obstacle, straddle = (_distances(kind, grid, shape, cap) for kind in outlines)
    lattice, gradient = _slopes(terrain, box, mobility)
    return MobilityMap(box, mobility, grid, obstacle, straddle, lattice, gradient)


def _grid(box: Box, cell_m: float) -> tuple[Array, tuple[int, int]]:
    x0, y0 = math.floor(box.x_min / cell_m), math.floor(box.y_min / cell_m)
    shape = (math.ceil(box.y_max / cell_m) + 1 - y0, math.ceil(box.x_max / cell_m) + 1 - x0)
    return np.array([x0, y0, cell_m]), shape


def _check_size(shape: tuple[int, int], cell_m: float) -> None:
    if shape[0] * shape[1] > _NODES_MAX:
        side_m = math.sqrt(_NODES_MAX) * cell_m
        raise PlanningError(
            f"{shape[1] * cell_m:.0f} x {shape[0] * cell_m:.0f} m is too much to map at once with "
            f"cell_m {cell_m:g}: up to {side_m:.0f} x {side_m:.0f} m is possible, or a larger cell"
        )


def _outlines(terrain: Ground, box: Box, mobility: MobilitySpec) -> tuple[list[Array], list[Array]]:
    # Lower rocks need not be drawn; a rock is at most so high for its width.
    rocks = terrain.rocks(box, mobility.climb_height_m / HEIGHT_RATIO[1] * (1 - 1e-9))
    obstacles, straddled = kinds_of(rocks, mobility)
    return rocks.select(obstacles).outlines(), rocks.select(straddled).outlines()


def _distances(outlines: list[Array], grid: Array, shape: tuple[int, int], cap_m: float) -> Floats:
    distance = np.full(shape, cap_m, dtype=np.float32)
    corners = np.concatenate([np.empty((0, 2)), *outlines])
    offsets = np.cumsum([0, *map(len, outlines)])
    stamp_polygons(distance, int(grid[0]), int(grid[1]), float(grid[2]), corners, offsets)
    return distance


def _slopes(terrain: Ground, box: Box, mobility: MobilitySpec) -> tuple[Array, Floats]:
    """Take central differences over the scale of the slope, on a lattice of half of it."""
    step = mobility.slope_scale_m / _LATTICE_PER_SCALE
    lattice, shape = _grid(box.grown(2 * step), step)
    x0, y0 = int(lattice[0]), int(lattice[1])
    heights = terrain.patch(x0, y0, shape, step)
    dz_dy, dz_dx = np.gradient(heights, step)
    gradient = np.stack([dz_dx, dz_dy], axis=-1).astype(np.float32)
    x, y = _nodes(x0, shape[1], step), _nodes(y0, shape[0], step)
    gradient[~_within(box, x, y)] = np.inf
    if terrain.drivable is not None:
        reach = mobility.circumscribed_m
        gradient[~_within(terrain.drivable.grown(-reach), x, y)] = np.inf
    return lattice, gradient


def _nodes(first: int, count: int, step_m: float) -> Array:
    return np.asarray((first + np.arange(count)) * step_m, dtype=np.float64)


def _within(box: Box, x: Array, y: Array) -> Bools:
    in_x = (x >= box.x_min - 1e-9) & (x <= box.x_max + 1e-9)
    in_y = (y >= box.y_min - 1e-9) & (y <= box.y_max + 1e-9)
    return np.asarray(in_y[:, None] & in_x[None, :])
