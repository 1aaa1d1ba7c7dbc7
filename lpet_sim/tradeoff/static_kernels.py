"""Compiled parts of the static analysis: who is seen from where, and what that tells of poses."""

from __future__ import annotations

import math

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def look(R, eyes, camera, limits, points, shown):  # type: ignore[no-untyped-def]
    """Mark which landmarks each station shows, the strongest first, as the sensor does.

    Args:
        R: Rotations ``R_world_camera``, Shape (k, 3, 3).
        eyes: Places of the left eye [m], Shape (k, 3).
        camera: (f, cx, cy, baseline, width, height), Shape (6,).
        limits: (border, least range, cosine of the incidence, most landmarks), Shape (4,).
        points: Places, normals, reach, least slope of the line of sight, and which are far.
        shown: Filled, Shape (k, n).
    """
    p_world, normal, reach, slope_min, is_far = points
    for k in range(len(eyes)):
        count = 0
        for i in range(len(p_world)):
            shown[k, i] = False
            if count >= limits[3]:
                continue
            if not is_far[i] and not _in_sight(
                p_world[i], normal[i], reach[i], slope_min[i], eyes[k], limits
            ):
                continue
            if _in_image(p_world[i], R[k], eyes[k], camera, limits[0]):
                shown[k, i] = True
                count += 1


@njit(cache=True, nogil=True)
def _in_sight(p, normal, reach, slope_min, eye, limits):  # type: ignore[no-untyped-def]
    """Tell whether a near landmark is in range, not seen too flatly, and not hidden."""
    dx, dy, dz = eye[0] - p[0], eye[1] - p[1], eye[2] - p[2]
    level = math.sqrt(dx * dx + dy * dy)
    if level > reach or dz < slope_min * level:
        return False
    distance = math.sqrt(level * level + dz * dz)
    if distance < limits[1] or distance > reach:
        return False
    return normal[0] * dx + normal[1] * dy + normal[2] * dz >= limits[2] * distance


@njit(cache=True, nogil=True)
def _in_image(p, R, eye, camera, border):  # type: ignore[no-untyped-def]
    """Tell whether both eyes have a point in their image."""
    dx, dy, dz = p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]
    z = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
    if z <= 1e-6:
        return False
    u = camera[0] * (R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz) / z + camera[1]
    v = camera[0] * (R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz) / z + camera[2]
    right, bottom = camera[4] - 1.0 - border, camera[5] - 1.0 - border
    return border <= u - camera[0] * camera[3] / z and u <= right and border <= v <= bottom


@njit(cache=True, nogil=True)
def derivatives(p, R_world_body, p_world_body, R_body_camera, p_body_camera, camera, G, J):  # type: ignore[no-untyped-def]
    """Fill the derivatives of (u_left, u_right, v) by the landmark (3, 3) and the pose (3, 6).

    With ``q = R_world_body^T (p - t)`` and ``c = R_body_camera^T (q - t_body_camera)``: the right
    perturbation ``xi = (rho, phi)`` moves q by ``-rho + q x phi``.
    """
    f, b = camera[0], camera[3]
    q, c = np.empty(3), np.empty(3)
    for i in range(3):
        q[i] = 0.0
        for j in range(3):
            q[i] += R_world_body[j, i] * (p[j] - p_world_body[j])
    for i in range(3):
        c[i] = 0.0
        for j in range(3):
            c[i] += R_body_camera[j, i] * (q[j] - p_body_camera[j])
    H = np.zeros((3, 3))
    H[0, 0] = H[1, 0] = H[2, 1] = f / c[2]
    H[0, 2], H[1, 2], H[2, 2] = -f * c[0] / c[2] ** 2, -f * (c[0] - b) / c[2] ** 2, 0.0
    H[2, 2] = -f * c[1] / c[2] ** 2
    for i in range(3):
        for j in range(3):
            J[i, j] = 0.0  # first: derivative by q
            for k in range(3):
                J[i, j] += H[i, k] * R_body_camera[j, k]
    for i in range(3):
        a0, a1, a2 = J[i, 0], J[i, 1], J[i, 2]
        for j in range(3):
            G[i, j] = a0 * R_world_body[j, 0] + a1 * R_world_body[j, 1] + a2 * R_world_body[j, 2]
        J[i, 3] = a1 * q[2] - a2 * q[1]
        J[i, 4] = a2 * q[0] - a0 * q[2]
        J[i, 5] = a0 * q[1] - a1 * q[0]
        J[i, 0], J[i, 1], J[i, 2] = -a0, -a1, -a2


