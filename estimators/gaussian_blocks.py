"""The covariance of a state that grows and shrinks, changed in place.

The state is a few variables of the rover followed by blocks of three, one for each landmark. A
block whose rows and columns are zero is free: no variable of the state stands there.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.linalg import blas, lapack

from estimators.gaussian import symmetrise
from lpet_sim.errors import BrokenFilterError
from lpet_sim.recording.arrays import Array, Ints

_BLIND = 1e-12
"""Share of the largest information below which a measurement tells nothing of a move."""


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
def add_block_noise(P: Array, first: int, B: Array) -> None:
    """Add ``B_i B_i^T`` to each block of three, in place, for noise that each has of its own.

    Args:
        P: Covariance, Shape (first + 3 c, first + 3 c); changed.
        first: Number of variables before the blocks.
        B: What unit noises do to each block, Shape (c, 3, 3).
    """
    for i in range(len(B)):
        row = first + 3 * i
        for a in range(3):
            for b in range(3):
                for k in range(3):
                    P[row + a, row + b] += B[i, a, k] * B[i, b, k]


@njit(cache=True)
def carry(P: Array, B_T: Array, first: int) -> None:
    """Let variables of the state act on others, in place: ``x += B d`` for consecutive ones d.

    Args:
        P: Covariance, Shape (n, n); changed.
        B_T: B transposed, zero in the columns of d, Shape (k, n).
        first: Row of the first of d.
    """
    n, k = len(P), len(B_T)
    for i in range(n):
        for a in range(k):
            factor = B_T[a, i]
            if factor != 0.0:
                for j in range(n):
                    P[i, j] += factor * P[first + a, j]
    for j in range(n):
        for a in range(k):
            factor = B_T[a, j]
            if factor != 0.0:
                for i in range(n):
                    P[i, j] += factor * P[i, first + a]


@njit(cache=True)
def join_block(P: Array, row: int, known: Ints, J: Array, B: Array) -> None:
    """Let three free variables become ``J x + B noise`` of others x, in place.

    Args:
        P: Covariance, Shape (n, n); changed in the three rows and columns.
        row: First of the three.
        known: Rows of x, Shape (k,).
        J: Their derivative by x, Shape (3, k).
        B: Derivative by unit noises that are independent of all else, Shape (3, m).
    """
    n, k = len(P), len(known)
    rows = np.zeros((3, n))
    for i in range(3):
        for a in range(k):
            for j in range(n):
                rows[i, j] += J[i, a] * P[known[a], j]
    for i in range(3):
        for j in range(n):
            P[row + i, j] = rows[i, j]
            P[j, row + i] = rows[i, j]
    for i in range(3):
        for j in range(3):
            total = 0.0
            for a in range(B.shape[1]):
                total += B[i, a] * B[j, a]
            for a in range(k):
                total += 0.5 * (rows[i, known[a]] * J[j, a] + rows[j, known[a]] * J[i, a])
            P[row + i, row + j] = total


@njit(cache=True)
def clone_block(P: Array, row: int, size: int) -> None:
    """Let free variables become copies of the first ones, in place.

    Args:
        P: Covariance, Shape (n, n); changed in the copies' rows and columns.
        row: First of the copies.
        size: Their number.
    """
    n = len(P)
    for i in range(size):
        for j in range(n):
            P[row + i, j] = P[i, j]
    for i in range(n):
        for j in range(size):
            P[i, row + j] = P[i, j]


@njit(cache=True)
def free_block(P: Array, row: int, size: int) -> None:
    """Take variables out of the state, in place: what is left loses nothing."""
    for i in range(size):
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


def square_root(S: Array) -> Array:
    """Give the lower Cholesky factor L of a covariance, ``S = L L^T``, Shape (m, m).

    What stands above the diagonal of L means nothing.

    Raises:
        BrokenFilterError: S is not positive definite.
    """
    L, failed = lapack.dpotrf(S.T, lower=1, clean=0, overwrite_a=0)
    if failed:
        raise BrokenFilterError("the covariance of an innovation is not positive definite")
    return np.asarray(L)


def solved(L: Array, b: Array) -> Array:
    """Give ``S^-1 b`` by the factor of S, Shape (m,)."""
    return np.asarray(lapack.dpotrs(L, b, lower=1)[0])


def score_square(L: Array, moves: Array, innovation: Array) -> float:
    """Give the square by which an innovation gets likelier if the state may move freely.

    ``g = M^T S^-1 r``, ``A = M^T S^-1 M``, ``g^T A^+ g``: chi-square of p degrees of freedom where
    the innovation is as its covariance S says.

    Args:
        L: Factor of S, Shape (m, m).
        moves: What unit moves do to the measurement, M, Shape (m, p).
        innovation: Shape (m,).
    """
    white = blas.dtrsm(1.0, L, np.column_stack([moves, innovation]), lower=1)
    M, r = white[:, :-1], white[:, -1]
    sizes, axes = np.linalg.eigh(M.T @ M)
    told = sizes > _BLIND * sizes[-1]
    along = axes[:, told].T @ (M.T @ r)
    return float(along @ (along / sizes[told]))


def update_in_place(P: Array, HP: Array, L: Array, innovation: Array) -> tuple[Array, float]:
    """Take in a measurement whose ``H P`` is at hand, by the square root of its innovation's S.

    ``S = L L^T``, ``W = L^-1 H P``: ``P+ = P - W^T W`` and ``dx = W^T L^-1 innovation``. One
    triangular solve and one symmetric rank-m product, the least that a full covariance costs; what
    is taken off is positive semidefinite whatever the rounding, and nothing is inverted.

    Args:
        P: Covariance, Shape (n, n), C-contiguous; changed.
        HP: ``H P``, Shape (m, n), C-contiguous; spoiled.
        L: Factor of the innovation's covariance S as `square_root` gives it, Shape (m, m).
        innovation: Measured minus predicted, Shape (m,).

    Returns:
        The correction of the state, Shape (n,), and ``innovation^T S^-1 innovation``.

    Raises:
        BrokenFilterError: The new P is not positive definite.

    Reference:
        Bar-Shalom, Li, Kirubarajan (2001), eq. 5.2.3-17 [recalled].
    """
    W_T = blas.dtrsm(1.0, L, HP.T, side=1, lower=1, trans_a=1, overwrite_b=1)
    white = blas.dtrsv(L, innovation, lower=1)
    blas.dsyrk(-1.0, W_T, beta=1.0, c=P.T, lower=0, overwrite_c=1)
    mirror_lower(P)
    if P.diagonal().min() < 0.0:
        raise BrokenFilterError("the covariance of the state is not positive definite")
    return W_T @ white, float(white @ white)
