"""Nested levels of ground around the rover: fine near, coarse out to the skyline.

Each level is a window of 4 x 4 tiles on a world grid of its own; a tile is both a square of texture
and a block of mesh. A level is drawn where no finer one is. Nodes and texels lie on fixed world
grids, so a window that moves changes nothing of what was there before.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.sensors.camera_spec import GroundDetailSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.terrain import Terrain

TILES = 4
"""Tiles along a window's edge."""

_SLACK = 0.55
"""How far, in tiles, a window may be off its best place before it moves."""

_FINE_LEVELS = 3
_COARSE_TEXTURE_FROM = 6


@dataclass(frozen=True)
class Level:
    """One level of detail.

    Attributes:
        texel_m: Size of a texel [m].
        texels: Texels along a tile.
        cell_m: Size of a mesh cell [m].
        cells: Cells along a tile.
        parent_cell_m: Cell of the next coarser level, which the rim follows [m]; None: the last.
    """

    texel_m: float
    texels: int
    cell_m: float
    cells: int
    parent_cell_m: float | None

    @property
    def tile_m(self) -> float:
        """Size of a tile [m]."""
        return self.texel_m * self.texels

    @property
    def guard_cells(self) -> int:
        """Cells at the window's rim that are left to the next level: one of its cells."""
        return 0 if self.parent_cell_m is None else round(self.parent_cell_m / self.cell_m)


def make_levels(spec: GroundDetailSpec) -> tuple[Level, ...]:
    """Lay out the levels: tiles double twice and then quadruple; far cells are twice as coarse."""
    cells = round(spec.tile_texels * spec.texel_m / spec.cell_m)
    rows: list[tuple[float, int, float, int]] = []
    tile_m = spec.tile_texels * spec.texel_m
    for index in range(spec.levels):
        tile_m *= 1 if index == 0 else 2 if index < _FINE_LEVELS else 4
        n = cells if index < _FINE_LEVELS - 1 else cells // 2
        texels = spec.tile_texels // (2 if index >= _COARSE_TEXTURE_FROM else 1)
        rows.append((tile_m / texels, texels, tile_m / n, n))
    parents = [row[2] for row in rows[1:]] + [None]
    return tuple(Level(*row, parent) for row, parent in zip(rows, parents, strict=True))


def place_window(level: Level, xy: Array, current: tuple[int, int] | None) -> tuple[int, int]:
    """Choose a window's first tile so that it is centred near a point, without hurry to move.

    Args:
        level: The level.
        xy: Where the centre should be in the world [m], Shape (2,).
        current: First tile (ix, iy) now; None: there is no window yet.
    """
    wish = xy / level.tile_m - TILES / 2
    if current is not None and np.all(np.abs(wish - current) <= _SLACK):
        return current
    return math.floor(wish[0] + 0.5), math.floor(wish[1] + 0.5)


def active_box(level: Level, window: tuple[int, int]) -> Box:
    """Give the part of a window that the level is drawn in [m]."""
    guard = level.guard_cells * level.cell_m
    x, y = window[0] * level.tile_m, window[1] * level.tile_m
    side = TILES * level.tile_m
    return Box(x + guard, y + guard, x + side - guard, y + side - guard)


def window_heights(terrain: Terrain, level: Level, window: tuple[int, int]) -> Array:
    """Give the heights of a window's nodes, its rim on the edges of the next level.

    Returns:
        Heights [m], Shape (4 cells + 1, 4 cells + 1); rows are y.
    """
    n = TILES * level.cells
    x0, y0 = window[0] * level.cells, window[1] * level.cells
    z = terrain.patch(x0, y0, (n + 1, n + 1), level.cell_m, _detail(level.cell_m)).copy()
    if level.parent_cell_m is not None:
        _follow_parent(terrain, level, (x0, y0), z)
    return z


def _detail(cell_m: float) -> float:
    """Leave nothing out of the near ground, whose shape is the physics'."""
    return cell_m / 2 if cell_m > 1.0 else 0.0


def _follow_parent(terrain: Terrain, level: Level, origin: tuple[int, int], z: Array) -> None:
    """Bring the four rims onto the straight edges of the next level's cells: no cracks."""
    g, parent = level.guard_cells, float(level.parent_cell_m or 0.0)
    m = (len(z) - 1) // g + 1
    px, py = origin[0] // g, origin[1] // g
    at, nodes = np.arange(len(z)), np.arange(m) * g
    for k in (1, m - 2):
        row = terrain.patch(px, py + k, (1, m), parent, _detail(parent))[0]
        column = terrain.patch(px + k, py, (m, 1), parent, _detail(parent))[:, 0]
        z[k * g, :] = np.interp(at, nodes, row)
        z[:, k * g] = np.interp(at, nodes, column)


def block_vertices(level: Level, z: Array, tile: tuple[int, int]) -> Array:
    """Give a block's corners relative to its own (x, y) corner [m], Shape ((cells + 1)^2, 3).

    Args:
        level: The level.
        z: Heights of the window's nodes.
        tile: Column and row of the tile in the window, 0 to 3.
    """
    n = level.cells
    part = z[tile[1] * n : tile[1] * n + n + 1, tile[0] * n : tile[0] * n + n + 1]
    at = np.arange(n + 1) * level.cell_m
    x, y = np.meshgrid(at, at)
    return np.stack([x, y, part], axis=-1).reshape(-1, 3)


def block_faces(cells: int) -> Ints:
    """Give the triangles of a block, two to a cell, cell by cell, Shape (2 cells^2, 3)."""
    i, j = np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij")
    a = (i * (cells + 1) + j).ravel()
    lower = np.stack([a, a + 1, a + cells + 2], axis=1)
    upper = np.stack([a, a + cells + 2, a + cells + 1], axis=1)
    return np.stack([lower, upper], axis=1).reshape(-1, 3)


def kept_cells(
    level: Level, tile: tuple[int, int], inside: Box, hole: Box | None
) -> NDArray[np.bool_]:
    """Tell which cells of a tile are drawn.

    Args:
        level: The level.
        tile: The tile's world index (ix, iy).
        inside: Where the level is drawn.
        hole: Where the next finer level is drawn instead.

    Returns:
        Booleans by cell, Shape (cells^2,).
    """
    at = (np.arange(level.cells) + 0.5) * level.cell_m
    x, y = np.meshgrid(at + tile[0] * level.tile_m, at + tile[1] * level.tile_m)
    centres = np.stack([x.ravel(), y.ravel()], axis=1)
    kept = inside.contains(centres)
    return kept if hole is None else kept & ~hole.contains(centres)


def block_texcoords(cells: int, slot: tuple[int, int]) -> Array:
    """Give the corners' place in a level's texture, which tiles share by their index modulo 4."""
    at = np.arange(cells + 1) / cells
    u, v = np.meshgrid((slot[0] + at) / TILES, (slot[1] + at) / TILES)
    return np.stack([u.ravel(), v.ravel()], axis=1)
