"""A score tells the slip that its estimates show, and splits dead reckoning's error to the bit."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console

from estimators.dead_reckoning import DeadReckoning
from lpet_sim.evaluation import Requirement
from lpet_sim.geometry import SE3
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.overlay import add_estimates
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import Measurements, WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth
from lpet_sim.recording.writer import write_recording
from lpet_sim.sweep.report import score_tables
from lpet_sim.sweep.score import attribute_dead_reckoning, find_slip_in, score_recording
from tests.recording import synthetic

SPEED_MPS, FORCED = 0.05, Event(60_000_000_000, "forced_slip", 6.0, "the rover stands")
SLIP_ANGLE_RAD, SLIP = 0.05, 0.1
# The middle wheels are fixed, and their encoders tell of a steering that there is not.
STEERABLE = (True, True, False, False, True, True)


def _recording() -> Recording:
    """Drive 120 s straight on at a slip angle, with a forced slip."""
    t_ns = np.arange(0, 120 * 20 + 1) * (synthetic.NS // 20)
    t = t_ns / synthetic.NS
    calibration = synthetic.calibration()
    declared = calibration.wheels.model_copy(update={"steerable": STEERABLE})
    calibration = calibration.model_copy(update={"wheels": declared, "stereo": None, "imu": None})
    angle = np.tile((SPEED_MPS * t / declared.radius_m)[:, None], (1, 6))
    begin = FORCED.t_ns / synthetic.NS
    moving = 1.0 - ((t > begin) & (t <= begin + FORCED.duration_s))
    way = SPEED_MPS / 20 * (1.0 - SLIP) * np.concatenate([[0.0], np.cumsum(moving[1:])])
    position = np.stack([way, way * np.tan(SLIP_ANGLE_RAD), 0 * way], axis=-1)
    zero = np.zeros((len(t), 6))
    wheels = WheelTruth(
        t_ns=t_ns,
        drive_angle_rad=angle,
        steer_angle_rad=zero.copy(),
        slip=np.tile((1.0 - (1.0 - SLIP) * moving)[:, None], (1, 6)),
        load_n=zero + 100.0,
        traction_n=zero.copy(),
        sinkage_m=zero.copy(),
        slip_angle_rad=zero + SLIP_ANGLE_RAD,
        contact=np.ones((len(t), 6), np.uint8),
        joint_angle_rad=zero[:, :3].copy(),
    )
    still = np.zeros((len(t), 3))
    body = BodyTruth(t_ns, SE3(SE3.identity(len(t)).rotation, position), still, still.copy())
    steer = np.where(STEERABLE, 0.0, 0.3) * np.ones((len(t), 1))
    measured = WheelStream(t_ns.copy(), angle * 1.01, steer)
    manifest = synthetic.recording(1.0).manifest
    return Recording(
        manifest, Measurements(calibration, wheels=measured), Truth(body, wheels, (FORCED,))
    )


def _estimates(recording: Recording) -> list[Estimate]:
    """Reckon by the wheels, and see the truth every three seconds."""
    assert recording.truth is not None
    t_ns = np.arange(0, 120, 3) * synthetic.NS
    seen = Trajectory(t_ns, recording.truth.trajectory.at(t_ns))
    vision = Estimate("frame_to_frame", seen, None, {"step_sigma_m": np.full(len(t_ns), 1e-3)})
    return [DeadReckoning().estimate(recording.measurements), vision]


def test_a_score_tells_of_the_forced_slip(tmp_path: Path) -> None:
    """Found within an image from what the file holds, and a line of the report."""
    recording, path = _recording(), tmp_path / "run.rrd"
    write_recording(path, recording)
    add_estimates(path, [(estimate, None) for estimate in _estimates(recording)])
    score = score_recording(path)
    assert score.slips is not None
    (match,) = score.slips
    assert match.within_one_image
    np.testing.assert_allclose(match.lost_true_m, 1.01 * SPEED_MPS * FORCED.duration_s, rtol=0.02)
    file = io.StringIO()
    for table in score_tables(score, Requirement()):
        Console(file=file, width=160).print(table)
    assert "forced slip at 60.0 s for 6.0 s" in file.getvalue()
    assert "side_slip" in file.getvalue()


def test_without_one_of_the_two_estimates_no_slip_is_looked_for() -> None:
    """Nor where vision has a single image."""
    recording = _recording()
    reckoned, vision = _estimates(recording)
    assert find_slip_in(recording, [reckoned]) is None
    assert find_slip_in(recording, [vision]) is None
    once = Trajectory(vision.trajectory.t_ns[:1].copy(), vision.trajectory.T_world_body[:1])
    assert find_slip_in(recording, [reckoned, Estimate(vision.name, once)]) is None
    assert find_slip_in(recording, [reckoned, vision]) is not None


def test_fixed_wheels_slip_sideways_too() -> None:
    """Every cause has its closed form though dead reckoning passes over two wheels' steering."""
    recording = _recording()
    split = attribute_dead_reckoning(recording)
    assert split is not None and recording.truth is not None
    end = _estimates(recording)[0].trajectory.T_world_body.translation[-1]
    error = end - recording.truth.trajectory.T_world_body.translation[-1]
    np.testing.assert_allclose(split.total_m, error, atol=1e-12)
    np.testing.assert_allclose(sum(map(np.array, split.contributions_m.values())), error, atol=1e-9)
    turned, forced = SPEED_MPS * 120.0, SPEED_MPS * FORCED.duration_s
    gone = (turned - forced) * (1.0 - SLIP)
    expected = {
        "scale": [0.01 * turned, 0, 0],
        "forced_slip": [forced, 0, 0],
        "slip": [SLIP * (turned - forced), 0, 0],
        "side_slip": [0, -gone * np.tan(SLIP_ANGLE_RAD), 0],
        "model": [0, 0, 0],
    }
    for cause, vector in expected.items():
        np.testing.assert_allclose(split.contributions_m[cause], vector, atol=1e-6)


def test_a_recording_without_wheels_has_no_causes() -> None:
    """Neither encoders nor true wheels can be done without."""
    recording = _recording()
    assert recording.truth is not None
    bare = replace(recording, truth=Truth(recording.truth.body))
    assert attribute_dead_reckoning(bare) is None
    assert (
        attribute_dead_reckoning(
            replace(recording, measurements=replace(recording.measurements, wheels=None))
        )
        is None
    )
