"""Compiled parts of measuring a stereo sensor: landmarks fitted to their tracks at known poses.

A track is all sightings of one landmark. Its point is held as ``q = (u_left, v, disparity)`` in a
reference image of the track, where near and far points are alike in size and nearly linear.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

CAUCHY = 9.0
"""Squared normalised residual at which a sighting's weight has fallen to a half."""
_DISPARITY_MIN_PX = 0.05
_CANDIDATES = 8
_ITERATIONS = 6
_STILL_PX = 1e-4
_NEAREST_M = 0.05


@njit(cache=True, nogil=True)
def point_in_camera(q: Array, camera: Array, p: Array) -> None:
    """Give the point of (u_left, v, disparity) in its camera; camera is (f, b, cx, cy)."""
    p[2] = camera[0] * camera[1] / q[2]
    p[0] = (q[0] - camera[2]) * p[2] / camera[0]
    p[1] = (q[1] - camera[3]) * p[2] / camera[0]


@njit(cache=True, nogil=True)
def predict(q: Array, R: Array, t: Array, camera: Array, px: Array, H: Array) -> None:
    """Predict a sighting and its derivative by q, Shape (3, 3).

    ``H = d(u_left, u_right, v)/dp R dp_ref/dq`` with ``p = R p_ref + t``.

    Args:
        q: The point in its reference image.
        R: Rotation from the reference camera to this one.
        t: Origin of the reference camera in this one [m].
        camera: (focal_px, baseline_m, cx_px, cy_px).
        px: Receives (u_left, u_right, v) [px].
        H: Receives the derivative.
    """
    f, b = camera[0], camera[1]
    z_ref = f * b / q[2]
    x_ref, y_ref = (q[0] - camera[2]) * z_ref / f, (q[1] - camera[3]) * z_ref / f
    x = R[0, 0] * x_ref + R[0, 1] * y_ref + R[0, 2] * z_ref
    y = R[1, 0] * x_ref + R[1, 1] * y_ref + R[1, 2] * z_ref
    z = R[2, 0] * x_ref + R[2, 1] * y_ref + R[2, 2] * z_ref
    right = z_ref / f, z_ref / f, -1.0 / q[2]
    H[0, 0], H[1, 0], H[2, 0] = R[0, 0] * right[0], R[1, 0] * right[0], R[2, 0] * right[0]
    H[0, 1], H[1, 1], H[2, 1] = R[0, 1] * right[1], R[1, 1] * right[1], R[2, 1] * right[1]
    H[0, 2], H[1, 2], H[2, 2] = x * right[2], y * right[2], z * right[2]
    x, y, z = x + t[0], y + t[1], max(z + t[2], 1e-3)
    px[0], px[1] = f * x / z + camera[2], f * (x - b) / z + camera[2]
    px[2] = f * y / z + camera[3]
    for j in range(3):
        dx, dy, dz = H[0, j], H[1, j], H[2, j]
        H[0, j] = f / z * (dx - x / z * dz)
        H[1, j] = f / z * (dx - (x - b) / z * dz)
        H[2, j] = f / z * (dy - y / z * dz)


@njit(cache=True, nogil=True)
def _in_reference(px: Array) -> Array:
    return np.array([px[0], px[2], max(px[0] - px[1], _DISPARITY_MIN_PX)])


@njit(cache=True, nogil=True)
def _residuals(
    q: Array, px: Array, R: Array, t: Array, camera: Array, residual: Array, H: Array
) -> None:
    """Fill residuals, Shape (n, 3), and derivatives, Shape (n, 3, 3), of a track."""
    for i in range(len(px)):
        predict(q, R[i], t[i], camera, residual[i], H[i])
        for k in range(3):
            residual[i, k] = px[i, k] - residual[i, k]


@njit(cache=True, nogil=True)
def _distance(residual: Array, variance: Array) -> float:
    return float(
        residual[0] ** 2 / variance[0]
        + residual[1] ** 2 / variance[1]
        + residual[2] ** 2 / variance[2]
    )


@njit(cache=True, nogil=True)
def _step(q: Array, residual: Array, H: Array, weight: Array, variance: Array) -> float:
    """Move q by one Gauss-Newton step, and give the step's length [px]."""
    normal, right = 1e-9 * np.eye(3), np.zeros(3)
    for i in range(len(residual)):
        for k in range(3):
            w = weight[i] / variance[k]
            for a in range(3):
                right[a] += w * H[i, k, a] * residual[i, k]
                for b in range(3):
                    normal[a, b] += w * H[i, k, a] * H[i, k, b]
    step = np.linalg.solve(normal, right)
    # No step may take the point through infinity.
    step[2] = max(step[2], -0.7 * q[2])
    q += step
    q[2] = max(q[2], _DISPARITY_MIN_PX)
    return float(np.abs(step).max())


