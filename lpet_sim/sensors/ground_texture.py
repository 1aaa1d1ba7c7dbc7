"""The ground's look, tile by tile: albedo with the sun's light and shadows baked in.

The sun does not move during a traverse and the ground scatters evenly, so its radiance is a
function of the place alone. A tile is a pure function of its index: it can be thrown away and made
again, and a landmark on it never swims.
"""

from __future__ import annotations

import math
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from lpet_sim.recording.arrays import Array
from lpet_sim.sensors.clipmap import Level
from lpet_sim.sensors.grain_kernels import (
    CRACK_M,
    RIPPLE_M,
    add_grain,
    add_pebbles,
    add_plates,
    add_ripples,
)
from lpet_sim.sensors.shade_kernels import halve, light_texels, raise_triangles, shadow_height
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks
from lpet_sim.terrain.terrain import Terrain

Floats = NDArray[np.float32]

SKY_SHARE = 0.25
"""Share of the light that comes from the dusty sky; about 0.3 at an optical depth of 0.5
[recalled]."""

_COARSE_M = 0.025
_SHADOW_CELLS = 72
_RIM_CELLS = 10
_ROCK_REACH_M = 1.0
_FINE_MARGIN = 32
_GRAIN_LONGEST_M = 0.064
_GRAIN_OCTAVES = 4
_GRAIN_STEEPNESS = 0.085
_PEBBLES = ((0.08, 0.07), (0.04, 0.22), (0.02, 0.6), (0.01, 1.0))
_SUN_WIDTH_M = 0.02
_ROCKS_TO_CELL_M = 0.5
_DRAWN_ROCK_TONE = 0.65


@dataclass(frozen=True)
class _Coarse:
    """Fields at a tile's coarse nodes, Shape (c, c): texel (i, j) is at ``(i + 0.5) / factor``.

    Attributes:
        factor: Texels to a coarse cell.
        slope_x: dz/dx of what is drawn.
        slope_y: dz/dy.
        clearance: Height over the shadow [m].
        open_sky: Share of the sky that is seen.
        tone: Factor on the albedo, for the rocks that are drawn.
        firm: Share of firm soil, with a rim as wide as the grain's.
    """

    factor: int
    slope_x: Array
    slope_y: Array
    clearance: Array
    open_sky: Array
    tone: Array
    firm: Array


@dataclass(frozen=True)
class _Grid:
    """Nodes ``(x0 + j, y0 + i) cell_m`` of some rows and columns."""

    x0: int
    y0: int
    shape: tuple[int, int]
    cell_m: float

    @property
    def box(self) -> Box:
        x, y = self.x0 * self.cell_m, self.y0 * self.cell_m
        return Box(x, y, x + self.shape[1] * self.cell_m, y + self.shape[0] * self.cell_m)

    def window(self, tile: tuple[int, int], n: int, before: int, after: int) -> tuple[slice, slice]:
        """Pick a tile's nodes with some before and after them."""
        i, j = tile[1] * n - self.y0, tile[0] * n - self.x0
        return slice(i - before, i + n + after), slice(j - before, j + n + after)


