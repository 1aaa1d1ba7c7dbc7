"""Gaussian estimates: the one place where a covariance is written.

The compiled functions are for filters that run at the rate of a sensor; they take and give plain
float arrays. A covariance is symmetrised once, where it is made, and no inverse is ever formed:
systems with a covariance are solved by its Cholesky factor.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.stats import chi2

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
