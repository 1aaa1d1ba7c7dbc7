"""Estimators run on recordings at hand, each run kept as it ends: for tables over real data."""

from __future__ import annotations

import hashlib
import json
import logging
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from estimators import build_estimator
from lpet_sim.errors import BrokenFilterError, EstimatorFaultError
from lpet_sim.evaluation import EvaluationSpec, RunResult, evaluate, failed
from lpet_sim.failures import BAD_COVARIANCE, EXCEPTION
from lpet_sim.outputs import whole_file
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import OdometryStream
from lpet_sim.recording.truth import BodyTruth, Truth
from lpet_sim.sweep.sweep_row import share_seen

Row = dict[str, Any]

_log = logging.getLogger(__name__)
_ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Job:
    """One run.

    Attributes:
        data_set: Name of the data set.
        arm: How its sightings are taken.
        estimator: Name of the estimator.
        fields: Its spec.
        label: What tables call it.
        from_image: Image from which on it is scored, moved onto the truth there; None scores all of
            it as it stands.
    """

    data_set: str
    arm: str
    estimator: str
    fields: dict[str, Any]
    label: str
    from_image: int | None = None

    @property
    def key(self) -> str:
        """A short name for all that the run hangs on but code and recording."""
        text = json.dumps([vars(self)[name] for name in sorted(vars(self))])
        return hashlib.sha256(text.encode()).hexdigest()[:16]


def code_key(*packages: str) -> str:
    """Give a short name for the state of some of the product's code, such as ``estimators``."""
    files = [path for package in packages for path in sorted((_ROOT / package).rglob("*.py"))]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()[:12]


def first_images(recording: Recording, count: int) -> Recording:
    """Cut a recording whose odometry and truth have the times of its images."""
    m, truth = recording.measurements, recording.truth
    assert m.sightings is not None and m.odometry is not None and truth is not None
    o, b, sightings = m.odometry, truth.body, m.sightings.images(0, count)
    t_ns, twist = o.t_ns[:count], o.twist[:count]
    odometry = OdometryStream(t_ns, twist, o.variance[:count], o.scale_sigma[:count])
    body = BodyTruth.from_poses(b.t_ns[:count], b.T_world_body[:count])
    cut = replace(m, sightings=sightings, odometry=odometry)
    return replace(recording, measurements=cut, truth=Truth(body))


def run_kept(job: Job, recording: Recording, folder: Path) -> Row:
    """Run an estimator and score it, or give the row that was kept.

    An exception is a row too, with the failure kind ``exception``, or ``bad_covariance`` where a
    filter broke; it is not kept.

    Args:
        job: What to run.
        recording: With a truth.
        folder: Where rows are kept; its name should tell the recording and the code.
    """
    file = folder / f"{job.key}.json"
    if file.exists():
        return dict(json.loads(file.read_text()))
    begin = time.perf_counter()
    try:
        estimate = build_estimator(job.estimator, job.fields).estimate(recording.measurements)
    except Exception as error:
        _log.warning("%s: %s", job.label, error)
        kind = BAD_COVARIANCE if isinstance(error, BrokenFilterError) else EXCEPTION
        kind = error.kind if isinstance(error, EstimatorFaultError) else kind
        return _named(job, failed(job.label, kind, f"{type(error).__name__}: {error}"))
    row = score_row(job, recording, estimate) | {"time_s": time.perf_counter() - begin}
    with whole_file(file) as temporary:
        temporary.write_text(json.dumps(row))
    return row


def score_row(job: Job, recording: Recording, estimate: Estimate) -> Row:
    """Score an estimate as one row, unaligned; attitude errors are about the body's axes.

    Those of roll, pitch and yaw mean nothing where the body may point straight up.
    """
    truth = recording.truth
    assert truth is not None
    anchor = None if job.from_image is None else int(estimate.trajectory.t_ns[job.from_image])
    result = evaluate(estimate, truth, EvaluationSpec(), anchor)
    row, series = _named(job, result), result.series
    if series is None:
        return row
    error_m = np.linalg.norm(series.position_error_m, axis=1)
    row |= {"distance_m": result.distance_m, "rmse_m": float(np.sqrt(np.mean(error_m**2)))}
    row |= {"end_m": float(error_m[-1]), "end_percent": 100 * result.endpoint_ratio}
    row |= {"worst_m": float(error_m.max())}
    for axis, error_deg in zip("xyz", np.abs(np.degrees(series.xi[:, 3:])).T, strict=True):
        row[f"rms_{axis}_deg"] = float(np.sqrt(np.mean(error_deg**2)))
        row[f"worst_{axis}_deg"] = float(error_deg.max())
    for name, value in (result.nees_end or {}).items():
        row[f"nees_{name}_end"] = value
    if series.nees is not None and len(series.nees) > 1:
        mean = np.nanmean(series.nees[1:], axis=0)
        row |= dict(
            zip(("nees_position", "nees_attitude", "nees_pose"), map(float, mean), strict=True)
        )
    return row | _logged(estimate)


def _named(job: Job, result: RunResult) -> Row:
    row: Row = {"data_set": job.data_set, "arm": job.arm, "variant": job.label}
    return row | {"failure": result.failure or "", "failure_text": result.failure_text}


def _logged(estimate: Estimate) -> Row:
    """Give what an estimator says of its images."""
    log, row = estimate.diagnostics, Row()
    if "bridged" in log:
        row["bridged_share"] = float(np.mean(log["bridged"]))
    if "landmarks" in log:
        row["state_max"] = int(np.max(log["landmarks"]))
    if "rejected" in log and "matched" in log:
        row["rejected_share"] = float(log["rejected"].sum() / max(log["matched"].sum(), 1))
        row["dropped"] = int(np.sum(log["dropped"]))
    if "anchors_seen" in log:
        row["anchors_seen_share"] = share_seen(log["anchors_seen"])
    return row