class GroundTexture:
    """Bakes tiles of radiance.

    Attributes:
        terrain: The ground.
        key: Hash of the terrain, from which the grain is drawn.
    """

    def __init__(self, terrain: Terrain) -> None:
        self.terrain = terrain
        self.key = zlib.crc32(terrain.patch(0, 0, (8, 8), 1.0).tobytes())
        self._sun = np.array(terrain.spec.sun.direction)

    def bake(self, level: Level, tile: tuple[int, int], min_drawn_m: float) -> Floats:
        """Give the radiance of a tile, relative to a white Lambert surface that faces the sun.

        Args:
            level: Its level.
            tile: Its world index (ix, iy).
            min_drawn_m: Rocks from this diameter on have a mesh and only cast a shadow here;
                smaller ones are drawn into the texture [m].

        Returns:
            Shape (texels, texels); row 0 is at the lowest y.
        """
        factor = max(2, round(_COARSE_M / level.texel_m))
        coarse = self._coarse(level, tile, factor, min_drawn_m)
        fine, shade, tone = self._fine(level, tile, coarse)
        tan = math.tan(self.terrain.spec.sun.elevation_rad)
        soft = np.array([tan * _SUN_WIDTH_M + 0.3 * level.texel_m, tan * level.texel_m])
        albedo = self._albedo(level, tile) * tone
        fields = (coarse.slope_x, coarse.slope_y, coarse.clearance, coarse.open_sky, coarse.tone)
        scale = (level.texel_m, float(factor))
        return light_texels(albedo, fine, shade, *fields, *scale, self._sun, soft, SKY_SHARE)

    def _albedo(self, level: Level, tile: tuple[int, int]) -> Array:
        n = level.texels
        x = (tile[0] * n + np.arange(n) + 0.5) * level.texel_m
        y = (tile[1] * n + np.arange(n) + 0.5) * level.texel_m
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return self.terrain.albedo(points, level.texel_m, pebbles=False).reshape(n, n)

    def _coarse(
        self, level: Level, tile: tuple[int, int], factor: int, min_drawn_m: float
    ) -> _Coarse:
        """Work out what the light needs at the tile's coarse nodes."""
        n, rim = level.texels // factor, _FINE_MARGIN // factor
        grid = self._grid(tile, n, level.texel_m * factor, rim)
        drawn = self.terrain.patch(grid.x0, grid.y0, grid.shape, grid.cell_m, grid.cell_m / 2)
        firm = self._firm(grid)
        if grid.cell_m <= RIPPLE_M / 3:
            drawn = drawn.copy()
            add_ripples(drawn, 1.0 - firm, grid.x0, grid.y0, grid.cell_m, self.key)
        ground = tops = drawn
        if grid.cell_m <= _ROCKS_TO_CELL_M:
            drawn, tops = self._with_rocks(drawn, grid, min_drawn_m)
        shade = cast_shadows(tops, grid.cell_m, self._sun)
        covered = np.clip((tops - drawn) / (4 * grid.cell_m), 0.0, 1.0)
        slope_y, slope_x = (np.asarray(slope) for slope in np.gradient(drawn, grid.cell_m))
        inner = grid.window(tile, n, 0, 2)
        return _Coarse(
            factor=factor,
            slope_x=np.ascontiguousarray(slope_x[inner]),
            slope_y=np.ascontiguousarray(slope_y[inner]),
            clearance=np.ascontiguousarray((drawn - shade)[inner]),
            open_sky=1.0 - 0.6 * np.asarray(gaussian_filter(covered, 2.0)[inner]),
            tone=np.ascontiguousarray(np.where(drawn > ground, _DRAWN_ROCK_TONE, 1.0)[inner]),
            firm=np.ascontiguousarray(firm[grid.window(tile, n, rim, rim + 1)]),
        )

    def _grid(self, tile: tuple[int, int], n: int, cell_m: float, rim: int) -> _Grid:
        """Lay nodes over a tile and as far towards the sun as its shadows come from."""
        lead = max(abs(self._sun[0]), abs(self._sun[1]), 1e-9)
        least = max(_RIM_CELLS, rim + 2)
        low, high = [least, least], [least, least]
        for axis in (0, 1):
            reach = least + math.ceil(_SHADOW_CELLS * abs(self._sun[axis]) / lead)
            (high if self._sun[axis] > 0 else low)[axis] = reach
        shape = (n + 2 + low[1] + high[1], n + 2 + low[0] + high[0])
        return _Grid(tile[0] * n - low[0], tile[1] * n - low[1], shape, cell_m)

    def _firm(self, grid: _Grid) -> Array:
        """Give the share of firm soil at nodes, its borders softened."""
        x = (grid.x0 + np.arange(grid.shape[1])) * grid.cell_m
        y = (grid.y0 + np.arange(grid.shape[0])) * grid.cell_m
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        firm = np.array([soil.firm for soil in self.terrain.spec.soils], dtype=float)
        share = firm[self.terrain.soil(points)].reshape(grid.shape)
        return np.asarray(gaussian_filter(share, 2.0))

    def _with_rocks(self, ground: Array, grid: _Grid, min_drawn_m: float) -> tuple[Array, Array]:
        """Raise the small rocks that are drawn, and then all that cast a shadow."""
        rocks = self.terrain.rocks(grid.box.grown(_ROCK_REACH_M), 1.5 * grid.cell_m)
        drawn = ground.copy()
        _raise(drawn, rocks, rocks.diameter_m < min_drawn_m, grid)
        tops = drawn.copy()
        _raise(tops, rocks, rocks.diameter_m >= min_drawn_m, grid)
        return drawn, tops

    def _fine(
        self, level: Level, tile: tuple[int, int], coarse: _Coarse
    ) -> tuple[Array, Array, Array]:
        """Grow plates, grain and pebbles: heights, their shadow heights and tone."""
        n, texel, m = level.texels, level.texel_m, _FINE_MARGIN
        x0, y0 = tile[0] * n - m, tile[1] * n - m
        fine, tone = np.zeros((n + 2 * m, n + 2 * m)), np.ones((n + 2 * m, n + 2 * m))
        for octave in range(_GRAIN_OCTAVES):
            wave = _GRAIN_LONGEST_M / 2**octave
            if wave >= 2 * texel:
                add_grain(fine, x0, y0, texel, wave, _GRAIN_STEEPNESS * wave, self.key)
        if texel <= CRACK_M * 2:
            add_plates(fine, tone, coarse.firm, coarse.factor, x0, y0, texel, self.key)
        for diameter, cover in _PEBBLES:
            if diameter >= 2 * texel:
                add_pebbles(fine, tone, x0, y0, texel, diameter, cover, self.key)
        shade = cast_shadows(fine, texel, self._sun)
        rim, inner = slice(m - 1, m + n + 1), slice(m, m + n)
        return fine[rim, rim].copy(), shade[rim, rim].copy(), tone[inner, inner].copy()


