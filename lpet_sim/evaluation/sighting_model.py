"""How sightings hang on true poses and landmarks: the derivatives that a bound is made of.

A landmark is a homogeneous point in the world, ``(X, w)`` with position ``X / w``, and its three
parameters are its image coordinates ``x = (u_left, u_right, v)`` in the true camera of its best
view: ``P = b (u_left - cx, v - cy, f)``, ``w = u_left - u_right`` and ``X = R P + t w``. Nothing is
divided by the disparity, so a landmark at the horizon is as good as a near one. What a bound says
of poses does not hang on which parameters a landmark has.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream

OUTLIER_CHI2 = 40.0
"""Chi-square of a sighting at the truth (3 degrees of freedom) from which on it is an outlier; a
sound one comes out above it once in 1e8."""

_CAUCHY_SCALES = (1e6, 1e4, 1e3, 1e2, 9.0, 9.0, 9.0, 9.0)


@dataclass(frozen=True, eq=False)
class Rows:
    """Sightings of landmarks that are seen at least twice, in order of the images.

    Attributes:
        image: Which image, Shape (m,).
        landmark: Which landmark, counted from 0, Shape (m,).
        stereo_px: (u_left, u_right, v) [px], Shape (m, 3).
        sigma_px: Noise of each coordinate, 1 sigma [px], Shape (m,).
        landmark_id: The name of each landmark, Shape (n,).
    """

    image: Ints
    landmark: Ints
    stereo_px: Array
    sigma_px: Array
    landmark_id: Ints

    @classmethod
    def of(cls, sightings: SightingStream) -> Rows:
        """Take the sightings whose landmark is seen at least twice."""
        image = np.repeat(np.arange(len(sightings)), np.diff(sightings.offsets))
        ids, landmark = np.unique(sightings.landmark_id, return_inverse=True)
        everything = cls(image, landmark, sightings.stereo_px, sightings.sigma_px, ids)
        return everything.kept(np.ones(len(image), dtype=bool))

    def kept(self, mask: NDArray[np.bool_]) -> Rows:
        """Keep some rows, less those of landmarks that are then seen but once."""
        count = np.bincount(self.landmark[mask], minlength=len(self.landmark_id))
        keep = mask & (count >= 2)[self.landmark]
        names, landmark = np.unique(self.landmark[keep], return_inverse=True)
        columns = self.image[keep], landmark, self.stereo_px[keep], self.sigma_px[keep]
        return Rows(*columns, self.landmark_id[names])

    def best_view(self) -> Ints:
        """Give for each landmark its row of the largest disparity, Shape (n,)."""
        disparity = self.stereo_px[:, 0] - self.stereo_px[:, 1]
        order = np.lexsort((-disparity, self.landmark))
        first = np.searchsorted(self.landmark[order], np.arange(len(self.landmark_id)))
        return np.asarray(order[first], dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Landmarks as points of host cameras.

    Attributes:
        T_world_camera: Camera of the best view of each, Shape (n,).
        x: Image coordinates in it [px], Shape (n, 3).
    """

    T_world_camera: SE3
    x: Array


def homogeneous(calibration: StereoCalibration, x: ArrayLike) -> Array:
    """Give the homogeneous point ``(P, w)`` in the camera that sees it at x, Shape (..., 4)."""
    s, b = np.asarray(x, dtype=float), calibration.baseline_m
    P_x, P_y = b * (s[..., 0] - calibration.cx_px), b * (s[..., 2] - calibration.cy_px)
    P_z = np.full(s.shape[:-1], b * calibration.focal_px)
    return np.stack([P_x, P_y, P_z, s[..., 0] - s[..., 1]], axis=-1)


def homogeneous_jacobian(calibration: StereoCalibration) -> Array:
    """Give ``d(P, w)/d(u_left, u_right, v)``, the same everywhere, Shape (4, 3)."""
    b = calibration.baseline_m
    return np.array([[b, 0, 0], [0, 0, b], [0, 0, 0], [1, -1, 0]], dtype=float)


def seen_at(calibration: StereoCalibration, point: Array) -> Array:
    """Project homogeneous points in the camera, Shape (..., 4), to image coordinates (..., 3)."""
    f, b = calibration.focal_px, calibration.baseline_m
    X, Y, Z, w = np.moveaxis(point, -1, 0)
    u_left = f * X / Z + calibration.cx_px
    return np.stack([u_left, u_left - f * b * w / Z, f * Y / Z + calibration.cy_px], axis=-1)


def seen_at_jacobian(calibration: StereoCalibration, point: Array) -> Array:
    """Give the derivative of `seen_at` by the point, Shape (..., 3, 4)."""
    f, b = calibration.focal_px, calibration.baseline_m
    X, Y, Z, w = np.moveaxis(point, -1, 0)
    out = np.zeros((*Z.shape, 3, 4))
    out[..., 0, 0] = out[..., 1, 0] = out[..., 2, 1] = f / Z
    out[..., 0, 2], out[..., 1, 2] = -f * X / Z**2, -f * (X - b * w) / Z**2
    out[..., 1, 3], out[..., 2, 2] = -f * b / Z, -f * Y / Z**2
    return out


