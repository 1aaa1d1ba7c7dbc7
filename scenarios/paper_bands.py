"""Do the errors of the observable form stay in a band, and could they?

    python -m scenarios.paper_bands [--quick] [--data-sets out/paper] [--count 24] [--workers 2]
        [--out docs/results]

Takes data sets of the paper's experiment, runs the filter without and with anchors on each, and
puts the error at the end over that half-way beside the same of the Cramer-Rao bound of all
sightings up to there, for position and attitude. Writes ``paper_bands.md`` and ``.csv``. Data sets
that are done are kept, so a killed run goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from joblib import Parallel, delayed

from estimators import build_estimator
from lpet_sim.errors import LpetError
from lpet_sim.evaluation.bounds import pose_bounds
from lpet_sim.evaluation.errors import error_series
from lpet_sim.evaluation.sheet import ENDS, Heading, Sheet, heads, interval, number, words
from lpet_sim.evaluation.statistics import Interval, draw_runs, interval_of
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.sweep.kept_runs import code_key
from lpet_sim.sweep.sweep_job import Scene, prepare
from lpet_sim.sweep.sweep_spec import ArmSpec
from lpet_sim.terminal import bar, wrote
from scenarios.paper.tables import markdown
from scenarios.paper.variants import ANCHORS, M, N, bounded, multiframe
from scenarios.paper_data_sets import MIN_PATH_M, QUICK_MIN_PATH_M, driven_sets, traverse_file

COMMAND: Final = "python -m scenarios.paper_bands"
KEPT: Final = Path("out/paper_bands")
BOUND: Final = "Cramer-Rao bound"
_STANDARD: Final = {"formulation": "standard"}
VARIANTS: Final = {
    f"M = {M}": multiframe(M, **_STANDARD),
    f"M = {M}, observable": multiframe(M, **_STANDARD, anchors=ANCHORS),
    f"N = {N}": bounded(N, **_STANDARD),
    f"N = {N}, observable": bounded(N, **_STANDARD, anchors=ANCHORS),
}
_SEED: Final = 0
Errors = dict[str, list[float]]


def errors_of(path: Path, kept: Path) -> Errors:
    """Give the errors on one data set, or those that were kept.

    Returns:
        For the bound and each variant: position error half-way and at the end [m], and the angle of
        the attitude error there [rad].
    """
    file = kept / f"{path.stem}.json"
    if not file.exists():
        scene = prepare(path, ArmSpec.from_mapping({"sensor": {}}), "fused")
        images = _half_and_last(scene)
        found = {BOUND: _bound_at(scene, images)}
        found |= {name: _errors_at(scene, spec, images) for name, spec in VARIANTS.items()}
        with whole_file(file) as temporary:
            temporary.write_text(json.dumps(found))
    return dict(json.loads(file.read_text()))


def _half_and_last(scene: Scene) -> list[int]:
    sightings = scene.measurements.sightings
    assert sightings is not None
    truth = scene.truth.trajectory
    along_m = np.interp(sightings.t_ns, truth.t_ns, truth.arc_length_m)
    return [int(np.searchsorted(along_m, along_m[-1] / 2)), len(sightings) - 1]


def _bound_at(scene: Scene, images: Sequence[int]) -> list[float]:
    told = scene.measurements
    declared = told.calibration
    assert told.sightings is not None and declared.stereo is not None and declared.imu is not None
    bounds = pose_bounds(
        scene.truth.trajectory.at(told.sightings.t_ns),
        told.sightings,
        declared.stereo,
        told.odometry,
        at=images,
        rate_sigma_radps=declared.imu.gyro_bias_radps,
    )
    return [*(b.position_rms_m for b in bounds), *(b.attitude_rms_rad for b in bounds)]


def _errors_at(scene: Scene, variant: dict[str, Any], images: Sequence[int]) -> list[float]:
    estimate = build_estimator(variant["estimator"], variant["spec"]).estimate(scene.measurements)
    assert scene.measurements.sightings is not None
    t_ns = scene.measurements.sightings.t_ns[list(images)]
    at = np.searchsorted(estimate.trajectory.t_ns, t_ns)
    xi = error_series(estimate.trajectory, scene.truth.trajectory).xi[at]
    return [*np.linalg.norm(xi[:, :3], axis=1), *np.linalg.norm(xi[:, 3:], axis=1)]


def sheet_of(found: Sequence[Errors]) -> Sheet:
    """Make the table from the errors on all data sets."""
    lines = []
    for name in (BOUND, *VARIANTS):
        errors = np.array([one[name] for one in found])
        rms = np.sqrt(np.mean(np.square(errors), axis=0))
        metres, degrees = 100 * rms[:2], 1000 * np.degrees(rms[2:])
        lines.append(
            (
                words(name),
                *(number(x, ".2f") for x in metres),
                interval(_growth(errors[:, :2]), ".2f"),
                *(number(x, ".1f") for x in degrees),
                interval(_growth(errors[:, 2:]), ".2f"),
            )
        )
    headings = (
        Heading("variant, standard form", words=True),
        *heads("position half-way [cm]", "at the end [cm]"),
        Heading("end over half-way", ENDS),
        *heads("attitude half-way [mdeg]", "at the end [mdeg]"),
        Heading("end over half-way, attitude", ENDS),
    )
    note = (
        f"Ideal arm, {len(found)} data sets, RMS over them; their ratio with a 95 % bootstrap "
        "interval over data sets: 1 is a band. The bound is that of all sightings up to the image, "
        "with every landmark remembered."
    )
    return Sheet("bands", "Half-way and at the end", note, headings, tuple(lines))


def _growth(errors: Array) -> Interval:
    """Give the RMS at the end over that half-way, of errors of Shape (data sets, 2)."""
    drawn = np.square(errors[draw_runs(len(errors), stream(_SEED, "bootstrap", "bands"))])
    rms = np.sqrt(drawn.mean(axis=1))
    half, end = np.sqrt(np.mean(np.square(errors), axis=0))
    return interval_of(end / half, rms[:, 1] / rms[:, 0])


def main() -> None:
    """Run, and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data-sets", type=Path, default=Path("out/paper"))
    parser.add_argument("--count", type=int, default=24, help="only the first so many")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    parser.add_argument("--quick", action="store_true", help="takes data sets of 3 m")
    options = parser.parse_args()
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    least = QUICK_MIN_PATH_M if options.quick else MIN_PATH_M
    driven = [d.seed for d in driven_sets(options.data_sets) if d.path_m >= least][: options.count]
    if not driven:
        raise LpetError(f"no data set in {options.data_sets / 'traverses'} covers {least:g} m")
    kept = output_folder(KEPT / code_key("estimators", "lpet_sim"))
    jobs = (delayed(errors_of)(traverse_file(options.data_sets, s), kept) for s in driven)
    found = []
    with bar("estimating") as progress:
        for errors in Parallel(options.workers, return_as="generator")(jobs):
            found.append(errors)
            progress(len(found) / len(driven))
    sheet, out = sheet_of(found), output_folder(options.out)
    said = f"`{COMMAND}`; seeds {', '.join(map(str, driven))}."
    text = "\n\n".join(["# Does the error stay in a band?", said, markdown(sheet)]) + "\n"
    for name, content in (("paper_bands.md", text), ("paper_bands.csv", sheet.to_csv())):
        with whole_file(out / name) as temporary:
            temporary.write_text(content)
    wrote(out / "paper_bands.md", out / "paper_bands.csv")


if __name__ == "__main__":
    main()
