"""Dead reckoning and fused odometry: exact without noise, and honest about what they lack."""

from __future__ import annotations

import numpy as np
import pytest

from estimators import ESTIMATORS, build_estimator
from estimators.dead_reckoning import DeadReckoning
from estimators.fused_odometry import FusedOdometry, odometry_track
from estimators.rest import RestSpec, detect_rest
from lpet_sim.errors import RecordingError, UnknownNameError
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.streams import ImuStream, Measurements, WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.rng import stream
from lpet_sim.sensors.imu import Imu, ImuSpec
from tests.estimators.traverses import (
    GRAVITY_MPS2,
    MOUNT,
    NoisyDrive,
    calibration,
    noisy_drive,
    planar_arc,
    readings,
    rolling_wheels,
    ticks,
    wheel_calibration,
)

START = SE3.from_rpy([0.05, -0.1, 0.7], [10.0, -5.0, 2.0])


def largest_error(estimate: Trajectory, truth: Trajectory) -> tuple[float, float]:
    """Give the largest error of position [m] and attitude [rad]."""
    xi = (estimate.T_world_body.inverse() @ truth.at(estimate.t_ns)).log()
    return np.linalg.norm(xi[:, :3], axis=1).max(), np.linalg.norm(xi[:, 3:], axis=1).max()


def body_of(path: Trajectory, speed: float, yaw_rate: float) -> BodyTruth:
    """Dress a planar arc as truth."""
    n = len(path)
    velocity = speed * path.T_world_body.rotation[:, :, 0]
    return BodyTruth(path.t_ns, path.T_world_body, velocity, np.tile([0, 0, yaw_rate], (n, 1)))


def sensed(body: BodyTruth, spec: ImuSpec, seed: int = 0) -> tuple[ImuStream, Calibration]:
    """Measure a body with a unit, and declare it; the start is the body's first pose."""
    imu = Imu(spec, MOUNT, GRAVITY_MPS2, stream(seed, "imu")).sense(body)
    return imu, calibration(body.T_world_body[0], imu=spec.declared(MOUNT, 100.0))


@pytest.mark.parametrize(
    ("speed", "yaw_rate"), [(0.028, 0.0), (0.028, 0.005), (-0.02, 0.01), (0.0, 0.02)]
)
def test_without_noise_and_slip_both_end_on_the_closed_form(speed: float, yaw_rate: float) -> None:
    """Line, circle, backwards and point turn in a tilted plane, 200 s."""
    fine, coarse = ticks(20_001, 100.0), ticks(4001, 20.0)
    truth = planar_arc(fine, speed, yaw_rate, START)
    imu, declared = sensed(body_of(truth, speed, yaw_rate), ImuSpec.perfect())
    wheels = readings(rolling_wheels(coarse, speed, yaw_rate))
    for name in ("dead_reckoning", "fused_odometry"):
        estimate = build_estimator(name).estimate(Measurements(declared, imu=imu, wheels=wheels))
        assert np.array_equal(estimate.trajectory.t_ns, coarse)
        position, attitude = largest_error(estimate.trajectory, truth)
        assert position < 1e-9
        assert attitude < 1e-9


def test_fused_odometry_follows_ground_that_tilts_where_dead_reckoning_cannot() -> None:
    """Without noise the fused path is the truth in all three dimensions."""
    quiet = wheel_calibration(
        scale_sigma=0.0, white_sigma_m_rtm=0.0, lateral_sigma_m_rtm=0.0, heading_sigma_rad_rtm=0.0
    )
    drive = noisy_drive(stream(0, "drive"), quiet, 0.0)
    imu, declared = sensed(drive.body, ImuSpec.perfect())
    measurements = Measurements(declared, imu=imu, wheels=drive.wheels)
    truth = Trajectory(drive.body.t_ns, drive.body.T_world_body)
    position, attitude = largest_error(FusedOdometry().estimate(measurements).trajectory, truth)
    # A twist held over 50 ms against five of 10 ms: second order in the rate.
    assert position < 2e-5
    assert attitude < 1e-9
    flat, _ = largest_error(DeadReckoning().estimate(measurements).trajectory, truth)
    assert flat > 0.05


