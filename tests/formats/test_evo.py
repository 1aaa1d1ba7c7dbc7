"""evo, run as a process of its own, as an outside checker of our errors and of our files."""

from __future__ import annotations

import io
import os
import shutil
import subprocess
import sys
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.evaluation.errors import segment_drift
from lpet_sim.evaluation.pose_errors import (
    Alignment,
    absolute_errors,
    every_pair,
    relative_errors,
    rigid_fit,
)
from lpet_sim.formats.euroc import export_euroc
from lpet_sim.formats.tum import read_tum, write_tum
from lpet_sim.geometry import SE3
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream
from tests.formats.samples import small
from tests.recording.synthetic import drive_poses

AGREEMENT = 1e-9
MS = 1_000_000


def evo(folder: Path, program: str, *arguments: str | Path) -> str:
    """Run one of evo's programs, or skip where it is not installed."""
    found = shutil.which(program, path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    if found is None:
        pytest.skip("evo is not installed: pip install 'lpet[dev]'")
    settings = {**os.environ, "HOME": str(folder), "MPLBACKEND": "agg"}
    done = subprocess.run(
        [found, *map(str, arguments)],
        capture_output=True,
        text=True,
        env=settings,
        cwd=folder,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def errors_of(folder: Path, program: str, *arguments: str | Path) -> np.ndarray:
    """Give the errors that evo finds, one for each pose or pair."""
    evo(folder, program, *arguments, "--save_results", "result.zip", "--no_warnings")
    with zipfile.ZipFile(folder / "result.zip") as result:
        return np.load(io.BytesIO(result.read("error_array.npy")))


@cache
def truth() -> Trajectory:
    """Drive an S-curve for 20 s, 100 poses a second."""
    t_ns = np.arange(2001) * 10 * MS
    return Trajectory(t_ns, drive_poses(t_ns / 1e9, 0.5))


def drifting(t_ns: np.ndarray) -> Trajectory:
    """Give an estimate that turns and drifts away from the truth, and starts beside it."""
    rng = stream(5, "evo", "drift")
    beside = SE3.exp(np.array([0.2, -0.1, 0.05, 0.01, -0.02, 0.1]))
    noise = np.cumsum(rng.normal(0.0, 0.003, (len(t_ns), 6)), axis=0)
    return Trajectory(t_ns, beside @ truth().at(t_ns) @ SE3.exp(noise))


def written(folder: Path, estimate: Trajectory, true: Trajectory) -> tuple[Path, Path]:
    """Write both as TUM files."""
    paths = folder / "truth.txt", folder / "estimate.txt"
    for path, trajectory in zip(paths, (true, estimate), strict=True):
        write_tum(path, trajectory)
    return paths


@pytest.mark.parametrize(
    ("alignment", "options"), [("none", ()), ("origin", ("--align_origin",)), ("all", ("-a",))]
)
def test_our_absolute_errors_are_evos_ape(
    alignment: Alignment, options: tuple[str, ...], tmp_path: Path
) -> None:
    """Position and angle of every pose, unaligned, laid on the first, and aligned with all."""
    estimate = drifting(np.arange(0, 2001, 20) * 10 * MS)
    files = written(tmp_path, estimate, truth())
    ours = absolute_errors(estimate, truth(), alignment)
    for part, mine in (("trans_part", ours.position_m), ("angle_rad", ours.angle_rad)):
        theirs = errors_of(tmp_path, "evo_ape", "tum", *files, "-r", part, *options)
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=AGREEMENT)
        assert mine.max() > 0.01
        rmse = ours.rmse_m if part == "trans_part" else ours.rmse_rad
        assert rmse == pytest.approx(float(np.sqrt(np.mean(theirs**2))), abs=AGREEMENT)


def test_between_the_stamps_of_the_truth_evo_interpolates_as_we_do(tmp_path: Path) -> None:
    """An estimate whose times are none of the truth's, by ``--sync_method interpolation``."""
    estimate = drifting(np.arange(3, 1990, 17) * 10 * MS + 3 * MS)
    files = written(tmp_path, estimate, truth())
    ours = absolute_errors(estimate, truth())
    options = ("-r", "trans_part", "--sync_method", "interpolation")
    theirs = errors_of(tmp_path, "evo_ape", "tum", *files, *options)
    np.testing.assert_allclose(ours.position_m, theirs, rtol=0, atol=AGREEMENT)


def test_our_relative_errors_are_evos_rpe(tmp_path: Path) -> None:
    """Over all pairs that lie seven poses apart."""
    step = 7
    estimate = drifting(np.arange(0, 2001, 20) * 10 * MS)
    files = written(tmp_path, estimate, truth())
    ours = relative_errors(estimate, truth(), every_pair(len(estimate), step))
    for part, mine in (("trans_part", ours.position_m), ("angle_rad", ours.angle_rad)):
        options = ("-r", part, "-u", "f", "-d", str(step), "--all_pairs")
        theirs = errors_of(tmp_path, "evo_rpe", "tum", *files, *options)
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=AGREEMENT)


