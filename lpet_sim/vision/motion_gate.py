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
_ROUNDS = 12


def fit_motion(calibration: StereoCalibration, before_px: Array, after_px: Array) -> SE3:
    """Fit ``T_after_before`` to matches by Gauss-Newton with a Geman-McClure kernel.

    The kernel starts wide and narrows (graduated non-convexity), so that a third of false matches
    does no harm.

    Args:
        calibration: The declared pair.
        before_px: Sightings in the image before, Shape (n, 3), n >= 3.
        after_px: Sightings in this image, Shape (n, 3).

    Reference:
        Yang et al., Graduated non-convexity for robust spatial perception (2020).
    """
    p = calibration.triangulate(before_px)
    T = SE3.identity()
    for k in range(_ROUNDS):
        kernel_px = _KERNEL_PX * max(1.0, 32.0 / 2.0**k)
        q = T @ p
        residual = after_px - calibration.project(q)
        J = calibration.projection_jacobian(q) @ np.concatenate(
            [np.broadcast_to(np.eye(3), (len(q), 3, 3)), -so3.hat(q)], axis=2
        )
        weight = (1 + (residual**2).sum(axis=1) / kernel_px**2) ** -2
        H = np.einsum("n,nij,nik->jk", weight, J, J, optimize=True)
        g = np.einsum("n,nij,ni->j", weight, J, residual, optimize=True)
        T = SE3.exp(np.linalg.solve(H + 1e-6 * np.eye(6), g)) @ T
    return T


def predict(
    calibration: StereoCalibration, T_after_before: SE3, before_px: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Predict sightings in this image, and tell which of them lie before the camera."""
    q = T_after_before @ calibration.triangulate(before_px)
    ahead = q[:, 2] > calibration.baseline_m
    q = np.where(ahead[:, None], q, [0.0, 0.0, 1.0])
    return calibration.project(q), ahead
