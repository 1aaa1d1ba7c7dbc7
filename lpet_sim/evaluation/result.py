"""One estimator on one recording, scored against the truth."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import Field

from lpet_sim.evaluation.consistency import BLOCKS, is_positive_definite, nees
from lpet_sim.evaluation.errors import (
    ErrorSeries,
    SegmentDrift,
    distance_driven_m,
    error_series,
    segment_drift,
    worst_position_ratio,
)
from lpet_sim.failures import (
    BAD_COVARIANCE,
    DIVERGED,
    EXCEPTION,
    INCOMPLETE,
    LOST,
    NOT_FINITE,
)
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import Truth
from lpet_sim.spec import Spec

Triple = tuple[float, float, float]


class EvaluationSpec(Spec):
    """What counts as a segment, as the first metres and as a failure.

    Attributes:
        start_m: Distance after which an error is measured as a share of the distance [m].
        segment_lengths_m: Lengths of the segments of the drift [m].
        min_completion: A run that covers a smaller share of the traverse is incomplete.
        max_gap_m: Between poses that are farther apart the traverse is not covered, nor before a
            first pose that comes later [m].
        max_error_ratio: A run with a larger endpoint error has diverged.
        max_lost_images: More images in a row bridged without vision means lost.
    """

    start_m: float = Field(default=5.0, ge=0)
    segment_lengths_m: tuple[float, ...] = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
    min_completion: float = Field(default=0.99, ge=0, le=1)
    max_gap_m: float = Field(default=5.0, gt=0)
    max_error_ratio: float = Field(default=0.1, gt=0)
    max_lost_images: int = Field(default=50, ge=0)


@dataclass(frozen=True, eq=False)
class RunResult:
    """The score of one run. Ratios are of the distance truly driven; 0.01 is 1 %.

    Attributes:
        name: The estimator's name.
        distance_m: Length of the part of the traverse that is scored [m].
        completion: Share of that distance that the estimate covers.
        failure: None, or the first that applies of ``exception``, ``timeout`` (in a sweep that
            sets a time limit), `FAULTS`, ``not_finite``, ``incomplete``, ``bad_covariance``,
            ``lost`` and ``diverged``.
        failure_text: One sentence on the failure.
        endpoint_error_m: ``p_est - p_true`` at the last estimate, in the world [m].
        endpoint_ratio: Its length over the distance driven by then.
        worst_ratio: The largest position error over the distance so far, after the first metres.
        endpoint_attitude_rad: Roll, pitch and yaw error at the last estimate, signed [rad].
        worst_attitude_rad: The largest absolute roll, pitch and yaw error [rad].
        segments: Drift over segments.
        nees_end: NEES of position, attitude and pose at the last estimate, by name; None without
            a positive definite covariance.
        series: All errors over time; None where the run ended in an exception.
    """

    name: str
    distance_m: float
    completion: float
    failure: str | None
    failure_text: str
    endpoint_error_m: Triple
    endpoint_ratio: float
    worst_ratio: float
    endpoint_attitude_rad: Triple
    worst_attitude_rad: Triple
    segments: tuple[SegmentDrift, ...] = ()
    nees_end: dict[str, float] | None = None
    series: ErrorSeries | None = None

    def to_mapping(self) -> dict[str, Any]:
        """Give everything but the series as plain JSON-ready values."""
        fields = {k: v for k, v in vars(self).items() if k not in ("series", "segments")}
        return fields | {"segments": [vars(segment) for segment in self.segments]}


def evaluate(
    estimate: Estimate,
    truth: Truth,
    spec: EvaluationSpec | None = None,
    anchor_t_ns: int | None = None,
    last_image_t_ns: int | None = None,
) -> RunResult:
    """Score an estimate against the truth, unaligned.

    The truth is interpolated at the estimate's times. An estimate that ends early is scored where
    it ends and is marked ``incomplete``; it is never dropped.

    Args:
        estimate: What an estimator returned.
        truth: The truth of the same traverse.
        spec: What counts as what; the defaults if None.
        anchor_t_ns: Score from here on only, with the estimate moved as a whole onto the true
            pose at its first time from here [ns]. The covariances then no longer belong to the
            errors, and no NEES is given.
        last_image_t_ns: Time of the last image [ns]: an estimate that ends with it covers the
            traverse, however far the drive then still went. None: it must reach the truth's end.

    Returns:
        The score.

    Raises:
        RecordingError: Estimate and truth do not overlap in time.
    """
    spec = spec or EvaluationSpec()
    finite = _finite_part(estimate)
    if not len(finite.trajectory):
        return failed(estimate.name, NOT_FINITE, "no pose of the estimate is finite")
    series = _series(finite, truth, anchor_t_ns)
    distance_m, completion = _completion(series, truth.trajectory, last_image_t_ns, spec.max_gap_m)
    begin = series.t_ns[0]
    scored = Trajectory(
        finite.trajectory.t_ns[finite.trajectory.t_ns >= begin],
        finite.trajectory.T_world_body[finite.trajectory.t_ns >= begin],
    )
    result = RunResult(
        name=estimate.name,
        distance_m=distance_m,
        completion=completion,
        failure=None,
        failure_text="",
        endpoint_error_m=_triple(series.position_error_m[-1]),
        endpoint_ratio=float(series.position_ratio[-1]),
        worst_ratio=worst_position_ratio(series, spec.start_m),
        endpoint_attitude_rad=_triple(series.attitude_error_rad[-1]),
        worst_attitude_rad=_triple(np.abs(series.attitude_error_rad).max(axis=0)),
        segments=segment_drift(scored, truth.trajectory, spec.segment_lengths_m),
        nees_end=_nees_end(series),
        series=series,
    )
    kind, text = _failure(estimate, result, spec)
    return replace(result, failure=kind, failure_text=text)


def failed(name: str, kind: str = EXCEPTION, text: str = "") -> RunResult:
    """Make the result of a run that gave nothing to score: infinite errors, nothing covered.

    Args:
        name: The estimator's name.
        kind: Kind of failure, ``exception`` unless told.
        text: One sentence on it.
    """
    inf = (np.inf, np.inf, np.inf)
    return RunResult(name, 0.0, 0.0, kind, text, inf, np.inf, np.inf, inf, inf)


def _finite_part(estimate: Estimate) -> Estimate:
    """Cut the estimate before its first pose that is not finite."""
    T = estimate.trajectory.T_world_body
    bad = ~(np.isfinite(T.translation).all(axis=-1) & np.isfinite(T.rotation).all(axis=(-1, -2)))
    if not bad.any():
        return estimate
    keep = slice(0, int(np.argmax(bad)))
    covariance = None if estimate.covariance is None else estimate.covariance[keep]
    trajectory = Trajectory(estimate.trajectory.t_ns[keep], T[keep])
    return Estimate(estimate.name, trajectory, covariance, estimate.diagnostics)


def _series(estimate: Estimate, truth: Truth, anchor_t_ns: int | None) -> ErrorSeries:
    series = error_series(estimate.trajectory, truth.trajectory, anchor_t_ns)
    if estimate.covariance is None or anchor_t_ns is not None:
        return series
    covariance = estimate.covariance[np.isin(estimate.trajectory.t_ns, series.t_ns)]
    return replace(series, nees=nees(series.xi, covariance))


def _completion(
    series: ErrorSeries, truth: Trajectory, last_image_t_ns: int | None, max_gap_m: float
) -> tuple[float, float]:
    """Give the length of the scored traverse [m] and the share that the estimate covers.

    A traverse that does not move is covered by the share of its time.
    """
    gaps_m = np.diff(series.distance_m, prepend=0.0)
    missed_m = float(gaps_m[gaps_m > max_gap_m].sum())
    driven = distance_driven_m(truth)
    begin = np.interp(series.t_ns[0], truth.t_ns, driven) - series.distance_m[0]
    total = float(driven[-1] - begin)
    if last_image_t_ns is not None and series.t_ns[-1] == last_image_t_ns:
        return total, 1.0 - missed_m / total if total > 0 else 1.0
    if total > 0:
        return total, float((series.distance_m[-1] - missed_m) / total)
    span = int(truth.t_ns[-1] - truth.t_ns[0])
    return total, float((series.t_ns[-1] - truth.t_ns[0]) / span) if span else 1.0


def _nees_end(series: ErrorSeries) -> dict[str, float] | None:
    if series.nees is None or np.isnan(series.nees[-1]).any():
        return None
    return dict(zip(BLOCKS, map(float, series.nees[-1]), strict=True))


def _failure(estimate: Estimate, result: RunResult, spec: EvaluationSpec) -> tuple[str | None, str]:
    T = estimate.trajectory.T_world_body
    covariance = estimate.covariance
    lost = _longest_run(estimate.diagnostics.get("bridged", np.zeros(0)))
    checks = (
        (not np.isfinite(T.matrix()).all(), NOT_FINITE, "a pose of the estimate is not finite"),
        (
            result.completion < spec.min_completion,
            INCOMPLETE,
            f"the estimate covers {result.completion:.1%} of the traverse",
        ),
        (
            covariance is not None and not is_positive_definite(covariance[-1:]).all(),
            BAD_COVARIANCE,
            "the last covariance is not positive definite",
        ),
        (lost > spec.max_lost_images, LOST, f"{lost} images in a row had no visual motion"),
        (
            result.endpoint_ratio > spec.max_error_ratio,
            DIVERGED,
            f"the endpoint is off by {result.endpoint_ratio:.1%} of the distance",
        ),
    )
    return next(((kind, text) for applies, kind, text in checks if applies), (None, ""))


def _longest_run(flags: Array) -> int:
    """Give the length of the longest row of set flags."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(flags) > 0, [0]]).astype(int)))
    return int((edges[1::2] - edges[::2]).max()) if len(edges) else 0


def _triple(values: Array) -> Triple:
    x, y, z = map(float, values)
    return x, y, z
