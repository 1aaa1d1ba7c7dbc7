"""The chain from a traverse to its scores, with every file that a reader wants."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lpet_sim.evaluation import Requirement
from lpet_sim.evaluation.figures import plot_errors, plot_plan_view, save
from lpet_sim.outputs import output_folder
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.arrays import Array
from lpet_sim.sweep.score import Score, estimate_recording, score_recording
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.terrain import build_terrain

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"

_SIMULATED, _ESTIMATED = 0.9, 0.97
_PLAN_MARGIN_M = 3.0
_PLAN_ROCK_MIN_M = 0.1


@dataclass(frozen=True)
class StudyResult:
    """What a study has found.

    Attributes:
        score: Estimates and their scores.
        requirement: What they were held to.
        written: The files written.
    """

    score: Score
    requirement: Requirement
    written: tuple[Path, ...]


def run_traverse(
    spec: TraverseSpec,
    seed: int,
    folder: Path,
    requirement: Requirement | None = None,
    progress: Progress = silent,
) -> StudyResult:
    """Drive a traverse, run every estimator on the recording, score them and draw the result.

    Args:
        spec: The traverse.
        seed: The run's seed.
        folder: Where the recording and the pictures go.
        requirement: What the estimates are held to; 1 % and 1 deg throughout if None.
        progress: Called with the fraction done.

    Raises:
        LpetError: The traverse cannot be driven, or the folder cannot be written.
    """
    run = output_folder(folder) / f"{spec.name}_seed{seed}.rrd"
    simulate(spec, seed, run, lambda fraction: progress(_SIMULATED * fraction))
    estimate_recording(run)
    progress(_ESTIMATED)
    score = score_recording(run)
    held_to = requirement or Requirement()
    pictures = draw_score(score, held_to, folder, run.stem, _rocks_beside(spec, seed, score))
    progress(1.0)
    return StudyResult(score, held_to, (run, *pictures))


def draw_score(
    score: Score,
    requirement: Requirement,
    folder: Path,
    stem: str,
    rocks_m: Array | None = None,
) -> tuple[Path, ...]:
    """Draw the plan view (the paper's figure 4) and the errors against distance.

    Args:
        score: What to draw.
        requirement: Whose limits to draw.
        folder: Where the pictures go.
        stem: How their names begin.
        rocks_m: Rocks to draw in the plan view, (x, y, diameter) [m], Shape (n, 3).

    Returns:
        The pictures written.
    """
    plan, errors = folder / f"{stem}_plan.png", folder / f"{stem}_errors.png"
    save(plot_plan_view(score.truth.trajectory, score.estimates, rocks_m), plan)
    save(plot_errors(score.results, requirement), errors)
    return plan, errors


def _rocks_beside(spec: TraverseSpec, seed: int, score: Score) -> Array:
    xy = score.truth.trajectory.T_world_body.translation[:, :2]
    corners = (*(xy.min(axis=0) - _PLAN_MARGIN_M), *(xy.max(axis=0) + _PLAN_MARGIN_M))
    box = Box(*(float(x) for x in corners))
    rocks = build_terrain(spec.terrain, seed).rocks(box, _PLAN_ROCK_MIN_M)
    return np.column_stack([rocks.p_world_rock[:, :2], rocks.diameter_m])


def run_demo(folder: Path, seed: int, progress: Progress = silent) -> StudyResult:
    """Run the demo's traverse: at least 20 m among rocks, with one forced slip.

    Args:
        folder: Where its files go.
        seed: The run's seed.
        progress: Called with the fraction done.
    """
    spec = TraverseSpec.from_yaml(SCENARIOS / "demo.yaml")
    return run_traverse(spec, seed, folder, progress=progress)
