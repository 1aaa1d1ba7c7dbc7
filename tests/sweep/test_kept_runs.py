"""Runs on recordings at hand: rows of scores and of failures, kept and given again."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements, OdometryStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Truth
from lpet_sim.sweep.kept_runs import Job, code_key, run_kept, score_row

JOB = Job("made", "all", "odometry", {}, "odometry")


def drive(steps: int = 50) -> Recording:
    """Drive straight by a metre a second with odometry that is right, and says so."""
    t_ns = np.arange(steps + 1) * 10**9
    twist = np.zeros((steps + 1, 6))
    twist[1:, 0] = 1.0
    odometry = OdometryStream(t_ns, twist, np.full(twist.shape, 1e-4), np.zeros(twist.shape))
    p = np.zeros((steps + 1, 3))
    p[:, 0] = np.arange(steps + 1)
    poses = SE3(np.tile(np.eye(3), (steps + 1, 1, 1)), p)
    truth = Truth(BodyTruth.from_poses(t_ns.copy(), poses))
    return Recording(Manifest("made"), Measurements(Calibration(), odometry=odometry), truth)


def test_a_row_holds_the_errors_in_metres_and_degrees_about_the_body() -> None:
    """A side step of 3 m at the last of five poses and a turn of 2 deg about y throughout."""
    recording = drive(4)
    truth = recording.truth.body
    p = np.array(truth.T_world_body.translation)
    p[-1, 1] = 3.0
    turned = SE3.from_rpy([0.0, np.radians(2.0), 0.0], [0.0, 0.0, 0.0])
    poses = SE3(truth.T_world_body.rotation, p) @ turned
    log = {"bridged": np.array([0.0, 1, 0, 0, 0]), "landmarks": np.arange(5.0)}
    row = score_row(JOB, recording, Estimate("x", Trajectory(truth.t_ns, poses), None, log))
    assert row["end_m"] == row["worst_m"] == pytest.approx(3.0)
    assert row["rmse_m"] == pytest.approx(3.0 / np.sqrt(5))
    assert row["rms_y_deg"] == row["worst_y_deg"] == pytest.approx(2.0)
    assert row["rms_x_deg"] == pytest.approx(0.0, abs=1e-9)
    assert row["bridged_share"] == 0.2 and row["state_max"] == 4
    assert row["failure"] == "diverged" and "nees_pose" not in row


def test_scoring_from_an_image_on_forgives_what_came_before() -> None:
    """The estimate is moved onto the truth there; the rest of the way is what is scored."""
    recording = drive(10)
    T = recording.truth.body.T_world_body
    shifted = SE3(T.rotation, T.translation + np.array([0.0, 5.0, 0.0]))
    estimate = Estimate("x", Trajectory(recording.truth.body.t_ns, shifted), None, {})
    late = score_row(replace(JOB, from_image=4), recording, estimate)
    assert late["rmse_m"] == pytest.approx(0.0, abs=1e-12)
    assert late["distance_m"] == pytest.approx(6.0)


def test_a_run_is_kept_and_given_again(tmp_path: Path) -> None:
    """The second time nothing is run: even a recording that is of no use gives the row."""
    first = run_kept(JOB, drive(), tmp_path)
    assert first["rmse_m"] == pytest.approx(0.0, abs=1e-9) and first["failure"] == ""
    useless = Recording(Manifest("none"), Measurements(Calibration()))
    assert run_kept(JOB, useless, tmp_path) == first
    assert replace(JOB, fields={"a": 1}).key != JOB.key == replace(JOB).key


def test_an_exception_is_a_row_and_is_tried_again(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """It tells its kind and its sentence, and is not kept."""
    useless = Recording(Manifest("none"), Measurements(Calibration()))
    with caplog.at_level(logging.WARNING):
        row = run_kept(JOB, useless, tmp_path)
    assert row["failure"] == "exception"
    assert "no stream 'odometry'" in row["failure_text"] and "no stream" in caplog.text
    assert run_kept(JOB, drive(), tmp_path)["failure"] == ""


def test_the_key_of_code_is_that_of_its_files() -> None:
    """Other packages, other keys; the same, the same."""
    assert code_key("estimators") == code_key("estimators") != code_key("lpet_sim/geometry")
