"""Predict the error of visual motion on real stereo images, and set the obtained one beside it.

    python -m scenarios.kitti_prediction [--quick] [--data DIR] [--out docs/results]

The sensor is measured on the matches of KITTI 00 at the true poses (images 20 to 99; the truth is
off by over a metre before). A landmark sensor of KITTI's camera and that noise then drives the same
true path, past landmarks of its own, and frame-to-frame motion is estimated for 20 seeds. Writes
``kitti_prediction.md`` and ``kitti_prediction.csv``. The front end's sightings are kept in
``out/real_stereo``.
"""

from __future__ import annotations

import argparse
import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from rich.progress import track as shown_progress

from estimators import Estimator, build_estimator
from estimators.frame_to_frame import FrameToFrame
from lpet_sim.datasets import DataError, data_path
from lpet_sim.evaluation.sensor_fit import SensorFit, fit_sensor
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.streams import Measurements, SightingStream
from lpet_sim.sensors.landmark_sensor import report_sightings
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec, SightingNoiseSpec
from lpet_sim.sweep.calibrate import sensor_spec, white_px
from scenarios.kitti.reading import READING, SLAM_EVERY
from scenarios.kitti.world import (
    FIRST,
    Drive,
    calibration_of,
    measured_landmarks,
    sighted,
    strewn_landmarks,
)

COMMAND: Final = "python -m scenarios.kitti_prediction"
SEEDS: Final = 20
RANSAC_SEEDS: Final = 5
NOTHING: Final = np.zeros(6)
SLAM: Final = {"retention": {"kind": "time_to_live", "images": 3}}
OBTAINED: Final = "**obtained on the real images**"
Row = dict[str, str | int]


@dataclass(frozen=True)
class Arm:
    """One prediction.

    Attributes:
        name: What is in it.
        noise: The noise of its sightings.
        misclassified: Share of wrong names.
        shared: Focal, baseline and mounting errors of the camera, as in `fit_noise`, Shape (6,).
    """

    name: str
    noise: SightingNoiseSpec
    misclassified: float
    shared: Array


def arms(fit: SensorFit, shared: Array) -> tuple[Arm, ...]:
    """Give the predictions, each with one more cause of error than the one before."""
    spec = sensor_spec(fit)
    white = spec.noise.model_copy(update={"bias_sigma_px": 0.0})
    wrong, scales = spec.misclassification_probability, np.where(np.arange(6) < 3, shared, 0.0)
    return (
        Arm("white noise", white, 0.0, NOTHING),
        Arm("and fixed errors, wrong names", spec.noise, wrong, NOTHING),
        Arm("and the camera's scales as measured", spec.noise, wrong, scales),
        Arm("and its mounting as measured", spec.noise, wrong, shared),
    )


def predict(drive: Drive, fit: SensorFit, arm: Arm, kind: str, runs: Runs) -> list[Array]:
    """Simulate the drive for every seed and give the errors, Shape (6,) each."""
    out = []
    for seed in range(runs.seeds):
        if kind == "measured":
            landmarks, detection = measured_landmarks(drive, fit.p_world, arm.shared, seed)
        else:
            landmarks, detection = strewn_landmarks(drive, fit, arm.shared, seed)
        spec = LandmarkSensorSpec(
            noise=arm.noise,
            detection_probability=detection,
            misclassification_probability=arm.misclassified,
            disparity_bias_px=float(arm.shared[0]),
        )
        sightings = report_sightings(landmarks, drive.stereo, spec, seed)
        out.append(runs.errors(drive, sightings, seed))
    return out


