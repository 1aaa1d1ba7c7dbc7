"""Static prediction against simulation, over sensors drawn beforehand.

    python -m scenarios.tradeoff_check [--quick] [--out out/tradeoff_check] [--data-sets DIR]

Forty settings of a Latin hypercube (`SEED`, scenarios/tradeoff/check.yaml) are predicted statically
and simulated on one drive of the paper's experiment (`DRIVE`) with five draws of landmarks, noise
and odometry each. The same command goes on where a run was stopped. The drive is made unless the
folder of data sets holds it.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import spearmanr

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terminal import bar, say, two_bars, wrote
from lpet_sim.tradeoff.candidate import PARAMETERS, Candidate
from lpet_sim.tradeoff.simulated import SimulatedCandidate, simulate_candidates
from lpet_sim.tradeoff.space import SamplingSpec, draw_candidates
from lpet_sim.tradeoff.spec import TradeoffSpec
from lpet_sim.tradeoff.tradeoff_figures import plot_agreement, save
from scenarios.paper_data_sets import paper_traverse, traverse_file

SPEC = Path(__file__).parent / "tradeoff" / "check.yaml"
OUT = Path("out/tradeoff_check")
SEED = 40
"""Of the hypercube, the static landmarks and the draws; chosen before the first run."""
DRIVE = 3
"""The data set of the paper's experiment that is driven on; nothing was tried on it before."""
_RESAMPLED = 2000


@dataclass(frozen=True)
class Setting:
    """One setting of the hypercube with what came of it.

    Attributes:
        candidate: The sensor.
        predicted: Static prediction of the RMS position error over the distance.
        bound: RMS over the draws of the Cramer-Rao bound of what was really measured.
        errors: RMS error of each estimator, the deciding one first.
        failed: Runs of the deciding estimator that failed.
    """

    candidate: Candidate
    predicted: float
    bound: float
    errors: dict[str, float]
    failed: int


def quick_traverse() -> TraverseSpec:
    """Make a short straight drive over flat ground."""
    return TraverseSpec.from_mapping(
        {
            "name": "short",
            "terrain": {"relief": {"rms_slope_rad": 0.02}, "far": None},
            "drive": {"waypoints_m": [[0, 0], [3, 0]]},
            "route": None,
            "images": None,
        }
    )


def recording_of(out: Path, data_sets: Path | None, quick: bool) -> Path:
    """Give the drive, made if it is not there."""
    path = traverse_file(out if data_sets is None or quick else data_sets, DRIVE)
    if not path.exists():
        with bar("driving") as progress:
            simulate(quick_traverse() if quick else paper_traverse(DRIVE), DRIVE, path, progress)
    return path


def settings_of(
    candidates: Sequence[Candidate], found: dict[int, SimulatedCandidate]
) -> list[Setting]:
    """Put prediction and simulation of each setting side by side."""
    rows = []
    for i, candidate in enumerate(candidates):
        one = found[i]
        labels = dict.fromkeys(str(row["variant"]) for row in one.rows)
        held = [row["bound_m"] / row["path_m"] for row in one.of(one.lead)]
        bound = math.sqrt(float(np.mean(np.square(held))))
        errors = {label: one.error_ratio(label) for label in labels}
        rows.append(Setting(candidate, one.predicted_ratio, bound, errors, one.efficiency.failed))
    return rows


def rank_correlation(x: Array, y: Array) -> float:
    """Give Spearman's rank correlation."""
    return float(spearmanr(x, y).statistic)


def interval(x: Array, y: Array) -> tuple[float, float]:
    """Give the 95 % bootstrap interval of the rank correlation, over settings."""
    rng = stream(SEED, "tradeoff_check", "bootstrap")
    picks = rng.integers(0, len(x), (_RESAMPLED, len(x)))
    values = [rank_correlation(x[p], y[p]) for p in picks if len(set(x[p])) > 2]
    low, high = np.quantile(values, [0.025, 0.975])
    return float(low), float(high)


def lines_of(settings: Sequence[Setting]) -> list[str]:
    """Write the rank correlations, over all settings and over the best third."""
    predicted = np.array([s.predicted for s in settings])
    columns = {"Cramer-Rao bound": np.array([s.bound for s in settings])}
    for label in settings[0].errors:
        columns[label] = np.array([s.errors[label] for s in settings])
    third = max(3, len(settings) // 3)
    best = np.argsort(predicted)[:third]
    out = []
    for name, y in columns.items():
        low, high = interval(predicted, y)
        own = np.argsort(y)[:third]
        ratio = y / predicted
        quartiles = ", ".join(f"{q:.2f}" for q in np.quantile(ratio, [0.25, 0.5, 0.75]))
        out.append(
            f"{name}: rank correlation with the prediction {rank_correlation(predicted, y):.3f} "
            f"[{low:.3f}, {high:.3f}] over {len(settings)} settings; "
            f"{rank_correlation(predicted[best], y[best]):.3f} within the third that is predicted "
            f"best, {rank_correlation(predicted[own], y[own]):.3f} within its own best third; over "
            f"the prediction: quartiles {quartiles}, at most {ratio.max():.2f}"
        )
    return out


def write_table(settings: Sequence[Setting], path: Path) -> Path:
    """Write one row for each setting."""
    figures = ("predicted", "bound", *settings[0].errors)
    with whole_file(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([*PARAMETERS, *(f"{name}_percent" for name in figures), "failed"])
        for s in settings:
            shown = [getattr(s.candidate, name) for name in PARAMETERS]
            percent = [f"{100 * v:.5f}" for v in (s.predicted, s.bound, *s.errors.values())]
            short = [f"{v:.4f}" if isinstance(v, float) else v for v in shown]
            writer.writerow([*short, *percent, s.failed])
    return path


def main() -> None:
    """Compare them."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="four settings on three metres")
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--data-sets", type=Path, help="where the paper's traverses are")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--draws", type=int, help="fewer draws than the five of the spec")
    told = parser.parse_args()
    folder = output_folder(told.out)
    spec = TradeoffSpec.from_yaml(SPEC)
    assert spec.simulation is not None
    drive = recording_of(folder, told.data_sets, told.quick)
    draws = told.draws or (1 if told.quick else spec.simulation.draws)
    runs = {"recordings": (str(drive),), "draws": draws}
    sampling = SamplingSpec(count=4) if told.quick else spec.sampling
    told_spec = spec.model_copy(
        update={"simulation": spec.simulation.model_copy(update=runs), "sampling": sampling}
    )
    candidates = draw_candidates(spec.space, sampling, SEED)
    pool = Pool(told.workers)
    with two_bars("ready", "drives") as (ready, count):
        ready(1.0)
        found = simulate_candidates(
            told_spec, dict(enumerate(candidates)), folder, SEED, pool, count, bounds=True
        )
    settings = settings_of(candidates, found)
    for line in lines_of(settings):
        say(line)
    picture = folder / "agreement.png"
    drawn = {"Cramer-Rao bound": [s.bound for s in settings]}
    drawn |= {name: [s.errors[name] for s in settings] for name in settings[0].errors}
    save(plot_agreement([s.predicted for s in settings], drawn), picture)
    wrote(write_table(settings, folder / "tradeoff_check.csv"), picture)


if __name__ == "__main__":
    main()
