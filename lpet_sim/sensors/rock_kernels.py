"""Loops that paint rocks: light, grain and shade over their facets."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lpet_sim.terrain.hashing import tile_state, uniform

_BELOW_GROUND_M = 0.02


@njit(cache=True, nogil=True)
def _solid_noise(key, x, y, z):  # type: ignore[no-untyped-def]
    """Interpolate hashed nodes of the unit lattice; values in -1..1."""
    ix, iy, iz = math.floor(x), math.floor(y), math.floor(z)
    fx, fy, fz = x - ix, y - iy, z - iz
    fx, fy = fx * fx * (3.0 - 2.0 * fx), fy * fy * (3.0 - 2.0 * fy)
    fz = fz * fz * (3.0 - 2.0 * fz)
    total = 0.0
    for k in range(2):
        wz = fz if k == 1 else 1.0 - fz
        for i in range(2):
            wy = (fy if i == 1 else 1.0 - fy) * wz
            low = uniform(tile_state(key, iz + k + 1000, ix, iy + i), 0)
            high = uniform(tile_state(key, iz + k + 1000, ix + 1, iy + i), 0)
            total += wy * (low + fx * (high - low))
    return 2.0 * total - 1.0


@njit(cache=True, nogil=True)
def _grain(key, p, size):  # type: ignore[no-untyped-def]
    """Sum two octaves of solid noise, the longer of wavelength ``size``."""
    total = 0.0
    for octave in range(2):
        f = 2.0**octave / size
        total += 0.6**octave * _solid_noise(key + octave, p[0] * f, p[1] * f, p[2] * f)
    return total


@njit(cache=True, nogil=True)
def paint_rock(  # type: ignore[no-untyped-def]
    image, corners, places, normals, albedo, height, grain, rough, sun, ambient, key
):
    """Paint a rock's facets into its texture.

    ``L = albedo tone (ambient sky + (1 - ambient) max(0, n' . s))``: the normal n' is the facet's,
    tilted by the slope of solid noise; the sky is half hidden near the ground.

    Args:
        image: The texture, changed, Shape (n, n).
        corners: The facets' corners, the ground at z = 0 [m], Shape (f, 3, 3).
        places: The corners' texture coordinates, 0 to 1, Shape (f, 3, 2).
        normals: Unit normals, outwards, Shape (f, 3).
        albedo: Of the rock.
        height: Of the rock above ground [m].
        grain: Longest wavelength of its grain [m].
        rough: RMS-like tilt of the normal by the grain.
        sun: Unit vector to the sun, Shape (3,).
        ambient: The sky's share of the light.
        key: What its grain is hashed with.
    """
    n = image.shape[0]
    for k in range(corners.shape[0]):
        a, u, v = places[k, 0] * n, places[k, 1] * n, places[k, 2] * n
        area = (u[0] - a[0]) * (v[1] - a[1]) - (u[1] - a[1]) * (v[0] - a[0])
        if abs(area) < 1e-9 or corners[k, :, 2].max() < -_BELOW_GROUND_M:
            continue
        left = max(int(min(a[0], u[0], v[0]) - 1.5), 0)
        right = min(int(max(a[0], u[0], v[0]) + 1.5), n - 1)
        low = max(int(min(a[1], u[1], v[1]) - 1.5), 0)
        high = min(int(max(a[1], u[1], v[1]) + 1.5), n - 1)
        rim = 1.2 * (abs(u[0] - a[0]) + abs(v[1] - a[1]) + abs(u[1] - a[1]) + abs(v[0] - a[0]))
        slack = min(rim / abs(area), 0.6)
        for i in range(low, high + 1):
            for j in range(left, right + 1):
                x, y = j + 0.5 - a[0], i + 0.5 - a[1]
                s = (x * (v[1] - a[1]) - y * (v[0] - a[0])) / area
                t = ((u[0] - a[0]) * y - (u[1] - a[1]) * x) / area
                outside = max(-s, -t, s + t - 1.0)
                if outside > slack or (outside > 0.0 and image[i, j] > 0.0):
                    continue
                p = corners[k, 0] + s * (corners[k, 1] - corners[k, 0])
                p = p + t * (corners[k, 2] - corners[k, 0])
                if p[2] < -_BELOW_GROUND_M:
                    continue
                image[i, j] = albedo * _light(
                    p, normals[k], height, grain, rough, sun, ambient, key
                )


@njit(cache=True, nogil=True)
def _light(p, normal, height, grain, rough, sun, ambient, key):  # type: ignore[no-untyped-def]
    """Light one point of a facet, with its tone."""
    here = _grain(key, p, grain)
    step = 0.08 * grain
    tilted = normal.copy()
    for axis in range(3):
        beside = p.copy()
        beside[axis] += step
        tilted[axis] -= rough * grain * (_grain(key, beside, grain) - here) / step
    tilted /= np.sqrt(np.sum(tilted * tilted))
    facing = max(np.sum(tilted * sun), 0.0) if np.sum(normal * sun) > -0.1 else 0.0
    free = min(max(p[2] / (0.5 * height), 0.0), 1.0)
    sky = 0.5 * (1.0 + tilted[2]) * (0.45 + 0.55 * free)
    tone = 1.0 + 0.18 * here
    return max(tone, 0.3) * (ambient * sky + (1.0 - ambient) * facing)
