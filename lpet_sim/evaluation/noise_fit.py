"""The noise and the systematic errors of a stereo sensor, from its sightings at true poses.

Each landmark's point is fitted to its track; what is left is split by restricted maximum likelihood
into white noise of u_left, u_right and v and a fixed error of each landmark (`variance_kernels`).
What front ends really make has heavy tails: the noise is Student's t with degrees of freedom that
are fitted as well, by expectation-maximisation, whose weights enter the restricted likelihood.
Errors that all sightings share (disparity bias, focal length, baseline, the camera's mounting) are
found beside them by generalised least squares, for the true motion tells them from the landmarks'
places. A point takes up most of a landmark's fixed error, so that this is known only as well as its
standard error says.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np
from scipy.special import gammaln
from scipy.stats import chi2

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.noise_model import (
    TAILS_MAX,
    NoiseFit,
    corrected,
    predicted_points,
    shared_design,
)
from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks
from lpet_sim.evaluation.track_kernels import Flags, fit_points
from lpet_sim.evaluation.variance_kernels import sum_tracks
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration

_SHARED_PRIOR: Final = np.array([5.0, 0.2, 0.2, 0.2, 0.2, 0.2])
_START_PX: Final = 1.0
_ROUNDS: Final = 15
_STILL: Final = 1e-3
_SETTLING_ROUNDS: Final = 10
_VARIANCE_MIN_PX2: Final = 1e-10
_TRACKS_MIN: Final = 10
_TAILS: Final = np.geomspace(1.0, TAILS_MAX, 80)


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
        gate_probability: Share of Gaussian sightings that would be called impossible, by the
            declared noise or the measured one, whichever is larger.

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
    for k in range(_ROUNDS):
        before = fit.sigma_px
        fit = _pointed(fit, tracks, calibration, gate, cold=k == 0)
        fit = _refined(fit, tracks, calibration, shared=True)
        if np.allclose(fit.sigma_px, before, rtol=_STILL, atol=_STILL):
            break
    if settle:
        # A pose could trade places with a fixed error that all its landmarks share: none meanwhile.
        fit = replace(fit, fixed_px=np.zeros_like(fit.fixed_px))
        for _ in range(_SETTLING_ROUNDS):
            fit = _settled(_pointed(fit, tracks, calibration, gate), tracks, calibration)
        for _ in range(_ROUNDS // 2):
            fit = _pointed(fit, tracks, calibration, gate)
            fit = _refined(fit, tracks, calibration, shared=False)
        fit = _charged(fit, tracks)
    return fit


def _blank(tracks: Tracks, path: CameraPath) -> NoiseFit:
    """Start from a pixel of white noise and no other error."""
    m = len(tracks.image)
    start = np.array([*[_START_PX**2] * 3, _VARIANCE_MIN_PX2])
    nothing, points, rows = np.zeros(6), np.zeros((len(tracks), 3)), np.zeros((m, 3))
    H, fits = np.zeros((m, 3, 3)), np.zeros(m, dtype=bool)
    shared = TAILS_MAX, nothing, nothing
    squares = np.full(len(tracks), 3 * _VARIANCE_MIN_PX2)
    per_track = points, squares
    return NoiseFit(start, start, *shared, points, rows, H, *per_track, rows, rows, fits, path)


def _pointed(
    fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration, gate: float, cold: bool = False
) -> NoiseFit:
    """Fit every landmark's point at the errors known so far."""
    camera, path = corrected(fit.shared, stereo, fit.path)
    fixed = fit.fixed_px[tracks.track]
    shift = np.array([0.0, fit.shared[0], 0.0])
    px = tracks.stereo_px + shift - fixed
    points, residual = fit.point_px.copy(), np.empty_like(fit.residual_px)
    H, fits = np.empty_like(fit.H), np.empty_like(fit.fits)
    fit_points(
        tracks.starts,
        tracks.image,
        px,
        path.R_camera_world,
        path.t_camera_world_m,
        camera,
        fit.variance_px2[:3],
        fit.tails,
        gate * np.maximum(1.0, tracks.sigma_px**2 / fit.variance_px2[:3].mean()),
        cold,
        points,
        residual,
        H,
        fits,
    )
    fits &= _held(tracks, fits)
    both = residual + fixed
    return replace(fit, point_px=points, residual_px=both, H=H, left_px=residual, fits=fits)


