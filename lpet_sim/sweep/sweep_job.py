"""One job of a sweep: a data set in one arm is read and sensed once, then runs every variant."""

from __future__ import annotations

import logging
import math
import os
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from estimators import outside_code
from estimators.odometry_steps import image_odometry
from lpet_sim.errors import LpetError, RecordingError, SpecError
from lpet_sim.evaluation.bounds import end_bound
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import Measurements
from lpet_sim.rng import stream
from lpet_sim.sweep.carried import Carrier
from lpet_sim.sweep.miscalibration import miscalibrate
from lpet_sim.sweep.sensing import sense_recording, terrain_of
from lpet_sim.sweep.sweep_once import PlannedRun, RunSettings, Scene, run_row, said, worker_name
from lpet_sim.sweep.sweep_plan import code_digest
from lpet_sim.sweep.sweep_spec import ArmSpec
from lpet_sim.sweep.sweep_store import Journal, RowStore

_log = logging.getLogger(__name__)
_ORPHAN_S = 0.25
_WATCH = "orphan watch"


@dataclass(frozen=True, slots=True)
class Job:
    """One data set in one arm. It has slots so that Dask ships it with its task, not apart from it.

    Attributes:
        key: Names what its runs have in common.
        recording: The data set.
        arm: How it is sensed.
        runs: What to run on it.
        settings: What all runs have in common.
        bound: Whether to compute its Cramer-Rao bound.
    """

    key: str
    recording: Path
    arm: ArmSpec
    runs: tuple[PlannedRun, ...]
    settings: RunSettings
    bound: bool = False


def run_job(job: Job) -> int:
    """Run what is missing of a job, and add each row to the sweep's store as its run ends.

    Returns:
        How many runs were run.

    Raises:
        LpetError: This worker does not see the sweep's files, or has other code than the driver.
    """
    if job.settings.is_local:
        _end_with_parent()
    job.settings.find_modules()
    _check_worker(job)
    store = RowStore(job.settings.folder).refresh(job.key)
    missing = store.missing([run.key for run in job.runs], job.settings.redo)
    todo = [run for run in job.runs if run.key in missing]
    wants_bound = job.bound and job.key not in store.bounds
    if todo or wants_bound:
        with Journal(job.settings.folder, job.key) as journal:
            _run_all(job, todo, wants_bound, journal)
    return len(todo)


def _check_worker(job: Job) -> None:
    """Hold this worker to have what the driver has: a row must not tell of other code."""
    for path in (job.recording, job.settings.folder):
        if not path.exists():
            raise LpetError(
                f"worker {worker_name()} sees no {path}: all workers must see the data sets and "
                "the sweep's folder under the same names as the driver"
            )
    if code_digest(True) != job.settings.code:
        raise LpetError(
            f"worker {worker_name()} has other source code than the driver: install the same on "
            "all machines, or start the sweep again if the code was changed while it ran"
        )


def _check_outside(run: PlannedRun) -> None:
    """Hold an estimator that is not ours to be the one that the run was planned with."""
    try:
        code = outside_code(run.estimator, run.spec)
    except SpecError:  # Its run tells what is wrong with it.
        return
    if code and code != run.spec["code"]:
        raise LpetError(
            f"estimator '{run.estimator}' was changed while the sweep ran: start it again, and it "
            "runs what hangs on the change"
        )


def _run_all(job: Job, todo: Sequence[PlannedRun], wants_bound: bool, journal: Journal) -> None:
    scene: Scene | str
    try:
        scene = prepare(job.recording, job.arm, job.settings.odometry)
    except Exception as error:
        _log.debug("job %s", job.key, exc_info=True)
        scene = f"before the run: {said(error)}"
    for run in todo:
        _check_outside(run)
        journal.start(run.key, job.settings.driver)
        journal.row(run_row(run, scene, job.settings))
    if wants_bound:
        journal.bound(job.key, bound_of(scene))


def prepare(path: Path, arm: ArmSpec, odometry: str) -> Scene:
    """Read a recording, sense it as the arm says, and give it odometry at its images.

    Args:
        path: The recording.
        arm: How it is sensed.
        odometry: ``fused`` or ``wheels``.

    Raises:
        LpetError: It cannot be read or sensed so, or holds no truth.
    """
    recording = read_recording(path)
    measurements, truth = recording.measurements, recording.truth
    if truth is None:
        raise RecordingError(f"{path} holds no truth to score against; give one that does")
    if arm.sensor is not None and arm.sensors is not None:
        carrier = Carrier.of(recording, terrain_of(recording.manifest))
        measurements = carrier.carry(arm.sensors, arm.sensor, _drawn(recording, arm))
    elif arm.sensor is not None:
        sensed = sense_recording(recording, arm.sensor, _drawn(recording, arm))
        measurements = replace(measurements, sightings=sensed, images=None)
    if arm.declared is not None:
        measurements = miscalibrate(measurements, arm.declared)
    measurements = _with_odometry(measurements, odometry)
    seen = measurements.sightings or measurements.images
    return Scene(measurements, truth, 0 if seen is None else len(seen))


def _drawn(recording: Recording, arm: ArmSpec) -> int:
    """Give the seed of what an arm draws."""
    own = recording.manifest.seed or 0
    if arm.draw == 0:
        return own
    return int(stream(own, "sweep", "draw", arm.draw).integers(1, 2**31))


def _with_odometry(measurements: Measurements, kind: str) -> Measurements:
    """Give the increments from image to image, where there is anything to make them of."""
    sightings = measurements.sightings
    if sightings is None or (measurements.odometry is None and measurements.wheels is None):
        return measurements
    heard = replace(measurements, imu=None) if kind == "wheels" else measurements
    return replace(measurements, odometry=image_odometry(heard, sightings.t_ns))


def bound_of(scene: Scene | str) -> dict[str, Any]:
    """Give the Cramer-Rao bound of a job, or NaN with the reason why there is none."""
    none = {"bound_m": math.nan, "bound_rad": math.nan}
    if isinstance(scene, str):
        return none | {"bound_text": scene}
    told = scene.measurements
    if told.sightings is None or told.calibration.stereo is None:
        return none | {"bound_text": "there are no sightings of a declared stereo camera"}
    try:
        at_images = scene.truth.trajectory.at(told.sightings.t_ns)
        imu = told.calibration.imu
        bound = end_bound(
            at_images,
            told.sightings,
            told.calibration.stereo,
            told.odometry,
            rate_sigma_radps=0.0 if imu is None else imu.gyro_bias_radps,
        )
    except Exception as error:
        _log.debug("no bound", exc_info=True)
        return none | {"bound_text": said(error)}
    rms = {"bound_m": bound.position_rms_m, "bound_rad": bound.attitude_rms_rad}
    return rms | {"bound_text": ""}


def _end_with_parent() -> None:
    """End this process when the driver is gone: nobody would know what it still does."""
    if _WATCH in (thread.name for thread in threading.enumerate()):
        return
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_ORPHAN_S)
        os._exit(1)

    threading.Thread(target=watch, name=_WATCH, daemon=True).start()
