"""Simple craters, fresh to degraded, drawn tile by tile from a hash of the place."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.hashing import MAX_COUNT, poisson, tile_state, uniform
from lpet_sim.terrain.spec import CraterSpec

REACH = 3.0  # where the ejecta end, in rim radii
RIM_RATIO = 0.2  # rim height over depth of a fresh crater, 0.04 D over 0.2 D [recalled, Pike 1977]


@dataclass(frozen=True, eq=False)
class CraterField:
    """All craters of a terrain.

    Attributes:
        key: What the places are hashed with.
        levels: (least diameter [m], greatest [m], side of a tile [m], mean count on a tile) of
            each octave of size, Shape (l, 4).
        exponent: Of the cumulative size distribution.
        depth_ratio: Depth over diameter of a fresh crater.
        freshness_min: Least depth as a fraction of a fresh crater's.
    """

    key: int
    levels: Array
    exponent: float
    depth_ratio: float
    freshness_min: float

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Give the relief of the craters at points [m], Shape (n, 2) -> (n,).

        Args:
            xy: Points in the world [m], Shape (n, 2).
            detail_m: Leave out craters smaller than twice this [m].
        """
        levels = self.levels[self.levels[:, 1] >= 2.0 * detail_m]
        first = len(self.levels) - len(levels)
        return self._evaluate(xy, levels, first)[:, 0]

    def gradient(self, xy: Array) -> Array:
        """Give (dz/dx, dz/dy) at points [m], Shape (n, 2) -> (n, 2)."""
        return self._evaluate(xy, self.levels, 0)[:, 1:]

    def _evaluate(self, xy: Array, levels: Array, first: int) -> Array:
        out = np.zeros((len(xy), 3))
        form = np.array([self.exponent, self.depth_ratio, self.freshness_min])
        for number, level in enumerate(levels, start=first):
            _sum_level(xy, self.key, number, level, form, out)
        return out


def build_craters(spec: CraterSpec, rng: np.random.Generator) -> CraterField:
    """Lay out the octaves of size; a tile is as wide as its largest crater's ejecta reach."""
    low, rows = spec.diameter_min_m, []
    while low < spec.diameter_max_m:
        high = min(2.0 * low, spec.diameter_max_m)
        side = 0.5 * REACH * high
        count = spec.density_1m_per_m2 * (low**-spec.exponent - high**-spec.exponent) * side**2
        rows.append((low, high, side, count))
        low = high
    key = int(rng.integers(2**62))
    return CraterField(
        key, np.array(rows), spec.exponent, spec.depth_ratio_fresh, spec.freshness_min
    )


@njit(cache=True, nogil=True)
def crater_profile(r, depth, rim, softness):  # type: ignore[no-untyped-def]
    """Give height and slope of a crater at a distance from its centre.

    A parabolic bowl ``rim - depth (1 - r^2)`` meets ejecta ``rim r^-3``, tapered to end at REACH;
    the crest is rounded by a polynomial minimum of width ``softness``.

    Args:
        r: Distance over the rim's radius.
        depth: From the rim's crest to the floor [m].
        rim: Height of the crest over the plain [m].
        softness: Width of the rounding [m].

    Returns:
        Height [m] and its derivative with respect to r [m].
    """
    if r >= REACH:
        return 0.0, 0.0
    s = max(r, 0.3)  # the bowl alone counts near the centre
    taper = 1.0 - (s / REACH) ** 2
    scale = rim / (1.0 - REACH**-2.0) ** 2
    ejecta = scale * taper**2 / s**3
    ejecta_slope = scale * taper / s**4 * (-4.0 * (s / REACH) ** 2 - 3.0 * taper)
    bowl, bowl_slope = rim - depth * (1.0 - r * r), 2.0 * depth * r
    m = min(max(0.5 + 0.5 * (ejecta - bowl) / softness, 0.0), 1.0)
    height = m * bowl + (1.0 - m) * ejecta - softness * m * (1.0 - m)
    return height, m * bowl_slope + (1.0 - m) * ejecta_slope


@njit(cache=True, nogil=True)
def _draw(state, index, level, form, out):  # type: ignore[no-untyped-def]
    """Draw crater number index of a tile: (x, y) in the tile, radius, depth, rim, softness."""
    low, high, side = level[0], level[1], level[2]
    n = 8 * (index + 1)
    near, far = low ** -form[0], high ** -form[0]
    diameter = (near - uniform(state, n) * (near - far)) ** (-1.0 / form[0])
    freshness = form[2] ** uniform(state, n + 1)
    out[0], out[1] = uniform(state, n + 2) * side, uniform(state, n + 3) * side
    out[2] = 0.5 * diameter
    out[3] = form[1] * freshness * diameter
    out[4] = RIM_RATIO * freshness * out[3]
    out[5] = (0.05 + 0.4 * (1.0 - freshness)) * out[3]


@njit(cache=True, nogil=True)
def _gather(key, number, level, form, ix, iy, found):  # type: ignore[no-untyped-def]
    """List the craters of a tile and its eight neighbours, always in the same order."""
    total = 0
    for jy in range(iy - 1, iy + 2):
        for jx in range(ix - 1, ix + 2):
            state = tile_state(key, number, jx, jy)
            for index in range(poisson(uniform(state, 0), level[3])):
                _draw(state, index, level, form, found[total])
                found[total, 0] += jx * level[2]
                found[total, 1] += jy * level[2]
                total += 1
    return total


@njit(cache=True, nogil=True)
def _sum_level(xy, key, number, level, form, out):  # type: ignore[no-untyped-def]
    """Add the craters of one octave: (z, dz/dx, dz/dy), Shape (n, 3)."""
    found = np.empty((9 * MAX_COUNT, 6))
    last_x, last_y, total = 1 << 60, 1 << 60, 0
    for i in range(len(xy)):
        ix, iy = math.floor(xy[i, 0] / level[2]), math.floor(xy[i, 1] / level[2])
        if ix != last_x or iy != last_y:
            total = _gather(key, number, level, form, ix, iy, found)
            last_x, last_y = ix, iy
        for k in range(total):
            _add_crater(xy[i, 0] - found[k, 0], xy[i, 1] - found[k, 1], found[k], out[i])


@njit(cache=True, nogil=True)
def _add_crater(dx, dy, crater, out):  # type: ignore[no-untyped-def]
    """Add one crater at an offset from its centre."""
    squared = dx * dx + dy * dy
    radius = crater[2]
    if squared < (REACH * radius) ** 2:
        distance = math.sqrt(squared)
        z, slope = crater_profile(distance / radius, crater[3], crater[4], crater[5])
        out[0] += z
        per_m = slope / (radius * max(distance, 1e-12))
        out[1] += per_m * dx
        out[2] += per_m * dy
