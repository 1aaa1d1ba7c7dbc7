"""Integrated odometry: closed forms, agreement with sampling, and bridging by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimators import build_estimator
from estimators.fused_odometry import odometry_track
from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.consistency import anees
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration, ImuCalibration, PoseSpec
from lpet_sim.recording.streams import Measurements, OdometryStream, SightingStream
from lpet_sim.rng import stream
from tests.recording import synthetic

STEPS = 60
SIGMA = np.array([0.004, 0.003, 0.002, 0.001, 0.002, 0.003])
SCALE = np.array([0.02, 0.02, 0.02, 0.0, 0.0, 0.01])


def true_twists() -> np.ndarray:
    """Drive a curve that rises and banks; the first row's step is zero."""
    k = np.arange(STEPS + 1)
    turn = np.stack([0.01 * np.cos(k / 7), 0.01 * np.sin(k / 9), np.full(k.shape, 0.03)], -1)
    twist = np.concatenate([np.tile([0.1, 0.0, 0.01], (len(k), 1)), turn], axis=1)
    twist[0] = 0.0
    return twist


def measured(seed: int, told: float = 1.0) -> Measurements:
    """Give noisy increments of the curve, with their variances told ``told`` times too large."""
    rng = stream(seed, "test", "odometry")
    true, rows = true_twists(), (STEPS + 1, 1)
    noise = SE3.exp(rng.normal(size=true.shape) * SIGMA)
    twist = (SE3.exp(true / (1.0 + SCALE * rng.normal())) @ noise.inverse()).log()
    twist[0] = 0.0
    odometry = OdometryStream(
        np.arange(STEPS + 1) * 10**8,
        twist,
        np.tile(told**2 * SIGMA**2, rows),
        np.tile(told * SCALE, rows),
    )
    start = PoseSpec.from_se3(SE3.from_rpy([0.1, -0.2, 2.0], [3.0, 4.0, 5.0]))
    return Measurements(Calibration(T_world_body_start=start), odometry=odometry)


def nees_end(seed: int, told: float) -> float:
    """Give the NEES of the pose at the end."""
    return nees_of(measured(seed, told))


def nees_of(measurements: Measurements) -> float:
    """Give the NEES of the pose at the end of the curve."""
    estimate = build_estimator("odometry").estimate(measurements)
    start = measurements.calibration.T_world_body_start.se3()
    true = start
    for step in SE3.exp(true_twists()):
        true = true @ step
    xi = (estimate.trajectory.T_world_body[-1].inverse() @ true).log()
    return float(xi @ np.linalg.solve(estimate.covariance[-1], xi))


@pytest.mark.parametrize(("told", "consistent"), [(1.0, True), (0.5, False), (2.0, False)])
def test_its_covariance_is_what_it_errs(told: float, consistent: bool) -> None:
    """White noise and shared scale: NEES inside its band, and outside where told another noise."""
    found = anees([nees_end(seed, told) for seed in range(100)], 6)
    assert found.is_consistent == consistent


RATE = 3e-3


def test_a_declared_gyro_is_held_to_turn_it_all_the_way() -> None:
    """A rate of turn of its own in each of 100 runs: consistent where the unit declares it."""
    none = dict.fromkeys(("accel_bias_mps2", "accel_quantum_mps"), 0.0)
    walks = dict.fromkeys(("gyro_random_walk_radps_rthz", "accel_random_walk_mps2_rthz"), 0.0)
    unit = ImuCalibration(
        rate_hz=10.0, T_body_imu=PoseSpec(), gyro_bias_radps=RATE, **none, **walks
    )
    found = {True: list[float](), False: list[float]()}
    for seed in range(100):
        given = measured(seed)
        assert given.odometry is not None
        rate = np.r_[0, 0, 0, RATE * stream(seed, "test", "rate").normal(size=3)]
        twist = given.odometry.twist - 0.1 * rate
        twist[0] = 0.0
        turned = replace(given, odometry=replace(given.odometry, twist=twist))
        declared = replace(turned, calibration=turned.calibration.model_copy(update={"imu": unit}))
        for says, each in ((True, declared), (False, turned)):
            found[says].append(nees_of(each))
    assert anees(found[True], 6).is_consistent
    assert not anees(found[False], 6).is_consistent


