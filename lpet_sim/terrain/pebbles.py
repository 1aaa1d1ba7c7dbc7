"""Pebbles: what is too small to collide with, drawn in light and shade on the ground's albedo."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.hashing import MAX_COUNT, poisson, tile_state, uniform
from lpet_sim.terrain.spec import AlbedoSpec, SunSpec

SIDE = 2.0  # side of a tile over its largest pebble: no shadow reaches further
SHADOW_DEPTH = 0.5  # share of the light that a pebble's shadow takes. A choice.
SHADING = 0.3  # brightness of the sunlit edge over that of the middle. A choice.
SHADOW_RATIO = 0.35  # height of a pebble over its diameter [recalled: half-buried rocks D/2]
ELLIPSE = 0.25 * math.pi * 0.758  # mean area over the squared diameter, see _gather's flattening
SAMPLES = 20_000  # points over which an octave's mean albedo is measured: to about 0.1 %
LONGEST_SHADOW = 1.6  # limit of a shadow's length, in radii


@dataclass(frozen=True, eq=False)
class PebbleField:
    """All pebbles of a terrain.

    Attributes:
        key: What the places are hashed with.
        levels: (least diameter [m], greatest [m], side of a tile [m], mean count on a tile,
            mean albedo with the octave over that without) of each octave, Shape (l, 5).
        light: (x, y) towards the sun in the plane, shadow length in radii, contrast, Shape (4,).
    """

    key: int
    levels: Array
    light: Array

    def apply(self, xy: Array, texel_m: float, relative: Array) -> None:
        """Draw the octaves that reach two texels of size over a relative albedo, in place.

        Args:
            xy: Points in the world [m], Shape (n, 2).
            texel_m: Distance of the samples, over which edges are smoothed [m].
            relative: Albedo over the mean, Shape (n,).
        """
        for number, level in enumerate(self.levels):
            if level[1] >= 2.0 * texel_m:
                _draw_level(xy, self.key, number, level, self.light, texel_m, relative)
                relative /= level[4]


def build_pebbles(spec: AlbedoSpec, sun: SunSpec, rng: np.random.Generator) -> PebbleField:
    """Lay out the octaves of size, each covering the same share of the ground."""
    length = min(2.0 * SHADOW_RATIO / math.tan(sun.elevation_rad), LONGEST_SHADOW)
    x, y = math.cos(sun.azimuth_rad), math.sin(sun.azimuth_rad)
    light = np.array([x, y, length, spec.pebble_contrast])
    key = int(rng.integers(2**62))
    levels = np.array([[*octave, 1.0] for octave in _octaves(spec)]).reshape(-1, 5)
    for number, level in enumerate(levels):
        level[4] = _mean_albedo(key, number, level, light, rng)
    return PebbleField(key, levels, light)


def _octaves(spec: AlbedoSpec) -> Iterator[tuple[float, float, float, float]]:
    """Yield (least diameter, greatest, side of a tile, mean count on a tile) of each octave."""
    low = spec.pebble_min_m
    while low < spec.pebble_max_m * (1.0 - 1e-9):
        high = min(2.0 * low, spec.pebble_max_m)
        side = SIDE * high
        area = ELLIPSE * (low * low + low * high + high * high) / 3.0
        yield low, high, side, spec.pebble_cover * side**2 / area
        low = high


def _mean_albedo(
    key: int, number: int, level: Array, light: Array, rng: np.random.Generator
) -> float:
    """Measure what an octave does to the mean albedo, which must not depend on the sampling."""
    xy = rng.uniform(0.0, 100.0 * level[2], (SAMPLES, 2))
    relative = np.ones(SAMPLES)
    _draw_level(xy, key, number, level, light, 0.1 * level[0], relative)
    return float(relative.mean())


@njit(cache=True, nogil=True)
def _gather(key, number, level, contrast, ix, iy, found):  # type: ignore[no-untyped-def]
    """List the pebbles of a tile and its neighbours: (x, y, radius, cos, sin, flattening, tone)."""
    total = 0
    for jy in range(iy - 1, iy + 2):
        for jx in range(ix - 1, ix + 2):
            state = tile_state(key, number, jx, jy)
            for index in range(poisson(uniform(state, 0), level[3])):
                n, row = 8 * (index + 1), found[total]
                row[0] = (jx + uniform(state, n)) * level[2]
                row[1] = (jy + uniform(state, n + 1)) * level[2]
                row[2] = 0.5 * (level[0] + uniform(state, n + 2) * (level[1] - level[0]))
                turn = math.pi * uniform(state, n + 3)
                row[3], row[4] = math.cos(turn), math.sin(turn)
                row[5] = 1.0 + 0.7 * uniform(state, n + 4)
                row[6] = contrast * math.sqrt(3.0) * (2.0 * uniform(state, n + 5) - 1.0)
                total += 1
    return total


@njit(cache=True, nogil=True, inline="always")
def _cover(dx, dy, row, texel):  # type: ignore[no-untyped-def]
    """Give how much of a texel lies on the ellipse of a pebble, 0 to 1."""
    u = row[3] * dx + row[4] * dy
    v = (row[3] * dy - row[4] * dx) * row[5]
    return min(max((row[2] - math.sqrt(u * u + v * v)) / texel + 0.5, 0.0), 1.0)


@njit(cache=True, nogil=True)
def _lit(dx, dy, row, light, texel):  # type: ignore[no-untyped-def]
    """Give what a pebble and its shadow multiply the albedo by at an offset from its centre."""
    on = _cover(dx, dy, row, texel)
    slope = (dx * light[0] + dy * light[1]) / row[2]
    pebble = 1.0 + row[6] + SHADING * slope
    reach = light[2] * row[2]
    shaded = 0.0
    for part in (0.5, 1.0):
        shift = part * reach
        shaded = max(shaded, _cover(dx + shift * light[0], dy + shift * light[1], row, texel))
    return on * pebble + (1.0 - on) * (1.0 - SHADOW_DEPTH * shaded)


@njit(cache=True, nogil=True)
def _draw_level(xy, key, number, level, light, texel, out):  # type: ignore[no-untyped-def]
    """Draw the pebbles of one octave of size over a relative albedo."""
    found = np.empty((9 * MAX_COUNT, 7))
    last_x, last_y, total = 1 << 60, 1 << 60, 0
    for i in range(len(xy)):
        x, y = xy[i, 0], xy[i, 1]
        ix, iy = math.floor(x / level[2]), math.floor(y / level[2])
        if ix != last_x or iy != last_y:
            total = _gather(key, number, level, light[3], ix, iy, found)
            last_x, last_y = ix, iy
        for k in range(total):
            dx, dy = x - found[k, 0], y - found[k, 1]
            reach = (1.0 + light[2]) * found[k, 2] + texel
            if dx * dx + dy * dy < reach * reach:
                out[i] *= _lit(dx, dy, found[k], light, texel)
