"""The sensors of a rover together, and what it believes of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration, PoseSpec
from lpet_sim.sensors.camera_spec import StereoCameraSpec
from lpet_sim.sensors.imu import ImuSpec
from lpet_sim.sensors.wheels import WheelOdometrySpec
from lpet_sim.spec import Spec

if TYPE_CHECKING:
    from lpet_sim.rover.frames import RoverFrames


class SensorSuiteSpec(Spec):
    """Which sensors a rover has; None where it has none of a kind.

    Attributes:
        imu: The inertial unit.
        wheels: Wheel and steering encoders.
        stereo: The camera pair.
    """

    imu: ImuSpec | None = ImuSpec()
    wheels: WheelOdometrySpec | None = WheelOdometrySpec()
    stereo: StereoCameraSpec | None = StereoCameraSpec()


def declared_calibration(
    suite: SensorSuiteSpec,
    frames: RoverFrames,
    gravity_mps2: float,
    T_world_body_start: SE3,
    imu_rate_hz: float = 100.0,
) -> Calibration:
    """Give the calibration that the rover believes, with the suite's declared errors in it.

    Args:
        suite: The sensors.
        frames: Where things truly are on the rover.
        gravity_mps2: Magnitude of gravity.
        T_world_body_start: The pose at time 0, which is given to every estimator.
        imu_rate_hz: Rate of the inertial samples.
    """
    steerable = tuple(bool(limit > 0) for limit in frames.steer_limit_rad)
    geometry = (frames.wheel_names, frames.contact_body_m, frames.wheel_radius_m, steerable)
    return Calibration(
        stereo=suite.stereo and suite.stereo.declared_calibration(frames.T_body_camera),
        imu=suite.imu and suite.imu.declared(frames.T_body_imu, imu_rate_hz),
        wheels=suite.wheels and suite.wheels.declared(*geometry),
        T_world_body_start=PoseSpec.from_se3(T_world_body_start),
        gravity_mps2=gravity_mps2,
    )