def into_camera(T_world_camera: SE3, point: Array) -> Array:
    """Express homogeneous points of the world, (n, 4) or (n, 4, k), in cameras (n,)."""
    columns = point if point.ndim == 3 else point[..., None]
    R, t = T_world_camera.rotation, T_world_camera.translation
    moved = columns[:, :3] - t[:, :, None] * columns[:, 3:]
    out = np.concatenate([np.swapaxes(R, 1, 2) @ moved, columns[:, 3:]], axis=1)
    return out if point.ndim == 3 else out[..., 0]


def out_of_camera(T_world_camera: SE3, point: Array) -> Array:
    """Express homogeneous points of cameras (n,), Shape (n, 4), in the world: ``R P + t w``."""
    R, t = T_world_camera.rotation, T_world_camera.translation
    X = (R @ point[:, :3, None])[..., 0] + t * point[:, 3:]
    return np.concatenate([X, point[:, 3:]], axis=1)


def in_view(
    rows: Rows, T_world_camera: SE3, landmarks: Landmarks, calibration: StereoCalibration
) -> tuple[Array, Array, Array]:
    """Give where each row's landmark truly appears, with derivatives.

    ``T_world_camera exp(xi)``, ``xi = (rho, phi)``: ``dP = -w rho + P x phi``.

    Args:
        rows: Which image sees which landmark, m.
        T_world_camera: True cameras of the images.
        landmarks: The landmarks.
        calibration: The camera pair.

    Returns:
        The homogeneous point in the camera, Shape (m, 4); the derivatives of its image coordinates
        by those in the landmark's host, Shape (m, 3, 3), and by xi, Shape (m, 3, 6).
    """
    camera, host = T_world_camera[rows.image], landmarks.T_world_camera[rows.landmark]
    world = out_of_camera(host, homogeneous(calibration, landmarks.x[rows.landmark]))
    point = into_camera(camera, world)
    pushed = seen_at_jacobian(calibration, point)
    across = _relative(camera, host) @ homogeneous_jacobian(calibration)
    by_xi = np.zeros((len(point), 4, 6))
    by_xi[:, :3, :3] = -point[:, 3, None, None] * np.eye(3)
    by_xi[:, :3, 3:] = so3.hat(point[:, :3])
    return point, pushed @ across, pushed @ by_xi


def _relative(camera: SE3, host: SE3) -> Array:
    """Give the matrices, Shape (m, 4, 4), that take homogeneous points of hosts into cameras."""
    return (camera.inverse() @ host).matrix()


def place_landmarks(
    rows: Rows, T_world_camera: SE3, calibration: StereoCalibration, p_world_of: Array
) -> Landmarks:
    """Put known landmarks, Shape (n, 3) [m], into the cameras of their best views."""
    host = T_world_camera[rows.image[rows.best_view()]]
    point = np.concatenate([p_world_of, np.ones((len(p_world_of), 1))], axis=1)
    return Landmarks(host, seen_at(calibration, into_camera(host, point)))


def triangulate(
    rows: Rows, T_world_camera: SE3, calibration: StereoCalibration
) -> tuple[Landmarks, Array]:
    """Estimate landmarks by maximum likelihood at the true poses.

    Gauss-Newton on the image coordinates in the host. Cauchy weights ``1 / (1 + chi2 / c)`` keep
    outliers from carrying a landmark away; c falls from round to round, so that a first view that
    is itself an outlier does no harm.

    Returns:
        The landmarks, and the chi-square of each row, Shape (m,).
    """
    best = rows.best_view()
    landmarks = Landmarks(T_world_camera[rows.image[best]], rows.stereo_px[best].copy())
    for scale in _CAUCHY_SCALES:
        residual, G = _residuals(rows, T_world_camera, landmarks, calibration)
        chi2 = (residual**2).sum(axis=1)
        weight = 1.0 / (1.0 + chi2 / scale)
        normal = np.zeros((len(best), 3, 3))
        right = np.zeros((len(best), 3))
        np.add.at(normal, rows.landmark, weight[:, None, None] * np.swapaxes(G, 1, 2) @ G)
        np.add.at(right, rows.landmark, weight[:, None] * np.einsum("nij,ni->nj", G, residual))
        step = np.linalg.solve(normal, right[..., None])[..., 0]
        landmarks = Landmarks(landmarks.T_world_camera, landmarks.x + step)
    residual, _ = _residuals(rows, T_world_camera, landmarks, calibration)
    return landmarks, (residual**2).sum(axis=1)


def _residuals(
    rows: Rows, T_world_camera: SE3, landmarks: Landmarks, calibration: StereoCalibration
) -> tuple[Array, Array]:
    """Give residuals and derivatives by the landmark, both in units of the noise."""
    point, G, _ = in_view(rows, T_world_camera, landmarks, calibration)
    residual = rows.stereo_px - seen_at(calibration, point)
    return residual / rows.sigma_px[:, None], G / rows.sigma_px[:, None, None]


def known_landmarks(rows: Rows, p_world_of: Mapping[int, ArrayLike]) -> Array:
    """Look up the true places of the landmarks by their names, Shape (n, 3) [m]."""
    return np.array([p_world_of[int(name)] for name in rows.landmark_id], dtype=float)
