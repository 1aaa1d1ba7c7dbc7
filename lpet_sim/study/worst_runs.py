"""The worst runs of a study's best algorithm as recordings, to be looked at."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Final

from estimators import build_estimator
from lpet_sim.errors import BrokenFilterError
from lpet_sim.evaluation.errors import error_series
from lpet_sim.evaluation.study_verdict import AlgorithmOutcome, worst_runs
from lpet_sim.outputs import output_folder
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.overlay import add_estimate
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.writer import write_recording
from lpet_sim.study.chain import DRIVES, StudyResult
from lpet_sim.study.report import StudyVerdict
from lpet_sim.study.runs import sweep_of
from lpet_sim.sweep.sweep_job import prepare
from lpet_sim.sweep.sweep_plan import expand

WORST_RUNS: Final = "worst_runs"


def save_worst_runs(
    result: StudyResult, verdict: StudyVerdict, progress: Progress = silent
) -> list[Path]:
    """Run the worst runs of the best algorithm again, and keep what was measured and estimated.

    Args:
        result: The study.
        verdict: Its verdict.
        progress: Told the share done.

    Returns:
        The recordings; one of a run that came to no estimate holds what was measured.
    """
    folder = result.folder / WORST_RUNS
    shutil.rmtree(folder, ignore_errors=True)
    if result.rows is None or verdict.best is None:
        return []
    output_folder(folder)
    runs, paths = worst_runs(result.rows, verdict.best), []
    for done, (run, data_set) in enumerate(runs, 1):
        paths.append(folder / f"{run}.rrd")
        _save(result, verdict.best, data_set, paths[-1])
        progress(done / len(runs))
    return paths


def _save(result: StudyResult, best: AlgorithmOutcome, data_set: str, path: Path) -> None:
    assert result.sensor is not None
    drive, _, arm = data_set.rpartition("-")
    drives = next(stage.path for stage in result.stages if stage.name == DRIVES)
    sweep = sweep_of(result.spec, result.sensor, drives)
    source = drives / f"{drive}.rrd"
    scene = prepare(source, sweep.arms[arm], sweep.odometry)
    manifest = read_recording(source).manifest
    write_recording(path, Recording(manifest, scene.measurements, scene.truth))
    variant = next(v for v in expand(sweep.variants) if v.label == best.variant)
    try:
        estimate = build_estimator(variant.estimator, variant.spec).estimate(scene.measurements)
    except BrokenFilterError:
        return
    add_estimate(path, estimate, error_series(estimate.trajectory, scene.truth.trajectory))
