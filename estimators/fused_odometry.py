"""IMU-fused odometry in three dimensions: gyro attitude and wheel translation.

The error-state filter of the paper's figure 8, by right perturbations ``T_true = T exp(xi)``. Its
state is the pose, the gyro's and the accelerometer's bias (both in the body) and the scale of the
wheels. While the rover drives, the gyro turns it and the wheels move it; while it stands, the pose
is held, the gyro reads its own bias and the accelerometer the direction of up.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from pydantic import Field

from estimators import fused_filter
from estimators.gaussian import chi_square_threshold
from estimators.motion import (
    MotionSpec,
    OdometryTrack,
    declared_wheels,
    stream_odometry,
    variance_per_metre,
    wheel_displacements,
    wheel_odometry,
    wheel_steps,
)
from estimators.rest import RestSpec, detect_rest
from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.calibration import ImuCalibration, WheelCalibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import ImuStream, Measurements, WheelStream
from lpet_sim.recording.trajectory import Trajectory


class FusedOdometrySpec(MotionSpec):
    """Parameters of IMU-fused odometry, beside what the calibration declares.

    Attributes:
        rest: What counts as standing still.
        rest_block_s: Longest rest that is taken in as one measurement.
        rest_turn_sigma_radps: Rate at which a parked rover still turns on its springs and soil, 1
            sigma, in each block: by 0.1 mrad within half a minute in LPET's own simulation.
        gate_probability: Share of fitting rest measurements that pass the chi-square gate.
        gyro_bias_walk_radps_rts: Rate random walk [rad/s/sqrt(s)]; LN-200 class, from the Allan
            deviation of real data at 1000-5000 s.
        accel_bias_walk_mps2_rts: Acceleration random walk [m/s^2/sqrt(s)]; likewise.
    """

    rest: RestSpec = RestSpec()
    rest_block_s: float = Field(default=10.0, gt=0)
    rest_turn_sigma_radps: float = Field(default=5e-6, ge=0)
    gate_probability: float = Field(default=0.999, gt=0, lt=1)
    gyro_bias_walk_radps_rts: float = Field(default=4e-9, ge=0)
    accel_bias_walk_mps2_rts: float = Field(default=8e-7, ge=0)


_LATE_NS = NS_PER_S // 2
_ROLLED_RAD = 0.05
"""An inertial unit may begin this late, and wheels that roll less than that before it stand."""


@dataclass(frozen=True)
class FusedOdometry:
    """Gyro and wheels, with the accelerometer at rest.

    Attributes:
        spec: Its parameters.
        name: The name under which results are reported.
        needs: The streams without which it cannot run.

    Reference:
        Bakambu, Langley, Mukherji, figure 8 (block diagram of the IMU-fused 3D odometry).
    """

    spec: FusedOdometrySpec = field(default_factory=FusedOdometrySpec)
    name: str = "fused_odometry"
    needs: ClassVar[tuple[str, ...]] = ("wheels", "imu")

    def estimate(self, measurements: Measurements) -> Estimate:
        """Run the filter over wheel intervals; see `Estimator`."""
        wheels, wheel_calibration = declared_wheels(measurements)
        imu, imu_calibration = declared_imu(measurements)
        wheels = _covered_by(wheels, imu)
        inputs = _inputs(wheels, wheel_calibration, imu, imu_calibration, self.spec)
        constants = _constants(measurements, wheel_calibration, imu_calibration, self.spec)
        start = measurements.calibration.T_world_body_start.se3()
        pose = np.array(start.rotation), np.array(start.translation)
        rotation, translation, covariance, rejected = fused_filter.run(*pose, inputs, constants)
        diagnostics = {
            "at_rest": np.concatenate([inputs.rest[:1], inputs.rest]).astype(float),
            "rest_rejected": rejected,
        }
        trajectory = Trajectory(wheels.t_ns.copy(), SE3(rotation, translation))
        return Estimate(self.name, trajectory, covariance, diagnostics)


def odometry_track(
    measurements: Measurements, spec: FusedOdometrySpec | None = None
) -> OdometryTrack:
    """Give the best odometry there is.

    It is the recording's own odometry if there is one, else wheels with the inertial unit, else
    wheels alone.

    Raises:
        RecordingError: The recording has neither odometry nor wheels.
    """
    if measurements.odometry is not None:
        return stream_odometry(measurements)
    spec = spec or FusedOdometrySpec()
    calibration = measurements.calibration.imu
    if measurements.imu is None or calibration is None:
        return wheel_odometry(measurements, spec)
    wheels, wheel_calibration = declared_wheels(measurements)
    trajectory = FusedOdometry(spec).estimate(measurements).trajectory
    rolled = wheel_steps(wheels, wheel_calibration).rolled_m[: len(trajectory) - 1]
    per_metre = variance_per_metre(wheel_calibration, spec) * [1, 1, 1, 0, 0, 0]
    per_second = calibration.gyro_random_walk_radps_rthz**2 * np.array([0, 0, 0, 1.0, 1, 1])
    scale = wheel_calibration.scale_sigma * np.array([1.0, 1, 1, 0, 0, 0])
    track = np.concatenate([[0.0], np.cumsum(rolled)])
    return OdometryTrack(trajectory, track, per_metre, scale, per_second)


def declared_imu(measurements: Measurements) -> tuple[ImuStream, ImuCalibration]:
    """Give the inertial stream and its calibration.

    Raises:
        RecordingError: One of them is absent, or there are fewer than two samples.
    """
    measurements.require("imu")
    imu, calibration = measurements.imu, measurements.calibration.imu
    if imu is None or calibration is None:
        raise RecordingError("the recording declares no inertial unit: its calibration must")
    if len(imu) < 2:
        raise RecordingError(f"fused odometry needs at least 2 samples, there are {len(imu)}")
    return imu, calibration


def _covered_by(wheels: WheelStream, imu: ImuStream) -> WheelStream:
    """Keep the wheel readings up to the last inertial sample; none may roll before the first."""
    before = int(np.searchsorted(wheels.t_ns, imu.t_ns[0] - _LATE_NS))
    if before > 1 and np.ptp(wheels.drive_angle_rad[:before], axis=0).max() > _ROLLED_RAD:
        raise RecordingError(
            f"the wheels roll before the first inertial sample at {imu.t_ns[0]} ns, so that their "
            "turns are not known; give a recording of which both begin together or at rest"
        )
    kept = int(np.searchsorted(wheels.t_ns, imu.t_ns[-1], side="right"))
    if kept < 2:
        raise RecordingError(
            f"the inertial samples end at {imu.t_ns[-1]} ns, before the second wheel reading: "
            "both must be of one traverse"
        )
    return WheelStream(
        wheels.t_ns[:kept], wheels.drive_angle_rad[:kept], wheels.steer_angle_rad[:kept]
    )


def _inputs(
    wheels: WheelStream,
    wheel_calibration: WheelCalibration,
    imu: ImuStream,
    imu_calibration: ImuCalibration,
    spec: FusedOdometrySpec,
) -> fused_filter.Inputs:
    """Bring the inertial samples to the wheels' intervals and the body's axes."""
    t_s, ends_s = wheels.t_s, imu.t_s
    edges_s = np.concatenate([[2 * ends_s[0] - ends_s[1]], ends_s])
    R_body_imu = np.array(imu_calibration.T_body_imu.se3().rotation)
    turns = fused_filter.turns_between(t_s, edges_s, np.array(imu.gyro_radps)) @ R_body_imu.T
    speeds = _velocity_increments(t_s, edges_s, imu.accel_mps2) @ R_body_imu.T
    moved = wheel_displacements(wheels, wheel_calibration)
    return fused_filter.Inputs(
        np.diff(t_s),
        np.ascontiguousarray(turns),
        np.ascontiguousarray(speeds),
        moved.mean(axis=1),
        np.linalg.norm(moved, axis=-1).mean(axis=1),
        detect_rest(wheels, turns, spec.rest),
    )


def _velocity_increments(t_s: Array, edges_s: Array, accel_mps2: Array) -> Array:
    """Integrate the specific force over the wheels' intervals, for rests: no rotation."""
    steps = accel_mps2 * np.diff(edges_s)[:, None]
    speed = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    at = np.stack([np.interp(t_s, edges_s, speed[:, i]) for i in range(3)], axis=1)
    return np.diff(at, axis=0)


def _constants(
    measurements: Measurements,
    wheels: WheelCalibration,
    imu: ImuCalibration,
    spec: FusedOdometrySpec,
) -> fused_filter.Constants:
    return fused_filter.Constants(
        np.array([0.0, 0.0, measurements.calibration.gravity_mps2]),
        np.mean(np.array(wheels.position_body_m), axis=0),
        variance_per_metre(wheels, spec)[:3],
        wheels.scale_sigma,
        np.array([imu.gyro_bias_radps, imu.accel_bias_mps2]),
        np.array([spec.gyro_bias_walk_radps_rts, spec.accel_bias_walk_mps2_rts]),
        np.array([imu.gyro_random_walk_radps_rthz, imu.accel_random_walk_mps2_rthz]),
        imu.accel_quantum_mps,
        spec.rest_turn_sigma_radps,
        spec.rest_block_s,
        chi_square_threshold(6, spec.gate_probability),
    )
