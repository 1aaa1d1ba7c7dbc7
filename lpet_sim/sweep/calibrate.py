"""Measure a recording's sensor, so that the landmark sensor can stand for its front end."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.figures import save
from lpet_sim.evaluation.sensor_fit import FAR_M, SensorFit, fit_sensor
from lpet_sim.evaluation.sensor_report import plot_sensor
from lpet_sim.evaluation.sighting_tracks import since
from lpet_sim.outputs import whole_file
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.sensors.landmark_spec import (
    LandmarkFieldSpec,
    LandmarkSensorSpec,
    SightingNoiseSpec,
    VisibilitySpec,
)
from lpet_sim.sweep.sensing import sense_recording

_SURE: Final = 3.0
"""A shared error enters the spec only if it is this many standard errors from none."""
_DENSITY_MAX_PER_M2: Final = 10.0
_PROBE_PER_M2: Final = 1.0
_PROBE_PERIODS: Final = 8
_SIGMA_MIN_PX: Final = 1e-3


@dataclass(frozen=True, eq=False)
class Calibrated:
    """A recording's sensor.

    Attributes:
        fit: What was measured.
        spec: The landmark sensor that stands for it.
        sensed: The landmark sensor on the same traverse, measured likewise; None for real data,
            where no terrain is known.
    """

    fit: SensorFit
    spec: LandmarkSensorSpec
    sensed: SensorFit | None


def calibrate_sensor(
    recording: Recording, from_image: int = 0, seed: int = 0, progress: Progress = silent
) -> Calibrated:
    """Measure the sensor of a recording with truth and sightings.

    For real data the truth is measured too: what all landmarks of an image have in common is then
    left out of the noise.

    Args:
        recording: The recording.
        from_image: Images before this one are left out.
        seed: Seed of the landmarks that are strewn to find how dense they are.
        progress: Called with the fraction done.

    Raises:
        RecordingError: The recording lacks truth, sightings or the stereo calibration.
    """
    truth, stereo = _known(recording)
    assert recording.measurements.sightings is not None
    simulated = recording.manifest.source == "simulation"
    sightings = since(recording.measurements.sightings, from_image)
    fit = fit_sensor(sightings, truth, stereo, settle=not simulated)
    spec = sensor_spec(fit)
    if not simulated:
        return Calibrated(fit, spec, None)
    progress(0.6)

    def sensed_by(spec: LandmarkSensorSpec) -> SensorFit:
        return fit_sensor(sense_recording(recording, spec, seed), truth, stereo)

    spec = _with_density(spec, fit, recording, seed)
    sensed = sensed_by(spec)
    progress(0.8)
    lost = _lost_beyond(fit, sensed)
    if lost > 0.0:
        spec = _with_density(sensor_spec(fit, lost), fit, recording, seed)
        sensed = sensed_by(spec)
    progress(1.0)
    return Calibrated(fit, spec, sensed)


def _known(recording: Recording) -> tuple[Trajectory, StereoCalibration]:
    stereo = recording.measurements.calibration.stereo
    recording.measurements.require("sightings")
    if stereo is None:
        raise RecordingError("the recording declares no stereo camera; give one that does")
    if recording.truth is None:
        raise RecordingError("the recording holds no truth: a sensor is measured at true poses")
    return recording.truth.trajectory, stereo


def _lost_beyond(fit: SensorFit, sensed: SensorFit) -> float:
    """Give the share of sightings that are lost and not hidden, out of range or crowded out.

    Args:
        fit: Measured on the recording.
        sensed: Measured on the sensor that stands for it, which loses none for good.
    """
    rates = [(one.tracks.lost, one.tracks.sightings.sum()) for one in (fit, sensed)]
    error = np.sqrt(sum(p * (1.0 - p) / n for p, n in rates))
    more = fit.tracks.lost - sensed.tracks.lost
    return float(more) if more > _SURE * error else 0.0


def sensor_spec(fit: SensorFit, lost: float = 0.0) -> LandmarkSensorSpec:
    """Make the landmark sensor of measured figures; how dense landmarks are is left at its default.

    A landmark of this sensor is found anew in each image, unless it is lost for good. Detection and
    loss are such that a sighting is followed by another in the next image, and by another at all,
    as often as it was: two images then share as many as they did, and tracks are as long.

    Args:
        fit: What was measured.
        lost: Share of the sightings that are their track's last, though the landmark is in view and
            nothing hides it.
    """
    detection, loss = chances(fit.tracks.seen_next, lost)
    sure = np.abs(fit.shared[:3]) > _SURE * fit.shared_se[:3]
    disparity, focal, baseline = (float(x) for x in np.where(sure, fit.shared[:3], 0.0))
    tracks, slides = fit.tracks, fit.drift is not None and fit.drift.slides
    wrong = fit.drift.wrong if fit.drift is not None and slides else tracks.impossible
    return LandmarkSensorSpec(
        period_s=tracks.period_s,
        visibility=VisibilitySpec(
            border_px=tracks.border_px,
            range_min_m=float(tracks.range_m[0]),
            range_max_m=tracks.range_near_m,
            range_full_m=float(tracks.range_m[0]),
            sightings_max=max(round(float(tracks.sightings.mean() / detection)), 1),
        ),
        noise=sliding_noise(fit) if slides else still_noise(fit),
        detection_probability=detection,
        loss_probability=loss,
        misclassification_probability=min(wrong, 0.99),
        disparity_bias_px=disparity,
        focal_scale_error=focal,
        baseline_scale_error=baseline,
    )


def chances(seen_next: float, lost: float) -> tuple[float, float]:
    """Give the chances of detection d and of loss p, each image, of landmarks that stay in view.

    A sighting is followed by one in the next image with ``s = (1 - p) d``, and by none at all with
    ``l = p / (p + d - p d)``: ``p = l s / (1 - l)``, ``d = s / (1 - p)``.

    Args:
        seen_next: Share s of the sightings that are followed by one in the next image.
        lost: Share l of the sightings that are their track's last.
    """
    loss = min(lost * seen_next / max(1.0 - lost, seen_next), 1.0 - seen_next)
    return min(seen_next / max(1.0 - loss, 1e-9), 1.0), loss


def still_noise(fit: SensorFit) -> SightingNoiseSpec:
    """Make the noise of tracks that do not slide: what changes slowly adds to the fixed error."""
    left, right, v = white = np.maximum(white_px(fit), _SIGMA_MIN_PX)
    sure_fixed = fit.noise.fixed_px[0] > _SURE * fit.noise.fixed_px[1]
    slow_px2 = max(float(np.mean(fit.noise.sigma_px**2 - white**2)), 0.0)
    fixed_px = fit.noise.fixed_px[0] if sure_fixed else 0.0
    return SightingNoiseSpec(
        sigma_left_px=float(left),
        sigma_right_px=float(right),
        sigma_v_px=float(v),
        bias_sigma_px=float(np.hypot(fixed_px, np.sqrt(slow_px2))),
        declared_sigma_px=fit.noise.declared_px,
        declared_drift_px=fit.declared_drift_px,
    )


def sliding_noise(fit: SensorFit) -> SightingNoiseSpec:
    """Make the noise of tracks that slide: white, as the walk leaves it, and the walk.

    What differs between consecutive images holds some of the walk, so that it only tells how white
    noise is shared by the coordinates; and a fixed error would explain a walk once more, for over
    one track they look alike.
    """
    assert fit.drift is not None
    share = white_px(fit) / np.sqrt(np.mean(white_px(fit) ** 2))
    left, right, v = np.maximum(fit.drift.sigma_px.value * share, _SIGMA_MIN_PX)
    return SightingNoiseSpec(
        sigma_left_px=float(left),
        sigma_right_px=float(right),
        sigma_v_px=float(v),
        drift_px=fit.drift.spread.drift_px,
        drift_spread=fit.drift.spread.spread,
        declared_sigma_px=fit.noise.declared_px,
        declared_drift_px=fit.declared_drift_px,
    )


def white_px(fit: SensorFit) -> Array:
    """Give the part of the noise that is new in each image, 1 sigma [px], Shape (3,)."""
    step_px = np.where(np.isfinite(fit.noise.step_px), fit.noise.step_px, fit.noise.sigma_px)
    return np.asarray(np.minimum(step_px, fit.noise.sigma_px))


def _with_density(
    spec: LandmarkSensorSpec, fit: SensorFit, recording: Recording, seed: int
) -> LandmarkSensorSpec:
    """Strew as many landmarks as were seen, fading with range so that they cover images evenly.

    A field holds only so many landmarks a square metre; where near ones would have to be denser,
    they fade from further on, and their median range is larger than the one measured.
    """
    range_m, images = _probe(spec, recording, seed)
    wanted = float(fit.tracks.sightings.mean()) / spec.detection_probability * images
    near_m, wanted_near = range_m[range_m < FAR_M], wanted * (1.0 - fit.tracks.far)

    def shown(full_m: float) -> float:
        return float(np.sum(np.minimum(1.0, full_m / near_m) ** spec.visibility.range_exponent))

    most = _DENSITY_MAX_PER_M2 / _PROBE_PER_M2
    steps = np.geomspace(spec.visibility.range_min_m, spec.visibility.range_max_m, 60)
    full_m = next((x for x in steps if shown(x) * most >= wanted_near), steps[-1])
    density = _PROBE_PER_M2 * min(wanted_near / max(shown(full_m), 1.0), most)
    far_per_rad = _probe_field().far_per_rad
    far_per_rad *= wanted * fit.tracks.far / max(len(range_m) - len(near_m), 1)
    field = LandmarkFieldSpec(ground_per_m2=density, per_rock=density, far_per_rad=far_per_rad)
    visibility = spec.visibility.model_copy(update={"range_full_m": float(full_m)})
    return spec.model_copy(update={"field": field, "visibility": visibility})


def _probe(spec: LandmarkSensorSpec, recording: Recording, seed: int) -> tuple[Array, int]:
    """Give the ranges of all landmarks in view of a thin field [m], and the number of images."""
    visibility = spec.visibility.model_copy(update={"sightings_max": None, "range_exponent": 0.0})
    thin = LandmarkSensorSpec(
        period_s=_PROBE_PERIODS * spec.period_s,
        field=_probe_field(),
        visibility=visibility,
        noise=SightingNoiseSpec(sigma_left_px=0.0, sigma_right_px=0.0, sigma_v_px=0.0),
        detection_probability=1.0,
    )
    sensed, stereo = (
        sense_recording(recording, thin, seed),
        recording.measurements.calibration.stereo,
    )
    assert stereo is not None
    return np.linalg.norm(stereo.triangulate(sensed.stereo_px), axis=1), len(sensed)


def _probe_field() -> LandmarkFieldSpec:
    """Give a thin field, as many landmarks on a rock as on a square metre of ground."""
    return LandmarkFieldSpec(ground_per_m2=_PROBE_PER_M2, per_rock=_PROBE_PER_M2)


def calibrate_file(
    path: Path, out: Path, from_image: int = 0, progress: Progress = silent
) -> tuple[Calibrated, tuple[Path, ...]]:
    """Measure a recording's sensor and write its spec (YAML) and figure (PNG).

    Args:
        path: The recording.
        out: Where the spec goes; the figure lies beside it.
        from_image: Images before this one are left out.
        progress: Called with the fraction done.

    Raises:
        RecordingError: The recording cannot be read, or lacks what is needed.
        OutputError: The files cannot be written.
    """
    recording = read_recording(path)
    bare = replace(recording, measurements=replace(recording.measurements, images=None))
    found = calibrate_sensor(bare, from_image, progress=progress)
    picture = out.with_suffix(".png")
    with whole_file(out) as temporary:
        found.spec.to_yaml(temporary)
    with whole_file(picture) as temporary:
        save(plot_sensor(found.fit, found.sensed), temporary)
    return found, (out, picture)
