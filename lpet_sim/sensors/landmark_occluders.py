"""What hides landmarks: the ground as nested grids of height, and the rocks as they are drawn.

The ground is sampled on grids that are fine near the path and coarse far from it. A line of sight
is walked over them in steps that the steepest slope of the grid allows, so that nothing is missed
that is wider than half a cell. Rocks are the very polyhedra that the renderer draws, and exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks
from lpet_sim.terrain.terrain import Terrain

CELL_M = 0.05
"""Finest cell of the heights [m]: off the ground by 2 mm RMS and 8 mm at most on the ExoMars
terrain [measured]."""

FAR_CELL_M = 0.4
"""Cell of the second level [m]; each further one is four times as coarse and reaches four times as
far."""

FAR_REACH_M = 64.0
"""Reach of the second level [m]."""

ROCK_CELL_M = 0.5
"""Cell of the index of rocks [m]."""

_SLACK = 0.25  # by which a coarse level is made too large, over its reach, to be used for longer


@dataclass(frozen=True, eq=False)
class HeightLevel:
    """Heights of the ground on one grid.

    Attributes:
        cell_m: Distance of the nodes [m].
        reach_m: How far from a place in the block it is used [m].
        first: Index of the first node (ix, iy): it lies at ``first * cell_m``.
        z: Heights [m], Shape (ny, nx), float32.
    """

    cell_m: float
    reach_m: float
    first: tuple[int, int]
    z: np.ndarray

    def covers(self, box: Box) -> bool:
        """Tell whether a box and what is within reach of it lie on the grid."""
        wide = box.grown(self.reach_m)
        ny, nx = self.z.shape
        (x, y), cell = self.first, self.cell_m
        low = x * cell <= wide.x_min and y * cell <= wide.y_min
        return low and (x + nx - 1) * cell >= wide.x_max and (y + ny - 1) * cell >= wide.y_max

    @property
    def slope(self) -> float:
        """Bound of the steepest slope of the surface between the nodes."""
        steps = [np.abs(np.diff(self.z, axis=axis)).max(initial=0.0) for axis in (0, 1)]
        return float(np.hypot(*steps)) / self.cell_m


@dataclass(frozen=True, eq=False)
class Occluders:
    """What may hide landmarks from the places of one block, as plain arrays for compiled code.

    Attributes:
        levels: (first x [m], first y [m], cell [m], nx, ny, start in `z`, reach [m], steepest
            slope) of each level, the finest first, Shape (l, 8).
        z: Heights of all levels [m], Shape (k,), float32.
        rocks: (x, y, reach, lowest z, highest z) of each rock [m], Shape (r, 5).
        plane_start: First plane of each rock, and the number of all, Shape (r + 1,).
        planes: Outward normal and distance from the origin of each facet, Shape (p, 4).
        grid: (first x [m], first y [m], cell [m], nx, ny) of the index of rocks, Shape (5,).
        cell_start: First entry of each cell of the index, and the number of all, Shape (nx ny + 1).
        cell_rocks: Rocks by cell, Shape (e,).
    """

    levels: Array
    z: np.ndarray
    rocks: Array
    plane_start: Ints
    planes: Array
    grid: Array
    cell_start: Ints
    cell_rocks: Ints


class OccluderSource:
    """Makes the occluders of one block after the other, keeping what can be used again."""

    def __init__(self, terrain: Terrain, near_m: float, far_m: float, rock_min_m: float) -> None:
        """Plan the levels.

        Args:
            terrain: Ground and rocks.
            near_m: How far from a place landmarks on ground and rocks are seen [m].
            far_m: How far landmarks are at most [m].
            rock_min_m: Diameter of the smallest rock that hides anything [m].
        """
        self._terrain, self._near_m, self._rock_min_m = terrain, near_m, rock_min_m
        self._plan = [(CELL_M, near_m)]
        cell_m, reach_m = FAR_CELL_M, FAR_REACH_M
        while self._plan[-1][1] < far_m:
            if reach_m > near_m:
                self._plan.append((cell_m, reach_m))
            cell_m, reach_m = 4.0 * cell_m, 4.0 * reach_m
        self._kept: dict[float, HeightLevel] = {}

    def around(self, box: Box) -> Occluders:
        """Give what may hide landmarks from any place in a box [m]."""
        for cell_m, reach_m in self._plan:
            if cell_m not in self._kept or not self._kept[cell_m].covers(box):
                self._kept[cell_m] = self._level(box, cell_m, reach_m)
        levels = [self._kept[cell_m] for cell_m, _ in self._plan]
        table, start = [], 0
        for level in levels:
            (x, y), (ny, nx) = level.first, level.z.shape
            corner = (x * level.cell_m, y * level.cell_m)
            table.append((*corner, level.cell_m, nx, ny, start, level.reach_m, level.slope))
            start += level.z.size
        z = np.concatenate([level.z.reshape(-1) for level in levels])
        return Occluders(np.array(table), z, *self._rocks(box.grown(self._near_m)))

    def _level(self, box: Box, cell_m: float, reach_m: float) -> HeightLevel:
        slack = 0.0 if cell_m == CELL_M else _SLACK
        wide = box.grown((1.0 + slack) * reach_m + cell_m)
        x0, y0 = math.floor(wide.x_min / cell_m), math.floor(wide.y_min / cell_m)
        nx, ny = math.ceil(wide.x_max / cell_m) - x0 + 1, math.ceil(wide.y_max / cell_m) - y0 + 1
        z = self._terrain.patch(x0, y0, (ny, nx), cell_m)
        return HeightLevel(cell_m, reach_m, (x0, y0), z.astype(np.float32))

    def _rocks(self, box: Box) -> tuple[Array, Ints, Array, Array, Ints, Ints]:
        rocks = self._terrain.rocks(box, self._rock_min_m)
        table, plane_start, planes = _polyhedra(rocks)
        nx = math.ceil((box.x_max - box.x_min) / ROCK_CELL_M) + 1
        ny = math.ceil((box.y_max - box.y_min) / ROCK_CELL_M) + 1
        grid = np.array([box.x_min, box.y_min, ROCK_CELL_M, nx, ny])
        cell_start = np.zeros(nx * ny + 1, np.int64)
        _index_rocks(table, grid, cell_start, np.empty(0, np.int64))
        cell_rocks = np.empty(cell_start[-1], np.int64)
        _index_rocks(table, grid, cell_start, cell_rocks)
        return table, plane_start, planes, grid, cell_start, cell_rocks


def _polyhedra(rocks: Rocks) -> tuple[Array, Ints, Array]:
    """Give the rocks as boxes and planes: see `Occluders`."""
    top = rocks.p_world_rock[:, 2] + rocks.height_m
    foot = rocks.p_world_rock[:, 2] - rocks.depth_m
    table = np.column_stack([rocks.p_world_rock[:, :2], rocks.reach_m, foot, top])
    facets = np.zeros(len(rocks), np.int64)
    parts = []
    for rows, corners, faces in rocks.meshes():
        a, b, c = (corners[:, faces[:, k]] for k in range(3))
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        facets[rows] = len(faces)
        parts.append((rows, np.dstack([normal, np.sum(normal * a, axis=-1)])))
    start = np.concatenate([[0], np.cumsum(facets)])
    planes = np.empty((start[-1], 4))
    for rows, part in parts:
        planes[start[rows][:, None] + np.arange(part.shape[1])] = part
    return table, start, planes


@njit(cache=True, nogil=True)
def _index_rocks(rocks, grid, cell_start, cell_rocks):  # type: ignore[no-untyped-def]
    """Count the rocks of each cell of the index; with room for them, enter them, too."""
    nx, ny = int(grid[3]), int(grid[4])
    filled = np.zeros(nx * ny + 1, np.int64)
    for k in range(len(rocks)):
        x0 = max(0, math.floor((rocks[k, 0] - rocks[k, 2] - grid[0]) / grid[2]))
        x1 = min(nx - 1, math.floor((rocks[k, 0] + rocks[k, 2] - grid[0]) / grid[2]))
        y0 = max(0, math.floor((rocks[k, 1] - rocks[k, 2] - grid[1]) / grid[2]))
        y1 = min(ny - 1, math.floor((rocks[k, 1] + rocks[k, 2] - grid[1]) / grid[2]))
        for j in range(y0, y1 + 1):
            for i in range(x0, x1 + 1):
                cell = j * nx + i
                if len(cell_rocks) > 0:
                    cell_rocks[cell_start[cell] + filled[cell]] = k
                filled[cell] += 1
    if len(cell_rocks) == 0:
        total = 0
        for cell in range(nx * ny):
            cell_start[cell] = total
            total += filled[cell]
        cell_start[nx * ny] = total
