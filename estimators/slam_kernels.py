"""The arithmetic of the SLAM filter, compiled: sightings of a map, their gate, and new landmarks.

A landmark is three numbers x, the image coordinates (u_left, u_right, v) that it has in a camera
at its host pose, where it was first seen: near and far ones are then equally close to linear, and
the error of a new one is that of its sighting. Errors of the pose are in the world, ``R_true =
exp(phi) R``. In the standard form ``p_true = p + dp`` and ``x_true = x + e``; in the
right-invariant one ``p_true = exp(phi) p + rho`` and the host poses turn by exp(phi) too, so that
one rotation moves pose and map together and no sighting can tell of it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from estimators.observation import push, transfer_into
from lpet_sim.recording.arrays import Array, Ints

STANDARD, FIRST_ESTIMATES, RIGHT_INVARIANT = 0, 1, 2


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
    hosts: tuple[Array, Array],
    x: Array,
    x_first: Array,
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
        hosts: Rotations (c, 3, 3) and positions (c, 3) of the host cameras.
        x: Landmarks in their hosts [px], Shape (c, 3).
        x_first: Their first estimates [px], Shape (c, 3).
        slots: Which landmarks, Shape (m,).
        form: `STANDARD`, `FIRST_ESTIMATES` or `RIGHT_INVARIANT`.
        predicted: Takes the sightings [px], Shape (m, 3).
        H: Takes the derivatives by the pose's error, Shape (m, 3, 6).
        G: Takes the derivatives by the landmark's own, Shape (m, 3, 3).
    """
    R_c, t_c = pose_camera
    R, t_back, J, unused = np.empty((3, 3)), np.empty(3), np.empty((3, 6)), np.empty(3)
    for i in range(len(slots)):
        s = slots[i]
        _relative(hosts[0][s], hosts[1][s], R_c, t_c, R, t_back)
        transfer_into(camera, R, t_back, x[s], predicted[i], G[i], J)
        if form == FIRST_ESTIMATES:
            transfer_into(camera, R, t_back, x_first[s], unused, G[i], J)
        _world_jacobian(J, R_c, arm, form != RIGHT_INVARIANT, H[i])


@njit(cache=True)
def gate(P: Array, slots: Ints, r: Array, H: Array, G: Array, variance: Array, out: Array) -> None:
    """Give the squared Mahalanobis distance of each innovation by itself, in place, Shape (m,)."""
    D, PD, S = np.empty((3, 9)), np.empty((9, 3)), np.empty((3, 3))
    index = np.arange(9)
    for i in range(len(slots)):
        D[:, :6], D[:, 6:] = H[i], G[i]
        for a in range(3):
            index[6 + a] = 6 + 3 * slots[i] + a
        for a in range(9):
            for b in range(3):
                PD[a, b] = 0.0
                for k in range(9):
                    PD[a, b] += P[index[a], index[k]] * D[b, k]
        for a in range(3):
            for b in range(3):
                S[a, b] = variance[i] if a == b else 0.0
                for k in range(9):
                    S[a, b] += D[a, k] * PD[k, b]
        out[i] = _weighted_square(S, r[i])


@njit(cache=True)
def _weighted_square(S: Array, r: Array) -> float:
    """Give ``r' S^-1 r`` for a symmetric S of three rows, by its Cholesky factor; inf if none."""
    a = S[0, 0]
    if not a > 0.0:
        return np.inf
    a = np.sqrt(a)
    b, c = S[1, 0] / a, S[2, 0] / a
    d = S[1, 1] - b * b
    if not d > 0.0:
        return np.inf
    d = np.sqrt(d)
    e = (S[2, 1] - b * c) / d
    f = S[2, 2] - c * c - e * e
    if not f > 0.0:
        return np.inf
    y0 = r[0] / a
    y1 = (r[1] - b * y0) / d
    y2 = r[2] - c * y0 - e * y1
    return y0 * y0 + y1 * y1 + y2 * y2 / f


@njit(cache=True)
def project_covariance(P: Array, slots: Ints, H: Array, G: Array, out: Array) -> None:
    """Give ``P H'`` of the stacked sightings in place, Shape (n, 3 m): only ten columns count."""
    n, m = len(P), len(slots)
    for r in range(n):
        p = P[r]
        for i in range(m):
            c = 6 + 3 * slots[i]
            for a in range(3):
                total = p[c] * G[i, a, 0] + p[c + 1] * G[i, a, 1] + p[c + 2] * G[i, a, 2]
                for k in range(6):
                    total += p[k] * H[i, a, k]
                out[r, 3 * i + a] = total


