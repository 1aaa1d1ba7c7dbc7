"""A rigid motion fitted to matches: it finds the false ones and predicts where lost ones would be.

This is no localization: nothing of it leaves the front end. It only says that what does not move
is seen to move together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.calibration import StereoCalibration

Array = NDArray[np.float64]

_KERNEL_PX = 2.0
_WIDEST_PX = 64.0
_ROUNDS = 9
_MATCHES = 300


def fit_motion(calibration: StereoCalibration, before_px: Array, after_px: Array) -> SE3:
    """Fit ``T_after_before`` to matches by Gauss-Newton with a Geman-McClure kernel.

    The kernel starts wide and narrows by half each round (graduated non-convexity), so that a third
    of false matches does no harm.

    Args:
        calibration: The declared pair.
        before_px: Sightings in the image before, Shape (n, 3), n >= 3.
        after_px: Sightings in this image, Shape (n, 3).

    Reference:
        Yang et al., Graduated non-convexity for robust spatial perception (2020).
    """
    every = max(1, len(before_px) // _MATCHES)
    p, after = calibration.triangulate(before_px[::every]), after_px[::every]
    T = SE3.identity()
    for k in range(_ROUNDS):
        kernel_px = max(_KERNEL_PX, _WIDEST_PX / 2**k)
        q = T @ p
        residual = after - calibration.project(q)
        weight = (1 + (residual**2).sum(axis=1) / kernel_px**2) ** -1
        xi = _step(calibration.projection_jacobian(q), q, residual, weight)
        T = SE3.exp(xi) @ T
    return T


def _step(by_point: Array, q: Array, residual: Array, root_weight: Array) -> Array:
    """Solve one weighted step of a left perturbation, ``dq = rho + phi x q``, Shape (6,)."""
    J = np.concatenate([by_point, -by_point @ so3.hat(q)], axis=2) * root_weight[:, None, None]
    J = J.reshape(-1, 6)
    H = J.T @ J + 1e-6 * np.eye(6)
    return np.asarray(np.linalg.solve(H, J.T @ (residual * root_weight[:, None]).ravel()))


def predict(
    calibration: StereoCalibration, T_after_before: SE3, before_px: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Predict sightings in this image, and tell which of them lie before the camera."""
    q = T_after_before @ calibration.triangulate(before_px)
    ahead = q[:, 2] > calibration.baseline_m
    q = np.where(ahead[:, None], q, [0.0, 0.0, 1.0])
    return calibration.project(q), ahead