@dataclass(frozen=True)
class Runs:
    """Which estimator runs, and how often.

    Attributes:
        estimator: Its name.
        seeds: How many simulations.
        repeats: How many runs on the real images.
    """

    estimator: str
    seeds: int
    repeats: int

    def errors(self, drive: Drive, sightings: SightingStream, seed: int) -> Array:
        """Give the end's error along the start's axes [m], and its rotation [rad], Shape (6,)."""
        if self.estimator == "frame_to_frame":
            estimator: Estimator = FrameToFrame(ransac_seed=seed)
        else:
            estimator = build_estimator("slam", SLAM)
            sightings = every(sightings, SLAM_EVERY)
        given = Measurements(calibration_of(drive), sightings=sightings)
        end, true = estimator.estimate(given).trajectory.T_world_body[-1], drive.truth.T_world_body
        off_m = true.rotation[0].T @ (end.translation - true.translation[-1])
        return np.concatenate([off_m, (true[-1].inverse() @ end).log()[3:]])

    def obtained(self, drive: Drive) -> list[Array]:
        """Run on the real sightings."""
        return [self.errors(drive, drive.sightings, seed) for seed in range(self.repeats)]


def every(sightings: SightingStream, step: int) -> SightingStream:
    """Keep one in so many landmarks, for a filter whose cost grows with their square."""
    return sightings.chosen(sightings.landmark_id % step == 0)


def row(piece: str, estimator: str, what: str, drive: Drive, found: list[Array]) -> Row:
    """Sum up runs: the end's error in percent of the distance, its direction, its rotation."""
    values = np.array(found)
    length_m = float(drive.truth.arc_length_m[-1])
    percent = 100 * np.linalg.norm(values[:, :3], axis=1) / length_m
    degrees = np.degrees(np.linalg.norm(values[:, 3:], axis=1))
    low, middle, high = np.quantile(percent, [0.05, 0.5, 0.95])
    ahead, left, up = 100 * np.median(values[:, :3], axis=0) / length_m
    return {
        "images": piece,
        "estimator": estimator,
        "sightings": what,
        "runs": len(found),
        "end_percent": f"{middle:.3f}",
        "end_5_percent": f"{low:.3f}",
        "end_95_percent": f"{high:.3f}",
        "ahead_percent": f"{ahead:+.3f}",
        "left_percent": f"{left:+.3f}",
        "up_percent": f"{up:+.3f}",
        "rotation_deg": f"{np.median(degrees):.3f}",
    }


def experiment(drive: Drive, quick: bool) -> tuple[list[Row], SensorFit]:
    """Run every arm, and the held-out halves."""
    vision = Runs("frame_to_frame", 2 if quick else SEEDS, 1 if quick else RANSAC_SEEDS)
    filter_ = Runs("slam", 1 if quick else SEEDS, 1)
    fit = fit_sensor(drive.sightings, drive.truth, drive.stereo, settle=True)
    last = FIRST + len(drive.truth) - 1
    piece = f"{FIRST}-{last}"
    jobs = [(arm, "strewn") for arm in arms(fit, fit.shared)]
    jobs += [(arm, "measured") for arm in arms(fit, fit.shared)[1::2]]
    rows = [row(piece, "frame_to_frame", OBTAINED, drive, vision.obtained(drive))]
    for arm, kind in shown_progress(jobs, "frame to frame"):
        found = predict(drive, fit, arm, kind, vision)
        rows.append(row(piece, "frame_to_frame", f"{kind} landmarks: {arm.name}", drive, found))
    if quick:
        return rows, fit
    rows.append(row(piece, "slam", OBTAINED, drive, filter_.obtained(drive)))
    for arm in shown_progress(arms(fit, fit.shared)[1::2], "slam"):
        found = predict(drive, fit, arm, "strewn", filter_)
        rows.append(row(piece, "slam", f"strewn landmarks: {arm.name}", drive, found))
    return rows + held_out(drive, vision), fit


def held_out(drive: Drive, runs: Runs) -> list[Row]:
    """Predict each half with the camera's errors that were measured on the other."""
    middle = len(drive.truth) // 2
    halves = drive.piece(0, middle + 1), drive.piece(middle, len(drive.truth))
    names = f"{FIRST}-{FIRST + middle}", f"{FIRST + middle}-{FIRST + len(drive.truth) - 1}"
    fits = [fit_sensor(half.sightings, half.truth, half.stereo, settle=True) for half in halves]
    rows = []
    for k in shown_progress(range(2), "held-out halves"):
        half, fit = halves[k], fits[k]
        rows.append(row(names[k], "frame_to_frame", OBTAINED, half, runs.obtained(half)))
        for arm in arms(fit, fits[1 - k].shared)[1::2]:
            found = predict(half, fit, arm, "strewn", runs)
            told = f"strewn landmarks: {arm.name}" + (
                " on the other half" if any(arm.shared) else ""
            )
            rows.append(row(names[k], "frame_to_frame", told, half, found))
    return rows


