"""Loops that make the ground's grain: fine roughness and pebbles as pure functions of the place."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lpet_sim.terrain.hashing import tile_state, uniform


@njit(cache=True)
def smooth_noise(key, level, x, y):  # type: ignore[no-untyped-def]
    """Interpolate hashed nodes of the unit grid smoothly; values in -1..1."""
    ix, iy = int(math.floor(x)), int(math.floor(y))
    fx, fy = x - ix, y - iy
    fx, fy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    low = uniform(tile_state(key, level, ix, iy), 0) * (1.0 - fx)
    low += uniform(tile_state(key, level, ix + 1, iy), 0) * fx
    high = uniform(tile_state(key, level, ix, iy + 1), 0) * (1.0 - fx)
    high += uniform(tile_state(key, level, ix + 1, iy + 1), 0) * fx
    return 2.0 * (low + fy * (high - low)) - 1.0


@njit(cache=True)
def stoniness(key, x, y):  # type: ignore[no-untyped-def]
    """Say how stony the ground is, 0 (bare sand) to 2, with patches of metres and decimetres."""
    wide = smooth_noise(key, 900, x / 3.1, y / 3.1)
    middle = smooth_noise(key, 901, x / 0.9, y / 0.9)
    narrow = smooth_noise(key, 902, x / 0.27, y / 0.27)
    return min(max(0.8 + 0.9 * wide + 0.7 * middle + 0.5 * narrow, 0.0), 2.0)


@njit(cache=True)
def stoniness_at(key, x0, y0, cell, rows, columns):  # type: ignore[no-untyped-def]
    """Give `stoniness` at the nodes ``((x0 + j), (y0 + i)) * cell``, Shape (rows, columns)."""
    out = np.empty((rows, columns))
    for i in range(rows):
        for j in range(columns):
            out[i, j] = stoniness(key, (x0 + j) * cell, (y0 + i) * cell)
    return out


@njit(cache=True)
def add_grain(height, x0, y0, texel, wavelength, amplitude, key):  # type: ignore[no-untyped-def]
    """Add one octave of smooth noise; texel (i, j) is at ``(x0 + j + 0.5, y0 + i + 0.5) texel``."""
    rows, columns = height.shape
    ratio = texel / wavelength
    level = 400 + int(round(-8.0 * math.log2(wavelength)))
    first = int(math.floor((x0 + 0.5) * ratio))
    count = int(math.floor((x0 + columns - 0.5) * ratio)) - first + 2
    nodes = np.empty((2, count))
    last = -(1 << 60)
    for i in range(rows):
        y = (y0 + i + 0.5) * ratio
        iy = int(math.floor(y))
        fy = y - iy
        fy = fy * fy * (3.0 - 2.0 * fy)
        if iy != last:
            for k in range(count):
                nodes[0, k] = uniform(tile_state(key, level, first + k, iy), 0) - 0.5
                nodes[1, k] = uniform(tile_state(key, level, first + k, iy + 1), 0) - 0.5
            last = iy
        for j in range(columns):
            x = (x0 + j + 0.5) * ratio
            k = int(math.floor(x)) - first
            fx = x - first - k
            fx = fx * fx * (3.0 - 2.0 * fx)
            low = nodes[0, k] + fx * (nodes[0, k + 1] - nodes[0, k])
            high = nodes[1, k] + fx * (nodes[1, k + 1] - nodes[1, k])
            height[i, j] += 2.0 * amplitude * (low + fy * (high - low))


@njit(cache=True)
def add_pebbles(height, tone, x0, y0, texel, diameter, cover, key):  # type: ignore[no-untyped-def]
    """Lay one octave of pebbles: a hashed cell of ``3 diameter`` holds one or none.

    Args:
        height: Grain heights to lie on [m], Shape (r, c), as in `add_grain`.
        tone: Factor on the albedo, changed under a pebble, Shape (r, c).
        x0: Column of the first texel on the world grid.
        y0: Row likewise.
        texel: [m].
        diameter: Largest pebble of the octave [m]; the smallest is half of it.
        cover: Chance that a cell holds one where `stoniness` is 1.
        key: The terrain's key.
    """
    cell = 3.0 * diameter
    level = 600 + int(round(-8.0 * math.log2(diameter)))
    left, right = int(math.floor(x0 * texel / cell)), (x0 + height.shape[1]) * texel / cell
    low, high = int(math.floor(y0 * texel / cell)), (y0 + height.shape[0]) * texel / cell
    for cy in range(low - 1, int(math.floor(high)) + 2):
        for cx in range(left - 1, int(math.floor(right)) + 2):
            state = tile_state(key, level, cx, cy)
            px, py = (cx + uniform(state, 1)) * cell, (cy + uniform(state, 2)) * cell
            if uniform(state, 0) < cover * stoniness(key, px, py):
                radius = 0.5 * diameter * (0.5 + 0.5 * uniform(state, 3))
                _lay(height, tone, px / texel - x0, py / texel - y0, texel, radius, state)


@njit(cache=True)
def _lay(height, tone, column, row, texel, radius, state):  # type: ignore[no-untyped-def]
    """Lay one blunt stone cut by four slanted planes, the albedo its own."""
    reach = int(radius / texel) + 2
    shade = 0.55 + 0.75 * uniform(state, 4)
    tall = radius * (0.5 + 0.7 * uniform(state, 5))
    turn = 6.283185 * uniform(state, 6)
    for i in range(max(int(row) - reach, 0), min(int(row) + reach + 1, height.shape[0])):
        for j in range(max(int(column) - reach, 0), min(int(column) + reach + 1, height.shape[1])):
            dx, dy = (j + 0.5 - column) * texel / radius, (i + 0.5 - row) * texel / radius
            z = 1.0
            for k in range(4):
                angle = turn + 1.5708 * k + uniform(state, 7 + k)
                along = dx * math.cos(angle) + dy * math.sin(angle)
                z = min(z, (0.75 + 0.4 * uniform(state, 11 + k) - along) * 2.0)
            z = min(z, 1.6 * (1.0 - dx * dx - dy * dy))
            if z > 0.0:
                height[i, j] += min(z, 1.0) * tall
                tone[i, j] = shade