def _held(tracks: Tracks, fits: Flags) -> Flags:
    """Tell which rows are of tracks of which more than half fit one point, Shape (m,)."""
    held = tracks.total(fits) > 0.5 * tracks.lengths
    return np.asarray(held[tracks.track])


def _refined(fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration, shared: bool) -> NoiseFit:
    """Improve the variances, and the shared errors where asked for."""
    X = shared_design(fit, tracks, stereo)
    F, quadratic = np.zeros((4, 4)), np.zeros(4)
    sums = np.zeros((6, 6)), np.zeros(6), np.zeros((6, 6))
    fixed, left = np.zeros_like(fit.point_px), np.zeros_like(fit.left_px)
    weight, taken, squares = fit.weight, np.zeros_like(left), np.zeros_like(fit.fixed_px2)
    used = fit.residual_px, fit.H, X, weight, _width(fit), fit.variance_px2
    sum_tracks(tracks.starts, *used, F, quadratic, sums, (fixed, left, taken, squares))
    variance = solve_variances(F, quadratic)
    spread = np.sqrt(2.0 * np.diag(np.linalg.pinv(F)))
    fit = replace(
        fit,
        variance_px2=variance,
        variance_se_px2=spread,
        fixed_px=fixed,
        fixed_px2=squares,
        left_px=left,
        taken=taken,
    )
    fit = replace(fit, tails=fit_tails(fit, tracks))
    if not shared:
        return fit
    bread = np.linalg.inv(sums[0] + np.diag(_SHARED_PRIOR**-2.0))
    step_se = np.sqrt(np.diag(bread @ sums[2] @ bread))
    return replace(fit, shared=fit.shared + bread @ sums[1], shared_se=step_se)


def fit_tails(fit: NoiseFit, tracks: Tracks) -> float:
    """Find the most likely degrees of freedom of Student's t at the scales known so far."""
    px, use = fit.studentised_px(tracks)
    if not np.any(use):
        return TAILS_MAX
    far = (px[use] ** 2 / fit.variance_px2[:3]).sum(axis=1)
    likelihood = [
        np.mean(-(n + 3.0) / 2.0 * np.log1p(far / n))
        + gammaln((n + 3.0) / 2.0)
        - gammaln(n / 2.0)
        - 1.5 * np.log(n)
        for n in _TAILS
    ]
    return float(_TAILS[int(np.argmax(likelihood))])


def _width(fit: NoiseFit) -> Array:
    """Give the factors that Student's t puts on the fixed errors, whose tails are taken alike."""
    far = fit.fixed_px2 / fit.variance_px2[3]
    return np.asarray(np.sqrt((fit.tails + far) / (fit.tails + 3.0)))


def solve_variances(F: Array, quadratic: Array) -> Array:
    """Solve ``F theta = quadratic`` with every variance kept positive, Shape (4,).

    The fixed error of landmarks may come out negative where there is none; it is then held at zero.
    """
    theta = np.linalg.lstsq(F, quadratic, rcond=None)[0]
    if theta[3] < _VARIANCE_MIN_PX2:
        theta = np.append(np.linalg.lstsq(F[:3, :3], quadratic[:3], rcond=None)[0], 0.0)
    return np.maximum(theta, _VARIANCE_MIN_PX2)


def _settled(fit: NoiseFit, tracks: Tracks, stereo: StereoCalibration) -> NoiseFit:
    """Move each image's pose onto the landmarks it sees, one Gauss-Newton step."""
    true, _, p = predicted_points(fit, tracks, stereo)
    J = true.projection_jacobian(p)
    J = np.concatenate([J, -J @ so3.hat(p)], axis=2)
    use = fit.fits & (tracks.lengths > 1)[tracks.track]
    weighted = J[use] * fit.weight[use, None, None] / fit.variance_px2[:3, None]
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
