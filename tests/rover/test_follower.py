"""The follower on a rover of pure kinematics, apart from any physics."""

import math

import numpy as np
import pytest

from lpet_sim.rover.follower import FEEDBACK_LENGTH_M, Follower, PlanarPose
from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.spec import DriveSpec, RoverSpec, Stop


def _run(spec: DriveSpec, pose: PlanarPose, slip: float = 0.0) -> tuple[Follower, np.ndarray]:
    """Integrate the commands exactly; rows of t, x, y, yaw, cross-track, speed."""
    follower = Follower(spec, RoverSpec(), rover_frames(RoverSpec()))
    dt_s = 1 / spec.control_rate_hz
    rows = []
    x, y, yaw = pose.x_m, pose.y_m, pose.yaw_rad
    for k in range(40_000):
        command = follower.command(PlanarPose(x, y, yaw))
        rows.append((k * dt_s, x, y, yaw, follower.cross_track_m, command.speed_mps))
        if follower.finished:
            break
        v = command.speed_mps * (1 - slip)
        middle = yaw + command.yaw_rate_radps * dt_s / 2
        x, y = x + v * dt_s * math.cos(middle), y + v * dt_s * math.sin(middle)
        yaw += command.yaw_rate_radps * dt_s
    return follower, np.array(rows)


def test_an_offset_decays_as_a_critically_damped_spring() -> None:
    """``e(s) = e0 (1 + s/L) exp(-s/L)`` for a small offset from a straight line."""
    spec = DriveSpec(waypoints_m=((0, 0), (6, 0)), speed_mps=0.02)
    follower, rows = _run(spec, PlanarPose(0.0, 0.02, 0.0))
    s = rows[:, 1] / FEEDBACK_LENGTH_M
    closed = 0.02 * (1 + s) * np.exp(-s)
    assert follower.finished
    assert np.abs(rows[:, 2] - closed).max() < 0.0008


def test_a_winding_path_is_followed_to_the_goal_within_centimetres() -> None:
    """Corners, and a slip of 20 % that the plan knows nothing of."""
    spec = DriveSpec(waypoints_m=((0, 0), (4, 0), (7, 3), (7, 8), (3, 11)))
    follower, rows = _run(spec, PlanarPose(0.0, 0.0, 0.0), slip=0.2)
    assert follower.finished
    assert np.abs(rows[:, 4]).max() < 0.06
    assert math.dist(rows[-1, 1:3], (3, 11)) < 0.02


def test_a_sharp_corner_is_turned_on_the_spot() -> None:
    """The rover faces the next side before it drives on, and says so."""
    spec = DriveSpec(waypoints_m=((0, 0), (2, 0), (0.2, 0.5)))
    follower, rows = _run(spec, PlanarPose(0.0, 0.0, 0.0))
    turning = (np.abs(np.diff(rows[:, 3])) > 1e-9) & (np.diff(rows[:, 1]) == 0)
    assert turning.sum() > 100
    assert [notice.kind for notice in follower.take_notices()] == ["point_turn"]
    assert math.dist(rows[-1, 1:3], (0.2, 0.5)) < 0.02


def test_a_stop_lasts_as_long_as_asked_at_the_place_asked() -> None:
    """Speed is zero for the duration, within two control ticks, and within 5 mm of the place."""
    spec = DriveSpec(waypoints_m=((0, 0), (3, 0)), stops=(Stop(at_m=1.2, duration_s=12.0),))
    _, rows = _run(spec, PlanarPose(0.0, 0.0, 0.0))
    still = (rows[:, 5] == 0) & (rows[:, 1] > 0.5) & (rows[:, 1] < 2)
    assert still.sum() / spec.control_rate_hz == pytest.approx(12.0, abs=0.2)
    np.testing.assert_allclose(rows[still, 1], 1.2, atol=0.005)


def test_speed_and_its_change_stay_within_the_spec() -> None:
    """No command is faster than the speed or ramps up faster than the acceleration."""
    spec = DriveSpec(waypoints_m=((0, 0), (3, 0), (6, 2)), acceleration_mps2=0.01)
    _, rows = _run(spec, PlanarPose(0.0, 0.0, 0.0))
    assert rows[:, 5].max() <= spec.speed_mps
    assert np.diff(rows[:, 5]).max() <= 0.01 / spec.control_rate_hz + 1e-12
