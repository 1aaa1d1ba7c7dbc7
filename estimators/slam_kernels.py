"""The arithmetic of the SLAM filter, compiled: sightings of a map, their gate, and new landmarks.

A landmark is three numbers x in the camera at its host pose: its place [m] or, where it is far or
where its host is a keyframe in the state, its image coordinates (u_left, u_right, v) [px]. The
point is ``P / w``: ``P = x, w = 1`` or ``P = b (u_left - cx, v - cy, f), w = u_left - u_right``.

Errors of a pose are in the world, ``R_true = exp(phi) R``. In the standard form ``p_true = p + dp``
and ``x_true = x + e``. In the right-invariant one ``p_true = exp(phi) p + rho``: if landmarks stand
in the world, their hosts turn by exp(phi) too, so that one rotation moves pose and map together
and no sighting can tell of it; if they stand in keyframes, the error of a keyframe is of the same
kind, and a sighting sees the difference of two such errors, whatever the estimates are.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from estimators.observation import push
from lpet_sim.recording.arrays import Array, Ints

STANDARD, FIRST_ESTIMATES, RIGHT_INVARIANT, RELATIVE = 0, 1, 2, 3
"""The formulations; `RELATIVE` is the right-invariant one with keyframes as hosts."""
Four = tuple[float, float, float, float]


@njit(cache=True)
def homogeneous(camera: Array, far: float, x: Array) -> tuple[Four, tuple[Four, Four, Four]]:
    """Give ``(P, w)`` of a landmark and its derivatives by the three numbers."""
    if far > 0.0:
        f, cx, cy, b = camera
        point = (b * (x[0] - cx), b * (x[2] - cy), b * f, x[0] - x[1])
        return point, ((b, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, -1.0), (0.0, b, 0.0, 0.0))
    unit = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
    return (x[0], x[1], x[2], 1.0), unit


@njit(cache=True)
def _numbers_moved(camera: Array, far: float, P: Four, dP: Four) -> tuple[float, float, float]:
    """Give how the three numbers change if the point moves by ``dP / w``."""
    return push(camera, P, dP) if far > 0.0 else (dP[0], dP[1], dP[2])


@njit(cache=True)
def _turned(R: Array, t: Array, P: Four) -> Four:
    """Give ``(R' P - t w, w)``: a point or its derivative in the frame at ``T = (R, R t)``."""
    return (
        R[0, 0] * P[0] + R[1, 0] * P[1] + R[2, 0] * P[2] - t[0] * P[3],
        R[0, 1] * P[0] + R[1, 1] * P[1] + R[2, 1] * P[2] - t[1] * P[3],
        R[0, 2] * P[0] + R[1, 2] * P[1] + R[2, 2] * P[2] - t[2] * P[3],
        P[3],
    )


@njit(cache=True)
def _seen(
    camera: Array, R: Array, t: Array, far: float, x: Array, z: Array, G: Array, J: Array
) -> None:
    """Predict a sighting with its derivatives by x and by the camera's right perturbation.

    A point in the camera moves by ``-rho w + P x phi``.
    """
    point, basis = homogeneous(camera, far, x)
    P = _turned(R, t, point)
    focal, X, Y, Z, w = camera[0], P[0], P[1], P[2], P[3]
    z[0], z[2] = focal * X / Z + camera[1], focal * Y / Z + camera[2]
    z[1] = z[0] - focal * camera[3] * w / Z
    for k in range(3):
        G[0, k], G[1, k], G[2, k] = push(camera, P, _turned(R, t, basis[k]))
    J[0, 0], J[1, 0], J[2, 0] = push(camera, P, (-w, 0.0, 0.0, 0.0))
    J[0, 1], J[1, 1], J[2, 1] = push(camera, P, (0.0, -w, 0.0, 0.0))
    J[0, 2], J[1, 2], J[2, 2] = push(camera, P, (0.0, 0.0, -w, 0.0))
    J[0, 3], J[1, 3], J[2, 3] = push(camera, P, (0.0, Z, -Y, 0.0))
    J[0, 4], J[1, 4], J[2, 4] = push(camera, P, (-Z, 0.0, X, 0.0))
    J[0, 5], J[1, 5], J[2, 5] = push(camera, P, (Y, -X, 0.0, 0.0))


@njit(cache=True)
def _relative(R_h: Array, t_h: Array, R_c: Array, t_c: Array, R: Array, t_back: Array) -> None:
    """Give camera c as seen from host h, ``R_h' R_c`` and ``R_c' (t_c - t_h)``, in place."""
    for i in range(3):
        t_back[i] = 0.0
        for j in range(3):
            R[i, j] = 0.0
            t_back[i] += R_c[j, i] * (t_c[j] - t_h[j])
            for k in range(3):
                R[i, j] += R_h[k, i] * R_c[k, j]


@njit(cache=True)
def _world_jacobian(J: Array, R_c: Array, arm: Array, turns: bool, H: Array) -> None:
    """Turn a derivative by the camera's right perturbation into one by world errors, in place.

    ``rho = R_c' (dp + phi x arm)`` and ``phi_c = R_c' phi``, with ``arm`` from the body's origin to
    the camera in the world; where the map turns with the rover only dp is seen.

    Args:
        J: Derivative by the right perturbation of the camera, Shape (3, 6).
        R_c: Rotation of the camera in the world, Shape (3, 3).
        arm: Shape (3,).
        turns: Whether phi is seen.
        H: Takes the derivative by (dp, phi), Shape (3, 6).
    """
    for i in range(3):
        for j in range(3):
            H[i, j] = J[i, 0] * R_c[j, 0] + J[i, 1] * R_c[j, 1] + J[i, 2] * R_c[j, 2]
            H[i, 3 + j] = 0.0
            if turns:
                H[i, 3 + j] = J[i, 3] * R_c[j, 0] + J[i, 4] * R_c[j, 1] + J[i, 5] * R_c[j, 2]
        if turns:
            a, b, c = H[i, 0], H[i, 1], H[i, 2]
            H[i, 3] += arm[1] * c - arm[2] * b
            H[i, 4] += arm[2] * a - arm[0] * c
            H[i, 5] += arm[0] * b - arm[1] * a


@njit(cache=True)
def linearise(
    camera: Array,
    pose_camera: tuple[Array, Array],
    arm: Array,
    hosts: tuple[Array, Array, Ints],
    numbers: tuple[Array, Array, Array],
    slots: Ints,
    form: int,
    predicted: Array,
    H: Array,
    G: Array,
) -> None:
    """Predict the sightings of landmarks with their derivatives, in place.

    Args:
        camera: Focal length, principal point and baseline, `observation.camera_vector`.
        pose_camera: Rotation and position of the camera in the world.
        arm: From the body's origin to the camera, in the world [m], Shape (3,).
        hosts: Rotations (c, 3, 3) and positions (c, 3) of host cameras, and which of them is each
            landmark's, Shape (c,).
        numbers: x of the landmarks, their first estimates, both Shape (c, 3), and 1 for those that
            are far, Shape (c,).
        slots: Which landmarks, Shape (m,).
        form: `STANDARD`, `FIRST_ESTIMATES`, `RIGHT_INVARIANT` or `RELATIVE`.
        predicted: Takes the sightings [px], Shape (m, 3).
        H: Takes the derivatives by the pose's error, Shape (m, 3, 6).
        G: Takes the derivatives by the landmark's own, Shape (m, 3, 3).
    """
    R_c, t_c = pose_camera
    x, x_first, far = numbers
    R, t_back, J, unused = np.empty((3, 3)), np.empty(3), np.empty((3, 6)), np.empty(3)
    for i in range(len(slots)):
        s = slots[i]
        h = hosts[2][s]
        _relative(hosts[0][h], hosts[1][h], R_c, t_c, R, t_back)
        _seen(camera, R, t_back, far[s], x[s], predicted[i], G[i], J)
        if form == FIRST_ESTIMATES:
            _seen(camera, R, t_back, far[s], x_first[s], unused, G[i], J)
        _world_jacobian(J, R_c, arm, form != RIGHT_INVARIANT, H[i])


@njit(cache=True)
def entry_jacobian(
    camera: Array, far: float, x: Array, R_c: Array, arm: Array, turns: bool, out: Array
) -> None:
    """Give how a landmark's error in its host depends on the pose's error when it enters, (3, 6).

    The landmark sits at x in the true camera, which is off its estimate, the host: a point moves by
    ``rho + phi x point``.
    """
    J = np.empty((3, 6))
    P = homogeneous(camera, far, x)[0]
    w = P[3]
    moves = (
        (w, 0.0, 0.0, 0.0),
        (0.0, w, 0.0, 0.0),
        (0.0, 0.0, w, 0.0),
        (0.0, -P[2], P[1], 0.0),
        (P[2], 0.0, -P[0], 0.0),
        (-P[1], P[0], 0.0, 0.0),
    )
    for k in range(6):
        J[0, k], J[1, k], J[2, k] = _numbers_moved(camera, far, P, moves[k])
    _world_jacobian(J, R_c, arm, turns, out)


@njit(cache=True)
def relative_entry(
    camera: Array,
    now: tuple[Array, Array],
    host: tuple[Array, Array],
    z: Array,
    x: Array,
    H: Array,
    G: Array,
) -> None:
    """Carry a sighting into the camera of a keyframe, with derivatives, in place.

    Args:
        camera: `observation.camera_vector`.
        now: Rotation and position of the camera that sees it.
        host: Those of the keyframe's camera.
        z: The sighting [px], Shape (3,).
        x: Takes its image coordinates in the keyframe [px], Shape (3,).
        H: Takes their derivative by the keyframe's error; by the pose's it is -H, Shape (3, 6).
        G: Takes their derivative by z, Shape (3, 3).
    """
    R, t_back, J = np.empty((3, 3)), np.empty(3), np.empty((3, 6))
    _relative(now[0], now[1], host[0], host[1], R, t_back)
    _seen(camera, R, t_back, 1.0, z, x, G, J)
    _world_jacobian(J, host[0], host[1], True, H)


@njit(cache=True)
def numbers_of(camera: Array, far: float, z: Array, x: Array, by_z: Array) -> None:
    """Give the three numbers of a landmark seen at z and their derivatives by z, in place."""
    focal, cx, cy, b = camera
    by_z[:] = np.eye(3)
    x[:] = z
    if far > 0.0:
        return
    scale = b / (z[0] - z[1])
    x[0], x[1], x[2] = scale * (z[0] - cx), scale * (z[2] - cy), scale * focal
    by_z[:] = 0.0
    by_z[0, 0], by_z[1, 2] = scale, scale
    for i in range(3):
        by_z[i, 0] -= x[i] * scale / b
        by_z[i, 1] += x[i] * scale / b


@njit(cache=True)
def turning_noise(
    camera: Array,
    hosts: tuple[Array, Array],
    numbers: tuple[Array, Array, Array],
    alive: Array,
    turn: Array,
    B_T: Array,
) -> None:
    """Add to B' how turns of the rover against the map enter right-invariant landmarks, in place.

    If the rover alone turns by omega, the map's error must turn back: its points move by
    ``-omega x point``.

    Args:
        camera: `observation.camera_vector`.
        hosts: Rotations (c, 3, 3) and positions (c, 3) of the host cameras.
        numbers: As in `linearise`.
        alive: 1 where there is a landmark, Shape (c,).
        turn: Turns in the world, one for each noise [rad], Shape (m, 3).
        B_T: Changed, Shape (m, 6 + 3 c).
    """
    back, shift = np.empty(3), np.empty(3)
    for s in range(len(alive)):
        if alive[s] == 0.0:
            continue
        R, t, far = hosts[0][s], hosts[1][s], numbers[2][s]
        P = homogeneous(camera, far, numbers[0][s])[0]
        for m in range(len(turn)):
            o = turn[m]
            lever = (
                o[1] * t[2] - o[2] * t[1],
                o[2] * t[0] - o[0] * t[2],
                o[0] * t[1] - o[1] * t[0],
            )
            for i in range(3):
                back[i] = -(R[0, i] * o[0] + R[1, i] * o[1] + R[2, i] * o[2])
                along = R[0, i] * lever[0] + R[1, i] * lever[1] + R[2, i] * lever[2]
                shift[i] = -P[3] * along
            dX = shift[0] + back[1] * P[2] - back[2] * P[1]
            dY = shift[1] + back[2] * P[0] - back[0] * P[2]
            dZ = shift[2] + back[0] * P[1] - back[1] * P[0]
            d = _numbers_moved(camera, far, P, (dX, dY, dZ, 0.0))
            for i in range(3):
                B_T[m, 6 + 3 * s + i] += d[i]
