"""How a landmark seen by a stereo pair looks from another pose, with Jacobians.

A sighting ``x = (u_left, u_right, v)`` stands for the homogeneous point ``P = b (u_left - cx,
v - cy, f)`` with weight ``w = u_left - u_right``: the point in the camera is ``P / w``. Nothing is
divided by the disparity, so points at the horizon are as good as near ones. Seen from a camera at
``T_a_b`` the point is ``R_a_b' (P - t_a_b w)`` with the same weight.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration


def camera_vector(calibration: StereoCalibration) -> Array:
    """Give ``(focal_px, cx_px, cy_px, baseline_m)`` for the compiled functions, Shape (4,)."""
    c = calibration
    return np.array([c.focal_px, c.cx_px, c.cy_px, c.baseline_m])


@njit(cache=True)
def lift(camera: Array, x: Array) -> tuple[Array, float]:
    """Give the homogeneous point ``(P, w)`` of a sighting.

    Args:
        camera: `camera_vector`.
        x: (u_left, u_right, v) [px], Shape (3,).
    """
    focal, cx, cy, baseline = camera
    return baseline * np.array([x[0] - cx, x[2] - cy, focal]), x[0] - x[1]


@njit(cache=True)
def view(camera: Array, P: Array, w: float) -> Array:
    """Project a homogeneous point of the camera to (u_left, u_right, v) [px], Shape (3,)."""
    focal, cx, cy, baseline = camera
    u_left = focal * P[0] / P[2] + cx
    return np.array([u_left, u_left - focal * baseline * w / P[2], focal * P[1] / P[2] + cy])


@njit(cache=True)
def view_jacobian(camera: Array, P: Array, w: float) -> Array:
    """Give d(u_left, u_right, v)/d(P, w), Shape (3, 4)."""
    focal, _, _, baseline = camera
    k = focal / P[2]
    out = np.zeros((3, 4))
    out[0, 0] = out[1, 0] = out[2, 1] = k
    out[0, 2] = -k * P[0] / P[2]
    out[1, 2] = -k * (P[0] - baseline * w) / P[2]
    out[1, 3] = -k * baseline
    out[2, 2] = -k * P[1] / P[2]
    return out


@njit(cache=True)
def transfer_with_jacobians(
    camera: Array, R_a_b: Array, t_a_b: Array, x: Array
) -> tuple[Array, Array, Array]:
    """Predict where camera b sees what camera a saw at x, with both Jacobians.

    With ``P_b = R_a_b' (P - t_a_b w)`` and the right perturbation ``T_a_b exp(xi)``, ``xi =
    (rho, phi)``: ``dP_b = -w rho + P_b x phi``.

    Args:
        camera: `camera_vector`.
        R_a_b: Rotation of camera b in camera a, Shape (3, 3).
        t_a_b: Position of camera b in camera a [m], Shape (3,).
        x: Sighting in camera a [px], Shape (3,).

    Returns:
        The sighting in camera b [px], Shape (3,); its derivative by x, Shape (3, 3); its
        derivative by xi [px/m, px/rad], Shape (3, 6).
    """
    P, w = lift(camera, x)
    P_b = R_a_b.T @ (P - t_a_b * w)
    by_P = view_jacobian(camera, P_b, w)
    t_back = R_a_b.T @ t_a_b
    dP = np.zeros((4, 3))
    dP[:3, 0] = camera[3] * R_a_b[0] - t_back
    dP[:3, 1] = t_back
    dP[:3, 2] = camera[3] * R_a_b[1]
    dP[3, 0], dP[3, 1] = 1.0, -1.0
    dxi = np.zeros((4, 6))
    dxi[0, 0] = dxi[1, 1] = dxi[2, 2] = -w
    dxi[0, 4], dxi[0, 5] = -P_b[2], P_b[1]
    dxi[1, 3], dxi[1, 5] = P_b[2], -P_b[0]
    dxi[2, 3], dxi[2, 4] = -P_b[1], P_b[0]
    return view(camera, P_b, w), by_P @ dP, by_P @ dxi


def transfer(calibration: StereoCalibration, T_a_b: SE3, stereo_px: Array) -> Array:
    """Predict where camera b sees what camera a saw, Shape (n, 3) [px].

    Args:
        calibration: The pair, the same at both poses.
        T_a_b: Pose of camera b in camera a.
        stereo_px: (u_left, u_right, v) in camera a [px], Shape (n, 3).
    """
    camera = camera_vector(calibration)
    R, t = np.ascontiguousarray(T_a_b.rotation), np.ascontiguousarray(T_a_b.translation)
    rows = [transfer_with_jacobians(camera, R, t, x)[0] for x in np.asarray(stereo_px, float)]
    return np.array(rows).reshape(-1, 3)
