"""Measure a stereo sensor with its front end: sightings and truth in, the sensor's figures out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.drift_fit import DriftFit, fit_drift
from lpet_sim.evaluation.equivalent_noise import equivalent_sigma_px
from lpet_sim.evaluation.noise_fit import fit_noise
from lpet_sim.evaluation.noise_model import NoiseFit, corrected
from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.trajectory import Trajectory

LAGS: Final = 10
FAR_M: Final = 60.0
"""From here on landmarks are on far relief, as in the landmark sensor."""
RANGE_SHARES: Final = (0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99)
_LONG_TRACK: Final = 15
_STEPPED: Final = 8
_BINS: Final = 6


@dataclass(frozen=True, eq=False)
class NoiseFigures:
    """How large the noise is, and what of it a Gaussian cannot carry.

    Attributes:
        sigma_px: White noise of u_left, u_right and v of a Gaussian sensor on which an estimator
            that trusts the declared noise would do as well, 1 sigma [px], Shape (3,).
        step_px: The same of what differs between consecutive images alone, Shape (3,): what is left
            of it changes slowly, and is more like a fixed error.
        rms_px: Root mean square of the noise of sightings that fit, Shape (3,).
        core_px: Noise by Student's t (`NoiseFit.sigma_px`) with its standard error, Shape (3, 2).
        tails: Degrees of freedom of that t.
        fixed_px: Fixed error of each coordinate of a landmark, 1 sigma, and its standard error.
        declared_px: Declared noise whose weight is the sightings' mean weight.
        kurtosis: Of u_left, u_right and v, 3 where Gaussian, Shape (3,).
        beyond_3_sigma: Share beyond three root mean squares, 0.0027 where Gaussian, Shape (3,).
        lag_correlation: Correlation of what point and fixed error leave of a track's residuals,
            against the number of images between, Shape (LAGS, 3); near 0 where the noise is white.
        by_range: Range [m] and root mean square noise [px] of six equal shares, Shape (6, 2).
    """

    sigma_px: Array
    step_px: Array
    rms_px: Array
    core_px: Array
    tails: float
    fixed_px: tuple[float, float]
    declared_px: float
    kurtosis: Array
    beyond_3_sigma: Array
    lag_correlation: Array
    by_range: Array


@dataclass(frozen=True, eq=False)
class TrackFigures:
    """How many landmarks are seen, how often, and where.

    Attributes:
        images: Number of images.
        period_s: Median time between them [s].
        landmarks: Number of different landmarks.
        sightings: Number of sightings of each image, Shape (n,).
        impossible: Share of sightings that cannot be of their track's landmark.
        seen_next: Share of sightings whose landmark is seen again in the next image, of those whose
            landmark is in its view.
        seen_between: Share of images with a sighting between a track's first and last one.
        lost: Share of sightings that are their track's last although the next image views the
            landmark's place.
        length: Mean number of sightings of a landmark.
        range_m: Quantiles `RANGE_SHARES` of the distance of landmarks from the left eye [m].
        range_near_m: Range that 99 % of those nearer than `FAR_M` do not exceed [m].
        far: Share of sightings that are further than `FAR_M`.
        border_px: Distance from the images' edge that 99.5 % of the sightings keep [px].
    """

    images: int
    period_s: float
    landmarks: int
    sightings: Array
    impossible: float
    seen_next: float
    seen_between: float
    lost: float
    length: float
    range_m: Array
    range_near_m: float
    far: float
    border_px: float


@dataclass(frozen=True, eq=False)
class SensorFit:
    """All that is measured of a sensor.

    Attributes:
        noise: Of its image coordinates.
        tracks: Of its landmarks.
        shared: Disparity bias [px], focal and baseline scale errors (declared over true, less 1),
            rotation of the camera against its mounting [rad], Shape (6,).
        shared_se: Their standard errors, Shape (6,).
        settled: Whether each image's common motion was taken out of the noise.
        drift: How far tracks slide; None where the truth is itself measured, for then its own error
            grows with the distance, and where landmarks are seen too seldom to tell.
        declared_drift_px: What the stream declares of it, mean over images [px/sqrt(m)].
        residual_px: Noise of each sighting that can tell [px], Shape (m, 3), for histograms.
        p_world: Places of the landmarks in order of their ids [m], Shape (k, 3).
    """

    noise: NoiseFigures
    tracks: TrackFigures
    shared: Array
    shared_se: Array
    settled: bool
    drift: DriftFit | None
    declared_drift_px: float
    residual_px: Array
    p_world: Array


def fit_sensor(
    sightings: SightingStream,
    truth: Trajectory,
    calibration: StereoCalibration,
    settle: bool = False,
) -> SensorFit:
    """Measure a sensor.

    Args:
        sightings: What its front end saw.
        truth: True poses of the body.
        calibration: The declared pair.
        settle: Whether the truth is itself measured, so that what all landmarks of an image have in
            common is its error and not the sensor's.

    Raises:
        RecordingError: There are too few sightings, or an image lies outside the truth.
    """
    tracks = Tracks.of(sightings)
    path = CameraPath.of(truth, sightings.t_ns, calibration)
    fit = fit_noise(tracks, path, calibration, settle)
    px, use = fit.studentised_px(tracks)
    noise = _noise_figures(fit, tracks, calibration)
    shown = _track_figures(fit, tracks, sightings, calibration)
    _, p_world = places(fit, tracks, calibration)
    drift = None if settle else _drift(fit, tracks, calibration)
    slides = settle, drift, float(np.mean(sightings.drift_px))
    return SensorFit(noise, shown, fit.shared, fit.shared_se, *slides, px[use], p_world)


def _drift(fit: NoiseFit, tracks: Tracks, calibration: StereoCalibration) -> DriftFit | None:
    """Measure how far tracks slide once the errors that all share are taken out."""
    (focal_px, baseline_m, _, _), path = corrected(fit.shared, calibration, fit.path)
    true = {"focal_px": float(focal_px), "baseline_m": float(baseline_m)}
    px = tracks.stereo_px + np.array([0.0, fit.shared[0], 0.0])
    try:
        stereo = calibration.model_copy(update=true)
        return fit_drift(replace(tracks, stereo_px=px), path, stereo)
    except RecordingError:
        return None


def _noise_figures(fit: NoiseFit, tracks: Tracks, calibration: StereoCalibration) -> NoiseFigures:
    px, use = fit.studentised_px(tracks)
    step_px = _step_sigma_px(fit, tracks)
    px, declared = px[use], tracks.sigma_px[use]
    rms = np.sqrt(np.mean(px**2, axis=0))
    return NoiseFigures(
        sigma_px=equivalent_sigma_px(px, declared),
        step_px=step_px,
        rms_px=rms,
        core_px=np.column_stack([fit.sigma_px[:3], fit.sigma_se_px[:3]]),
        tails=fit.tails,
        fixed_px=(float(fit.sigma_px[3]), float(fit.sigma_se_px[3])),
        declared_px=float(1.0 / np.sqrt(np.mean(tracks.sigma_px**-2.0))),
        kurtosis=np.mean(px**4, axis=0) / rms**4,
        beyond_3_sigma=np.mean(np.abs(px) > 3.0 * rms, axis=0),
        lag_correlation=lag_correlation(fit, tracks),
        by_range=_noise_by_range(px, _ranges_m(fit, tracks, calibration)[use]),
    )


def _step_sigma_px(fit: NoiseFit, tracks: Tracks) -> Array:
    """Measure the noise by differences between consecutive images of long tracks, Shape (3,)."""
    px, _ = fit.studentised_px(tracks)
    track, use = tracks.track, fit.fits & (tracks.total(fit.fits) >= _STEPPED)[tracks.track]
    pair = use[1:] & use[:-1] & (track[1:] == track[:-1]) & (np.diff(tracks.image) == 1)
    if not np.any(pair):
        return np.full(3, np.nan)
    sigma2 = tracks.sigma_px**2
    both = np.sqrt(sigma2[1:] + sigma2[:-1])[pair]
    return equivalent_sigma_px((px[1:] - px[:-1])[pair], both) / np.sqrt(2.0)


def lag_correlation(fit: NoiseFit, tracks: Tracks) -> Array:
    """Correlate what point and fixed error leave over 1 to `LAGS` images, Shape (LAGS, 3)."""
    track, px = tracks.track, fit.left_px
    use = fit.fits & (tracks.total(fit.fits) >= _LONG_TRACK)[track]
    product, square = np.zeros((LAGS + 1, 3)), np.zeros((LAGS + 1, 3))
    for ahead in range(1, LAGS + 1):
        a, b = slice(None, -ahead), slice(ahead, None)
        apart = tracks.image[b] - tracks.image[a]
        pair = use[a] & use[b] & (track[a] == track[b]) & (apart <= LAGS)
        np.add.at(product, apart[pair], px[a][pair] * px[b][pair])
        np.add.at(square, apart[pair], 0.5 * (px[a][pair] ** 2 + px[b][pair] ** 2))
    return np.asarray(product[1:] / np.maximum(square[1:], 1e-12))


def _ranges_m(fit: NoiseFit, tracks: Tracks, calibration: StereoCalibration) -> Array:
    """Give the distance of each sighting's landmark from the left eye [m], Shape (m,)."""
    _, p_world = places(fit, tracks, calibration)
    return np.asarray(
        np.linalg.norm(fit.path.seen_from(tracks.image, p_world[tracks.track]), axis=1)
    )