@njit(cache=True, nogil=True)
def add_landmarks(  # type: ignore[no-untyped-def]
    poses, mount, camera, weight, p_world, shown, memory, info
):
    """Add what sightings tell of the poses, the landmarks eliminated one by one.

    ``Y_ab += d_ab w_a J_a^T J_a - w_a w_b J_a^T G_a V^-1 G_b^T J_b``, ``V = sum w G^T G``; lower
    triangle only. A landmark that was unseen for more than `memory` stations comes back as a new
    one.

    Args:
        poses: ``R_world_body`` and places of the body, Shape (k, 3, 3) and (k, 3).
        mount: ``R_body_camera`` and the place of the left eye in the body.
        camera: As in `look`.
        weight: Number of sightings of a station over the variance of one, Shape (k,).
        p_world: Landmarks, Shape (n, 3).
        shown: Who is seen, Shape (k, n).
        memory: Stations.
        info: Information of all poses, added to, Shape (6 k, 6 k).
    """
    stations = len(weight)
    at = np.empty(stations, np.int64)
    B, A = np.empty((stations, 3, 6)), np.empty((stations, 6, 6))
    V, G, J = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 6))
    for i in range(len(p_world)):
        count = 0
        V[:] = 0.0
        for k in range(stations):
            if not shown[k, i]:
                continue
            if count > 0 and k - at[count - 1] > memory:
                _eliminate(count, at, A, B, V, info)
                count = 0
                V[:] = 0.0
            derivatives(p_world[i], poses[0][k], poses[1][k], mount[0], mount[1], camera, G, J)
            at[count] = k
            _square(G, J, weight[k], A[count], B[count], V)
            count += 1
        _eliminate(count, at, A, B, V, info)


@njit(cache=True, nogil=True)
def _square(G, J, w, A, B, V):  # type: ignore[no-untyped-def]
    """Set ``A = w J^T J`` and ``B = w G^T J``, and add ``w G^T G`` to V."""
    for r in range(6):
        for c in range(6):
            A[r, c] = w * (J[0, r] * J[0, c] + J[1, r] * J[1, c] + J[2, r] * J[2, c])
    for r in range(3):
        for c in range(6):
            B[r, c] = w * (G[0, r] * J[0, c] + G[1, r] * J[1, c] + G[2, r] * J[2, c])
        for c in range(3):
            V[r, c] += w * (G[0, r] * G[0, c] + G[1, r] * G[1, c] + G[2, r] * G[2, c])


@njit(cache=True, nogil=True)
def _eliminate(count, at, A, B, V, info):  # type: ignore[no-untyped-def]
    """Add the information of one landmark's sightings to its poses; one sighting tells nothing."""
    if count < 2:
        return
    L = np.linalg.cholesky(V)
    for a in range(count):
        for c in range(6):
            B[a, 0, c] /= L[0, 0]
            B[a, 1, c] = (B[a, 1, c] - L[1, 0] * B[a, 0, c]) / L[1, 1]
            B[a, 2, c] -= L[2, 0] * B[a, 0, c] + L[2, 1] * B[a, 1, c]
            B[a, 2, c] /= L[2, 2]
    for a in range(count):
        row = 6 * at[a]
        for r in range(6):
            for c in range(6):
                info[row + r, row + c] += A[a, r, c]
        for b in range(a + 1):
            column = 6 * at[b]
            for r in range(6):
                for c in range(6):
                    info[row + r, column + c] -= (
                        B[a, 0, r] * B[b, 0, c] + B[a, 1, r] * B[b, 1, c] + B[a, 2, r] * B[b, 2, c]
                    )
