"""What an estimator must do before its numbers mean anything: a drive without any error tells.

Flat firm ground without slip, sensors and landmarks without noise: whatever error is left is the
estimator's own.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.table import Table

from estimators import Estimator, build_estimator
from lpet_sim.errors import EstimatorFaultError, RecordingError, SpecError
from lpet_sim.evaluation import RunResult, evaluate
from lpet_sim.plugins.accept import accepted
from lpet_sim.plugins.confine import landlock_version
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import STREAMS, ImagesInMemory, Measurements
from lpet_sim.sensors.imu import ImuSpec
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sensors.wheels import WheelOdometrySpec
from lpet_sim.sweep.sensing import sense_recording
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec

ZERO_RATIO: Final = 1e-3
ZERO_RAD: Final = 1e-3
"""Errors that count as none where nothing is noisy: share of the distance, and attitude [rad]."""
_COARSE: Final = ("images", "wheels")
_COARSE_FACTOR: Final = 5.0
"""By so much more may an estimator be off that works on images, for a pixel is no point, or on
wheels, which creep by a quarter of a percent in physics on the hardest ground."""
_SEED: Final = 1


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        what: What an estimator must do.
        passed: Whether it does; None: it could not be looked at.
        text: What was found.
    """

    what: str
    passed: bool | None
    text: str


def perfect_spec(with_images: bool) -> TraverseSpec:
    """Give a drive of four metres with a bend, on ground and with sensors without errors."""
    ground = {
        "kind": "firm",
        "name": "hard",
        "evidence": "assumed",
        "source": "Ground on which nothing slips.",
        "friction": 0.8,
        "slip_stiffness": 1000.0,
    }
    mapping: dict[str, Any] = {
        "name": "perfect",
        "terrain": {
            "relief": {"rms_slope_rad": 0.0},
            "craters": None,
            "rocks": None,
            "soils": [{"name": "hard", "soil": ground}],
        },
        "drive": {"waypoints_m": [[0, 0], [2, 0], [4, 0.6]], "speed_mps": 0.05, "settle_s": 2.0},
        "route": None,
        "sensors": {
            "imu": ImuSpec.perfect().to_mapping(),
            "wheels": WheelOdometrySpec.perfect().to_mapping(),
        },
        "images": {"period_s": 1.6, "front_end": None} if with_images else None,
    }
    return TraverseSpec.from_mapping(mapping)


def perfect_sensor() -> LandmarkSensorSpec:
    """Give a landmark sensor without noise, at which every landmark in view is found."""
    none = {"sigma_left_px": 0.0, "sigma_right_px": 0.0, "sigma_v_px": 0.0}
    noise = none | {"declared_sigma_px": 0.1}
    return LandmarkSensorSpec.from_mapping(
        {"period_s": 1.6, "noise": noise, "detection_probability": 1.0}
    )


def check_estimator(
    name: str, fields: Mapping[str, Any], progress: Progress = silent
) -> tuple[Finding, ...]:
    """Look over an estimator.

    Args:
        name: As `estimators.estimator_kind` knows it.
        fields: Fields of its spec.
        progress: Called with the share of the drive done.

    Raises:
        LpetError: It cannot be built.
    """
    estimator = build_estimator(name, dict(fields))
    unknown = [need for need in estimator.needs if need not in STREAMS]
    if unknown:
        valid = ", ".join(STREAMS)
        raise SpecError(f"estimator '{name}' needs '{unknown[0]}': there are the streams {valid}")
    recording = _perfect_drive("images" in estimator.needs, progress)
    return tuple(_findings(estimator, recording))


def _perfect_drive(with_images: bool, progress: Progress) -> Recording:
    with tempfile.TemporaryDirectory(prefix="lpet-") as made:
        path = Path(made) / "perfect.rrd"
        simulate(perfect_spec(with_images), _SEED, path, progress)
        read = read_recording(path)
        given = replace(read.measurements, sightings=sense_recording(read, perfect_sensor()))
        if given.images is not None:
            given = replace(given, images=_held(given))
        return replace(read, measurements=given)


