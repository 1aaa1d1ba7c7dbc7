"""Every estimator and SLAM variant on real data with a known truth.

    python -m scenarios.real_data [--quick] [--out docs/results] [--pictures docs/pictures]

Starry Night (stereo sightings of 20 landmarks, gyro, velocity, motion capture) and the first 100
stereo pairs of KITTI 00, which have no odometry. Writes ``starry_night.csv`` (a row for each run),
``starry_night.md`` and the plan view ``starry_night.jpg``. Runs are kept in ``out/real_data`` as
they end, so a killed one goes on where it was; a change of code begins anew.
"""

from __future__ import annotations

import argparse
import csv
import importlib.util
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from estimators import build_estimator
from estimators.slam_spec import SlamSpec
from lpet_sim.datasets import data_path
from lpet_sim.evaluation.figures import plot_plan_view, save
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.progress import Progress, track
from lpet_sim.recording.kitti import BASELINE_M
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.starry_night import (
    StarryNightSpec,
    import_starry_night,
    read_starry_night,
)
from lpet_sim.sweep.importing import import_kitti
from lpet_sim.sweep.kept_runs import Job, Row, code_key, first_images, run_kept
from lpet_sim.sweep.sighting import sight_recording
from lpet_sim.terminal import bar
from lpet_sim.vision.spec import FrontEndSpec

ANCHORS = {"standstill_m": 0.02, "standstill_rad": 0.1}  # above what noise makes of a step at rest
COMMAND = "python -m scenarios.real_data"
KEPT = Path("out/real_data")
QUICK_IMAGES = 300
KITTI_FROM = 20
"""The truth of KITTI's images before this one is off by over a metre."""

RAW, LIMITED, DECLARED = "all", "rows within 1.5 px", "the file's variance"
ALL: dict[str, Any] = {"kind": "keep_all"}
OTHER_FORMS = ("standard", "first_estimates")
_JUMP = (
    "- the motion capture turns by 37 deg and back at 9.97 s, so that no worst attitude is less; "
    "images are missing for up to 0.73 s, over which a gyro reading held errs by up to 30 deg"
)


def lasting(images: int) -> dict[str, Any]:
    """Give the retention with a time to live."""
    return {"kind": "time_to_live", "images": images}


def queue(size: int, leave: str = "first_in_first_out") -> dict[str, Any]:
    """Give the retention with a bounded queue."""
    return {"kind": "bounded_queue", "size": size, "leave": leave}


def on_night(arm: str = RAW, **fields: Any) -> Job:
    """Make a run of a SLAM variant on Starry Night."""
    return Job("starry_night", arm, "slam", fields, SlamSpec.from_mapping(fields).label)


def on_kitti(**fields: Any) -> Job:
    """Make a run of a SLAM variant on KITTI."""
    return Job("kitti", RAW, "slam", fields, SlamSpec.from_mapping(fields).label, KITTI_FROM)


def night_jobs() -> Iterator[Job]:
    """Give the runs on Starry Night."""
    yield Job("starry_night", RAW, "odometry", {}, "odometry")
    for least in (8, 3):
        fields = {"two_view": {"inliers_min": least}}
        label = f"frame_to_frame, at least {least}"
        yield Job("starry_night", RAW, "frame_to_frame", fields, label)
    yield from (on_night(retention=r) for r in (ALL, *(lasting(m) for m in (1, 3, 10, 100))))
    for leave in ("first_in_first_out", "shortest_time_to_live", "least_confidence"):
        yield from (on_night(retention=queue(n, leave)) for n in (5, 10, 20))
    for r in (ALL, lasting(10)):
        yield on_night(retention=r, landmark_frame="world")
        for form in OTHER_FORMS:
            yield on_night(retention=r, formulation=form)
            for coupling in ("decoupled", "decoupled_pose_kept"):
                yield on_night(retention=r, formulation=form, coupling=coupling)
    for r in (ALL, lasting(10), queue(10)):
        yield on_night(retention=r, anchors=ANCHORS)
        yield on_night(retention=r, anchors=ANCHORS, formulation="first_estimates")
    for arm in (LIMITED, DECLARED):
        for form in ("right_invariant", *OTHER_FORMS):
            yield on_night(arm, retention=ALL, formulation=form)
    if importlib.util.find_spec("gtsam") is not None:
        yield Job("starry_night", RAW, "gtsam_fixed_lag", {}, "gtsam_fixed_lag 10")
        yield Job("starry_night", RAW, "gtsam_batch", {}, "gtsam_batch")


