"""Loops that make the ground's grain: fine roughness and pebbles as pure functions of the place."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lpet_sim.terrain.hashing import tile_state, uniform

RIPPLE_M = 0.16
"""Distance of wind ripples' crests [m]; 7-15 cm on Mars's smaller ripples [recalled]."""

RIPPLE_HEIGHT_M = 0.012
"""Height of a full-grown ripple [m]; about a tenth of the crests' distance [recalled]."""

PLATE_M = 0.22
"""Size of bedrock plates between cracks [m]. A choice, after Opportunity's images."""

CRACK_M = 0.006
"""Typical half-width of a crack [m]. A choice."""


@njit(cache=True, nogil=True)
def smooth_noise(key, level, x, y):  # type: ignore[no-untyped-def]
    """Interpolate hashed nodes of the unit grid smoothly; values in -1..1."""
    ix, iy = math.floor(x), math.floor(y)
    fx, fy = x - ix, y - iy
    fx, fy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    low = uniform(tile_state(key, level, ix, iy), 0) * (1.0 - fx)
    low += uniform(tile_state(key, level, ix + 1, iy), 0) * fx
    high = uniform(tile_state(key, level, ix, iy + 1), 0) * (1.0 - fx)
    high += uniform(tile_state(key, level, ix + 1, iy + 1), 0) * fx
    return 2.0 * (low + fy * (high - low)) - 1.0


@njit(cache=True, nogil=True)
def stoniness(key, x, y):  # type: ignore[no-untyped-def]
    """Say how stony the ground is, 0 (bare sand) to 2, with patches of metres and decimetres."""
    wide = smooth_noise(key, 900, x / 3.1, y / 3.1)
    middle = smooth_noise(key, 901, x / 0.9, y / 0.9)
    narrow = smooth_noise(key, 902, x / 0.27, y / 0.27)
    return min(max(0.8 + 0.9 * wide + 0.7 * middle + 0.5 * narrow, 0.0), 2.0)


@njit(cache=True, nogil=True)
def add_grain(height, x0, y0, texel, wavelength, amplitude, key):  # type: ignore[no-untyped-def]
    """Add one octave of smooth noise; texel (i, j) is at ``(x0 + j + 0.5, y0 + i + 0.5) texel``."""
    rows, columns = height.shape
    ratio = texel / wavelength
    level = 400 + round(-8.0 * math.log2(wavelength))
    first = math.floor((x0 + 0.5) * ratio)
    count = math.floor((x0 + columns - 0.5) * ratio) - first + 2
    nodes = np.empty((2, count))
    last = -(1 << 60)
    for i in range(rows):
        y = (y0 + i + 0.5) * ratio
        iy = math.floor(y)
        fy = y - iy
        fy = fy * fy * (3.0 - 2.0 * fy)
        if iy != last:
            for k in range(count):
                nodes[0, k] = uniform(tile_state(key, level, first + k, iy), 0) - 0.5
                nodes[1, k] = uniform(tile_state(key, level, first + k, iy + 1), 0) - 0.5
            last = iy
        for j in range(columns):
            x = (x0 + j + 0.5) * ratio
            k = math.floor(x) - first
            fx = x - first - k
            fx = fx * fx * (3.0 - 2.0 * fx)
            low = nodes[0, k] + fx * (nodes[0, k + 1] - nodes[0, k])
            high = nodes[1, k] + fx * (nodes[1, k + 1] - nodes[1, k])
            height[i, j] += 2.0 * amplitude * (low + fy * (high - low))


@njit(cache=True, nogil=True)
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
    level = 600 + round(-8.0 * math.log2(diameter))
    left, right = math.floor(x0 * texel / cell), (x0 + height.shape[1]) * texel / cell
    low, high = math.floor(y0 * texel / cell), (y0 + height.shape[0]) * texel / cell
    for cy in range(low - 1, math.floor(high) + 2):
        for cx in range(left - 1, math.floor(right) + 2):
            state = tile_state(key, level, cx, cy)
            px, py = (cx + uniform(state, 1)) * cell, (cy + uniform(state, 2)) * cell
            if uniform(state, 0) < cover * stoniness(key, px, py):
                radius = 0.5 * diameter * (0.5 + 0.5 * uniform(state, 3))
                _lay(height, tone, px / texel - x0, py / texel - y0, texel, radius, state)


@njit(cache=True, nogil=True)
def _lay(height, tone, column, row, texel, radius, state):  # type: ignore[no-untyped-def]
    """Lay one blunt stone cut by four slanted planes, the albedo its own."""
    reach = int(radius / texel) + 2
    shade = 0.45 + 0.75 * uniform(state, 4)
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


