"""Compiled sums over tracks for the variances of a sensor, by restricted maximum likelihood.

The residual of a track at a point near its best is ``y = X g + H dq + B b + e``: g are errors that
all tracks share, dq is the rest of the point's error (unknown), b the landmark's fixed error of
each coordinate, ``b ~ N(0, theta_3 I)``, and e white noise of variances theta_0, theta_1, theta_2
of the three coordinates. With ``V = D + theta_3 B B'`` and ``P = V^-1 - V^-1 H (H' V^-1 H)^-1 H'
V^-1`` the score and the information of the restricted likelihood are ``y' P Q_k P y - tr(P Q_k)``
and ``tr(P Q_k P Q_l)``, for the four parts Q of V. Because D is diagonal and M = [B H] is thin, P
is ``D^-1 - D^-1 M C M' D^-1`` with a C of 6x6, so that a track costs what it has rows. Weights of
the rows, as from Student's t, multiply y, X, H and B by their roots.

Reference:
    Patterson and Thompson, Recovery of inter-block information when block sizes are unequal (1971).
    Henderson, Best linear unbiased estimation and prediction under a selection model (1975).
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@njit(cache=True, nogil=True)
def _design(H: Array, k: int, root: float, wide: float, m: Array) -> None:
    """Fill the weighted row of [B H] for coordinate k; wide scales the fixed error."""
    m[:3] = 0.0
    m[k] = root * wide
    for a in range(3):
        m[3 + a] = H[k, a] * root


@njit(cache=True, nogil=True)
def _add_outer(a: Array, b: Array, factor: float, out: Array) -> None:
    for i in range(len(a)):
        for j in range(len(b)):
            out[i, j] += factor * a[i] * b[j]


@njit(cache=True, nogil=True)
def _form(m: Array, C: Array) -> float:
    """Give m' C m."""
    total = 0.0
    for i in range(len(m)):
        for j in range(len(m)):
            total += m[i] * C[i, j] * m[j]
    return total


@njit(cache=True, nogil=True)
def _grams(H: Array, root: Array, wide: float, grams: Array) -> int:
    """Fill the Gram matrix of each coordinate's rows, Shape (3, 6, 6), and give their number."""
    grams[:] = 0.0
    m, n = np.empty(6), 0
    for i in range(len(H)):
        if root[i] > 0:
            n += 1
            for k in range(3):
                _design(H[i], k, root[i], wide, m)
                _add_outer(m, m, 1.0, grams[k])
    return n


@njit(cache=True, nogil=True)
def _information(grams: Array, n: int, C: Array, theta: Array, F: Array) -> None:
    """Add a track's information ``tr(P Q_k P Q_l)``, Shape (4, 4)."""
    total = grams[0] / theta[0] + grams[1] / theta[1] + grams[2] / theta[2]
    U = (np.eye(6) - total @ C)[:3]
    for k in range(3):
        CG = C @ grams[k]
        F[k, k] += n / theta[k] ** 2 - 2.0 * np.trace(CG) / theta[k] ** 3
        for other in range(3):
            cross = np.trace(CG @ C @ grams[other])
            F[k, other] += cross / (theta[k] * theta[other]) ** 2
        fixed = np.trace(U @ grams[k] @ U.T) / theta[k] ** 2
        F[k, 3] += fixed
        F[3, k] += fixed
    # A slice of columns is not contiguous, which the matrix product wants.
    F[3, 3] += np.sum(((U @ total) ** 2)[:, :3])


@njit(cache=True, nogil=True)
def _weighted(
    residual: Array,
    H: Array,
    X: Array,
    root: Array,
    wide: float,
    theta: Array,
    my: Array,
    mx: Array,
) -> None:
    """Fill ``M' D^-1 y``, Shape (6,), and ``M' D^-1 X``, Shape (6, g)."""
    my[:], mx[:] = 0.0, 0.0
    m = np.empty(6)
    for i in range(len(residual)):
        if root[i] > 0:
            for k in range(3):
                _design(H[i], k, root[i], wide, m)
                for a in range(6):
                    my[a] += m[a] * root[i] * residual[i, k] / theta[k]
                _add_outer(m, X[i, k], root[i] / theta[k], mx)