def kitti_jobs() -> Iterator[Job]:
    """Give the runs on KITTI: 12,495 landmarks are too many for those that keep them for long."""
    yield Job("kitti", RAW, "frame_to_frame", {}, "frame_to_frame", KITTI_FROM)
    yield from (on_kitti(retention=r) for r in (lasting(1), lasting(3), *map(queue, (20, 80, 160))))
    yield from (on_kitti(retention=lasting(1), formulation=form) for form in OTHER_FORMS)


def quick_jobs() -> list[Job]:
    """Give one run of each kind."""
    return [*list(night_jobs())[:2], on_night(retention=ALL), on_night(retention=lasting(10))]


def night(arm: str, quick: bool) -> Recording:
    """Import Starry Night in one of its arms."""
    folder = data_path("stereo/starry_night")
    declared_px = math.sqrt(np.mean(read_starry_night(folder).pixel_variance))
    spec = {
        RAW: StarryNightSpec(),
        LIMITED: StarryNightSpec(epipolar_px=FrontEndSpec().stereo.epipolar_px),
        DECLARED: StarryNightSpec(sigma_px=declared_px),
    }[arm]
    recording = import_starry_night(folder, spec)
    return first_images(recording, QUICK_IMAGES) if quick else recording


def kitti(progress: Progress) -> Recording:
    """Import and sight KITTI's pairs, or take what was made of them before."""
    path = output_folder(KEPT) / f"kitti_{code_key('lpet_sim/vision', 'lpet_sim/recording')}.rrd"
    if not path.exists():
        with whole_file(path) as temporary:
            import_kitti(data_path("stereo/kitti00_first100"), temporary, baseline_m=BASELINE_M)
            sight_recording(temporary, temporary, FrontEndSpec(), progress)
    return read_recording(path)


def run_all(jobs: list[Job], nights: dict[str, Recording], quick: bool) -> list[Row]:
    """Run what has not been run."""
    rooms = ("recording", "geometry", "vision", "evaluation", "sweep")
    sources = ("estimators", *(f"lpet_sim/{room}" for room in rooms))
    kept = output_folder(KEPT / f"{code_key(*sources)}{'_quick' * quick}")
    recordings = dict(nights)
    if any(job.data_set == "kitti" for job in jobs):
        with bar("sighting KITTI") as progress:
            recordings["kitti"] = kitti(progress)
    with bar("estimating") as progress:
        return [
            run_kept(job, recordings["kitti" if job.data_set == "kitti" else job.arm], kept)
            for job in track(jobs, len(jobs), progress)
        ]


def draw(recording: Recording, path: Path) -> None:
    """Draw truth, landmarks, odometry, full SLAM and a filter that forgets, from above."""
    assert recording.truth is not None
    chosen: dict[str, tuple[str, dict[str, Any]]] = {
        "gyro and velocity": ("odometry", {}),
        "SLAM, all landmarks kept": ("slam", {"retention": ALL}),
        "SLAM, time to live 10": ("slam", {"retention": lasting(10)}),
    }
    estimates = [
        replace(build_estimator(name, fields).estimate(recording.measurements), name=label)
        for label, (name, fields) in chosen.items()
    ]
    figure = plot_plan_view(recording.truth.trajectory, estimates)
    axes, known = figure.axes[0], read_starry_night(data_path("stereo/starry_night"))
    x, y = known.p_world_landmark[:, :2].T
    axes.plot(x, y, "*", color="gray", ms=9, label="landmarks")
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="best")
    with whole_file(path) as temporary:
        picture = temporary.with_suffix(".png")
        save(figure, picture)
        Image.open(picture).convert("RGB").save(temporary, "JPEG", quality=88)
        picture.unlink()


def write_tables(rows: list[Row], nights: dict[str, Recording], folder: Path) -> list[Path]:
    """Write the rows as CSV and as Markdown."""
    table, text = folder / "starry_night.csv", folder / "starry_night.md"
    names = list(dict.fromkeys(name for row in rows for name in row))
    with whole_file(table) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, names, restval="")
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.5g}" if isinstance(v, float) else v for k, v in row.items()})
    with whole_file(text) as temporary:
        temporary.write_text("\n".join(summary(rows, nights)) + "\n")
    return [table, text]


def summary(rows: list[Row], nights: dict[str, Recording]) -> list[str]:
    """Give the Markdown: what the data are, and a table for each data set."""
    lines = [
        "# Real data with a known truth",
        "",
        f"`{COMMAND}`; errors are unaligned.",
        "",
        "Position: RMS, at the end, at most. Attitude: RMS (at most) about the axes of the body.",
        "NEES of the pose: 6 if consistent. Bridged: images in which fewer landmarks than asked",
        "for were accepted; more than 50 in a row are a failure, `lost`, whatever the error.",
        "",
    ]
    titles = {"starry_night": "Starry Night", "kitti": f"KITTI 00 from image {KITTI_FROM}"}
    for data_set, title in titles.items():
        chosen = [row for row in rows if row["data_set"] == data_set]
        if chosen:
            facts = [_facts(arm, nights[arm]) for arm in nights] if "night" in data_set else []
            lines += [f"## {title}, {chosen[0].get('distance_m', math.nan):.1f} m", "", *facts]
            lines += [*([_JUMP, *_remarks(chosen), ""] if facts else []), *_table(chosen), ""]
    return lines


