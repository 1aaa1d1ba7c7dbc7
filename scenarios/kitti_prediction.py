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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from rich.progress import track as shown_progress

from estimators import Estimator, build_estimator
from estimators.frame_to_frame import FrameToFrame
from lpet_sim.datasets import DataError, data_path
from lpet_sim.evaluation.noise_model import corrected
from lpet_sim.evaluation.sensor_fit import SensorFit, fit_sensor
from lpet_sim.evaluation.sighting_tracks import CameraPath, since
from lpet_sim.evaluation.track_kernels import Flags
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.kitti import GRAVITY_MPS2
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import Measurements, SightingStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream
from lpet_sim.sensors.landmark_sensor import ShownLandmarks, report_sightings
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec, SightingNoiseSpec
from lpet_sim.sweep.calibrate import sensor_spec, white_px
from lpet_sim.sweep.importing import import_kitti
from lpet_sim.sweep.sighting import sight_recording
from lpet_sim.vision.spec import FrontEndSpec

COMMAND: Final = "python -m scenarios.kitti_prediction"
CACHE: Final = Path("out/real_stereo")
FIRST: Final = 20
SEEDS: Final = 20
RANSAC_SEEDS: Final = 5
NOTHING: Final = np.zeros(6)
DISPARITY_MIN_PX: Final = 0.5
SLAM: Final = {"retention": {"kind": "time_to_live", "images": 3}}
SLAM_EVERY: Final = 4
OBTAINED: Final = "**obtained on the real images**"
READING: Final = (
    "*Strewn* landmarks share with the real ones how many there are, where in the image and",
    "how far away new ones appear, and how often they are lost; *measured* ones lie where the",
    "real ones do and are seen in the same images. Noise is drawn anew for both. Each row",
    f"adds a cause to the one before it. The filter (time to live 3) gets one in {SLAM_EVERY}",
    "landmarks.",
    "",
    "What agrees: with all that was measured, the median end error is 11 % above the obtained",
    "one for frame-to-frame and 8 % below it for the filter, and the end lies to the same",
    "side: short, to the right, and low. Where landmarks lie (strewn or measured) hardly",
    "matters.",
    "",
    "What does not, and why:",
    "",
    "- Noise is not what limits vision here. White noise explains 1 % of the obtained error,",
    "  fixed errors and wrong names another 4 %. The rest is systematic: the camera is turned",
    "  by 0.8 deg against the frame in which the truth is given, and distances read short.",
    "  Which calibration is at fault, the camera's or that of the truth against the camera,",
    "  cannot be told from here.",
    "- The systematic errors were measured on the same images and the same truth, so that the",
    "  rows that have them test the chain and are no foresight. The held-out halves are: what",
    "  the mounting does upwards carries over (-1.06 for -0.90 %, -0.88 for -0.90 %);",
    "  sideways it is off by 0.6 %, a third of a degree; ahead it is off by 1 %. The camera's",
    "  focal length and baseline cannot change from half to half, so the scale error of the",
    "  first half is more likely the truth's, whose images before 20 are known to be off by",
    "  over a metre. The standard errors take tracks as independent, know nothing of this,",
    "  and are far too small here.",
    "- The rotation at the end comes out at a quarter to a half of the obtained one: an",
    "  attitude error of the truth that changes along the way is in no sensor's figures.",
    "- The filter's predicted errors scatter widely (0.13 to 0.88 % without systematic",
    "  errors): it has no odometry here, so that each step starts from the one before, among",
    "  wrong names.",
    "- Real matches are not Gaussian and not white: kurtosis 13, and 0.6 of the noise carries",
    "  over to the next image. A landmark sensor has the slow part as a fixed error only.",
)
"""What the committed table says; a run with other data says something else."""
Row = dict[str, str | int]


@dataclass(frozen=True)
class Drive:
    """What is known of the piece of the sequence that is scored.

    Attributes:
        truth: True poses of the body at the images.
        stereo: The declared pair.
        sightings: What the front end saw in the real images.
    """

    truth: Trajectory
    stereo: StereoCalibration
    sightings: SightingStream

    def piece(self, first: int, last: int) -> Drive:
        """Give the images from one to before another."""
        rows = slice(first, last)
        seen = since(self.sightings, first)
        count = last - first
        end = int(seen.offsets[count])
        cut = SightingStream(
            seen.t_ns[:count].copy(),
            seen.offsets[: count + 1].copy(),
            seen.landmark_id[:end].copy(),
            seen.stereo_px[:end].copy(),
            seen.sigma_px[:end].copy(),
        )
        pose = self.truth.T_world_body[rows]
        return replace(self, truth=Trajectory(self.truth.t_ns[rows].copy(), pose), sightings=cut)


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


def sighted(folder: Path) -> Drive:
    """Import the sequence and run the front end over it, once."""
    run = CACHE / "kitti00_first100.rrd"
    done = run.exists() and read_recording(run).measurements.sightings is not None
    if not done:
        import_kitti(folder, run)
        sight_recording(run, run, FrontEndSpec())
    recording: Recording = read_recording(run)
    measurements = recording.measurements
    assert recording.truth is not None and measurements.sightings is not None
    assert measurements.calibration.stereo is not None
    drive = Drive(
        recording.truth.trajectory, measurements.calibration.stereo, measurements.sightings
    )
    return drive.piece(FIRST, len(drive.sightings))


