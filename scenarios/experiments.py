"""The demo's drive over ten seeds, with a true and with a wrong declared calibration.

    python -m scenarios.experiments [--quick] [--out docs/results] [--workers 2]

Writes ``demo_seeds.csv`` (a row for each seed, arm and estimator) and ``demo_seeds.md`` (medians).
Each seed is kept in ``out/experiments`` as it ends, so a killed run goes on where it was; a change
of spec or code begins anew.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import math
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from rich.progress import track

from estimators import build_estimator
from lpet_sim.evaluation import RunResult, evaluate
from lpet_sim.evaluation.attribution import CAUSES
from lpet_sim.evaluation.slip_match import SlipMatch
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.recording.reader import read_recording
from lpet_sim.sensors.camera_spec import DeclaredErrorSpec
from lpet_sim.study.one_traverse import SCENARIOS
from lpet_sim.sweep.miscalibration import miscalibrate
from lpet_sim.sweep.score import estimate_recording, score_recording
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec
from scenarios import first_traverse

Row = dict[str, Any]

SEEDS = range(1, 11)
WRONG = DeclaredErrorSpec(disparity_bias_px=0.2, focal_scale_error=0.002)
CACHE = Path("out/experiments")
COMMAND = "python -m scenarios.experiments"


def demo_spec(quick: bool) -> TraverseSpec:
    """Give the demo's traverse without keeping its images; a straight metre for --quick."""
    spec = TraverseSpec.from_yaml(SCENARIOS / "demo.yaml")
    if quick:
        spec = first_traverse.quick(spec, waypoints_m=((0.0, 0.0), (1.0, 0.0)), slip_s=5.0)
        spec = spec.model_copy(update={"route": None})
    images = spec.images and spec.images.model_copy(update={"keep_every": 0})
    return spec.model_copy(update={"images": images})


def run_seed(spec: TraverseSpec, seed: int) -> list[Row]:
    """Drive one seed and give its rows; the result is kept, and read back the next time."""
    key = _key(spec)
    kept = CACHE / f"{spec.name}_{key}_seed{seed}.json"
    if kept.exists():
        return list(json.loads(kept.read_text()))
    run = output_folder(CACHE) / f"{spec.name}_{key}_seed{seed}.rrd"
    simulate(spec, seed, run)
    rows = _score(run, seed)
    with whole_file(kept) as temporary:
        temporary.write_text(json.dumps(rows))
    run.unlink()
    return rows


def _key(spec: TraverseSpec) -> str:
    """Give what a kept result hangs on: the spec, and every line of the product's code."""
    digest = hashlib.sha256(json.dumps(spec.to_mapping()).encode())
    for package in ("lpet_sim", "estimators"):
        for path in sorted((SCENARIOS.parent / package).rglob("*.py")):
            digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _score(run: Path, seed: int) -> list[Row]:
    estimate_recording(run)
    score = score_recording(run)
    rows = [_row(seed, "true calibration", result) for result in score.results]
    measurements = miscalibrate(read_recording(run).measurements, WRONG)
    estimate = build_estimator("frame_to_frame").estimate(measurements)
    rows.append(_row(seed, "wrong calibration", evaluate(estimate, score.truth)))
    reckoned = rows[[row["estimator"] for row in rows].index("dead_reckoning")]
    if score.attribution is not None:
        causes = score.attribution.contributions_m
        reckoned.update({f"{name}_m": math.hypot(*vector) for name, vector in causes.items()})
    reckoned.update(_slip_row(score.slips or ()))
    return rows


def _slip_row(slips: tuple[SlipMatch, ...]) -> Row:
    """Sum up what comparing vision with the wheels found of the forced slip."""
    forced = [match for match in slips if match.event is not None and not match.harmless]
    row: Row = {"found_unforced": sum(match.event is None for match in slips)}
    if forced:
        row["found_in_time"] = int(forced[0].within_one_image)
        row["lost_true_m"] = forced[0].lost_true_m
        if forced[0].found is not None:
            row["found_late_s"] = forced[0].late_s
            row["found_lost_m"] = forced[0].found.lost_m
    return row


