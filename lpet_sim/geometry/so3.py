"""SO(3): rotations as matrices, with exponential map, logarithm, Jacobians and quaternions.

Every function works on stacks: ``...`` stands for any leading shape. Quaternions are scalar first
(``wxyz``) everywhere in LPET; SciPy's scalar-last order is converted here and nowhere else.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

_SMALL_ANGLE_RAD = 1e-4


def hat(phi: Array) -> Array:
    """Give the skew matrix with ``hat(a) @ b = a x b``.

    Args:
        phi: Vectors, Shape (..., 3).

    Returns:
        Skew-symmetric matrices, Shape (..., 3, 3).
    """
    phi = np.asarray(phi, dtype=float)
    out = np.zeros((*phi.shape, 3))
    out[..., 0, 1], out[..., 0, 2] = -phi[..., 2], phi[..., 1]
    out[..., 1, 0], out[..., 1, 2] = phi[..., 2], -phi[..., 0]
    out[..., 2, 0], out[..., 2, 1] = -phi[..., 1], phi[..., 0]
    return out


def _coefficients(phi: Array) -> tuple[Array, Array, Array]:
    """Give sin(x)/x, (1 - cos x)/x^2 and (x - sin x)/x^3, by series near zero."""
    angle = np.linalg.norm(phi, axis=-1)
    small = angle < _SMALL_ANGLE_RAD
    x = np.where(small, 1.0, angle)
    a = np.where(small, 1 - angle**2 / 6, np.sin(x) / x)
    b = np.where(small, 0.5 - angle**2 / 24, 2 * np.sin(x / 2) ** 2 / x**2)
    c = np.where(small, 1 / 6 - angle**2 / 120, (x - np.sin(x)) / x**3)
    return a[..., None, None], b[..., None, None], c[..., None, None]


def exp(phi: Array) -> Array:
    """Map rotation vectors to rotation matrices.

    ``exp(phi) = I + sin(x)/x hat(phi) + (1 - cos x)/x^2 hat(phi)^2`` with ``x = |phi|``.

    Args:
        phi: Rotation vectors [rad], Shape (..., 3).

    Returns:
        Rotation matrices, Shape (..., 3, 3).

    Reference:
        Barfoot, State Estimation for Robotics (2017), eq. 7.14 (Rodrigues).
    """
    phi = np.asarray(phi, dtype=float)
    a, b, _ = _coefficients(phi)
    skew = hat(phi)
    return np.eye(3) + a * skew + b * (skew @ skew)


def log(R: Array) -> Array:
    """Map rotation matrices to rotation vectors of angle at most pi, the inverse of `exp`.

    Args:
        R: Rotation matrices, Shape (..., 3, 3).

    Returns:
        Rotation vectors [rad], Shape (..., 3).
    """
    R = np.asarray(R, dtype=float)
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_rotvec()
    return flat.reshape(R.shape[:-1])


def left_jacobian(phi: Array) -> Array:
    """Give J with ``exp(phi + d) = exp(J d) exp(phi)`` to first order.

    ``J = I + (1 - cos x)/x^2 hat(phi) + (x - sin x)/x^3 hat(phi)^2``.

    Args:
        phi: Rotation vectors [rad], Shape (..., 3).

    Returns:
        Jacobians, Shape (..., 3, 3).

    Reference:
        Barfoot (2017), eq. 7.77.
    """
    phi = np.asarray(phi, dtype=float)
    _, b, c = _coefficients(phi)
    skew = hat(phi)
    return np.eye(3) + b * skew + c * (skew @ skew)


def left_jacobian_inv(phi: Array) -> Array:
    """Give the inverse of `left_jacobian`, Shape (..., 3, 3)."""
    return np.asarray(np.linalg.inv(left_jacobian(phi)), dtype=float)


def from_quat_wxyz(q: Array) -> Array:
    """Map unit quaternions (scalar first), Shape (..., 4), to matrices, Shape (..., 3, 3)."""
    q = np.asarray(q, dtype=float)
    flat = Rotation.from_quat(q.reshape(-1, 4)[:, [1, 2, 3, 0]]).as_matrix()
    return flat.reshape(*q.shape[:-1], 3, 3)


def to_quat_wxyz(R: Array) -> Array:
    """Map matrices, Shape (..., 3, 3), to unit quaternions (scalar first, w >= 0)."""
    R = np.asarray(R, dtype=float)
    xyzw = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_quat(canonical=True)
    return xyzw[:, [3, 0, 1, 2]].reshape(*R.shape[:-2], 4)


def from_rpy(rpy: Array) -> Array:
    """Map roll, pitch, yaw to ``Rz(yaw) @ Ry(pitch) @ Rx(roll)``.

    Args:
        rpy: Angles [rad], Shape (..., 3).

    Returns:
        Matrices, Shape (..., 3, 3).
    """
    rpy = np.asarray(rpy, dtype=float)
    flat = Rotation.from_euler("ZYX", rpy.reshape(-1, 3)[:, ::-1]).as_matrix()
    return flat.reshape(*rpy.shape[:-1], 3, 3)


def to_rpy(R: Array) -> Array:
    """Give roll, pitch, yaw [rad], Shape (..., 3), of ``Rz(yaw) @ Ry(pitch) @ Rx(roll)``."""
    R = np.asarray(R, dtype=float)
    flat = Rotation.from_matrix(R.reshape(-1, 3, 3)).as_euler("ZYX")[:, ::-1]
    return flat.reshape(R.shape[:-1])


def slerp(R_a: Array, R_b: Array, fraction: Array) -> Array:
    """Rotate from ``R_a`` towards ``R_b`` by a fraction of the way.

    Args:
        R_a: Rotations at fraction 0, Shape (n, 3, 3).
        R_b: Rotations at fraction 1, Shape (n, 3, 3).
        fraction: Fractions, Shape (n,).

    Returns:
        Rotations, Shape (n, 3, 3).
    """
    step = log(np.swapaxes(R_a, -1, -2) @ R_b)
    return R_a @ exp(np.asarray(fraction)[..., None] * step)
