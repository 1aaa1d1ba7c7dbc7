"""The suite of sensors and the calibration that it declares."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.geometry import SE3
from lpet_sim.rover.frames import RoverFrames, rover_frames
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.sensors.imu import ImuSpec
from lpet_sim.sensors.suite import SensorSuiteSpec, declared_calibration


@pytest.fixture(scope="module")
def frames() -> RoverFrames:
    """The frames of the default rover."""
    return rover_frames(RoverSpec())


def test_a_suite_goes_to_yaml_and_back(tmp_path: Path) -> None:
    """Every value survives, absent sensors too."""
    suite = SensorSuiteSpec(imu=None)
    suite.to_yaml(tmp_path / "suite.yaml")
    assert SensorSuiteSpec.from_yaml(tmp_path / "suite.yaml") == suite
    suite = SensorSuiteSpec()
    suite.to_yaml(tmp_path / "suite.yaml")
    assert SensorSuiteSpec.from_yaml(tmp_path / "suite.yaml") == suite


def test_absent_sensors_are_declared_absent(frames: RoverFrames) -> None:
    """None in, None out."""
    suite = SensorSuiteSpec(imu=None, wheels=None, stereo=None)
    declared = declared_calibration(suite, frames, 3.7, SE3.identity())
    assert (declared.imu, declared.wheels, declared.stereo) == (None, None, None)


def test_the_declared_calibration_has_the_rovers_frames(frames: RoverFrames) -> None:
    """Mounts, contact points, radius, start and gravity are those given."""
    start = SE3.from_rpy([0.1, 0.2, 0.3], [1.0, 2.0, 3.0])
    declared = declared_calibration(SensorSuiteSpec(), frames, 3.7, start, imu_rate_hz=50.0)
    assert declared.imu is not None
    assert declared.wheels is not None
    assert declared.stereo is not None
    assert declared.imu.rate_hz == 50.0
    np.testing.assert_allclose(declared.imu.T_body_imu.se3().matrix(), frames.T_body_imu.matrix())
    np.testing.assert_allclose(declared.wheels.position_body_m, frames.contact_body_m)
    assert declared.wheels.steerable == tuple(bool(x > 0) for x in frames.steer_limit_rad)
    np.testing.assert_allclose(declared.T_world_body_start.se3().matrix(), start.matrix())
    assert declared.gravity_mps2 == 3.7


def test_the_declared_noise_of_the_inertial_unit_is_the_rms_of_its_axes(
    frames: RoverFrames,
) -> None:
    """The declared quantum stands for the whole velocity noise, ``sqrt(12) Q``."""
    declared = ImuSpec().declared(frames.T_body_imu, 100.0)
    N = np.array(ImuSpec().gyro_random_walk_radps_rthz)
    assert declared.gyro_random_walk_radps_rthz == pytest.approx(np.sqrt(np.mean(N**2)))
    Q = np.sqrt(np.mean(np.square(ImuSpec().accel_velocity_noise_mps)))
    assert declared.accel_quantum_mps == pytest.approx(math.sqrt(12) * Q)
