"""Loops that light the ground: shadows cast along the sun, and the light on each texel."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def shadow_height(height, shift, drop):  # type: ignore[no-untyped-def]
    """Give the height below which the sun is hidden.

    The array lies so that the sun stands beyond row 0: ``S[i, j] = max(H, S)[i - 1, j + shift] -
    drop``, linear between columns. One pass, whatever the length of the shadows.
    """
    rows, columns = height.shape
    shade = np.full((rows, columns), -1e9)
    whole = math.floor(shift)
    part = shift - whole
    for i in range(1, rows):
        for j in range(columns):
            a = min(max(j + whole, 0), columns - 1)
            b = min(max(j + whole + 1, 0), columns - 1)
            left = max(height[i - 1, a], shade[i - 1, a])
            right = max(height[i - 1, b], shade[i - 1, b])
            shade[i, j] = (1.0 - part) * left + part * right - drop
    return shade


@njit(cache=True, nogil=True)
def raise_triangles(height, corners, x0, y0, cell):  # type: ignore[no-untyped-def]
    """Lift a height map to the upper sides of triangles, Shape (f, 3, 3), node by node."""
    rows, columns = height.shape
    for k in range(corners.shape[0]):
        ax, ay, az = corners[k, 0]
        ux, uy = corners[k, 1, 0] - ax, corners[k, 1, 1] - ay
        vx, vy = corners[k, 2, 0] - ax, corners[k, 2, 1] - ay
        area = ux * vy - uy * vx
        if area <= 1e-12:
            continue
        left, right = corners[k, :, 0].min(), corners[k, :, 0].max()
        low, high = corners[k, :, 1].min(), corners[k, :, 1].max()
        for i in range(
            max(math.ceil((low - y0) / cell), 0),
            min(math.floor((high - y0) / cell), rows - 1) + 1,
        ):
            for j in range(
                max(math.ceil((left - x0) / cell), 0),
                min(math.floor((right - x0) / cell), columns - 1) + 1,
            ):
                px, py = x0 + j * cell - ax, y0 + i * cell - ay
                s = (px * vy - py * vx) / area
                t = (ux * py - uy * px) / area
                if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
                    z = az + s * (corners[k, 1, 2] - az) + t * (corners[k, 2, 2] - az)
                    height[i, j] = max(height[i, j], z)


@njit(cache=True, nogil=True)
def _between(field, y, x):  # type: ignore[no-untyped-def]
    """Interpolate a field of nodes at a fractional row and column."""
    i, j = int(y), int(x)
    fy, fx = y - i, x - j
    low = field[i, j] + fx * (field[i, j + 1] - field[i, j])
    high = field[i + 1, j] + fx * (field[i + 1, j + 1] - field[i + 1, j])
    return low + fy * (high - low)


@njit(cache=True, nogil=True)
def light_texels(  # type: ignore[no-untyped-def]
    albedo,
    fine,
    fine_shade,
    slope_x,
    slope_y,
    clearance,
    open_sky,
    tone,
    texel,
    factor,
    sun,
    soft,
    ambient,
):
    """Light a tile: ``L = albedo (a_sky V (1 + n_z)/2 + (1 - a_sky) lit max(0, n . s))``.

    ``n`` is the normal of coarse ground and fine grain together; ``lit`` is the share of the sun's
    disc over the horizon that coarse and fine shadows leave.

    Args:
        albedo: Shape (t, t).
        fine: Grain heights with a rim of one texel, Shape (t + 2, t + 2) [m].
        fine_shade: Shadow height of the grain, Shape (t + 2, t + 2) [m].
        slope_x: Coarse slope at nodes, Shape (c, c); texel (i, j) is at ``(i + 0.5) / factor``.
        slope_y: Likewise.
        clearance: Height over the coarse shadow [m], Shape (c, c).
        open_sky: Share of the sky that is seen, Shape (c, c).
        tone: Factor on the albedo, Shape (c, c).
        texel: [m].
        factor: Texels to a coarse cell.
        sun: Unit vector to the sun, Shape (3,).
        soft: Height over which a coarse and a fine shadow's edge fades [m], Shape (2,).
        ambient: The sky's share of the light on open flat ground facing the sun.
    """
    size = albedo.shape[0]
    out = np.empty((size, size), np.float32)
    for i in range(size):
        y = (i + 0.5) / factor
        for j in range(size):
            x = (j + 0.5) / factor
            gx = _between(slope_x, y, x)
            gy = _between(slope_y, y, x)
            gx += (fine[i + 1, j + 2] - fine[i + 1, j]) / (2.0 * texel)
            gy += (fine[i + 2, j + 1] - fine[i, j + 1]) / (2.0 * texel)
            up = 1.0 / math.sqrt(1.0 + gx * gx + gy * gy)
            facing = max((sun[2] - gx * sun[0] - gy * sun[1]) * up, 0.0)
            lit = min(max(0.5 + _between(clearance, y, x) / soft[0], 0.0), 1.0)
            above = fine[i + 1, j + 1] - fine_shade[i + 1, j + 1]
            lit = min(lit, min(max(0.5 + above / soft[1], 0.0), 1.0))
            sky = 0.5 * ambient * _between(open_sky, y, x) * (1.0 + up)
            light = albedo[i, j] * _between(tone, y, x)
            out[i, j] = light * (sky + (1.0 - ambient) * lit * facing)
    return out


@njit(cache=True, nogil=True)
def halve(image):  # type: ignore[no-untyped-def]
    """Average 2 x 2 texels: one step down the pyramid."""
    rows, columns = image.shape[0] // 2, image.shape[1] // 2
    out = np.empty((rows, columns), np.float32)
    for i in range(rows):
        for j in range(columns):
            a = image[2 * i, 2 * j] + image[2 * i, 2 * j + 1]
            b = image[2 * i + 1, 2 * j] + image[2 * i + 1, 2 * j + 1]
            out[i, j] = 0.25 * (a + b)
    return out