@njit(cache=True, nogil=True)
def _quadratic(left: Array, root: Array, wide: float, theta: Array, quadratic: Array) -> None:
    """Add a track's quadratic forms ``y' P Q_k P y``, Shape (4,)."""
    for k in range(3):
        total = 0.0
        for i in range(len(left)):
            quadratic[k] += (root[i] * left[i, k] / theta[k]) ** 2
            total += root[i] ** 2 * left[i, k] / theta[k]
        quadratic[3] += (wide * total) ** 2


@njit(cache=True, nogil=True)
def sum_tracks(
    starts: Ints,
    residual: Array,
    H: Array,
    X: Array,
    weight: Array,
    wide: Array,
    theta: Array,
    F: Array,
    quadratic: Array,
    shared: tuple[Array, Array, Array],
    tracks: tuple[Array, Array, Array, Array],
) -> None:
    """Add up what all tracks with two sightings or more say of variances and shared errors.

    Args:
        starts: Rows of track j are ``starts[j]:starts[j + 1]``, Shape (k + 1,).
        residual: Measured less predicted coordinates [px], Shape (m, 3).
        H: Derivatives by the point, Shape (m, 3, 3).
        X: Derivatives by the shared errors, Shape (m, 3, g).
        weight: Weights of the rows, which divide their variances; 0 leaves one out, Shape (m,).
        wide: Factors on the fixed error of each landmark, for heavy tails of it, Shape (k,).
        theta: Variances of u_left, u_right, v and of the fixed error [px^2], Shape (4,), positive.
        F: Receives the information of the variances, Shape (4, 4).
        quadratic: Receives ``y' P Q_k P y``, Shape (4,).
        shared: Receive ``X' P X`` (g, g), ``X' P y`` (g,) and the sum of the outer products of the
            tracks' shares of the latter (g, g).
        tracks: Receive the likeliest fixed error of each landmark (k, 3), the residuals that it and
            the point leave (m, 3) [px], the share of their variance that both took up (m, 3), and
            the expected square of each landmark's fixed error, summed over coordinates (k,).
    """
    g = X.shape[2]
    grams, my, mx, m = np.empty((3, 6, 6)), np.empty(6), np.empty((6, g)), np.empty(6)
    prior = np.zeros((6, 6))
    for k in range(3):
        prior[k, k] = 1.0 / theta[3]
    for j in range(len(starts) - 1):
        rows = slice(starts[j], starts[j + 1])
        r, h, x, root = residual[rows], H[rows], X[rows], np.sqrt(weight[rows])
        n = _grams(h, root, wide[j], grams)
        if n < 2:
            continue
        total = grams[0] / theta[0] + grams[1] / theta[1] + grams[2] / theta[2]
        C = np.linalg.inv(total + prior)
        _information(grams, n, C, theta, F)
        _weighted(r, h, x, root, wide[j], theta, my, mx)
        a, score = C @ my, np.zeros(g)
        shared[0][:] -= mx.T @ C @ mx
        tracks[0][j] = wide[j] * a[:3]
        square = a[0] ** 2 + a[1] ** 2 + a[2] ** 2 + C[0, 0] + C[1, 1] + C[2, 2]
        tracks[3][j] = wide[j] ** 2 * square
        for i in range(len(r)):
            for k in range(3):
                _design(h[i], k, 1.0, wide[j], m)
                w = root[i] ** 2 / theta[k]
                left = r[i, k]
                for b in range(6):
                    left -= m[b] * a[b]
                tracks[1][starts[j] + i, k] = left
                tracks[2][starts[j] + i, k] = w * _form(m, C)
                for b in range(g):
                    score[b] += w * left * x[i, k, b]
                _add_outer(x[i, k], x[i, k], w, shared[0])
        _quadratic(tracks[1][rows], root, wide[j], theta, quadratic)
        shared[1][:] += score
        _add_outer(score, score, 1.0, shared[2])
