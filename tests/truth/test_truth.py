"""Every estimator against the physics of a drive, through the file that holds the drive."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimators import ESTIMATORS, build_estimator
from estimators.odometry_steps import image_odometry
from lpet_sim.evaluation import Requirement, evaluate
from lpet_sim.evaluation.errors import distance_driven_m
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.reader import read_measurements, read_recording
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.truth import Truth
from lpet_sim.sweep.traverse import ImagesSpec
from tests.truth.drives import RELIEF_SLOPE_RAD, SLIP, SPEED_MPS, driven_once, traverse_spec

# The last image may be one period, 8 cm, short of the goal.
_FROM_M, _COMPLETION = 1.0, 0.97


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the recording of four metres with images each 8 cm and one forced slip."""
    return driven_once(tmp_path_factory, traverse_spec(images=ImagesSpec(period_s=1.6)), 1, "seen")


@pytest.fixture(scope="session")
def other_truth(tmp_path_factory: pytest.TempPathFactory) -> Truth:
    """Give what happened on the same traverse with another seed."""
    truth = read_recording(driven_once(tmp_path_factory, traverse_spec(), 2, "other")).truth
    assert truth is not None
    return truth


def truth_of(path: Path) -> Truth:
    """Read what happened."""
    truth = read_recording(path).truth
    assert truth is not None
    return truth


def wheel_budget(truth: Truth, calibration: Calibration) -> float:
    """Give the share of the distance that wheels may be wrong by at any moment.

    What they truly slipped until then, the forced slip in it, and three sigma of their declared
    scale error.
    """
    assert truth.wheels is not None and calibration.wheels is not None
    turned_rad = np.abs(np.diff(truth.wheels.drive_angle_rad, axis=0, prepend=0.0)).mean(axis=1)
    rolled_m = calibration.wheels.radius_m * np.cumsum(turned_rad)
    path_m = distance_driven_m(truth.trajectory)
    driven_m = np.interp(truth.wheels.t_ns, truth.body.t_ns, path_m)
    late = driven_m >= _FROM_M
    slipped = np.max(rolled_m[late] / driven_m[late]) - 1
    return float(slipped + 3 * calibration.wheels.scale_sigma)


def fed(name: str, path: Path) -> Measurements:
    """Read measurements; what integrates odometry is given that of wheels and inertial unit."""
    measurements = read_measurements(path)
    if name != "odometry" or measurements.wheels is None:
        return measurements
    return replace(measurements, odometry=image_odometry(measurements, measurements.wheels.t_ns))


def limits(name: str, truth: Truth, calibration: Calibration) -> Requirement:
    """Give what an estimator must keep to on this drive, by its sensors."""
    if name == "frame_to_frame":
        return Requirement(start_m=_FROM_M, completion=_COMPLETION)
    budget = wheel_budget(truth, calibration)
    if name in ("fused_odometry", "odometry"):
        assert calibration.imu is not None
        drift_s = truth.body.t_s[-1]
        bias_rad = calibration.imu.gyro_bias_radps * drift_s
        walk_rad = calibration.imu.gyro_random_walk_radps_rthz * math.sqrt(drift_s)
        angle_rad = 3 * math.hypot(bias_rad, walk_rad)
        return held_to(budget, angle_rad, angle_rad)
    # The wheels know nothing of roll and pitch: three sigma of a slope, one of which is the start's
    # and one the wheels' own over rocks; the tilt costs its sine in height. Yaw drifts by what one
    # side slips more than the other, a twentieth of 4 m over a track of 1.2 m.
    tilt_rad = 3 * math.sqrt(2) * RELIEF_SLOPE_RAD
    return held_to(budget + math.sin(RELIEF_SLOPE_RAD), tilt_rad, 0.05 * 4.0 / 1.2)


def held_to(position_ratio: float, tilt_rad: float, yaw_rad: float) -> Requirement:
    """Make a requirement on a short drive."""
    return Requirement(
        position_ratio=position_ratio,
        roll_rad=tilt_rad,
        pitch_rad=tilt_rad,
        yaw_rad=yaw_rad,
        start_m=_FROM_M,
        completion=_COMPLETION,
    )


def breaches(estimate: Estimate, truth: Truth, limit: Requirement) -> list[str]:
    """Name the limits that an estimate breaks against a truth."""
    lines = limit.check(evaluate(estimate, truth)).lines
    return [f"{x.quantity}: {x.value:.4f} of {x.limit:.4f}" for x in lines if not x.passed]


@pytest.mark.parametrize("name", sorted(ESTIMATORS))
def test_an_estimator_is_where_physics_put_the_rover_and_not_where_another_run_ended(
    name: str, drive: Path, other_truth: Truth
) -> None:
    """The limits hold against the drive's own truth; the same limits break against another's."""
    measurements = fed(name, drive)
    estimate = build_estimator(name).estimate(measurements)
    truth = truth_of(drive)
    limit = limits(name, truth, measurements.calibration)
    assert breaches(estimate, truth, limit) == []
    assert any("position" in line for line in breaches(estimate, other_truth, limit))


@pytest.mark.parametrize("name", ["frame_to_frame", "fused_odometry"])
def test_attitude_belongs_to_one_run_even_when_both_set_out_alike(
    name: str, drive: Path, other_truth: Truth
) -> None:
    """With the start poses laid over each other the other run still breaks the limits."""
    measurements = read_measurements(drive)
    estimate = build_estimator(name).estimate(measurements)
    limit = limits(name, truth_of(drive), measurements.calibration)
    assert limit.check(evaluate(estimate, truth_of(drive), anchor_t_ns=0)).passed
    assert not limit.check(evaluate(estimate, other_truth, anchor_t_ns=0)).passed


def test_wheels_feel_a_forced_slip_as_motion_and_eyes_do_not(drive: Path) -> None:
    """While the rover is held the wheels count its speed, vision less than a tenth of it."""
    measurements, truth = read_measurements(drive), truth_of(drive)
    assert measurements.sightings is not None
    (event,) = [event for event in truth.events if event.kind == "forced_slip"]
    begin_ns, end_ns = event.t_ns + NS_PER_S // 5, event.t_ns + round(SLIP.duration_s * NS_PER_S)
    inside = [t for t in measurements.sightings.t_ns if begin_ns <= t <= end_ns]
    moved_m = {}
    for name in ("dead_reckoning", "frame_to_frame"):
        path = build_estimator(name).estimate(measurements).trajectory
        first, last = path.at([inside[0], inside[-1]]).translation
        moved_m[name] = float(np.linalg.norm(last - first))
    asked_m = SPEED_MPS * (inside[-1] - inside[0]) / NS_PER_S
    assert asked_m > 0.1
    assert moved_m["dead_reckoning"] == pytest.approx(asked_m, rel=0.2)
    assert moved_m["frame_to_frame"] < 0.1 * asked_m
