"""Efficiency and consistency on a hundred ideal metres: every estimator against the bound.

    python -m scenarios.hundred_metres [--quick] [--out docs/results] [--workers 2]

Writes ``hundred_metres.csv`` (a row for each seed and estimator) and ``hundred_metres.md``. The
set-up is `lpet_sim.sensors.s_curve`. Each piece is kept in ``out/experiments`` as it ends, so a
killed run goes on where it was; a change of set-up or code begins anew.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import math
import os
import time
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import numpy as np
from rich.progress import track

from estimators import build_estimator
from lpet_sim.evaluation import RunResult, evaluate, failed
from lpet_sim.evaluation.bounds import end_bound
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.sensors.s_curve import SCurveSpec, s_curve_run
from lpet_sim.study.one_traverse import SCENARIOS
from scenarios.metres.tables import DOF, Row, markdown

COMMAND: Final = "python -m scenarios.hundred_metres"
CACHE: Final = Path("out/experiments")
SEEDS: Final = range(1, 51)
PEERS: Final = ("GTSAM fixed lag 10, covariance of every image", "GTSAM fixed lag 10")


@dataclass(frozen=True, eq=False)
class Method:
    """An estimator with its parameters.

    Attributes:
        name: What the table calls it.
        estimator: Its name.
        spec: Its parameters.
        seeds: How many of the seeds it runs on; None: all.
    """

    name: str
    estimator: str
    spec: Mapping[str, Any] = field(default_factory=dict)
    seeds: int | None = None


def slam(name: str, images: int | None = 10, seeds: int | None = None, **spec: Any) -> Method:
    """Give a variant of the filter; without a number of images it keeps every landmark."""
    memory = {"kind": "keep_all"} if images is None else {"kind": "time_to_live", "images": images}
    return Method(name, "slam", {"retention": memory, **spec}, seeds)


METHODS: Final = (
    Method("odometry alone", "odometry"),
    Method("two-view maximum likelihood", "frame_to_frame", {"two_view": {"student_dof": 0.0}}),
    Method("two-view, Student-t (as shipped)", "frame_to_frame"),
    slam("SLAM M = 10, right-invariant"),
    slam("SLAM M = 3, right-invariant", 3),
    slam("SLAM M = 1, right-invariant", 1),
    slam("SLAM M = 10, standard", formulation="standard"),
    slam("SLAM M = 10, first estimates", formulation="first_estimates"),
    Method(PEERS[1], "gtsam_fixed_lag", {"lag_images": 10, "covariances": "last_image"}),
    Method(PEERS[0], "gtsam_fixed_lag", {"lag_images": 10, "covariances": "every_image"}, 5),
    Method("GTSAM batch", "gtsam_batch", {"covariances": "last_image"}),
    slam("SLAM M = 10, told half the noise", noise_scale=0.5),
    slam("SLAM M = 10, told twice the noise", noise_scale=2.0),
    slam("SLAM keeps all, right-invariant", None, seeds=5),
)


def run_piece(spec: SCurveSpec, seed: int, method: Method | None) -> Row:
    """Run one estimator on one seed, or take the bound; kept, and read back the next time."""
    kept = CACHE / "hundred_metres" / f"{_key(spec, method)}_seed{seed}.json"
    if not kept.exists():
        row = _bound(spec, seed) if method is None else _estimate(spec, seed, method)
        with whole_file(kept) as temporary:
            temporary.write_text(json.dumps(row))
    return dict(json.loads(kept.read_text()))


def _key(spec: SCurveSpec, method: Method | None) -> str:
    """Give what a kept result hangs on: the set-up, the parameters, and the code of both."""
    of_method = None if method is None else (method.estimator, dict(method.spec))
    digest = hashlib.sha256(json.dumps([spec.to_mapping(), of_method]).encode())
    digest.update(_code("" if method is None else method.estimator).encode())
    return digest.hexdigest()[:16]


@cache
def _code(estimator: str) -> str:
    """Digest the code behind a bound, or behind an estimator: its own and what all share."""
    root, digest = SCENARIOS.parent, hashlib.sha256()
    names = ("sensors/s_curve.py", "evaluation/bounds.py", "evaluation/sighting_model.py")
    paths = [root / "lpet_sim" / name for name in names]
    paths += sorted((root / "lpet_sim/geometry").glob("*.py"))
    for path in sorted((root / "estimators").rglob("*.py")) if estimator else ():
        own = "gtsam" if path.parent.name == "peers" else path.stem.split("_")[0]
        if own not in ("slam", "gtsam") or estimator.startswith(own):
            paths.append(path)
    for path in paths:
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _bound(spec: SCurveSpec, seed: int) -> Row:
    run = s_curve_run(spec, seed)
    bound = end_bound(run.poses, run.sightings, spec.stereo, run.odometry, run.p_world_of)
    return {
        "seed": seed,
        "bound_m": bound.position_rms_m,
        "bound_deg": math.degrees(bound.attitude_rms_rad),
        "distance_m": float(run.truth.trajectory.arc_length_m[-1]),
        "sightings": float(np.diff(run.sightings.offsets).mean()),
    }


def _estimate(spec: SCurveSpec, seed: int, method: Method) -> Row:
    """Run an estimator; its time is that of the processor, which other work does not touch."""
    _warm(method.estimator, method.spec.get("formulation"))
    run = s_curve_run(spec, seed)
    estimator = build_estimator(method.estimator, dict(method.spec))
    began = time.process_time()
    try:
        estimate = estimator.estimate(run.measurements)
    except Exception as error:  # Any failure is counted; it must not end the experiment.
        return _row(seed, method, failed(method.estimator, text=str(error)), math.nan, math.nan)
    spent_ms = 1e3 * (time.process_time() - began) / spec.images
    landmarks = estimate.diagnostics.get("landmarks", np.array([math.nan]))
    result = evaluate(estimate, run.truth)
    return _row(seed, method, result, spent_ms, float(landmarks.mean()))


@cache
def _warm(estimator: str, formulation: str | None) -> None:
    """Compile what an estimator compiles, once for each worker."""
    fields = {} if formulation is None else {"formulation": formulation}
    run = s_curve_run(SCurveSpec(images=15), 0)
    build_estimator(estimator, fields).estimate(run.measurements)


def _row(seed: int, method: Method, result: RunResult, spent_ms: float, landmarks: float) -> Row:
    nees = result.nees_end or dict.fromkeys(DOF, math.nan)
    xi = np.full(6, math.inf) if result.series is None else result.series.xi[-1]
    return {
        "seed": seed,
        "method": method.name,
        "end_m": float(np.linalg.norm(xi[:3])),
        "end_deg": math.degrees(float(np.linalg.norm(xi[3:]))),
        **{f"nees_{name}": nees[name] for name in DOF},
        "ms_per_image": spent_ms,
        "landmarks": landmarks,
        "failure": result.failure or "",
        "failure_text": result.failure_text,
    }


def write_tables(rows: list[Row], text: str, folder: Path) -> list[Path]:
    """Write the rows as CSV and their summary as Markdown."""
    table, summary = folder / "hundred_metres.csv", folder / "hundred_metres.md"
    with whole_file(table) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(
            {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows
        )
    with whole_file(summary) as temporary:
        temporary.write_text(text)
    return [table, summary]


def main() -> None:
    """Run every seed and method over the workers and write the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="docs/results; out/experiments with --quick")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seeds", type=int, help="only the first so many")
    parser.add_argument("--quick", action="store_true", help="three seeds, 6 m")
    options = parser.parse_args()
    spec = SCurveSpec(images=31) if options.quick else SCurveSpec()
    seeds = SEEDS[:3] if options.quick else SEEDS[: options.seeds]
    every = [(seed, method) for seed in seeds for method in (None, *METHODS)]
    asked = [piece for piece in every if piece[1] is None or piece[1].seeds is None]
    asked += [(seed, m) for seed, m in every if m and m.seeds and seed <= m.seeds]
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(run_piece, spec, *piece): piece for piece in asked}
        done = {
            futures[future]: future.result()
            for future in track(as_completed(futures), "estimating", total=len(futures))
        }
    rows = [{**row, **done[seed, None]} for (seed, method), row in done.items() if method]
    order = [method.name for method in METHODS]
    rows.sort(key=lambda row: (order.index(row["method"]), row["seed"]))
    folder = options.out or (CACHE if options.quick else Path("docs/results"))
    text = "\n".join(markdown(rows, spec, COMMAND, order, PEERS)) + "\n"
    paths = write_tables(rows, text, output_folder(folder))
    print(text, end="")
    for path in paths:
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
