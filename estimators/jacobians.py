"""Derivatives of a pose that a body-frame twist moves on: ``T_next = T exp(u)``.

With right perturbations ``T_true = T exp(xi)`` and ``u_true = u + du``, to first order
``xi_next = Ad(exp(-u)) xi + J_r(u) du``.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from lpet_sim.geometry.compiled import small_exp
from lpet_sim.recording.arrays import Array

_TERMS = 30


@njit(cache=True)
def hat(v: Array) -> Array:
    """Give the skew matrix with ``hat(a) @ b = a x b``, Shape (3, 3)."""
    out = np.zeros((3, 3))
    out[0, 1], out[0, 2], out[1, 2] = -v[2], v[1], -v[0]
    out[1, 0], out[2, 0], out[2, 1] = v[2], -v[1], v[0]
    return out


@njit(cache=True)
def small_adjoint(u: Array) -> Array:
    """Give ad(u), Shape (6, 6), with ``ad(u) = log Ad(exp(u))``.

    Reference:
        Barfoot, State Estimation for Robotics (2017), eq. 7.37.
    """
    out, turn, shift = np.zeros((6, 6)), hat(u[3:]), hat(u[:3])
    for i in range(3):
        for j in range(3):
            out[i, j] = out[3 + i, 3 + j] = turn[i, j]
            out[i, 3 + j] = shift[i, j]
    return out


@njit(cache=True)
def step_jacobians(u: Array) -> tuple[Array, Array]:
    """Give the derivatives of the next pose's error by the error before and by the step's.

    ``Ad(exp(-u)) = sum (-ad u)^n / n!`` and ``J_r(u) = sum (-ad u)^n / (n + 1)!``, summed until
    nothing above 1e-15 is added.

    Args:
        u: Twist of the step, ``(translation, rotation)`` [m, rad], Shape (6,).

    Returns:
        ``Ad(exp(-u))`` and ``J_r(u)``, both Shape (6, 6).

    Reference:
        Barfoot (2017), eq. 7.47 and 7.75 (which has the left Jacobian).
    """
    ad, term = small_adjoint(u), np.eye(6)
    F, G = np.eye(6), np.eye(6)
    for n in range(1, _TERMS):
        term = _product(term, ad, -1.0 / n)
        largest = 0.0
        for i in range(6):
            for j in range(6):
                F[i, j] += term[i, j]
                G[i, j] += term[i, j] / (n + 1)
                largest = max(largest, abs(term[i, j]))
        if largest < 1e-15:
            break
    return F, G


@njit(cache=True)
def put(target: Array, row: int, column: int, block: Array) -> None:
    """Copy a block into a matrix; one compiled function for every shape."""
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            target[row + i, column + j] = block[i, j]


@njit(cache=True)
def _product(A: Array, B: Array, factor: float) -> Array:
    """Multiply small matrices and a factor; plain loops compile faster than they run slower."""
    out = np.zeros(A.shape)
    for i in range(len(A)):
        for j in range(len(B)):
            for k in range(B.shape[1]):
                out[i, k] += factor * A[i, j] * B[j, k]
    return out


@njit(cache=True)
def se3_exp(xi: Array) -> tuple[Array, Array]:
    """Map one twist to rotation (3, 3) and translation (3,): ``(exp(phi), J(phi) rho)``.

    ``J = I + (1 - cos x)/x^2 hat(phi) + (x - sin x)/x^3 hat(phi)^2`` with ``x = |phi|``.

    Reference:
        Barfoot (2017), eq. 7.33 and 7.77.
    """
    phi, rho = xi[3:], xi[:3]
    skew, x = hat(phi), np.sqrt(np.sum(phi * phi))
    b, c = 0.5 - x * x / 24.0, 1.0 / 6.0 - x * x / 120.0
    if x > 1e-3:
        b, c = 2.0 * np.sin(0.5 * x) ** 2 / x**2, (x - np.sin(x)) / x**3
    first = skew @ rho
    return small_exp(phi), rho + b * first + c * (skew @ first)
