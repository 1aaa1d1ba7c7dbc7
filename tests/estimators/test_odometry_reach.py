"""Odometry that begins late or ends early: what it does not see it is unsure of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimators import build_estimator
from estimators.odometry_steps import image_odometry
from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Ints
from lpet_sim.recording.streams import ImuStream, Measurements, OdometryStream, SightingStream
from lpet_sim.sensors.imu import ImuSpec
from tests.estimators.test_integrated_odometry import measured
from tests.estimators.traverses import (
    GRAVITY_MPS2,
    calibration,
    readings,
    rolling_wheels,
    ticks,
)
from tests.recording import synthetic

SPEED_MPS = 0.1


def images_at(*t_s: float) -> Ints:
    """Give times of images [ns]."""
    return (np.array(t_s) * NS_PER_S).astype(np.int64)


def straight(seconds: int) -> Measurements:
    """Give ten increments a second of a rover that drives ahead at 0.1 m/s, without noise."""
    n = 10 * seconds + 1
    twist = np.tile([0.1 * SPEED_MPS, 0, 0, 0, 0, 0], (n, 1))
    twist[0] = 0.0
    nothing = np.zeros((n, 6))
    odometry = OdometryStream(np.arange(n) * NS_PER_S // 10, twist, nothing, nothing.copy())
    return replace(measured(0), odometry=odometry)


@pytest.mark.parametrize("stream", ["increments", "wheels"])
def test_a_step_that_odometry_does_not_reach_is_as_unsure_as_it_was_ever_fast(stream: str) -> None:
    """Two seconds of a step of three are beyond the end, then all of one second."""
    given = straight(10)
    if stream == "wheels":
        wheels = readings(rolling_wheels(ticks(201, 20.0), SPEED_MPS, 0.0))
        given = Measurements(calibration(), wheels=wheels)
    steps = image_odometry(given, images_at(0.0, 4.0, 9.0, 12.0, 13.0))
    inside, over, beyond = steps.variance[1:3], steps.variance[3], steps.variance[4]
    assert inside[:, 0].max() < 0.02
    rest = inside[0, 0] / 4.0
    assert over[0] == pytest.approx((2.0 * SPEED_MPS) ** 2 + rest, rel=1e-3)
    assert beyond[0] == pytest.approx(SPEED_MPS**2, rel=1e-3)
    np.testing.assert_allclose(steps.twist[4], np.zeros(6), atol=1e-12)
    for name in ("slam", "frame_to_frame"):
        blind = blinded(given, images_at(0.0, 4.0, 9.0, 12.0, 13.0))
        covariance = build_estimator(name).estimate(blind).covariance
        assert covariance is not None
        assert covariance[-1][0, 0] > (2.0 * SPEED_MPS) ** 2 + SPEED_MPS**2


def blinded(given: Measurements, t_ns: Ints) -> Measurements:
    """Give measurements whose images show nothing."""
    none = SightingStream(
        t_ns,
        np.zeros(len(t_ns) + 1, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
        np.zeros((0, 3)),
        np.zeros(0),
    )
    cameras = synthetic.calibration().stereo
    declared = given.calibration.model_copy(update={"stereo": cameras})
    return replace(given, sightings=none, calibration=declared)


def test_a_first_image_is_as_unsure_as_odometry_until_then() -> None:
    """Ten steps of noise before the first image are in every pose from there on."""
    given = measured(1)
    assert given.odometry is not None
    blind = blinded(given, given.odometry.t_ns[10::10].copy())
    wanted = given.odometry.variance[1:11].sum(axis=0)
    for name in ("slam", "frame_to_frame"):
        covariance = build_estimator(name).estimate(blind).covariance
        assert covariance is not None
        assert np.all(np.diagonal(covariance[0]) > 0.99 * wanted)


def test_wheels_that_roll_before_the_inertial_unit_runs_are_refused() -> None:
    """A turn that no gyro saw would be an error that nothing tells of; a rest is none."""
    wheels = readings(rolling_wheels(ticks(401, 20.0), SPEED_MPS, 0.1))
    late = ticks(2001, 100.0)[500:]
    up = np.tile([0.0, 0.0, GRAVITY_MPS2], (len(late), 1))
    imu = ImuStream(late, np.zeros(up.shape), up)
    declared = ImuSpec().declared(SE3.identity(), 100.0)
    given = Measurements(calibration(imu=declared), wheels=wheels, imu=imu)
    with pytest.raises(RecordingError, match="wheels roll before the first inertial sample at 5"):
        build_estimator("fused_odometry").estimate(given)
    parked = replace(wheels, drive_angle_rad=np.zeros_like(wheels.drive_angle_rad))
    rested = replace(given, wheels=parked)
    assert len(build_estimator("fused_odometry").estimate(rested).trajectory) == 401