@njit(cache=True, nogil=True)
def add_ripples(height, loose, x0, y0, cell, key):  # type: ignore[no-untyped-def]
    """Add wind ripples where the soil is loose: curved, forked crests, in patches.

    Args:
        height: Heights at the nodes ``(x0 + j, y0 + i) cell`` [m], Shape (r, c).
        loose: Share of loose soil at the nodes, Shape (r, c).
        x0: Column of the first node on the world grid.
        y0: Row likewise.
        cell: [m].
        key: The terrain's key.
    """
    turn = 6.283185 * uniform(tile_state(key, 910, 0, 0), 0)
    along, across = math.cos(turn), math.sin(turn)
    for i in range(height.shape[0]):
        for j in range(height.shape[1]):
            if loose[i, j] < 0.02:
                continue
            x, y = (x0 + j) * cell, (y0 + i) * cell
            where = smooth_noise(key, 911, x / 4.3, y / 4.3)
            where += 0.5 * smooth_noise(key, 912, x / 1.3, y / 1.3)
            strength = loose[i, j] * min(max(0.25 + 1.1 * where, 0.0), 1.0)
            bend = 0.35 * smooth_noise(key, 913, x / 1.1, y / 1.1)
            bend += 0.09 * smooth_noise(key, 914, x / 0.35, y / 0.35)
            phase = 6.283185 * ((x * along + y * across + bend) / RIPPLE_M)
            crest = 0.5 + 0.5 * math.sin(phase + 0.5 * math.sin(phase))
            height[i, j] += RIPPLE_HEIGHT_M * strength * crest * math.sqrt(crest)


@njit(cache=True, nogil=True)
def add_plates(  # type: ignore[no-untyped-def]
    height, tone, firm, factor, x0, y0, texel, key
):
    """Lay bare cracked bedrock where the ground is firm: plates of their own tone, sand between.

    Plates are the Voronoi cells of hashed points; a crack is where the two nearest points are
    almost as near.

    Args:
        height: Grain heights [m], Shape (r, c), as in `add_grain`.
        tone: Factor on the albedo, Shape (r, c).
        firm: Share of firm soil at coarse nodes, the first one at the first texel's corner.
        factor: Texels to a coarse cell.
        x0: Column of the first texel on the world grid.
        y0: Row likewise.
        texel: [m].
        key: The terrain's key.
    """
    for i in range(height.shape[0]):
        for j in range(height.shape[1]):
            bare = firm[int(i / factor), int(j / factor)]
            if bare < 0.05:
                continue
            x, y = (x0 + j + 0.5) * texel, (y0 + i + 0.5) * texel
            x += 0.03 * smooth_noise(key, 921, x / 0.06, y / 0.06)
            y += 0.03 * smooth_noise(key, 922, x / 0.06, y / 0.06)
            dx, dy, gap, state = _nearest_plate(x / PLATE_M, y / PLATE_M, key)
            cx, cy = x + dx * PLATE_M, y + dy * PLATE_M
            open_here = smooth_noise(key, 923, cx / 2.3, cy / 2.3) + 0.8 * uniform(state, 4)
            edge = gap * PLATE_M - CRACK_M * (0.4 + uniform(state, 3))
            if open_here < 0.2 or edge <= 0.0:
                continue
            rise = min(edge / 0.012, 1.0) * bare
            tone[i, j] *= 1.0 + rise * (0.08 + 0.22 * uniform(state, 5))
            tilt = (uniform(state, 6) - 0.5) * 0.06
            height[i, j] += rise * (0.006 + tilt * dx * PLATE_M)


@njit(cache=True, nogil=True)
def _nearest_plate(x, y, key):  # type: ignore[no-untyped-def]
    """Give the offset to the nearest point, half the second's lead over it, and its state."""
    ix, iy = math.floor(x), math.floor(y)
    first, second, to_x, to_y = 1e9, 1e9, 0.0, 0.0
    best = tile_state(key, 920, ix, iy)
    for a in range(-1, 2):
        for b in range(-1, 2):
            state = tile_state(key, 920, ix + a, iy + b)
            dx = ix + a + uniform(state, 0) - x
            dy = iy + b + uniform(state, 1) - y
            distance = math.sqrt(dx * dx + dy * dy)
            if distance < first:
                first, second, to_x, to_y, best = distance, first, dx, dy, state
            elif distance < second:
                second = distance
    return to_x, to_y, 0.5 * (second - first), best