def report(rows: list[Row], fit: SensorFit) -> list[str]:
    """Write the table and what was measured."""
    noise, tracks = fit.noise, fit.tracks
    shared, degrees = fit.shared, np.degrees(fit.shared[3:])
    white = white_px(fit)
    lines = [
        "# Prediction against reality: KITTI 00",
        "",
        f"`{COMMAND}`; simulations of seeds 0 to {SEEDS - 1}, real images with RANSAC seeds 0 to "
        f"{RANSAC_SEEDS - 1}; images {FIRST} to 99, at 10 Hz.",
        "",
        "Measured on the matches at the true poses, with what all landmarks of an image have in "
        "common taken out:",
        "",
        f"- noise that is new in each image {_px(white)} px (u_left, u_right, v; with what changes "
        f"slowly {_px(noise.sigma_px)}), fixed error of a landmark {noise.fixed_px[0]:.2f} px, "
        f"declared {noise.declared_px:.2f} px;",
        f"- heavy tails: Student's t of {noise.tails:.1f} degrees of freedom, kurtosis "
        f"{noise.kurtosis.max():.0f}; correlation from image to image "
        f"{noise.lag_correlation[0].max():.2f}; {100 * tracks.impossible:.1f} % impossible;",
        f"- {tracks.sightings.mean():.0f} sightings an image, {100 * tracks.seen_next:.0f} % of "
        f"those in view seen again in the next, {100 * tracks.lost:.0f} % lost; half of them "
        f"nearer than {tracks.range_m[3]:.0f} m;",
        f"- declared over true: focal length {100 * shared[1]:+.2f} %, baseline "
        f"{100 * shared[2]:+.2f} %; disparity bias {shared[0]:+.3f} px; the camera turned against "
        f"the frame of the truth by {degrees[0]:+.2f}, {degrees[1]:+.2f}, {degrees[2]:+.2f} deg "
        "about its x (right), y (down) and z.",
        "",
        "| images | estimator | sightings | end % median (5-95 %) | ahead, left, up % | deg |",
        "|---|---|---|---|---|---|",
    ]
    for r in rows:
        end = f"{r['end_percent']} ({r['end_5_percent']}-{r['end_95_percent']})"
        where = f"{r['ahead_percent']}, {r['left_percent']}, {r['up_percent']}"
        cells = r["images"], r["estimator"], r["sightings"], end, where, r["rotation_deg"]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return [*lines, ""]


def _px(values: Array) -> str:
    return ", ".join(f"{value:.2f}" for value in values)


def write(folder: Path, rows: list[Row], lines: list[str]) -> None:
    """Write and print the tables."""
    table, text = folder / "kitti_prediction.csv", folder / "kitti_prediction.md"
    with whole_file(table) as temporary, temporary.open("w") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    with whole_file(text) as temporary:
        temporary.write_text("\n".join(lines))
    print("\n".join(lines))
    print(f"wrote {table}\nwrote {text}")


def main() -> None:
    """Measure, predict, and set the obtained error beside it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, default=None, help="folder of the sequence")
    parser.add_argument("--out", type=Path, help="docs/results; out/experiments with --quick")
    parser.add_argument("--quick", action="store_true", help="two seeds, no filter, no halves")
    options = parser.parse_args()
    try:
        folder = options.data or data_path("stereo/kitti00_first100")
    except DataError as error:
        print(f"skipped: {error}")
        return
    rows, fit = experiment(sighted(folder), options.quick)
    out = options.out or (Path("out/experiments") if options.quick else Path("docs/results"))
    lines = report(rows, fit) + ([] if options.quick or options.data else [*READING, ""])
    write(output_folder(out), rows, lines)


if __name__ == "__main__":
    main()