def test_without_noise_it_ends_where_the_rover_does() -> None:
    """A circle comes back to its start, whose covariance is all that is left."""
    twist = np.tile([0.1, 0, 0, 0, 0, 2 * np.pi / STEPS], (STEPS + 1, 1))
    twist[0] = 0.0
    odometry = OdometryStream(
        np.arange(STEPS + 1) * 10**8, twist, np.zeros(twist.shape), np.zeros(twist.shape)
    )
    measurements = replace(measured(0), odometry=odometry)
    estimate = build_estimator("odometry").estimate(measurements)
    poses = estimate.trajectory.T_world_body
    np.testing.assert_allclose((poses[0].inverse() @ poses[-1]).log(), np.zeros(6), atol=1e-12)
    np.testing.assert_allclose(estimate.covariance[-1], 1e-12 * np.eye(6), atol=1e-14)


def test_a_straight_drive_has_the_variance_of_its_sum() -> None:
    """Along the drive ``n sigma^2 + (n u s)^2``; across it the heading adds ``sum (k u)^2``."""
    twist = np.zeros((STEPS + 1, 6))
    twist[1:, 0] = 0.1
    n, variance = STEPS, np.tile([4e-6, 0, 0, 0, 0, 1e-6], (STEPS + 1, 1))
    scale = np.tile([0.02, 0, 0, 0, 0, 0], (STEPS + 1, 1))
    odometry = OdometryStream(np.arange(STEPS + 1) * 10**8, twist, variance, scale)
    end = (
        build_estimator("odometry").estimate(replace(measured(0), odometry=odometry)).covariance[-1]
    )
    assert end[0, 0] == pytest.approx(n * 4e-6 + (n * 0.1 * 0.02) ** 2, rel=1e-5)
    assert end[1, 1] == pytest.approx(1e-6 * 0.01 * sum(k**2 for k in range(n)), rel=1e-5)
    assert end[5, 5] == pytest.approx(n * 1e-6, rel=1e-5)


def test_a_track_of_it_adds_the_variance_between_its_times() -> None:
    """Half a step has half its variance, ten steps ten times; scale adds along the motion."""
    track = odometry_track(measured(3))
    for a, b, steps in ((0, 10, 10.0), (4, 4.5, 0.5)):
        T, covariance = track.between(int(a * 1e8), int(b * 1e8))
        along = SCALE * T.log()
        np.testing.assert_allclose(
            covariance, np.diag(steps * SIGMA**2) + np.outer(along, along), rtol=1e-9
        )


def test_frame_to_frame_is_bridged_by_it_where_nothing_is_seen() -> None:
    """With blind images, frame-to-frame is the odometry."""
    measurements = measured(5)
    t_ns = measurements.odometry.t_ns[::10].copy()
    blind = SightingStream(
        t_ns,
        np.zeros(len(t_ns) + 1, dtype=np.int64),
        np.zeros(0, dtype=np.int64),
        np.zeros((0, 3)),
        np.zeros(0),
    )
    calibration = measurements.calibration.model_copy(
        update={"stereo": synthetic.calibration().stereo}
    )
    told = replace(measurements, sightings=blind, calibration=calibration)
    vision = build_estimator("frame_to_frame").estimate(told)
    chained = build_estimator("odometry").estimate(told)
    assert vision.diagnostics["bridged"][1:].all()
    np.testing.assert_allclose(
        vision.trajectory.T_world_body.matrix(),
        chained.trajectory.T_world_body[::10].matrix(),
        atol=1e-9,
    )


def test_a_recording_without_it_is_refused() -> None:
    """The sentence names the stream, or says how many rows there are."""
    with pytest.raises(RecordingError, match="no stream 'odometry'"):
        build_estimator("odometry").estimate(Measurements(Calibration()))
    odometry = measured(0).odometry
    one = OdometryStream(*(getattr(odometry, f)[:1] for f in odometry.__dataclass_fields__))
    with pytest.raises(RecordingError, match="at least 2 rows, one step; there are 1"):
        build_estimator("odometry").estimate(Measurements(Calibration(), odometry=one))