def places(
    fit: NoiseFit, tracks: Tracks, calibration: StereoCalibration
) -> tuple[StereoCalibration, Array]:
    """Give the pair without its shared errors, and every landmark's place [m], Shape (k, 3)."""
    true = calibration.model_copy(
        update={
            "focal_px": calibration.focal_px / (1.0 + fit.shared[1]),
            "baseline_m": calibration.baseline_m / (1.0 + fit.shared[2]),
        }
    )
    q = fit.point_px
    p = true.triangulate(np.stack([q[:, 0], q[:, 0] - q[:, 2], q[:, 1]], axis=1))
    middle = tracks.image[tracks.starts[:-1] + tracks.lengths // 2]
    return true, np.asarray(fit.path.T_camera_world[middle].inverse() @ p)


def _noise_by_range(px: Array, range_m: Array) -> Array:
    order = np.array_split(np.argsort(range_m), _BINS)
    rows = [[np.median(range_m[k]), np.sqrt(np.mean(px[k] ** 2))] for k in order if len(k)]
    return np.array(rows)


def _track_figures(
    fit: NoiseFit, tracks: Tracks, sightings: SightingStream, calibration: StereoCalibration
) -> TrackFigures:
    many = tracks.lengths >= 3
    told = many[tracks.track]
    span = tracks.image[tracks.starts[1:] - 1] - tracks.image[tracks.starts[:-1]] + 1
    inner = np.sum(span[many] - 2)
    edge = np.minimum(tracks.stereo_px, _size(calibration) - 1.0 - tracks.stereo_px).min(axis=1)
    border_px = max(float(np.quantile(edge, 0.005)), 0.0)
    seen_next, lost = _seen_next(fit, tracks, calibration, border_px)
    range_m = _ranges_m(fit, tracks, calibration)[fit.fits]
    near_m = range_m[range_m < FAR_M]
    return TrackFigures(
        images=len(sightings),
        period_s=float(np.median(np.diff(sightings.t_s))) if len(sightings) > 1 else 0.0,
        landmarks=len(tracks),
        sightings=np.diff(sightings.offsets).astype(float),
        impossible=float(np.mean(~fit.fits[told])) if np.any(told) else 0.0,
        seen_next=seen_next,
        seen_between=float(np.sum(tracks.lengths[many] - 2) / inner) if inner > 0 else 1.0,
        lost=lost,
        length=float(tracks.lengths.mean()),
        range_m=np.quantile(range_m, RANGE_SHARES),
        range_near_m=float(np.quantile(near_m, 0.99)) if len(near_m) else FAR_M,
        far=float(np.mean(range_m >= FAR_M)),
        border_px=border_px,
    )


def _size(calibration: StereoCalibration) -> Array:
    return np.array([calibration.width_px, calibration.width_px, calibration.height_px], float)


def _seen_next(
    fit: NoiseFit, tracks: Tracks, calibration: StereoCalibration, border_px: float
) -> tuple[float, float]:
    """Tell how often a landmark in view is seen in the next image, and how often never again."""
    true, p_world = places(fit, tracks, calibration)
    rows = np.flatnonzero(fit.fits & (tracks.image < tracks.images - 1))
    p = fit.path.seen_from(tracks.image[rows] + 1, p_world[tracks.track[rows]])
    ahead = p[:, 2] > 0.1
    rows, px = rows[ahead], true.project(p[ahead])
    inside = np.all((px >= border_px) & (px <= _size(calibration) - 1.0 - border_px), axis=1)
    rows = rows[inside]
    after = np.minimum(rows + 1, len(tracks.image) - 1)
    goes_on = (after > rows) & (tracks.track[after] == tracks.track[rows])
    again = goes_on & (tracks.image[after] == tracks.image[rows] + 1)
    if len(rows) == 0:
        return 0.0, 0.0
    return float(again.mean()), float(np.mean(~goes_on))
