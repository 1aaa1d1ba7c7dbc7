"""What is left of a stereo sensor's sightings at true poses, and the errors that explain it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks
from lpet_sim.evaluation.track_kernels import Flags
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration

TAILS_MAX: Final = 200.0
"""Degrees of freedom from which on Student's t is called Gaussian."""
_LONG: Final = 4


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """What is left of sightings at the best points of their landmarks.

    Attributes:
        variance_px2: Squared scales of the white noise of u_left, u_right, v under Student's t, and
            of the fixed error of each coordinate of a landmark, Shape (4,).
        variance_se_px2: Standard errors of these, Shape (4,).
        tails: Degrees of freedom of Student's t; `TAILS_MAX` is Gaussian.
        shared: Disparity bias [px], declared over true focal length less 1, the same of the
            baseline, rotation of the camera against its declared mounting [rad], Shape (6,).
        shared_se: Standard errors of these, tracks taken as independent, Shape (6,).
        point_px: Each landmark as (u_left, v, disparity) in the image of its track's middle row,
            Shape (k, 3).
        residual_px: Measured less predicted coordinates [px], Shape (m, 3).
        H: Derivatives of the coordinates by the landmark's point, Shape (m, 3, 3).
        fixed_px: Likeliest fixed error of each landmark [px], Shape (k, 3).
        fixed_px2: Expected square of it, summed over the coordinates [px^2], Shape (k,).
        left_px: What point and fixed error leave of the residuals [px], Shape (m, 3).
        taken: Share of the variance of each that both took up, Shape (m, 3).
        fits: Which sightings can be of their track's landmark by chi-square, Shape (m,).
        path: The camera's path at which this holds.
    """

    variance_px2: Array
    variance_se_px2: Array
    tails: float
    shared: Array
    shared_se: Array
    point_px: Array
    residual_px: Array
    H: Array
    fixed_px: Array
    fixed_px2: Array
    left_px: Array
    taken: Array
    fits: Flags
    path: CameraPath

    @property
    def sigma_px(self) -> Array:
        """Noise of u_left, u_right, v and the fixed error, 1 sigma [px], Shape (4,).

        The white noise is the Gaussian one that limits an estimator as much: Student's t of scale s
        in p = 3 dimensions holds the information ``(n + p) / (n + p + 2) / s^2`` on its centre.

        Reference:
            Lange, Little, Taylor, Robust statistical modeling using the t distribution (1989),
            appendix B.
        """
        return np.sqrt(self.variance_px2 * self._gaussian_share)

    @property
    def _gaussian_share(self) -> float:
        """Variance of the Gaussian noise over the squared scale of Student's t."""
        return (self.tails + 5.0) / (self.tails + 3.0)

    @property
    def sigma_se_px(self) -> Array:
        """Standard errors of `sigma_px` by the delta rule, the tails held known, Shape (4,)."""
        spread = self._gaussian_share * self.variance_se_px2
        return np.asarray(spread / (2.0 * np.maximum(self.sigma_px, 1e-3)))

    @property
    def weight(self) -> Array:
        """Weight of each sighting under Student's t, 0 where it does not fit, Shape (m,)."""
        # What point and fixed error took up is not seen in what they leave, but it is there.
        far = (self.left_px**2 / self.variance_px2[:3] + np.minimum(self.taken, 1.0)).sum(axis=1)
        return np.asarray(self.fits * (self.tails + 3.0) / (self.tails + far))

    def studentised_px(self, tracks: Tracks) -> tuple[Array, Flags]:
        """Give residuals as large as the noise that made them [px], (m, 3), and which can be used.

        Used are sightings of landmarks that are seen often enough for their residuals to tell.
        """
        use = self.fits & (tracks.total(self.fits) >= _LONG)[tracks.track]
        share = np.maximum(1.0 - self.taken, 0.1)
        return np.asarray(self.left_px / np.sqrt(share)), np.asarray(use)


def corrected(
    shared: Array, calibration: StereoCalibration, path: CameraPath
) -> tuple[Array, CameraPath]:
    """Give the camera (f, b, cx, cy), Shape (4,), and its path with shared errors taken out."""
    focal_px = calibration.focal_px / (1.0 + shared[1])
    baseline_m = calibration.baseline_m / (1.0 + shared[2])
    camera = np.array([focal_px, baseline_m, calibration.cx_px, calibration.cy_px])
    turn = SE3(so3.exp(shared[3:]), np.zeros(3))
    return camera, CameraPath.from_se3(turn @ path.T_camera_world)


def shared_design(fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration) -> Array:
    """Give the derivatives of the residuals by the shared errors, Shape (m, 3, 6).

    A disparity bias lowers u_right; a declared focal length or baseline above the true one makes
    the prediction too wide; the mounting turns points in the camera, ``dp = phi x p``.
    """
    true, predicted, p = predicted_points(fit, tracks, stereo)
    centre = np.array([stereo.cx_px, stereo.cx_px, stereo.cy_px])
    X = np.zeros((len(p), 3, 6))
    X[:, 1, 0] = -1.0
    X[:, :, 1] = -(predicted - centre)
    X[:, 1, 2] = predicted[:, 0] - predicted[:, 1]
    X[:, :, 3:] = -true.projection_jacobian(p) @ so3.hat(p)
    return X


def predicted_points(
    fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration
) -> tuple[StereoCalibration, Array, Array]:
    """Give the true pair, predicted coordinates [px] and points in the camera [m], (m, 3) each."""
    camera, _ = corrected(fit.shared, stereo, fit.path)
    true = stereo.model_copy(update={"focal_px": camera[0], "baseline_m": camera[1]})
    predicted = tracks.stereo_px + np.array([0.0, fit.shared[0], 0.0]) - fit.residual_px
    predicted[:, 1] = np.minimum(predicted[:, 1], predicted[:, 0] - 1e-3)
    return true, predicted, true.triangulate(predicted)