def _held(measurements: Measurements) -> ImagesInMemory:
    """Take the images into memory: their file goes."""
    images = measurements.images
    assert images is not None
    pairs = [images.pair(i) for i in range(len(images))]
    left, right = (np.array([pair[eye] for pair in pairs]) for eye in (0, 1))
    return ImagesInMemory(np.asarray(images.t_ns).copy(), left, right)


def _findings(estimator: Estimator, recording: Recording) -> list[Finding]:
    measurements = recording.measurements
    found = [_confined()]
    try:
        estimate = accepted(estimator.estimate(measurements), measurements)
    except (EstimatorFaultError, RecordingError) as error:
        kind = error.kind if isinstance(error, EstimatorFaultError) else "exception"
        return [*found, Finding("gives an estimate", False, f"{kind}: {error}")]
    times = estimate.trajectory.t_ns
    text = f"{len(times)} poses, {times[0] / 1e9:.2f} to {times[-1] / 1e9:.2f} s"
    found.append(Finding("gives an estimate whose times are in order", True, text))
    found.append(_covariance(estimate))
    assert recording.truth is not None
    sightings = measurements.sightings
    last = None if sightings is None else int(sightings.t_ns[-1])
    result = evaluate(estimate, recording.truth, last_image_t_ns=last)
    found.append(_whole(result))
    found.append(_exact(result, any(need in _COARSE for need in estimator.needs)))
    found.append(_deterministic(estimator, measurements, estimate))
    return found


def _confined() -> Finding:
    version = landlock_version()
    what = "runs apart from the truth, if it is not LPET's own"
    if version:
        return Finding(what, True, f"in a process of its own, confined by Landlock {version}")
    return Finding(what, None, "in a process of its own; this kernel has no Landlock")


def _covariance(estimate: Estimate) -> Finding:
    what = "has covariances that are some"
    if estimate.covariance is None:
        return Finding(what, None, "it gives none, so that its consistency is not known")
    return Finding(what, True, "all are finite, and none has a negative eigenvalue")


def _whole(result: RunResult) -> Finding:
    text = f"{result.completion:.1%} of the drive"
    return Finding("covers the drive", result.failure != "incomplete", text)


def _exact(result: RunResult, coarse: bool) -> Finding:
    factor = _COARSE_FACTOR if coarse else 1.0
    off_rad = max(map(abs, result.endpoint_attitude_rad))
    exact = result.endpoint_ratio <= factor * ZERO_RATIO and off_rad <= factor * ZERO_RAD
    text = (
        f"{100 * result.endpoint_ratio:.4f} % and {np.degrees(off_rad):.4f} deg at the end; "
        f"{100 * factor * ZERO_RATIO:g} % and {np.degrees(factor * ZERO_RAD):.2g} deg count as none"
    )
    return Finding("has no error without noise and slip", exact, text)


def _deterministic(estimator: Estimator, measurements: Measurements, first: Estimate) -> Finding:
    what = "gives the same again"
    try:
        second = estimator.estimate(measurements)
    except (EstimatorFaultError, RecordingError) as error:
        return Finding(what, False, str(error))
    same = second.trajectory.equals(first.trajectory)
    if first.covariance is not None and second.covariance is not None:
        same = same and np.array_equal(first.covariance, second.covariance)
    return Finding(what, same, "to the bit" if same else "two runs differ")


def finding_table(name: str, findings: tuple[Finding, ...]) -> Table:
    """Put the findings on one estimator into a table."""
    table = Table(title=f"estimator {name}")
    for head in ("what it must do", "", "found"):
        table.add_column(head)
    words = {None: "not known", True: "yes", False: "NO"}
    for finding in findings:
        table.add_row(finding.what, words[finding.passed], finding.text)
    return table