def _facts(arm: str, recording: Recording) -> str:
    """Tell how much there is to see."""
    sightings, truth = recording.measurements.sightings, recording.truth
    assert sightings is not None and truth is not None
    count, speed = np.diff(sightings.offsets), truth.body.v_world_body_mps
    moving = int(np.argmax(np.linalg.norm(speed, axis=1) > 0.05))
    standing = len(np.unique(sightings.landmark_id[: sightings.offsets[moving]]))
    return (
        f"- sightings *{arm}*: {len(sightings.landmark_id)}, declared noise "
        f"{sightings.sigma_px[0]:.2f} px; {np.mean(count < 3):.0%} of {len(count)} images see "
        f"fewer than three landmarks, {np.mean(count == 0):.0%} none; {standing} landmark in the "
        f"{truth.body.t_s[moving]:.1f} s of standstill"
    )


def _remarks(rows: list[Row]) -> list[str]:
    """Tell what frame-to-frame and the observable form make of so little in view."""
    by_name = {row["variant"]: row for row in rows if row["arm"] == RAW and "rmse_m" in row}
    blind = [row for name, row in by_name.items() if name.startswith("frame_to_frame")]
    said = ", ".join(f"{r['bridged_share']:.0%} with RMS {r['rmse_m']:.2f} m" for r in blind)
    lines = [
        f"- frame-to-frame bridges {said}; gyro and velocity: {by_name['odometry']['rmse_m']:.2f} m"
    ]
    for name, row in by_name.items():
        without = by_name.get(name.replace("-observable", "-unobservable"))
        if "-observable" in name and without is not None:
            lines.append(
                f"- the anchor of {name} is seen in {row['anchors_seen_share']:.0%} of the images: "
                f"RMS {row['rmse_m']:.3f} m with it, {without['rmse_m']:.3f} m without"
            )
    return lines


def _table(rows: list[Row]) -> list[str]:
    heads = "sightings|variant|failure|position [m]|end [%]|x [deg]|y [deg]|z [deg]|NEES at the end"
    heads += "|NEES mean|bridged|rejected|state|anchors seen"
    lines = ["| " + " | ".join(heads.split("|")) + " |", "|---" * (heads.count("|") + 1) + "|"]
    return lines + ["| " + " | ".join(_cells(row)) + " |" for row in rows]


def _cells(row: Row) -> list[str]:
    def said(name: str, form: str) -> str:
        return format(row[name], form) if name in row else "-"

    position = f"{said('rmse_m', '.3f')}, {said('end_m', '.3f')}, {said('worst_m', '.3f')}"
    turns = [f"{said(f'rms_{a}_deg', '.1f')} ({said(f'worst_{a}_deg', '.0f')})" for a in "xyz"]
    shares = [said(f"{n}_share", ".0%") for n in ("bridged", "rejected")]
    return [
        *(row["arm"], row["variant"], row["failure"] or "-", position, said("end_percent", ".2f")),
        *(*turns, said("nees_pose_end", ".3g"), said("nees_pose", ".3g"), *shares),
        *(said("state_max", "d"), said("anchors_seen_share", ".0%")),
    ]


def main() -> None:
    """Run what has not been run, and write tables and the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="docs/results; out/real_data with --quick")
    parser.add_argument("--pictures", type=Path, help="docs/pictures; as --out with --quick")
    parser.add_argument("--quick", action="store_true", help="300 images, four estimators")
    options = parser.parse_args()
    folder = options.out or (KEPT if options.quick else Path("docs/results"))
    pictures = options.pictures or (folder if options.quick else Path("docs/pictures"))
    jobs = quick_jobs() if options.quick else [*night_jobs(), *kitti_jobs()]
    arms = dict.fromkeys(job.arm for job in jobs if job.data_set == "starry_night")
    nights = {arm: night(arm, options.quick) for arm in arms}
    rows = run_all(jobs, nights, options.quick)
    for path in write_tables(rows, nights, output_folder(folder)):
        print(f"wrote {path}")
    picture = output_folder(pictures) / "starry_night.jpg"
    draw(nights[RAW], picture)
    print(f"wrote {picture}")


if __name__ == "__main__":
    main()
