"""Gaussian estimates: the one place where a covariance is written.

The compiled functions are for filters that run at the rate of a sensor; they take and give plain
float arrays. A covariance is symmetrised once, where it is made, and no inverse is ever formed:
systems with a covariance are solved by its Cholesky factor.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import blas, lapack
from scipy.stats import chi2

from lpet_sim.errors import BrokenFilterError
from lpet_sim.recording.arrays import Array


@njit(cache=True)
def with_noise(P: Array, variance: Array) -> Array:
    """Add independent noise of the given variances, Shape (n,), to a state that stays put."""
    return P + np.diag(variance)


@njit(cache=True)
def symmetrise(P: Array) -> Array:
    """Give ``(P + P^T) / 2``, Shape (n, n)."""
    n = P.shape[0]
    out = np.empty((n, n))
    for i in range(n):
        for j in range(n):
            out[i, j] = 0.5 * (P[i, j] + P[j, i])
    return out


@njit(cache=True)
def independent(variance: Array) -> Array:
    """Give the covariance of independent errors, Shape (n, n), from their variances, Shape (n,)."""
    return np.diag(variance)


@njit(cache=True)
def of_noise(B: Array, variance: Array) -> Array:
    """Give ``B diag(variance) B^T``: what independent noises do to a state.

    Args:
        B: Derivative of the state by the noises, Shape (n, m).
        variance: Of each noise, Shape (m,).

    Returns:
        Shape (n, n).
    """
    B = np.ascontiguousarray(B)
    return (B * variance) @ B.T


@njit(cache=True)
def propagate(P: Array, F: Array, cov_process: Array) -> Array:
    """Carry a covariance through a linear step: ``F P F^T + cov_process``.

    Args:
        P: Covariance of the state, Shape (n, n).
        F: Derivative of the new state by the old, Shape (m, n).
        cov_process: Covariance that the step adds, Shape (m, m).

    Returns:
        Shape (m, m).

    Reference:
        Bar-Shalom, Li, Kirubarajan (2001), eq. 5.2.3-5 [recalled].
    """
    F = np.ascontiguousarray(F)
    return symmetrise(F @ (np.ascontiguousarray(P) @ F.T) + cov_process)


@njit(cache=True)
def cholesky_solve(S: Array, B: Array) -> Array:
    """Solve ``S X = B`` for a symmetric positive definite S by ``S = L L^T``.

    Args:
        S: Shape (n, n).
        B: Right-hand sides, Shape (n, m).

    Returns:
        Shape (n, m).

    Raises:
        LinAlgError: S is not positive definite.
    """
    L, X = np.linalg.cholesky(np.ascontiguousarray(S)), B.copy()
    n, m = X.shape
    for i in range(n):
        for j in range(i):
            for k in range(m):
                X[i, k] -= L[i, j] * X[j, k]
        for k in range(m):
            X[i, k] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for j in range(i + 1, n):
            for k in range(m):
                X[i, k] -= L[j, i] * X[j, k]
        for k in range(m):
            X[i, k] /= L[i, i]
    return X


@njit(cache=True)
def innovation_covariance(P: Array, H: Array, cov_meas: Array) -> Array:
    """Give ``S = H P H^T + cov_meas``, Shape (m, m), of a measurement with derivative H (m, n)."""
    return propagate(P, H, cov_meas)


@njit(cache=True)
def update(P: Array, H: Array, innovation: Array, cov_meas: Array) -> tuple[Array, Array]:
    """Take in a measurement, in Joseph's form.

    ``K = P H^T S^-1``, ``dx = K innovation``, ``P+ = (I - K H) P (I - K H)^T + K cov_meas K^T``.

    Args:
        P: Covariance of the state, Shape (n, n).
        H: Derivative of the measurement by the state, Shape (m, n).
        innovation: Measured minus predicted, Shape (m,).
        cov_meas: Covariance of the measurement, Shape (m, m).

    Returns:
        The correction of the state, Shape (n,), and the new covariance, Shape (n, n).

    Reference:
        Bar-Shalom, Li, Kirubarajan (2001), eq. 5.2.3-18 [recalled].
    """
    H = np.ascontiguousarray(H)
    S = innovation_covariance(P, H, cov_meas)
    K = np.ascontiguousarray(cholesky_solve(S, H @ np.ascontiguousarray(P)).T)
    rest = np.eye(len(P)) - K @ H
    return K @ innovation, propagate(P, rest, K @ (np.ascontiguousarray(cov_meas) @ K.T))


@njit(cache=True)
def normalised_square(innovation: Array, S: Array) -> float:
    """Give ``innovation^T S^-1 innovation``, the squared Mahalanobis distance."""
    column = np.ascontiguousarray(innovation).reshape(-1, 1)
    return float(np.sum(column * cholesky_solve(S, column)))


def chi_square_threshold(dof: int, probability: float = 0.999) -> float:
    """Give the gate that a fitting measurement of ``dof`` numbers passes with a probability."""
    return float(chi2.ppf(probability, dof))


def passes_gate(innovation: Array, S: Array, probability: float = 0.999) -> bool:
    """Tell whether an innovation, Shape (m,), is likely under its covariance S, Shape (m, m)."""
    return normalised_square(innovation, S) <= chi_square_threshold(len(innovation), probability)


def marginalise(P: Array, keep: NDArray[np.int64]) -> Array:
    """Drop all but some rows of the state; what is kept loses nothing.

    Args:
        P: Covariance, Shape (n, n).
        keep: Indices of the rows to keep, Shape (m,).

    Returns:
        Shape (m, m).
    """
    return np.ascontiguousarray(P[np.ix_(keep, keep)])


def from_information(information: Array) -> Array:
    """Give the covariance of a least-squares solution from its normal matrix, Shape (n, n).

    Raises:
        LinAlgError: The matrix is not positive definite: something was not observed.
    """
    return symmetrise(cholesky_solve(information, np.eye(len(information))))


def transport(P: Array, F: Array) -> Array:
    """Express covariances in other coordinates, ``F P F^T``, for stacks (..., n, n)."""
    moved = F @ P @ np.swapaxes(F, -1, -2)
    return np.asarray(0.5 * (moved + np.swapaxes(moved, -1, -2)))


@njit(cache=True)
def move_block(P: Array, F: Array, cov_added: Array) -> None:
    """Carry the first variables of a state through a linear step, in place: ``F P F^T + cov``.

    Args:
        P: Covariance of the whole state, Shape (n, n); changed.
        F: Derivative of the first k variables by themselves, Shape (k, k).
        cov_added: What the step adds to them, Shape (k, k).
    """
    k, n = len(F), len(P)
    old = P[:k].copy()
    for i in range(k):
        for j in range(n):
            total = 0.0
            for a in range(k):
                total += F[i, a] * old[a, j]
            P[i, j] = total
            P[j, i] = total
    corner = symmetrise(F @ (np.ascontiguousarray(old[:, :k]) @ F.T) + cov_added)
    for i in range(k):
        for j in range(k):
            P[i, j] = corner[i, j]


@njit(cache=True)
def add_noise(P: Array, B_T: Array) -> None:
    """Add ``B B^T`` in place, for noise of unit variance that enters a state by B.

    Args:
        P: Covariance, Shape (n, n); changed.
        B_T: B transposed, Shape (m, n).
    """
    n, m = len(P), len(B_T)
    for i in range(n):
        for k in range(m):
            factor = B_T[k, i]
            if factor != 0.0:
                for j in range(n):
                    P[i, j] += factor * B_T[k, j]


@njit(cache=True)
def join_block(P: Array, row: int, J: Array, variance: float) -> None:
    """Let three free variables become ``J x + noise`` of the first variables x, in place.

    Args:
        P: Covariance, Shape (n, n); changed in the three rows and columns.
        row: First of the three.
        J: Their derivative by the first k variables, Shape (3, k).
        variance: Of the noise of each, independent of all else.
    """
    n, k = len(P), J.shape[1]
    rows = np.zeros((3, n))
    for i in range(3):
        for a in range(k):
            for j in range(n):
                rows[i, j] += J[i, a] * P[a, j]
    for i in range(3):
        for j in range(n):
            P[row + i, j] = rows[i, j]
            P[j, row + i] = rows[i, j]
    for i in range(3):
        for j in range(3):
            total = variance if i == j else 0.0
            for a in range(k):
                total += 0.5 * (rows[i, a] * J[j, a] + rows[j, a] * J[i, a])
            P[row + i, row + j] = total


@njit(cache=True)
def free_block(P: Array, row: int) -> None:
    """Take three variables out of the state, in place: what is left loses nothing."""
    for i in range(3):
        for j in range(len(P)):
            P[row + i, j] = 0.0
            P[j, row + i] = 0.0


def enlarged(P: Array, n: int) -> Array:
    """Give the covariance with free variables at its end, Shape (n, n)."""
    out = np.zeros((n, n))
    out[: len(P), : len(P)] = P
    return out


@njit(cache=True)
def drop_correlations(P: Array, first: int, keep_first: bool) -> None:
    """Set every correlation between blocks of three variables to zero, in place.

    Args:
        P: Covariance, Shape (n, n); changed.
        first: Number of variables before the blocks; correlations among them stay.
        keep_first: Whether the correlations of these with the blocks stay; then what comes out
            need not be positive definite.
    """
    n = len(P)
    for i in range(first, n):
        block = (i - first) // 3
        for j in range(0 if not keep_first else first, n):
            if j < first or (j - first) // 3 != block:
                P[i, j] = 0.0
                P[j, i] = 0.0


@njit(cache=True)
def mirror_lower(P: Array) -> None:
    """Copy the lower triangle over the upper one, in place, in tiles that fit the cache."""
    n, tile = len(P), 32
    for i0 in range(0, n, tile):
        for j0 in range(0, i0 + 1, tile):
            for i in range(i0, min(i0 + tile, n)):
                for j in range(j0, min(j0 + tile, i)):
                    P[j, i] = P[i, j]


def update_in_place(P: Array, PH_T: Array, S: Array, innovation: Array) -> tuple[Array, float]:
    """Take in a measurement whose ``P H^T`` is at hand, in Joseph's form multiplied out.

    ``K = P H^T S^-1``; ``(I - K H) P (I - K H)^T + K cov_meas K^T`` is ``P - K D^T - D K^T`` with
    ``D = P H^T - K S / 2``: for every K, not for the optimal one alone, so that an error of K enters
    squared. One symmetric rank-2m product, the least that a full covariance costs.

    Args:
        P: Covariance, Shape (n, n), C-contiguous; changed.
        PH_T: ``P H^T``, Shape (n, m), C-contiguous.
        S: Covariance of the innovation, Shape (m, m).
        innovation: Measured minus predicted, Shape (m,).

    Returns:
        The correction of the state, Shape (n,), and ``innovation^T S^-1 innovation``.

    Raises:
        BrokenFilterError: S is not positive definite.

    Reference:
        Bar-Shalom, Li, Kirubarajan (2001), eq. 5.2.3-18 [recalled].
    """
    L, failed = lapack.dpotrf(S, lower=1)
    if failed:
        raise BrokenFilterError("the covariance of an innovation is not positive definite")
    K_T, _ = lapack.dpotrs(L, PH_T.T, lower=1)
    weighted, _ = lapack.dpotrs(L, innovation, lower=1)
    D_T = blas.dgemm(-0.5, S, K_T, 1.0, PH_T.T)
    blas.dsyr2k(-1.0, K_T, D_T, 1.0, P.T, trans=1, lower=0, overwrite_c=1)
    mirror_lower(P)
    return K_T.T @ innovation, float(innovation @ weighted)
