"""Pairs of sightings of one landmark some images apart, the one taken into the other's image."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self

import numpy as np

from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks
from lpet_sim.evaluation.track_kernels import Flags
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration

_NEAREST_M = 0.05
_FLAT = 1e-6


@dataclass(frozen=True, eq=False)
class Pairs:
    """What sightings and those taken over from an earlier image differ by.

    Of a pair (a, b) of one landmark's sightings, of white noise s and a walk of variance ``q^2 d``
    over the distance d, the residual ``r = z_b - transfer(z_a)`` has the covariance
    ``s^2 A + q^2 B``: ``A = I + G_ba G_ba'``, G the derivatives of what one image sees by what
    another does, and ``B = d/6 (G_ba G_ba' + 4 G_bm G_bm' + I)``, by Simpson's rule over the poses
    between, m half-way. With ``V' A V = I`` and ``V' B V = diag(ratio)`` the normalised square of r
    is ``sum (V' r)^2 / (s^2 + q^2 ratio)``.

    Attributes:
        lag: Images between, of each pair, Shape (m,).
        track: Whose pair it is, Shape (m,).
        square_px2: ``(V' r)^2`` [px^2], Shape (m, 3).
        ratio_m: ``ratio`` [m], Shape (m, 3).
        walked_m: Distance d driven between [m], Shape (m,).
    """

    lag: Ints
    track: Ints
    square_px2: Array
    ratio_m: Array
    walked_m: Array

    @classmethod
    def of(
        cls, tracks: Tracks, path: CameraPath, stereo: StereoCalibration, lags: tuple[int, ...]
    ) -> Self:
        """Pair the sightings of tracks; those that no image could show are left out.

        Args:
            tracks: The sightings, the errors that all share taken out.
            path: True poses of the camera in the images.
            stereo: The cameras as they truly are.
            lags: How many images the sightings of a pair are apart.
        """
        a, b = _apart(tracks, lags)
        T = path.T_camera_world.inverse()
        T_a_b = T[tracks.image[a]].inverse() @ T[tracks.image[b]]
        there, G, ahead = transfer(stereo, T_a_b, tracks.stereo_px[a])
        _, G_ma, between = transfer(stereo, SE3.exp(0.5 * T_a_b.log()), tracks.stereo_px[a])
        use = np.flatnonzero(ahead & between & (np.abs(np.linalg.det(G_ma)) > _FLAT))
        a, b, G, G_bm = a[use], b[use], G[use], G[use] @ np.linalg.inv(G_ma[use])
        so_far_m = driven_m(path, stereo)[tracks.image]
        walked_m, far = so_far_m[b] - so_far_m[a], G @ np.swapaxes(G, 1, 2)
        mean = (far + 4.0 * G_bm @ np.swapaxes(G_bm, 1, 2) + np.eye(3)) / 6.0
        residual, walk = tracks.stereo_px[b] - there[use], walked_m[:, None, None] * mean
        square, ratio = _diagonal(residual, np.eye(3) + far, walk)
        return cls(tracks.image[b] - tracks.image[a], tracks.track[a], square, ratio, walked_m)

    def __len__(self) -> int:
        return len(self.lag)

    def distance2(self, white_px2: float, walk_px2: float) -> Array:
        """Give the normalised squares of the residuals at s^2 [px^2], q^2 [px^2/m], Shape (m,)."""
        variance = white_px2 + walk_px2 * self.ratio_m
        return np.asarray((self.square_px2 / variance).sum(axis=1))

    def chosen(self, keep: Flags) -> Self:
        """Give the pairs chosen, Shape (m,)."""
        return type(self)(*(getattr(self, one.name)[keep] for one in fields(self)))


def transfer(stereo: StereoCalibration, T_a_b: SE3, stereo_px: Array) -> tuple[Array, Array, Flags]:
    """Predict where cameras b see what cameras a saw, without a division by the disparity.

    ``P = b (u_left - cx, v - cy, f)``, ``w = u_left - u_right``, ``P_b = R_a_b' (P - t_a_b w)``;
    ``u_left = f X/Z + cx``, ``u_right = u_left - f b w/Z``, ``v = f Y/Z + cy``.

    Args:
        stereo: The pair.
        T_a_b: Poses of cameras b in cameras a, Shape (m,).
        stereo_px: (u_left, u_right, v) in cameras a [px], Shape (m, 3).

    Returns:
        Coordinates in cameras b [px], Shape (m, 3); their derivatives by those in a, Shape
        (m, 3, 3); which points lie ahead of cameras b, Shape (m,).
    """
    f, b = stereo.focal_px, stereo.baseline_m
    u, v, w = stereo_px[:, 0], stereo_px[:, 2], stereo_px[:, 0] - stereo_px[:, 1]
    P = b * np.stack([u - stereo.cx_px, v - stereo.cy_px, np.full(len(u), f)], axis=1)
    P_b = np.einsum("mij,mi->mj", T_a_b.rotation, P - T_a_b.translation * w[:, None])
    # Columns of the derivative of (P, w) by u_left, u_right, v.
    dP, dw = np.zeros((len(u), 3, 3)), np.array([1.0, -1.0, 0.0])
    dP[:, 0, 0] = dP[:, 1, 2] = b
    dP = np.einsum("mij,mik->mjk", T_a_b.rotation, dP - T_a_b.translation[:, :, None] * dw)
    ahead = P_b[:, 2] > _NEAREST_M * np.maximum(w, 0.0)
    X, Y, Z = P_b[:, 0], P_b[:, 1], np.where(ahead, P_b[:, 2], 1.0)
    left = f * X / Z + stereo.cx_px
    px = np.stack([left, left - f * b * w / Z, f * Y / Z + stereo.cy_px], axis=1)
    scale, dZ = (f / Z)[:, None], dP[:, 2]
    d_left = scale * (dP[:, 0] - (X / Z)[:, None] * dZ)
    d_right = d_left - scale * b * (dw - (w / Z)[:, None] * dZ)
    d_v = scale * (dP[:, 1] - (Y / Z)[:, None] * dZ)
    return px, np.stack([d_left, d_right, d_v], axis=1), np.asarray(ahead)


def _apart(tracks: Tracks, lags: tuple[int, ...]) -> tuple[Ints, Ints]:
    """Give the rows of all pairs of sightings of a landmark that are so many images apart."""
    key = tracks.track * (tracks.images + max(lags)) + tracks.image
    found = [np.intersect1d(key, key - lag, True, True)[1:] for lag in lags]
    return np.concatenate([a for a, _ in found]), np.concatenate([b for _, b in found])


def driven_m(path: CameraPath, stereo: StereoCalibration) -> Array:
    """Give the distance that the body has driven up to each image [m], Shape (n,)."""
    T_body_camera = stereo.T_body_camera.se3()
    p = (path.T_camera_world.inverse() @ T_body_camera.inverse()).translation
    steps = np.linalg.norm(np.diff(p, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _diagonal(residual: Array, white: Array, walk: Array) -> tuple[Array, Array]:
    """Give squares and ratios along both covariances' common axes, Shape (m, 3) each."""
    back = np.linalg.inv(np.linalg.cholesky(white))
    ratio, U = np.linalg.eigh(back @ walk @ np.swapaxes(back, 1, 2))
    along = np.einsum("mji,mj->mi", U, (back @ residual[..., None])[..., 0])
    return along**2, np.maximum(ratio, 0.0)
