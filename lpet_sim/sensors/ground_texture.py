"""The ground's look, tile by tile: albedo with the sun's light and shadows baked in.

The sun does not move during a traverse and the ground scatters evenly, so its radiance is a
function of the place alone. A tile is a pure function of its index: it can be thrown away and made
again, and a landmark on it never swims.
"""

from __future__ import annotations

import math
import zlib

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from lpet_sim.recording.arrays import Array
from lpet_sim.sensors.clipmap import Level
from lpet_sim.sensors.grain_kernels import add_grain, add_pebbles, stoniness_at
from lpet_sim.sensors.shade_kernels import light_texels, raise_triangles, shadow_height
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks
from lpet_sim.terrain.terrain import Terrain

Floats = NDArray[np.float32]

SKY_SHARE = 0.28
"""Share of the light that comes from the dusty sky; about 0.3 at an optical depth of 0.5
[recalled]."""

_COARSE_M = 0.025
_MARGIN_CELLS = 72
_FINE_MARGIN = 32
_GRAIN_LONGEST_M = 0.064
_GRAIN_OCTAVES = 4
_GRAIN_STEEPNESS = 0.035
_PEBBLES = ((0.08, 0.06), (0.04, 0.12), (0.02, 0.25), (0.01, 0.35))
_SUN_WIDTH = 0.02


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
        factor = max(1, round(_COARSE_M / level.texel_m))
        slopes, clearance, open_sky = self._coarse(level, tile, factor, min_drawn_m)
        fine, shade, tone = self._fine(level, tile)
        albedo = self._albedo(level, tile) * tone
        tan = self._tan_elevation()
        soft = np.array([tan * _SUN_WIDTH + 0.3 * level.texel_m, tan * level.texel_m])
        return light_texels(
            albedo, fine, shade, *slopes, clearance, open_sky, level.texel_m, float(factor),
            self._sun, soft, SKY_SHARE,
        )  # fmt: skip

    def _tan_elevation(self) -> float:
        return math.tan(self.terrain.spec.sun.elevation_rad)

    def _albedo(self, level: Level, tile: tuple[int, int]) -> Array:
        n = level.texels
        x = (tile[0] * n + np.arange(n) + 0.5) * level.texel_m
        y = (tile[1] * n + np.arange(n) + 0.5) * level.texel_m
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return self.terrain.albedo(points, level.texel_m).reshape(n, n)

    def _coarse(
        self, level: Level, tile: tuple[int, int], factor: int, min_drawn_m: float
    ) -> tuple[tuple[Array, Array], Array, Array]:
        """Work out slopes, clearance over shadows and open sky at the tile's coarse nodes."""
        cell, n, m = level.texel_m * factor, level.texels // factor, _MARGIN_CELLS
        x0, y0 = tile[0] * n - m, tile[1] * n - m
        side = n + 2 * m + 2
        ground = self.terrain.patch(x0, y0, (side, side), cell, cell / 2)
        box = Box(x0 * cell, y0 * cell, (x0 + side) * cell, (y0 + side) * cell)
        rocks = self.terrain.rocks(box, 1.5 * cell) if cell < 0.5 else None
        tops = ground.copy()
        if rocks is not None and len(rocks):
            _raise(tops, rocks, rocks.diameter_m < min_drawn_m, (x0 * cell, y0 * cell), cell)
            drawn = tops.copy()
            _raise(tops, rocks, rocks.diameter_m >= min_drawn_m, (x0 * cell, y0 * cell), cell)
        else:
            drawn = ground
        inner = slice(m, m + n + 2)
        slope_y, slope_x = np.gradient(drawn[m - 1 : m + n + 3, m - 1 : m + n + 3], cell)
        shade = cast_shadows(tops, cell, self._sun)
        covered = gaussian_filter(np.clip((tops - drawn) / (4 * cell), 0.0, 1.0), 2.0)
        return (
            (slope_x[1:-1, 1:-1].copy(), slope_y[1:-1, 1:-1].copy()),
            (drawn - shade)[inner, inner].copy(),
            (1.0 - 0.6 * covered)[inner, inner].copy(),
        )

    def _fine(self, level: Level, tile: tuple[int, int]) -> tuple[Array, Array, Array]:
        """Grow grain and pebbles: heights, their shadow heights and tone."""
        n, texel, m = level.texels, level.texel_m, _FINE_MARGIN
        x0, y0 = tile[0] * n - m, tile[1] * n - m
        fine, tone = np.zeros((n + 2 * m, n + 2 * m)), np.ones((n + 2 * m, n + 2 * m))
        for octave in range(_GRAIN_OCTAVES):
            wavelength = _GRAIN_LONGEST_M / 2**octave
            if wavelength >= 2 * texel:
                add_grain(fine, x0, y0, texel, wavelength, _GRAIN_STEEPNESS * wavelength, self.key)
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


def _raise(
    height: Array, rocks: Rocks, which: NDArray[np.bool_], origin: tuple[float, float], cell: float
) -> None:
    """Lift a height map to the tops of some rocks."""
    for _, corners, faces in rocks.select(which).meshes():
        triangles = np.ascontiguousarray(corners[:, faces].reshape(-1, 3, 3))
        raise_triangles(height, triangles, origin[0], origin[1], cell)


def pyramid(tile: Floats) -> list[NDArray[np.uint16]]:
    """Give a tile and its halvings down to one texel as 16-bit numbers; 0 is kept for the sky."""
    from lpet_sim.sensors.shade_kernels import halve

    levels = [tile]
    while len(levels[-1]) > 1:
        levels.append(halve(levels[-1]))
    return [np.clip(np.rint(image * 65535), 1, 65535).astype(np.uint16) for image in levels]
