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
def push(
    camera: Array, P: tuple[float, float, float, float], dP: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """Give how the projection (u_left, u_right, v) of ``(P, w)`` changes with ``(dP, dw)``.

    ``u_left = f X/Z + cx``, ``u_right = f (X - b w)/Z + cx``, ``v = f Y/Z + cy``.
    """
    scale = camera[0] / P[2]
    du_left = scale * (dP[0] - dP[2] * P[0] / P[2])
    parallax = scale * camera[3] * (dP[3] - dP[2] * P[3] / P[2])
    return du_left, du_left - parallax, scale * (dP[1] - dP[2] * P[1] / P[2])


@njit(cache=True)
def transfer_into(
    camera: Array, R_a_b: Array, t_back: Array, x: Array, predicted: Array, G: Array, J: Array
) -> None:
    """Predict where camera b sees what camera a saw at x, with both Jacobians, in place.

    With ``P_b = R_a_b' P - t_back w`` and the right perturbation ``T_a_b exp(xi)``, ``xi = (rho,
    phi)``: ``dP_b = -w rho + P_b x phi``.

    Args:
        camera: `camera_vector`.
        R_a_b: Rotation of camera b in camera a, Shape (3, 3).
        t_back: ``R_a_b' t_a_b`` [m], Shape (3,).
        x: Sighting in camera a [px], Shape (3,).
        predicted: Takes the sighting in camera b [px], Shape (3,).
        G: Takes its derivative by x, Shape (3, 3).
        J: Takes its derivative by xi [px/m, px/rad], Shape (3, 6).
    """
    focal, cx, cy, b = camera
    r, t, w = R_a_b, t_back, x[0] - x[1]
    p0, p1, p2 = b * (x[0] - cx), b * (x[2] - cy), b * focal
    X = r[0, 0] * p0 + r[1, 0] * p1 + r[2, 0] * p2 - t[0] * w
    Y = r[0, 1] * p0 + r[1, 1] * p1 + r[2, 1] * p2 - t[1] * w
    Z = r[0, 2] * p0 + r[1, 2] * p1 + r[2, 2] * p2 - t[2] * w
    P = (X, Y, Z, w)
    predicted[0], predicted[2] = focal * X / Z + cx, focal * Y / Z + cy
    predicted[1] = predicted[0] - focal * b * w / Z
    along_u = (b * r[0, 0] - t[0], b * r[0, 1] - t[1], b * r[0, 2] - t[2], 1.0)
    G[0, 0], G[1, 0], G[2, 0] = push(camera, P, along_u)
    G[0, 1], G[1, 1], G[2, 1] = push(camera, P, (t[0], t[1], t[2], -1.0))
    G[0, 2], G[1, 2], G[2, 2] = push(camera, P, (b * r[1, 0], b * r[1, 1], b * r[1, 2], 0.0))
    J[0, 0], J[1, 0], J[2, 0] = push(camera, P, (-w, 0.0, 0.0, 0.0))
    J[0, 1], J[1, 1], J[2, 1] = push(camera, P, (0.0, -w, 0.0, 0.0))
    J[0, 2], J[1, 2], J[2, 2] = push(camera, P, (0.0, 0.0, -w, 0.0))
    J[0, 3], J[1, 3], J[2, 3] = push(camera, P, (0.0, Z, -Y, 0.0))
    J[0, 4], J[1, 4], J[2, 4] = push(camera, P, (-Z, 0.0, X, 0.0))
    J[0, 5], J[1, 5], J[2, 5] = push(camera, P, (Y, -X, 0.0, 0.0))


@njit(cache=True)
def transfer_with_jacobians(
    camera: Array, R_a_b: Array, t_a_b: Array, stereo_px: Array
) -> tuple[Array, Array, Array]:
    """Predict where camera b sees what camera a saw, with both Jacobians; see `transfer_into`.

    Args:
        camera: `camera_vector`.
        R_a_b: Rotation of camera b in camera a, Shape (3, 3).
        t_a_b: Position of camera b in camera a [m], Shape (3,).
        stereo_px: Sightings in camera a [px], Shape (n, 3).

    Returns:
        Sightings in camera b [px], Shape (n, 3); their derivatives by those in a, Shape
        (n, 3, 3); their derivatives by xi, Shape (n, 3, 6).
    """
    n = len(stereo_px)
    predicted, G, J = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 3, 6))
    t_back = R_a_b.T @ t_a_b
    for i in range(n):
        transfer_into(camera, R_a_b, t_back, stereo_px[i], predicted[i], G[i], J[i])
    return predicted, G, J


def transfer(calibration: StereoCalibration, T_a_b: SE3, stereo_px: Array) -> Array:
    """Predict where camera b sees what camera a saw, Shape (n, 3) [px].

    Args:
        calibration: The pair, the same at both poses.
        T_a_b: Pose of camera b in camera a.
        stereo_px: (u_left, u_right, v) in camera a [px], Shape (n, 3).
    """
    camera = camera_vector(calibration)
    R, t = np.array(T_a_b.rotation), np.array(T_a_b.translation)
    return transfer_with_jacobians(camera, R, t, np.array(stereo_px, dtype=float))[0]