@njit(cache=True)
def innovation_covariance(
    PH_T: Array, slots: Ints, H: Array, G: Array, variance: Array, out: Array
) -> None:
    """Give ``H P H' + noise`` of the stacked sightings in place, Shape (3 m, 3 m)."""
    m = len(slots)
    for i in range(m):
        c = 6 + 3 * slots[i]
        for a in range(3):
            row = 3 * i + a
            for j in range(3 * m):
                total = 0.0
                for k in range(6):
                    total += H[i, a, k] * PH_T[k, j]
                for k in range(3):
                    total += G[i, a, k] * PH_T[c + k, j]
                out[row, j] = total
    for row in range(3 * m):
        for j in range(row):
            out[row, j] = out[j, row] = 0.5 * (out[row, j] + out[j, row])
        out[row, row] += variance[row // 3]


@njit(cache=True)
def _left_by(S: Array, r: Array, i: int, j: int, inverse: Array, rest: Array, left: Array) -> None:
    """Give innovation j and its covariance once sighting i is believed, in place."""
    gain = np.zeros((3, 3))
    for a in range(3):
        left[a] = r[j, a]
        for b in range(3):
            for k in range(3):
                gain[a, b] += S[3 * j + a, 3 * i + k] * inverse[k, b]
            left[a] -= gain[a, b] * r[i, b]
    for a in range(3):
        for b in range(3):
            rest[a, b] = S[3 * j + a, 3 * j + b]
            for k in range(3):
                rest[a, b] -= gain[a, k] * S[3 * i + k, 3 * j + b]


@njit(cache=True)
def consensus(S: Array, r: Array, threshold: float, support: Array) -> int:
    """Find the sighting with which most others agree once it is believed, one-point RANSAC.

    Believing sighting i alone leaves sighting j the innovation ``r_j - S_ji S_ii^-1 r_i`` with the
    covariance ``S_jj - S_ji S_ii^-1 S_ij``; j agrees if its square is below the threshold. All
    sightings are tried, so nothing is random.

    Args:
        S: Covariance of the stacked innovations, Shape (3 m, 3 m).
        r: Innovations, Shape (m, 3).
        threshold: Chi-square of three degrees of freedom.
        support: Takes 1 for the sightings that agree with the best, Shape (m,).

    Returns:
        Their number.

    Reference:
        Civera et al. (2010), 1-point RANSAC for EKF filtering, algorithm 1 [recalled]; here with
        the covariance of the hypothesis in place of its linearised state.
    """
    m, best = len(r), -1
    agree, rest, left = np.zeros(m), np.empty((3, 3)), np.empty(3)
    for i in range(m):
        inverse = np.linalg.inv(np.ascontiguousarray(S[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]))
        count = 0
        for j in range(m):
            _left_by(S, r, i, j, inverse, rest, left)
            agree[j] = 1.0 if i == j or _weighted_square(rest, left) < threshold else 0.0
            count += int(agree[j])
        if count > best:
            best = count
            support[:] = agree
        if best == m:
            break
    return best


@njit(cache=True)
def entry_jacobian(
    camera: Array, x: Array, R_c: Array, arm: Array, turns: bool, out: Array
) -> None:
    """Give how a landmark's error in its host depends on the pose's error when it enters, (3, 6).

    The landmark sits at x in the true camera, which is off its estimate, the host: a point moves by
    ``rho + phi x point``.
    """
    J = np.empty((3, 6))
    w, f, b = x[0] - x[1], camera[0], camera[3]
    P = (b * (x[0] - camera[1]), b * (x[2] - camera[2]), b * f, w)
    moves = (
        (w, 0.0, 0.0, 0.0),
        (0.0, w, 0.0, 0.0),
        (0.0, 0.0, w, 0.0),
        (0.0, -P[2], P[1], 0.0),
        (P[2], 0.0, -P[0], 0.0),
        (-P[1], P[0], 0.0, 0.0),
    )
    for k in range(6):
        J[0, k], J[1, k], J[2, k] = push(camera, P, moves[k])
    _world_jacobian(J, R_c, arm, turns, out)


@njit(cache=True)
def turning_noise(
    camera: Array, hosts: tuple[Array, Array], x: Array, alive: Array, turn: Array, B_T: Array
) -> None:
    """Add to B' how turns of the rover against the map enter right-invariant landmarks, in place.

    If the rover alone turns by omega, the map's error must turn back: its points move by
    ``-omega x point``.

    Args:
        camera: `observation.camera_vector`.
        hosts: Rotations (c, 3, 3) and positions (c, 3) of the host cameras.
        x: Landmarks [px], Shape (c, 3).
        alive: 1 where there is a landmark, Shape (c,).
        turn: Turns in the world, one for each noise [rad], Shape (m, 3).
        B_T: Changed, Shape (m, 6 + 3 c).
    """
    focal, cx, cy, b = camera
    back, shift = np.empty(3), np.empty(3)
    for s in range(len(x)):
        if alive[s] == 0.0:
            continue
        R, t, w = hosts[0][s], hosts[1][s], x[s, 0] - x[s, 1]
        P = (b * (x[s, 0] - cx), b * (x[s, 2] - cy), b * focal, w)
        for m in range(len(turn)):
            o = turn[m]
            lever = (
                o[1] * t[2] - o[2] * t[1],
                o[2] * t[0] - o[0] * t[2],
                o[0] * t[1] - o[1] * t[0],
            )
            for i in range(3):
                back[i] = -(R[0, i] * o[0] + R[1, i] * o[1] + R[2, i] * o[2])
                shift[i] = -w * (R[0, i] * lever[0] + R[1, i] * lever[1] + R[2, i] * lever[2])
            dX = shift[0] + back[1] * P[2] - back[2] * P[1]
            dY = shift[1] + back[2] * P[0] - back[0] * P[2]
            dZ = shift[2] + back[0] * P[1] - back[1] * P[0]
            d = push(camera, P, (dX, dY, dZ, 0.0))
            for i in range(3):
                B_T[m, 6 + 3 * s + i] += d[i]
