"""Which sightings fit the state, each by itself and all together, compiled.

A sighting depends on the pose, on its landmark and, where that has a keyframe, on this: few rows of
the covariance count.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array, Ints


@njit(cache=True)
def gate(
    P: Array, rows: tuple[Ints, Ints], r: Array, H: Array, G: Array, variance: Array, out: Array
) -> None:
    """Give the squared Mahalanobis distance of each innovation by itself, in place, Shape (m,).

    Args:
        P: Covariance of the state, Shape (n, n).
        rows: First row of each landmark and of its host, -1 where that is no part of the state.
        r: Innovations, Shape (m, 3).
        H: Derivatives by the pose's error; by the host's it is -H, Shape (m, 3, 6).
        G: Derivatives by the landmark's, Shape (m, 3, 3).
        variance: Of each image coordinate, Shape (m,).
        out: Takes the distances.
    """
    D, PD, S = np.zeros((3, 15)), np.zeros((15, 3)), np.empty((3, 3))
    index = np.arange(15)
    for i in range(len(r)):
        k = 9 if rows[1][i] < 0 else 15
        D[:, :6], D[:, 6:9], D[:, 9:] = H[i], G[i], -H[i]
        for a in range(3):
            index[6 + a] = rows[0][i] + a
        for a in range(6):
            index[9 + a] = rows[1][i] + a
        for a in range(k):
            for b in range(3):
                PD[a, b] = 0.0
                for c in range(k):
                    PD[a, b] += P[index[a], index[c]] * D[b, c]
        for a in range(3):
            for b in range(3):
                S[a, b] = variance[i] if a == b else 0.0
                for c in range(k):
                    S[a, b] += D[a, c] * PD[c, b]
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
def moved(rows: tuple[Ints, Ints], H: Array, G: Array, dx: Array, out: Array) -> None:
    """Give in place how corrections of the state, Shape (k, n), move sightings, (k, m, 3)."""
    for d in range(len(dx)):
        for i in range(len(H)):
            c, h = rows[0][i], rows[1][i]
            for a in range(3):
                total = 0.0
                for k in range(3):
                    total += G[i, a, k] * dx[d, c + k]
                for k in range(6):
                    shift = dx[d, k] if h < 0 else dx[d, k] - dx[d, h + k]
                    total += H[i, a, k] * shift
                out[d, i, a] = total


@njit(cache=True)
def project_covariance(P: Array, rows: tuple[Ints, Ints], H: Array, G: Array, out: Array) -> None:
    """Give ``H P`` of the stacked sightings in place, Shape (3 m, n): few rows of P count."""
    out[:] = 0.0
    for i in range(len(H)):
        c, h = rows[0][i], rows[1][i]
        for a in range(3):
            target = out[3 * i + a]
            for k in range(3):
                _add_scaled(target, P[c + k], G[i, a, k])
            for k in range(6):
                if H[i, a, k] != 0.0:
                    _add_scaled(target, P[k], H[i, a, k])
                    if h >= 0:
                        _add_scaled(target, P[h + k], -H[i, a, k])


@njit(cache=True)
def innovation_covariance(
    HP: Array, rows: tuple[Ints, Ints], H: Array, G: Array, variance: Array, out: Array
) -> None:
    """Give ``H P H' + noise`` of the stacked sightings in place, Shape (3 m, 3 m)."""
    m = len(H)
    p = np.empty(6)
    for row in range(3 * m):
        source = HP[row]
        for i in range(row // 3 + 1):
            c, h = rows[0][i], rows[1][i]
            for k in range(6):
                p[k] = source[k] if h < 0 else source[k] - source[h + k]
            for a in range(3):
                total = 0.0
                for k in range(3):
                    total += G[i, a, k] * source[c + k]
                for k in range(6):
                    total += H[i, a, k] * p[k]
                out[row, 3 * i + a] = total
    for row in range(3 * m):
        for j in range(row):
            out[j, row] = out[row, j]
        out[row, row] += variance[row // 3]


@njit(cache=True)
def _add_scaled(target: Array, source: Array, factor: float) -> None:
    for j in range(len(target)):
        target[j] += factor * source[j]


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