@njit(cache=True, nogil=True)
def _relative(
    rows: Ints, ref: int, image: Ints, R_camera_world: Array, t: Array, R_out: Array, t_out: Array
) -> None:
    """Fill the poses of the reference camera in the camera of every row."""
    R_ref, t_ref = R_camera_world[image[ref]], t[image[ref]]
    for i in range(len(rows)):
        k = image[rows[i]]
        R_out[i] = R_camera_world[k] @ R_ref.T
        t_out[i] = t[k] - R_out[i] @ t_ref


@njit(cache=True, nogil=True)
def _start(
    q: Array, px: Array, R: Array, t: Array, camera: Array, variance: Array, r: Array, H: Array
) -> None:
    """Start from the sighting that agrees best with all others."""
    n = len(px)
    best, start, p = np.inf, q.copy(), np.empty(3)
    for c in range(0, n, max(1, n // _CANDIDATES)):
        point_in_camera(_in_reference(px[c]), camera, p)
        p = R[c].T @ (p - t[c])
        if p[2] <= _NEAREST_M:
            continue
        trial = np.array([0.0, 0.0, camera[0] * camera[1] / p[2]])
        trial[0] = camera[0] * p[0] / p[2] + camera[2]
        trial[1] = camera[0] * p[1] / p[2] + camera[3]
        _residuals(trial, px, R, t, camera, r, H)
        cost = 0.0
        for i in range(n):
            cost += np.log1p(_distance(r[i], variance) / CAUCHY)
        if cost < best:
            best, start = cost, trial
    q[:] = start


@njit(cache=True, nogil=True)
def _fit(
    q: Array,
    px: Array,
    R: Array,
    t: Array,
    camera: Array,
    variance: Array,
    tails: float,
    gate: Array,
    r: Array,
    H: Array,
) -> None:
    """Fit a point: far sightings count less and less, in the end not at all beyond the gate."""
    weight = np.ones(len(px))
    for robust in (True, False):
        for _ in range(_ITERATIONS):
            _residuals(q, px, R, t, camera, r, H)
            for i in range(len(px)):
                far = _distance(r[i], variance)
                if robust:
                    weight[i] = 1.0 / (1.0 + far / CAUCHY)
                else:
                    weight[i] = (tails + 3.0) / (tails + far) if far < gate[i] else 0.0
            if weight.sum() == 0.0 or _step(q, r, H, weight, variance) < _STILL_PX:
                break
    _residuals(q, px, R, t, camera, r, H)


@njit(cache=True, nogil=True)
def fit_points(
    starts: Ints,
    image: Ints,
    px: Array,
    R_camera_world: Array,
    t_camera_world_m: Array,
    camera: Array,
    variance: Array,
    tails: float,
    gate: Array,
    cold: bool,
    q: Array,
    residual: Array,
    H: Array,
    fits: Flags,
) -> None:
    """Fit every track's point by weighted least squares over the sightings that fit it.

    The reference image of a track is that of its middle row.

    Args:
        starts: Rows of track j are ``starts[j]:starts[j + 1]``, Shape (k + 1,).
        image: Image of each row, Shape (m,).
        px: (u_left, u_right, v) [px], Shape (m, 3).
        R_camera_world: True rotations, Shape (n, 3, 3).
        t_camera_world_m: Origin of the world in each camera [m], Shape (n, 3).
        camera: (focal_px, baseline_m, cx_px, cy_px).
        variance: Squared scale of the white noise of each coordinate [px^2], Shape (3,).
        tails: Degrees of freedom of Student's t, which weighs the sightings.
        gate: Squared normalised residual from which on a sighting does not fit, Shape (m,).
        cold: Whether to look for starts; else the points given are the starts.
        q: Receives the points, Shape (k, 3).
        residual: Receives measured less predicted coordinates [px], Shape (m, 3).
        H: Receives the derivatives by q, Shape (m, 3, 3).
        fits: Receives who fits, Shape (m,).
    """
    for j in range(len(starts) - 1):
        first, last = starts[j], starts[j + 1]
        n = last - first
        rows, ref = np.arange(first, last), first + n // 2
        R, t = np.empty((n, 3, 3)), np.empty((n, 3))
        _relative(rows, ref, image, R_camera_world, t_camera_world_m, R, t)
        track_px, r, h = px[first:last], residual[first:last], H[first:last]
        if cold:
            q[j] = _in_reference(px[ref])
            _start(q[j], track_px, R, t, camera, variance, r, h)
        _fit(q[j], track_px, R, t, camera, variance, tails, gate[first:last], r, h)
        for i in range(n):
            fits[first + i] = _distance(r[i], variance) < gate[first + i]