def noisy_measurements(seed: int) -> tuple[NoisyDrive, Measurements]:
    """Drive the model with a real unit's noise."""
    drive = noisy_drive(stream(seed, "drive"), wheel_calibration(), 0.02)
    imu, declared = sensed(drive.body, ImuSpec(), seed)
    return drive, Measurements(declared, imu=imu, wheels=drive.wheels)


def test_a_rest_teaches_the_gyro_its_bias() -> None:
    """With rests the heading ends better than the turn-on bias alone would let it."""
    ends = []
    for seed in range(12):
        drive, measurements = noisy_measurements(seed)
        no_rest = FusedOdometry().spec.model_copy(update={"rest": RestSpec(window_s=1e4)})
        pair = [FusedOdometry(), FusedOdometry(no_rest)]
        truth = Trajectory(drive.body.t_ns, drive.body.T_world_body)
        ends.append([largest_error(e.estimate(measurements).trajectory, truth)[1] for e in pair])
    with_rest, without = np.sqrt(np.mean(np.square(ends), axis=0))
    assert with_rest < 0.5 * without


def test_rest_is_found_where_the_plan_stands_and_nowhere_else() -> None:
    """Two stops of 8 s, less the margins; the slow start of a drive is no rest."""
    _, measurements = noisy_measurements(0)
    at_rest = FusedOdometry().estimate(measurements).diagnostics["at_rest"]
    t = measurements.wheels.t_s if measurements.wheels is not None else np.zeros(0)
    stands = (t <= 8.0) | ((t > 68.0) & (t <= 76.0))
    assert at_rest[~stands].sum() == 0
    assert at_rest[stands].sum() * 0.05 > 16 - 4 * 0.5 - 0.3


def test_a_rover_that_slides_with_its_wheels_locked_is_not_at_rest() -> None:
    """Wheels that stand are not enough: the gyro has to be quiet too; steering is no rest."""
    still = np.zeros((400, 6))
    wheels = WheelStream(ticks(400, 20.0), still, still.copy())
    turning = np.tile([0.0, 0.0, 5e-3 * 0.05], (399, 1))
    assert not detect_rest(wheels, turning, RestSpec()).any()
    assert detect_rest(wheels, 0 * turning, RestSpec())[10:-10].all()
    steering = WheelStream(wheels.t_ns, still.copy(), 0.02 * wheels.t_s[:, None] + still)
    assert not detect_rest(steering, 0 * turning, RestSpec()).any()


def test_a_rest_while_the_rover_shakes_is_rejected_by_the_gate() -> None:
    """A specific force that is not gravity's does not tilt the rover."""
    body = body_of(planar_arc(ticks(3001, 100.0), 0.0, 0.0, START), 0.0, 0.0)
    imu, declared = sensed(body, ImuSpec())
    shaken = ImuStream(imu.t_ns, imu.gyro_radps, imu.accel_mps2 + np.array([0.2, 0.0, 0.0]))
    still = np.zeros((601, 6))
    wheels = WheelStream(ticks(601, 20.0), still, still.copy())
    estimate = FusedOdometry().estimate(Measurements(declared, imu=shaken, wheels=wheels))
    assert estimate.diagnostics["rest_rejected"].sum() > 0
    sound = FusedOdometry().estimate(Measurements(declared, imu=imu, wheels=wheels))
    assert sound.diagnostics["rest_rejected"].sum() == 0
    np.testing.assert_allclose(
        estimate.trajectory.T_world_body.rotation[-1], START.rotation, atol=1e-9
    )


