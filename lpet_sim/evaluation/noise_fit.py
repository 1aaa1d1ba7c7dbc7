"""The noise and the systematic errors of a stereo sensor, from its sightings at true poses.

Each landmark's point is fitted to its track; what is left is split by restricted maximum likelihood
into white noise of u_left, u_right and v and a fixed error of each landmark (`variance_kernels`).
Errors that all sightings share (disparity bias, focal length, baseline, the camera's mounting) are
found beside them by generalised least squares, for the true motion tells them from the landmarks'
places. A point takes up most of a landmark's fixed error, so that this is known only as well as its
standard error says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import chi2

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks
from lpet_sim.evaluation.track_kernels import Flags, fit_points
from lpet_sim.evaluation.variance_kernels import sum_tracks
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration

SHARED: Final = ("disparity_bias_px", "focal_scale_error", "baseline_scale_error")
"""Shared errors that a sensor's spec can hold; the camera's mounting follows as a rotation."""
_SHARED_PRIOR: Final = np.array([5.0, 0.2, 0.2, 0.2, 0.2, 0.2])
_START_PX: Final = 1.0
_ROUNDS: Final = 8
_SETTLING_ROUNDS: Final = 8
_VARIANCE_MIN_PX2: Final = 1e-10
_TRACKS_MIN: Final = 10


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """What is left of sightings at the best points of their landmarks.

    Attributes:
        variance_px2: Of the white noise of u_left, u_right, v, and of the fixed error of each
            coordinate of a landmark, Shape (4,).
        variance_se_px2: Standard errors of these, Shape (4,).
        shared: Disparity bias [px], declared over true focal length less 1, the same of the
            baseline, rotation of the camera against its declared mounting [rad], Shape (6,).
        shared_se: Standard errors of these, tracks taken as independent, Shape (6,).
        point_px: Each landmark as (u_left, v, disparity) in the image of its track's middle row,
            Shape (k, 3).
        residual_px: Measured less predicted coordinates [px], Shape (m, 3).
        H: Derivatives of the coordinates by the landmark's point, Shape (m, 3, 3).
        fits: Which sightings can be of their track's landmark by chi-square, Shape (m,).
        path: The camera's path at which this holds.
    """

    variance_px2: Array
    variance_se_px2: Array
    shared: Array
    shared_se: Array
    point_px: Array
    residual_px: Array
    H: Array
    fits: Flags
    path: CameraPath

    @property
    def sigma_px(self) -> Array:
        """Standard deviations of u_left, u_right, v and of the fixed error [px], Shape (4,)."""
        return np.sqrt(self.variance_px2)

    @property
    def sigma_se_px(self) -> Array:
        """Standard errors of `sigma_px` by the delta rule, Shape (4,)."""
        return np.asarray(self.variance_se_px2 / (2.0 * np.maximum(self.sigma_px, 1e-3)))


def fit_noise(
    tracks: Tracks,
    path: CameraPath,
    calibration: StereoCalibration,
    settle: bool = False,
    gate_probability: float = 1e-6,
) -> NoiseFit:
    """Measure white noise, fixed errors of landmarks and shared errors of a stereo sensor.

    Args:
        tracks: The sightings.
        path: True poses of the camera at the images.
        calibration: The declared pair.
        settle: Take out of the residuals what all landmarks of an image have in common, for truth
            that is itself measured. Shared errors are found at the given poses all the same.
        gate_probability: Share of Gaussian sightings that would be called impossible.

    Raises:
        RecordingError: Too few landmarks are seen more than once.
    """
    if np.sum(tracks.lengths > 1) < _TRACKS_MIN:
        raise RecordingError(
            f"{np.sum(tracks.lengths > 1)} landmarks are seen more than once; "
            f"a sensor is measured on at least {_TRACKS_MIN}"
        )
    gate = float(chi2.isf(gate_probability, 3))
    fit = _blank(tracks, path)
    for _ in range(_ROUNDS):
        fit = _refined(_pointed(fit, tracks, calibration, gate), tracks, calibration, shared=True)
    if settle:
        for _ in range(_SETTLING_ROUNDS):
            fit = _settled(_pointed(fit, tracks, calibration, gate), tracks, calibration)
            fit = _refined(_pointed(fit, tracks, calibration, gate), tracks, calibration, False)
        fit = _charged(fit, tracks)
    return fit


def _blank(tracks: Tracks, path: CameraPath) -> NoiseFit:
    """Start from a pixel of white noise and no other error."""
    m = len(tracks.image)
    start = np.array([*[_START_PX**2] * 3, _VARIANCE_MIN_PX2])
    nothing, points = np.zeros(6), np.zeros((len(tracks), 3))
    residual, H, fits = np.zeros((m, 3)), np.zeros((m, 3, 3)), np.zeros(m, dtype=bool)
    return NoiseFit(start, start, nothing, nothing, points, residual, H, fits, path)


def corrected(
    shared: Array, calibration: StereoCalibration, path: CameraPath
) -> tuple[Array, CameraPath]:
    """Give the camera (f, b, cx, cy), Shape (4,), and its path with shared errors taken out."""
    focal_px = calibration.focal_px / (1.0 + shared[1])
    baseline_m = calibration.baseline_m / (1.0 + shared[2])
    camera = np.array([focal_px, baseline_m, calibration.cx_px, calibration.cy_px])
    turn = SE3(so3.exp(shared[3:]), np.zeros(3))
    return camera, CameraPath.from_se3(turn @ path.T_camera_world)


def _pointed(fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration, gate: float) -> NoiseFit:
    """Fit every landmark's point at the errors known so far."""
    camera, path = corrected(fit.shared, stereo, fit.path)
    px = tracks.stereo_px + np.array([0.0, fit.shared[0], 0.0])
    points, residual = np.empty_like(fit.point_px), np.empty_like(fit.residual_px)
    H, fits = np.empty_like(fit.H), np.empty_like(fit.fits)
    poses = path.R_camera_world, path.t_camera_world_m
    variance = fit.variance_px2[:3] + fit.variance_px2[3]
    image = tracks.image
    fit_points(
        tracks.starts, image, px, *poses, camera, variance, gate, points, residual, H, fits
    )
    fits &= _held(tracks, fits)
    return replace(fit, point_px=points, residual_px=residual, H=H, fits=fits)


