"""Cubic B-splines on periodic tiles: the inner loop of every smooth random surface."""

from __future__ import annotations

import numpy as np
from numba import njit

TILE = 512  # cells along a tile's side, a power of two


@njit(cache=True, nogil=True, inline="always")
def weights(t):  # type: ignore[no-untyped-def]
    """Give the four cubic B-spline weights at the fraction t of a cell."""
    s = 1.0 - t
    w0 = s * s * s / 6.0
    w3 = t * t * t / 6.0
    w1 = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t)
    return w0, w1, 1.0 - w0 - w1 - w3, w3


@njit(cache=True, nogil=True, inline="always")
def slopes(t):  # type: ignore[no-untyped-def]
    """Give the derivatives of the four weights with respect to t."""
    s = 1.0 - t
    return -0.5 * s * s, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t * t


@njit(cache=True, nogil=True, inline="always")
def _blend(tile, iu, iv, a0, a1, a2, a3, b0, b1, b2, b3):  # type: ignore[no-untyped-def]
    """Sum sixteen coefficients of a periodic tile, weighted a along u and b along v."""
    m = TILE - 1
    j0_, j1, j2, j3 = (iu - 1) & m, iu & m, (iu + 1) & m, (iu + 2) & m
    r0, r1, r2, r3 = tile[(iv - 1) & m], tile[iv & m], tile[(iv + 1) & m], tile[(iv + 2) & m]
    s0 = a0 * r0[j0_] + a1 * r0[j1] + a2 * r0[j2] + a3 * r0[j3]
    s1 = a0 * r1[j0_] + a1 * r1[j1] + a2 * r1[j2] + a3 * r1[j3]
    s2 = a0 * r2[j0_] + a1 * r2[j1] + a2 * r2[j2] + a3 * r2[j3]
    s3 = a0 * r3[j0_] + a1 * r3[j1] + a2 * r3[j2] + a3 * r3[j3]
    return b0 * s0 + b1 * s1 + b2 * s2 + b3 * s3


@njit(cache=True, nogil=True, inline="always")
def _locate(x, y, frame):  # type: ignore[no-untyped-def]
    """Give a point's coordinates in a tile [cells]."""
    u = (frame[1] * x + frame[2] * y) / frame[0] + frame[3]
    v = (frame[1] * y - frame[2] * x) / frame[0] + frame[4]
    return u, v


@njit(cache=True, nogil=True)
def sum_heights(xy, tiles, frames, first, out):  # type: ignore[no-untyped-def]
    """Add the height of every band from the first on, Shape (n,)."""
    for i in range(len(xy)):
        z = 0.0
        for b in range(first, len(tiles)):
            u, v = _locate(xy[i, 0], xy[i, 1], frames[b])
            iu, iv = int(np.floor(u)), int(np.floor(v))
            a0, a1, a2, a3 = weights(u - iu)
            b0, b1, b2, b3 = weights(v - iv)
            z += _blend(tiles[b], iu, iv, a0, a1, a2, a3, b0, b1, b2, b3)
        out[i] += z


@njit(cache=True, nogil=True)
def sum_gradients(xy, tiles, frames, out):  # type: ignore[no-untyped-def]
    """Add the gradient of every band, Shape (n, 2)."""
    for i in range(len(xy)):
        for b in range(len(tiles)):
            u, v = _locate(xy[i, 0], xy[i, 1], frames[b])
            iu, iv = int(np.floor(u)), int(np.floor(v))
            a0, a1, a2, a3 = weights(u - iu)
            b0, b1, b2, b3 = weights(v - iv)
            c0, c1, c2, c3 = slopes(u - iu)
            d0, d1, d2, d3 = slopes(v - iv)
            du = _blend(tiles[b], iu, iv, c0, c1, c2, c3, b0, b1, b2, b3)
            dv = _blend(tiles[b], iu, iv, a0, a1, a2, a3, d0, d1, d2, d3)
            cos, sin = frames[b, 1] / frames[b, 0], frames[b, 2] / frames[b, 0]
            out[i, 0] += cos * du - sin * dv
            out[i, 1] += sin * du + cos * dv