def _calibration(drive: Drive) -> Calibration:
    start = PoseSpec.from_se3(drive.truth.T_world_body[0])
    return Calibration(stereo=drive.stereo, T_world_body_start=start, gravity_mps2=GRAVITY_MPS2)


def true_camera(drive: Drive, shared: Array) -> tuple[StereoCalibration, CameraPath]:
    """Give the pair as it is and its path, where the declared one has these errors."""
    declared = CameraPath.of(drive.truth, drive.truth.t_ns, drive.stereo)
    camera, path = corrected(shared, drive.stereo, declared)
    return drive.stereo.model_copy(update={"focal_px": camera[0], "baseline_m": camera[1]}), path


def in_view(p_camera: Array, pair: StereoCalibration) -> tuple[Array, Flags]:
    """Project points, Shape (m, 3), and tell which both images hold."""
    deep = np.where(p_camera[:, 2:] > 1.0, p_camera, [0.0, 0.0, 1.0])
    px = pair.project(deep)
    size = np.array([pair.width_px, pair.width_px, pair.height_px])
    inside = np.all((px >= 0) & (px <= size - 1), axis=1) & (p_camera[:, 2] > 1.0)
    return px, inside & (px[:, 0] - px[:, 1] >= DISPARITY_MIN_PX)


def measured_landmarks(
    drive: Drive, places_m: Array, shared: Array, seed: int
) -> tuple[ShownLandmarks, float]:
    """Show landmarks at the places of the real ones, in the images in which those were sighted."""
    seen = drive.sightings
    which = np.unique(seen.landmark_id, return_inverse=True)[1]
    image = np.repeat(np.arange(len(seen)), np.diff(seen.offsets))
    return shown(drive, places_m[which], which, image, shared, seed), 1.0


def strewn_landmarks(
    drive: Drive, fit: SensorFit, shared: Array, seed: int
) -> tuple[ShownLandmarks, float]:
    """Show landmarks of no real place: as many new ones, where new ones are, lost as often.

    A new landmark's image coordinates are drawn from those of all first sightings; it stays until
    it leaves the view or is lost, and is detected so often that as many are seen again in the next
    image as were.
    """
    rng = stream(seed, "kitti_prediction", "landmarks")
    seen = drive.sightings
    detection = min(fit.tracks.seen_next / (1.0 - fit.tracks.lost), 1.0)
    image = np.repeat(np.arange(len(seen)), np.diff(seen.offsets))
    first = np.unique(seen.landmark_id, return_index=True)[1]
    births = np.bincount(image[first], minlength=len(seen)) / detection
    born = np.repeat(np.arange(len(seen)), rng.poisson(births))
    pair, path = true_camera(drive, shared)
    drawn = np.where(born == 0, rng.integers(0, seen.offsets[1], len(born)), 0)
    later = first[image[first] > 0]
    drawn = np.where(born == 0, drawn, later[rng.integers(0, len(later), len(born))])
    p_camera = pair.triangulate(seen.stereo_px[drawn])
    places_m = path.T_camera_world[born].inverse() @ p_camera
    life = rng.geometric(max(fit.tracks.lost, 1e-6), len(born))
    which = np.repeat(np.arange(len(born)), np.minimum(life, len(seen) - born))
    age = np.arange(len(which)) - np.searchsorted(which, which)
    return shown(drive, places_m[which], which, born[which] + age, shared, seed), detection


def shown(
    drive: Drive, p_world: Array, which: Ints, image: Ints, shared: Array, seed: int
) -> ShownLandmarks:
    """Give the rows that are in view, by image, with a fixed error for each landmark."""
    pair, path = true_camera(drive, shared)
    px, seen = in_view(path.seen_from(image, p_world), pair)
    rows = np.flatnonzero(seen)
    rows = rows[np.lexsort((which[rows], image[rows]))]
    counts = np.bincount(image[rows], minlength=len(drive.truth))
    bias = stream(seed, "kitti_prediction", "fixed").standard_normal((int(which.max()) + 1, 3))
    return ShownLandmarks(
        drive.truth.t_ns.copy(),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        which[rows].astype(np.int64),
        np.zeros(len(rows), np.uint8),
        p_world[rows],
        px[rows],
        bias[which[rows]],
    )


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
        given = Measurements(_calibration(drive), sightings=sightings)
        end, true = estimator.estimate(given).trajectory.T_world_body[-1], drive.truth.T_world_body
        off_m = true.rotation[0].T @ (end.translation - true.translation[-1])
        return np.concatenate([off_m, (true[-1].inverse() @ end).log()[3:]])

    def obtained(self, drive: Drive) -> list[Array]:
        """Run on the real sightings."""
        return [self.errors(drive, drive.sightings, seed) for seed in range(self.repeats)]


def every(sightings: SightingStream, step: int) -> SightingStream:
    """Keep one in so many landmarks, for a filter whose cost grows with their square."""
    keep = sightings.landmark_id % step == 0
    before = np.concatenate([[0], np.cumsum(keep)])
    return SightingStream(
        sightings.t_ns.copy(),
        before[sightings.offsets].astype(np.int64),
        sightings.landmark_id[keep],
        sightings.stereo_px[keep],
        sightings.sigma_px[keep],
    )


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
