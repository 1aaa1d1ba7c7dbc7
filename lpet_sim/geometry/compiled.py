"""Single rotations for compiled loops over samples.

Every function is the same scalar operations in the same order wherever it is called, so that what
is built on them is equal to the bit however a traverse is cut into chunks.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def small_log(R: Array) -> Array:
    """Give the rotation vector of a rotation below pi/2, Shape (3,) [rad].

    ``phi = a/sin(a) w`` with ``w = vee(R - R^T)/2``, ``sin(a) = |w|`` and ``2 cos(a) = tr R - 1``.
    """
    w = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    sine = np.sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    if sine < 1e-6:
        return w * (1.0 + sine * sine / 6.0)
    return w * (np.arctan2(sine, 0.5 * (R[0, 0] + R[1, 1] + R[2, 2] - 1.0)) / sine)


@njit(cache=True)
def small_exp(phi: Array) -> Array:
    """Give the rotation matrix of a rotation vector [rad], Shape (3, 3), by Rodrigues' formula."""
    angle = np.sqrt(phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2])
    a, b = 1.0 - angle * angle / 6.0, 0.5 - angle * angle / 24.0
    if angle > 1e-4:
        a, b = np.sin(angle) / angle, 2.0 * np.sin(0.5 * angle) ** 2 / (angle * angle)
    x, y, z = phi[0], phi[1], phi[2]
    out = np.empty((3, 3))
    out[0, 0], out[1, 1] = 1 - b * (y * y + z * z), 1 - b * (x * x + z * z)
    out[2, 2] = 1 - b * (x * x + y * y)
    out[0, 1], out[1, 0] = b * x * y - a * z, b * x * y + a * z
    out[0, 2], out[2, 0] = b * x * z + a * y, b * x * z - a * y
    out[1, 2], out[2, 1] = b * y * z - a * x, b * y * z + a * x
    return out


@njit(cache=True)
def times(M: Array, v: Array) -> Array:
    """Multiply a 3x3 matrix and a vector, in a fixed order of operations."""
    out = np.empty(3)
    for i in range(3):
        out[i] = M[i, 0] * v[0] + M[i, 1] * v[1] + M[i, 2] * v[2]
    return out


@njit(cache=True)
def times_transposed(A: Array, B: Array) -> Array:
    """Give ``A^T B``, in a fixed order of operations."""
    out = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            out[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]
    return out