def _held(tracks: Tracks, fits: Flags) -> Flags:
    """Tell which rows are of tracks of which more than half fit one point, Shape (m,)."""
    held = tracks.total(fits) > 0.5 * tracks.lengths
    return np.asarray(held[tracks.track])


def _refined(fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration, shared: bool) -> NoiseFit:
    """Improve the variances, and the shared errors where asked for."""
    X = shared_design(fit, tracks, stereo)
    F, quadratic = np.zeros((4, 4)), np.zeros(4)
    sums = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    used = fit.residual_px, fit.H, X, fit.fits
    sum_tracks(tracks.starts, *used, fit.variance_px2, F, quadratic, sums)
    variance = solve_variances(F, quadratic)
    spread = np.sqrt(2.0 * np.diag(np.linalg.pinv(F)))
    fit = replace(fit, variance_px2=variance, variance_se_px2=spread)
    if not shared:
        return fit
    bread = np.linalg.inv(sums[0] + np.diag(_SHARED_PRIOR**-2.0))
    step_se = np.sqrt(np.diag(bread @ sums[2] @ bread))
    return replace(fit, shared=fit.shared + bread @ sums[1], shared_se=step_se)


def solve_variances(F: Array, quadratic: Array) -> Array:
    """Solve ``F theta = quadratic`` with every variance kept positive, Shape (4,).

    The fixed error of landmarks may come out negative where there is none; it is then held at zero.
    """
    theta = np.linalg.lstsq(F, quadratic, rcond=None)[0]
    if theta[3] < _VARIANCE_MIN_PX2:
        theta = np.append(np.linalg.lstsq(F[:3, :3], quadratic[:3], rcond=None)[0], 0.0)
    return np.maximum(theta, _VARIANCE_MIN_PX2)


def shared_design(fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration) -> Array:
    """Give the derivatives of the residuals by the shared errors, Shape (m, 3, 6).

    A disparity bias lowers u_right; a declared focal length or baseline above the true one makes
    the prediction too wide; the mounting turns points in the camera, ``dp = phi x p``.
    """
    true, predicted, p = _predicted(fit, tracks, stereo)
    centre = np.array([stereo.cx_px, stereo.cx_px, stereo.cy_px])
    X = np.zeros((len(p), 3, 6))
    X[:, 1, 0] = -1.0
    X[:, :, 1] = -(predicted - centre)
    X[:, 1, 2] = predicted[:, 0] - predicted[:, 1]
    X[:, :, 3:] = -true.projection_jacobian(p) @ so3.hat(p)
    return X


def _predicted(
    fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration
) -> tuple[StereoCalibration, Array, Array]:
    """Give the true pair, predicted coordinates [px] and points in the camera [m], (m, 3) each."""
    camera, _ = corrected(fit.shared, stereo, fit.path)
    true = stereo.model_copy(update={"focal_px": camera[0], "baseline_m": camera[1]})
    predicted = tracks.stereo_px + np.array([0.0, fit.shared[0], 0.0]) - fit.residual_px
    predicted[:, 1] = np.minimum(predicted[:, 1], predicted[:, 0] - 1e-3)
    return true, predicted, true.triangulate(predicted)


def _settled(fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration) -> NoiseFit:
    """Move each image's pose onto the landmarks it sees, one Gauss-Newton step."""
    true, _, p = _predicted(fit, tracks, stereo)
    J = true.projection_jacobian(p)
    J = np.concatenate([J, -J @ so3.hat(p)], axis=2)
    use = fit.fits & (tracks.lengths > 1)[tracks.track]
    weighted = J[use] / fit.variance_px2[:3, None]
    normal, right = np.zeros((tracks.images, 6, 6)), np.zeros((tracks.images, 6))
    np.add.at(normal, tracks.image[use], np.einsum("mki,mkj->mij", weighted, J[use]))
    np.add.at(right, tracks.image[use], np.einsum("mki,mk->mi", weighted, fit.residual_px[use]))
    # An image with too few landmarks stays nearly where it is.
    step = np.linalg.solve(normal + 1e-3 * np.eye(6), right[..., None])[..., 0]
    _, path = corrected(fit.shared, stereo, fit.path)
    moved = SE3.exp(step) @ path.T_camera_world
    back = SE3(so3.exp(-fit.shared[3:]), np.zeros(3))
    return replace(fit, path=CameraPath.from_se3(back @ moved))


def _charged(fit: NoiseFit, tracks: Tracks) -> NoiseFit:
    """Raise the variances for the six parameters that each image's pose took up."""
    used = fit.fits & (tracks.lengths > 1)[tracks.track]
    many = tracks.total(used)
    freedom = float(np.sum(3 * many[many > 1] - 3))
    factor = freedom / max(freedom - 6.0 * len(np.unique(tracks.image[used])), 1.0)
    variance = fit.variance_px2 * np.array([factor, factor, factor, 1.0])
    return replace(fit, variance_px2=variance)