def cast_shadows(height: Array, cell_m: float, sun: Array) -> Array:
    """Give the height below which each node does not see the sun.

    Args:
        height: Heights at nodes, rows are y [m], Shape (r, c).
        cell_m: Distance of the nodes [m].
        sun: Unit vector to the sun, Shape (3,).

    Returns:
        Shape (r, c), very low at the edge that the sun shines in from.
    """
    along_x = abs(sun[0]) > abs(sun[1])
    turned = height.T if along_x else height
    lead, side = (sun[0], sun[1]) if along_x else (sun[1], sun[0])
    if abs(lead) < 1e-9:
        return np.full(height.shape, -1e9)
    turned = turned[::-1] if lead > 0 else turned
    drop = cell_m * sun[2] / abs(lead)
    shade = shadow_height(np.ascontiguousarray(turned), side / abs(lead), drop)
    shade = shade[::-1] if lead > 0 else shade
    return shade.T if along_x else shade


def _raise(height: Array, rocks: Rocks, which: NDArray[np.bool_], grid: _Grid) -> None:
    """Lift a height map to the tops of some rocks."""
    x, y = grid.x0 * grid.cell_m, grid.y0 * grid.cell_m
    for _, corners, faces in rocks.select(which).meshes():
        triangles = np.ascontiguousarray(corners[:, faces].reshape(-1, 3, 3))
        raise_triangles(height, triangles, x, y, grid.cell_m)


def pyramid(tile: Floats) -> list[NDArray[np.uint16]]:
    """Give a tile and its halvings down to one texel as 16-bit numbers; 0 is kept for the sky."""
    levels = [tile]
    while len(levels[-1]) > 1:
        levels.append(halve(levels[-1]))
    return [np.clip(np.rint(image * 65535), 1, 65535).astype(np.uint16) for image in levels]
