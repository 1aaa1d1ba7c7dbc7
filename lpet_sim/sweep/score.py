"""Run estimators on a recording and score them: the one place where both are in hand."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from estimators import ESTIMATORS, Estimator, build_estimator
from estimators.dead_reckoning import DeadReckoning
from estimators.frame_to_frame import FrameToFrame
from lpet_sim.errors import RecordingError, SpecError
from lpet_sim.evaluation import RunResult, evaluate
from lpet_sim.evaluation.attribution import ErrorAttribution, attribute_error
from lpet_sim.evaluation.errors import ErrorSeries, error_series
from lpet_sim.evaluation.slip_match import SlipMatch, match_slips
from lpet_sim.evaluation.slip_onset import SlipReport, find_slip
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.overlay import add_estimates
from lpet_sim.recording.reader import read_estimates, read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import Measurements, WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import Truth

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Score:
    """What the estimators in a recording are worth.

    Attributes:
        recording: The recording.
        estimates: The estimates found in it.
        results: Their scores, in the same order.
        attribution: Dead reckoning's error by cause, None where the truth holds no wheels.
        slips: Forced slips with what was found of them by comparing vision with the wheels, and
            other slips found so; None where one of the two estimates is not there.
    """

    recording: Recording
    estimates: tuple[Estimate, ...]
    results: tuple[RunResult, ...]
    attribution: ErrorAttribution | None
    slips: tuple[SlipMatch, ...] | None = None

    @property
    def truth(self) -> Truth:
        """What really happened."""
        assert self.recording.truth is not None
        return self.recording.truth


def estimate_recording(
    path: Path,
    names: Sequence[str] | None = None,
    progress: Progress = silent,
    *,
    fields: Mapping[str, Any] | None = None,
    called: str | None = None,
) -> tuple[Estimate, ...]:
    """Run estimators on a recording's measurements and lay their estimates over it.

    Args:
        path: The recording; it is replaced as a whole once all estimates are there.
        names: Which estimators; None for all that the recording has the streams for.
        progress: Called after each estimator.
        fields: Fields of the spec of the one estimator that is named, as read from YAML.
        called: What the estimate of the one that is named is called; None for its own name.

    Raises:
        UnknownNameError: A name is not an estimator's.
        SpecError: The fields do not make its spec, or fields or a name for other than one.
        RecordingError: The recording cannot be read or lacks a stream.
    """
    if (fields is not None or called is not None) and len(names or ()) != 1:
        raise SpecError("a spec and a name are for one estimator: name one, and one only")
    if called is not None and not called.strip():
        raise SpecError("the name of an estimate is empty: give it one")
    asked = None if names is None else [build_estimator(name, dict(fields or {})) for name in names]
    recording = read_recording(path)
    measurements = recording.measurements
    built = _fed_by(measurements) if asked is None else asked
    estimates = tuple(e.estimate(measurements) for e in track(built, len(built), progress))
    if called is not None:
        estimates = tuple(replace(estimate, name=called) for estimate in estimates)
    slip = find_slip_in(recording, [*read_estimates(path).values(), *estimates])
    add_estimates(
        path,
        [(estimate, _errors(estimate, recording)) for estimate in estimates],
        slip=None if slip is None else slip.series,
    )
    return estimates


def _fed_by(measurements: Measurements) -> list[Estimator]:
    """Build every estimator whose streams are there.

    Raises:
        RecordingError: There is none.
    """
    every = [build_estimator(name) for name in ESTIMATORS]
    fed = [e for e in every if all(getattr(measurements, s) is not None for s in e.needs)]
    if not fed:
        needs = "; ".join(f"{e.name}: {', '.join(e.needs)}" for e in every)
        raise RecordingError(
            f"the recording has the streams of no estimator, they need ({needs}); "
            "run 'lpet sight' first if it has images"
        )
    return fed


def _errors(estimate: Estimate, recording: Recording) -> ErrorSeries | None:
    """Give the errors that the recording's curves show, where there is a truth."""
    if recording.truth is None:
        return None
    return error_series(estimate.trajectory, recording.truth.trajectory)


def score_recording(path: Path, from_s: float | None = None) -> Score:
    """Score every estimate in a recording against its truth.

    Args:
        path: The recording.
        from_s: Score from this time on only, each estimate moved as a whole onto the truth there;
            None scores all of it as it stands.

    Raises:
        RecordingError: The recording cannot be read, holds no truth, or no estimates.
    """
    recording = read_recording(path)
    estimates = tuple(read_estimates(path).values())
    if recording.truth is None:
        raise RecordingError(f"{path} holds no truth to score against; give one that does")
    if not estimates:
        raise RecordingError(f"{path} holds no estimates; run 'lpet estimate {path}' first")
    anchor_t_ns = None if from_s is None else round(from_s * NS_PER_S)
    sightings = recording.measurements.sightings
    last = None if sightings is None or not len(sightings) else int(sightings.t_ns[-1])
    results = tuple(
        evaluate(e, recording.truth, anchor_t_ns=anchor_t_ns, last_image_t_ns=last)
        for e in estimates
    )
    split = attribute_dead_reckoning(recording)
    return Score(recording, estimates, results, split, _match_slips(recording, estimates))


def find_slip_in(recording: Recording, estimates: Iterable[Estimate]) -> SlipReport | None:
    """Compare frame-to-frame vision with dead reckoning, or give None where one is not there.

    Args:
        recording: Its calibration says how far wheels are trusted.
        estimates: Estimates of it; of two of one name the later counts.
    """
    by_name = {estimate.name: estimate for estimate in estimates}
    vision, reckoned = by_name.get(FrameToFrame().name), by_name.get(DeadReckoning().name)
    calibration = recording.measurements.calibration.wheels
    if vision is None or reckoned is None or calibration is None:
        return None
    try:
        return find_slip(vision, reckoned, calibration)
    except RecordingError as error:
        _log.info("no slip is looked for: %s", error)
        return None


def _match_slips(
    recording: Recording, estimates: Sequence[Estimate]
) -> tuple[SlipMatch, ...] | None:
    report = find_slip_in(recording, estimates)
    if report is None or recording.truth is None:
        return None
    reckoned = next(e for e in estimates if e.name == DeadReckoning().name)
    return match_slips(report, recording.truth, reckoned)


def attribute_dead_reckoning(recording: Recording) -> ErrorAttribution | None:
    """Split dead reckoning's error by cause, or give None where wheels are not known."""
    measurements, truth = recording.measurements, recording.truth
    wheels, declared = measurements.wheels, measurements.calibration.wheels
    if wheels is None or declared is None or truth is None or truth.wheels is None:
        return None
    all_steered = declared.model_copy(update={"steerable": (True,) * len(declared.steerable)})
    calibration = measurements.calibration.model_copy(update={"wheels": all_steered})

    def dead_reckon(stream: WheelStream) -> Trajectory:
        told = replace(measurements, calibration=calibration, wheels=stream)
        return DeadReckoning().estimate(told).trajectory

    # What a fixed wheel's encoder says of its steering is noise, which dead reckoning passes over.
    steer = wheels.steer_angle_rad * np.array(declared.steerable, dtype=float)
    return attribute_error(replace(wheels, steer_angle_rad=steer), truth, dead_reckon)
