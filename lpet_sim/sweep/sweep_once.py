"""One run of a sweep: an estimator on what its job holds, timed, scored, and put into a row."""

from __future__ import annotations

import logging
import math
import os
import socket
import sys
import time
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from estimators import build_estimator
from lpet_sim.errors import BrokenFilterError, EstimatorFaultError
from lpet_sim.evaluation import EvaluationSpec, Requirement, RunResult, evaluate, failed
from lpet_sim.evaluation.errors import distance_driven_m
from lpet_sim.failures import BAD_COVARIANCE, EXCEPTION, TIMEOUT
from lpet_sim.plugins.python_plugin import search_path
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.truth import Truth
from lpet_sim.sweep.sweep_row import (
    diagnostic_columns,
    score_columns,
    variant_columns,
    verdict_columns,
)
from lpet_sim.sweep.sweep_store import Redo, Row
from lpet_sim.sweep.time_limit import TimeLimitError, time_limit

_log = logging.getLogger(__name__)
_warm: set[str] = set()


@dataclass(frozen=True)
class PlannedRun:
    """One run: a variant on the data set of its job.

    Attributes:
        key: Names the run by all that its row depends on.
        estimator: The estimator's name.
        spec: Its whole spec.
    """

    key: str
    estimator: str
    spec: dict[str, Any]


@dataclass(frozen=True)
class RunSettings:
    """What all runs of a sweep have in common.

    Attributes:
        requirement: What they are held to.
        evaluation: What counts as what when they are scored.
        odometry: ``fused`` or ``wheels``.
        redo: Which runs are run again although there is a row of them.
        driver: Names the call of the sweep on whose behalf they run.
        code: Names the source code that the driver has, as `sweep_plan.code_digest` does.
        folder: Where rows are kept.
        is_local: Whether the workers are children of the driver, and end with it.
        search_path: Where the driver looks for modules: estimators that are not ours.
    """

    requirement: Requirement
    evaluation: EvaluationSpec
    odometry: str
    redo: Redo
    driver: str
    code: str
    folder: Path
    is_local: bool = True
    search_path: tuple[str, ...] = field(default_factory=lambda: tuple(search_path()))

    def find_modules(self) -> None:
        """Look for modules where the driver does; a worker may have been there before its call."""
        if self.is_local:
            sys.path += [place for place in self.search_path if place not in sys.path]


@dataclass(frozen=True)
class Scene:
    """What a job has in hand before its first run.

    Attributes:
        measurements: What the estimators may know, as the arm says.
        truth: What really happened.
        images: Number of image pairs.
    """

    measurements: Measurements
    truth: Truth
    images: int

    @property
    def last_image_t_ns(self) -> int | None:
        """Time of the last image pair that was sighted [ns]."""
        sightings = self.measurements.sightings
        return None if sightings is None or not len(sightings) else int(sightings.t_ns[-1])


@dataclass(frozen=True)
class _Outcome:
    """What came of a run, and how long the estimator took [s]."""

    result: RunResult
    spent_s: float
    estimate: Estimate | None = None


def run_row(run: PlannedRun, scene: Scene | str, settings: RunSettings) -> Row:
    """Run one variant and give its row; whatever goes wrong in it becomes a kind of failure.

    Args:
        run: What to run.
        scene: On what, or why there is nothing to run it on.
        settings: What all runs have in common.
    """
    started_at, is_cold = now(), run.estimator not in _warm
    if isinstance(scene, str):
        return failure_row(run, settings, EXCEPTION, scene)
    outcome = _outcome(run, scene, settings)
    _warm.add(run.estimator)
    diagnostics = {} if outcome.estimate is None else outcome.estimate.diagnostics
    return {
        **_head(run, settings),
        "images": scene.images,
        "path_m": float(distance_driven_m(scene.truth.trajectory)[-1]),
        **score_columns(outcome.result, settings.evaluation),
        **diagnostic_columns(diagnostics),
        **verdict_columns(outcome.result, settings.requirement),
        "time_total_s": outcome.spent_s,
        "time_per_image_ms": 1e3 * outcome.spent_s / scene.images if scene.images else math.nan,
        "cold": is_cold,
        "worker": worker_name(),
        "started_at": started_at,
    }


def failure_row(run: PlannedRun, settings: RunSettings, kind: str, text: str) -> Row:
    """Give the row of a run that never came to an estimate: its failure and infinite errors."""
    result = failed(run.estimator, kind, text)
    return {
        **_head(run, settings),
        "images": 0,
        "path_m": math.nan,
        **score_columns(result, settings.evaluation),
        **diagnostic_columns({}),
        **verdict_columns(result, settings.requirement),
        "time_total_s": math.nan,
        "time_per_image_ms": math.nan,
        "cold": False,
        "worker": worker_name(),
        "started_at": now(),
    }


def now() -> str:
    """Give the time as rows tell it: ISO format, UTC, with microseconds."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def worker_name() -> str:
    """Name this process among all that may work on a sweep."""
    return f"{socket.gethostname()}:{os.getpid()}"


def _head(run: PlannedRun, settings: RunSettings) -> Row:
    held = {"odometry": settings.odometry, "time_limit_s": settings.redo.time_limit_s}
    return {"key": run.key, **variant_columns(run.estimator, run.spec), **held}


def _outcome(run: PlannedRun, scene: Scene, settings: RunSettings) -> _Outcome:
    begin_s = time.perf_counter()
    try:
        estimator = build_estimator(run.estimator, run.spec)
        begin_s = time.perf_counter()
        with time_limit(settings.redo.time_limit_s):
            estimate = estimator.estimate(scene.measurements)
        spent_s = time.perf_counter() - begin_s
        last = scene.last_image_t_ns
        result = evaluate(estimate, scene.truth, settings.evaluation, last_image_t_ns=last)
        return _Outcome(result, spent_s, estimate)
    except TimeLimitError:
        kind, text = TIMEOUT, f"stopped after {settings.redo.time_limit_s:g} s"
    except EstimatorFaultError as fault:
        kind, text = fault.kind, str(fault)
    except BrokenFilterError as error:
        kind, text = BAD_COVARIANCE, str(error)
    except Exception as error:
        _log.debug("run %s", run.key, exc_info=True)
        kind, text = EXCEPTION, said(error)
    return _Outcome(failed(run.estimator, kind, text), time.perf_counter() - begin_s)


def said(error: Exception) -> str:
    """Give an error's kind and text in one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