def test_a_tilted_attitude_is_levelled_at_rest() -> None:
    """After a long drive, a rest brings roll and pitch back to the accelerometer's bias."""
    spec = ImuSpec().model_copy(update={"gyro_random_walk_radps_rthz": (1e-3,) * 3})
    drive = noisy_drive(stream(5, "drive"), wheel_calibration(), 0.02)
    imu, declared = sensed(drive.body, spec, 5)
    estimate = FusedOdometry().estimate(Measurements(declared, imu=imu, wheels=drive.wheels))
    tilt = np.sqrt(np.trace(estimate.covariance[:, 3:5, 3:5], axis1=1, axis2=2))  # type: ignore[index]
    before, after = tilt[int(68.0 * 20)], tilt[int(76.0 * 20)]
    assert after < 0.2 * before


def test_a_unit_declared_perfect_breaks_nothing() -> None:
    """No noise at all, no bias that walks: a rest still has a covariance."""
    body = body_of(planar_arc(ticks(3001, 100.0), 0.0, 0.0, START), 0.0, 0.0)
    imu, declared = sensed(body, ImuSpec.perfect())
    still = np.zeros((601, 6))
    wheels = WheelStream(ticks(601, 20.0), still, still.copy())
    walks = {"gyro_bias_walk_radps_rts": 0.0, "accel_bias_walk_mps2_rts": 0.0}
    perfect = FusedOdometry(FusedOdometry().spec.model_copy(update=walks))
    estimate = perfect.estimate(Measurements(declared, imu=imu, wheels=wheels))
    assert estimate.diagnostics["rest_rejected"].sum() == 0
    np.testing.assert_allclose(
        estimate.trajectory.T_world_body.matrix(), np.tile(START.matrix(), (601, 1, 1)), atol=1e-9
    )


def test_every_covariance_is_positive_definite() -> None:
    """From the very first pose."""
    _, measurements = noisy_measurements(1)
    for name in ("dead_reckoning", "fused_odometry"):
        covariance = build_estimator(name).estimate(measurements).covariance
        assert covariance is not None
        np.linalg.cholesky(covariance)


def test_the_tilt_that_dead_reckoning_admits_is_that_of_the_ground() -> None:
    """It grows to the spec's and stays there."""
    wheels = readings(rolling_wheels(ticks(8001, 20.0), 0.1, 0.0))
    reckoning = DeadReckoning()
    covariance = reckoning.estimate(Measurements(calibration(), wheels=wheels)).covariance
    assert covariance is not None
    sigma = np.sqrt(covariance[:, 3, 3])
    assert sigma[100] < 0.7 * reckoning.spec.tilt_sigma_rad
    np.testing.assert_allclose(sigma[4000:], reckoning.spec.tilt_sigma_rad, rtol=1e-3)


def test_the_track_uses_the_gyro_where_there_is_one() -> None:
    """Without an inertial unit the heading of a step is the wheels', with one the gyro's."""
    _, measurements = noisy_measurements(2)
    t0, t1 = 20_000_000_000, 30_000_000_000
    _, fused = odometry_track(measurements).between(t0, t1)
    _, wheels = odometry_track(Measurements(calibration(), wheels=measurements.wheels)).between(
        t0, t1
    )
    assert fused[5, 5] < 1e-3 * wheels[5, 5]
    assert fused[0, 0] == pytest.approx(wheels[0, 0], rel=0.1)


def test_missing_streams_are_named() -> None:
    """Fused odometry without an inertial unit says so."""
    wheels = readings(rolling_wheels(ticks(10, 20.0), 0.05, 0.0))
    with pytest.raises(RecordingError, match="no stream 'imu'"):
        FusedOdometry().estimate(Measurements(calibration(), wheels=wheels))


def test_unknown_estimators_are_refused_with_the_valid_names() -> None:
    """The sentence lists them."""
    with pytest.raises(UnknownNameError, match=r"choose one of .*dead_reckoning"):
        build_estimator("clairvoyance")
    assert all(build_estimator(name).name == name for name in ESTIMATORS)