def _row(seed: int, arm: str, result: RunResult) -> Row:
    roll, pitch, yaw = np.degrees(result.worst_attitude_rad)
    return {
        "seed": seed,
        "arm": arm,
        "estimator": result.name,
        "distance_m": result.distance_m,
        "end_error_m": math.hypot(*result.endpoint_error_m),
        "end_error_percent": 100 * result.endpoint_ratio,
        "worst_error_percent": 100 * result.worst_ratio,
        "worst_roll_deg": roll,
        "worst_pitch_deg": pitch,
        "worst_yaw_deg": yaw,
        "nees_pose_6dof": result.nees_end["pose"] if result.nees_end else math.nan,
        "failure": result.failure or "",
    }


def write_tables(rows: list[Row], folder: Path) -> list[Path]:
    """Write the rows as CSV and their medians as Markdown."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    table, summary = folder / "demo_seeds.csv", folder / "demo_seeds.md"
    with whole_file(table) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        writer.writerows({k: _text(v) for k, v in row.items()} for row in rows)
    with whole_file(summary) as temporary:
        temporary.write_text("\n".join(_summary(rows)) + "\n")
    return [table, summary]


def _text(value: object) -> object:
    return f"{value:.5g}" if isinstance(value, float) else value


def _summary(rows: list[Row]) -> list[str]:
    seeds = sorted({row["seed"] for row in rows})
    lines = [
        "# The demo's drive over its seeds",
        "",
        f"`{COMMAND}`, seeds {seeds[0]} to {seeds[-1]}; median (least to largest) over the seeds.",
        "",
        "| arm | estimator | end error [% of distance] | worst after 5 m [%] | worst yaw [deg] |",
        "|---|---|---|---|---|",
    ]
    for arm, name in dict.fromkeys((row["arm"], row["estimator"]) for row in rows):
        group = [row for row in rows if (row["arm"], row["estimator"]) == (arm, name)]
        columns = ("end_error_percent", "worst_error_percent", "worst_yaw_deg")
        cells = " | ".join(_spread([row[column] for row in group]) for column in columns)
        lines.append(f"| {arm} | {name} | {cells} |")
    reckoned = [row for row in rows if "slip_m" in row]
    lines += ["", "Dead reckoning's end error by cause [m]:", "", "| cause | length |", "|---|---|"]
    for cause in CAUSES:
        lines.append(f"| {cause} | {_spread([row[f'{cause}_m'] for row in reckoned])} |")
    return [*lines, *_slip_summary(reckoned)]


def _slip_summary(rows: list[Row]) -> list[str]:
    forced = [row for row in rows if "found_in_time" in row]
    found = [row for row in forced if "found_late_s" in row]
    lines = ["", "Slip found by comparing frame-to-frame vision with the wheels:", ""]
    in_time = sum(row["found_in_time"] for row in forced)
    where = f"{len(forced)} seeds in which it cost 2 cm or more (of {len(rows)})"
    lines.append(f"- forced slip found within one image: {in_time} of {where}")
    if found:
        lines.append(f"- onset late by [s]: {_spread([row['found_late_s'] for row in found])}")
        lines.append(f"- lost, found [m]: {_spread([row['found_lost_m'] for row in found])}")
        lines.append(f"- lost, true [m]: {_spread([row['lost_true_m'] for row in found])}")
    unforced = [row["found_unforced"] for row in rows if "found_unforced" in row]
    return [*lines, f"- other slips found: {sum(unforced)} in {len(unforced)} seeds"]


def _spread(values: list[float]) -> str:
    return f"{np.median(values):.3f} ({min(values):.3f} to {max(values):.3f})"


def main() -> None:
    """Run the seeds over the workers and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="docs/results; out/experiments with --quick")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="two seeds, a metre")
    options = parser.parse_args()
    spec = demo_spec(options.quick)
    seeds = SEEDS[:2] if options.quick else SEEDS
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        done = {pool.submit(run_seed, spec, seed): seed for seed in seeds}
        rows_of = {
            done[future]: future.result()
            for future in track(as_completed(done), "driving", total=len(done))
        }
    rows = [row for seed in seeds for row in rows_of[seed]]
    folder = options.out or (CACHE if options.quick else Path("docs/results"))
    for path in write_tables(rows, folder):
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