def test_our_drift_over_segments_is_evos_rpe_over_metres(tmp_path: Path) -> None:
    """On a path whose poses lie half a metre apart, evo finds the same segments and one more."""
    true, length_m = half_metres(81), 5.0
    rng = stream(6, "evo", "segments")
    noise = np.cumsum(rng.normal(0.0, 0.01, (len(true), 6)), axis=0)
    estimate = Trajectory(true.t_ns, true.T_world_body @ SE3.exp(noise))
    files = written(tmp_path, estimate, true)
    (ours,) = segment_drift(estimate, true, (length_m,), spacing_m=0.5)
    metres = ("-u", "m", "-d", str(length_m), "--all_pairs", "--pairs_from_reference", "-t", "0.01")
    for part, mine in (
        ("trans_part", ours.translation_ratio),
        ("angle_rad", ours.rotation_radpm),
    ):
        theirs = errors_of(tmp_path, "evo_rpe", "tum", *files, "-r", part, *metres)
        assert len(theirs) == ours.count + 1
        assert mine == pytest.approx(theirs[:-1].mean() / length_m, abs=AGREEMENT)


def half_metres(count: int) -> Trajectory:
    """Drive along x over poses that lie exactly half a metre apart, nodding and rolling."""
    k = np.arange(count)
    rpy = np.stack([0.1 * np.sin(k / 3), 0.2 * np.cos(k / 5), 0.3 * np.sin(k / 7)], axis=-1)
    position = np.stack([0.5 * k, np.zeros(count), np.zeros(count)], axis=-1)
    return Trajectory(k * 1000 * MS, SE3.from_rpy(rpy, position))


def test_evo_accepts_the_exported_asl_folder(tmp_path: Path) -> None:
    """``evo_traj euroc`` finds every pose, rotations that are rotations, and times in order."""
    given = small()
    export_euroc(given, tmp_path / "asl")
    table = tmp_path / "asl/mav0/state_groundtruth_estimate0/data.csv"
    said = evo(tmp_path, "evo_traj", "euroc", table, "--full_check")
    assert given.truth is not None
    assert f"nr. of poses\t{len(given.truth.body)}\n" in said
    checks = said.split("checks:")[1].split("stats:")[0].splitlines()
    found = [line.split("\t")[-1] for line in checks if line.strip()]
    assert found == ["yes", "ok", "ok", "ok", "ok"], said


def test_the_files_that_evo_reads_come_back_equal_to_us(tmp_path: Path) -> None:
    """Times to the nanosecond, positions to the bit."""
    sent = drifting(np.arange(3, 1990, 17) * 10 * MS + 123_457)
    write_tum(tmp_path / "a.txt", sent)
    back = read_tum(tmp_path / "a.txt")
    assert back.t_ns.tolist() == sent.t_ns.tolist()
    assert back.T_world_body.translation.tobytes() == sent.T_world_body.translation.tobytes()
    np.testing.assert_allclose(back.T_world_body.rotation, sent.T_world_body.rotation, atol=4e-15)


def test_the_rigid_fit_finds_a_motion_and_never_a_mirror() -> None:
    """Points that were moved, and points that were mirrored."""
    points = stream(1, "evo", "points").normal(size=(20, 3))
    moved = SE3.exp(np.array([1.0, 2.0, 3.0, 0.4, -0.5, 0.6]))
    found = rigid_fit(points, moved @ points)
    np.testing.assert_allclose((found.inverse() @ moved).log(), np.zeros(6), atol=1e-12)
    mirrored = rigid_fit(points, points * [1.0, 1.0, -1.0])
    assert np.linalg.det(mirrored.rotation) == pytest.approx(1.0)
