"""Wheel odometry and the derivatives of its steps."""

from __future__ import annotations

import numpy as np
import pytest

from estimators import fused_filter, jacobians
from estimators.motion import (
    MotionSpec,
    integrate,
    rolling_matrix,
    wheel_displacements,
    wheel_odometry,
    wheel_steps,
)
from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.streams import Measurements, WheelStream
from lpet_sim.rng import stream
from tests.estimators.traverses import (
    CONTACTS,
    RADIUS_M,
    calibration,
    planar_arc,
    readings,
    rolling_wheels,
    ticks,
    wheel_calibration,
)
from tests.finite_difference import assert_jacobian

TWISTS = [
    np.zeros(6),
    np.array([1e-3, 2e-4, 0, 1e-3, -2e-3, 3e-3]),
    np.array([0.3, -0.2, 0.1, 0.2, -0.5, 0.8]),
]


@pytest.mark.parametrize("u", TWISTS, ids=["zero", "step", "large"])
def test_step_jacobians_are_those_of_composition(u: np.ndarray) -> None:
    """Errors of pose and twist reach the next pose as the derivatives say."""
    nominal = SE3.exp(u)
    F, G = jacobians.step_jacobians(u)
    np.testing.assert_allclose(F, nominal.inverse().adjoint(), atol=1e-9)
    assert_jacobian(lambda xi: (nominal.inverse() @ SE3.exp(xi) @ nominal).log(), np.zeros(6), F)
    assert_jacobian(lambda du: (nominal.inverse() @ SE3.exp(u + du)).log(), np.zeros(6), G)


@pytest.mark.parametrize("u", TWISTS, ids=["zero", "step", "large"])
def test_compiled_exponential_is_that_of_the_geometry(u: np.ndarray) -> None:
    """One motion by loops equals one by arrays."""
    R, p = jacobians.se3_exp(u)
    np.testing.assert_allclose(R, SE3.exp(u).rotation, atol=1e-14)
    np.testing.assert_allclose(p, SE3.exp(u).translation, atol=1e-14)


def test_body_twist_jacobians_are_those_of_finite_differences() -> None:
    """By the gyro's bias and by the scale of the wheels."""
    turn, moved, contact = np.array([0.01, -0.02, 0.03]), np.array([0.2, 0.05]), np.ones(3) * 0.3
    by_bias, by_scale = fused_filter.twist_jacobians(moved, 0.05, contact)

    def twist(bias: np.ndarray, scale: float) -> np.ndarray:
        return fused_filter.body_twist(turn, moved, 0.05, bias, scale, contact)

    assert_jacobian(lambda b: twist(b, 0.1), np.array([0.1, 0.2, 0.3]), by_bias)
    assert_jacobian(lambda s: twist(np.zeros(3), s[0]), np.array([0.1]), by_scale)


def test_rest_jacobian_is_that_of_finite_differences() -> None:
    """Rate and specific force at rest by attitude and biases; not by position or scale."""
    R, up = SE3.from_rpy([0.2, -0.3, 1.0], np.zeros(3)).rotation, np.array([0, 0, 3.721])

    def measured(x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[6:9], (R @ so3.exp(x[3:6])).T @ up + x[9:12]])

    assert_jacobian(measured, np.zeros(13), fused_filter.rest_jacobian(R, up))


def test_the_rolling_matrix_is_the_derivative_of_the_contact_points() -> None:
    """A small rigid motion moves each contact point by its two rows."""
    points = np.array(CONTACTS)

    def moved(u: np.ndarray) -> np.ndarray:
        T = SE3.exp([u[0], u[1], 0, 0, 0, u[2]])
        return (T @ points - points)[:, :2].ravel()

    assert_jacobian(moved, np.zeros(3), rolling_matrix(points))


@pytest.mark.parametrize(
    ("speed", "yaw_rate"), [(0.03, 0.0), (0.03, 0.01), (-0.02, 0.015), (0.0, 0.02)]
)
def test_rolling_without_slip_gives_the_twist_and_no_residual(
    speed: float, yaw_rate: float
) -> None:
    """Straight on, on an arc, backwards, and turning on the spot."""
    truth = rolling_wheels(ticks(50, 20.0), speed, yaw_rate)
    steps = wheel_steps(readings(truth), wheel_calibration())
    expected = np.array([speed, 0.0, yaw_rate]) * 0.05
    np.testing.assert_allclose(steps.planar, np.tile(expected, (49, 1)), atol=1e-14)
    assert steps.residual_m.max() < 1e-14
    assert steps.rolled_m.min() > 0


def test_a_wheel_that_slips_leaves_a_residual_and_a_sixth_of_its_error() -> None:
    """Least squares spreads one wheel's slip over all."""
    truth = rolling_wheels(ticks(3, 20.0), 0.03, 0.0)
    drive = truth.drive_angle_rad.copy()
    drive[1:, 2] += 0.01
    slipped = WheelStream(truth.t_ns, drive, truth.steer_angle_rad)
    steps = wheel_steps(slipped, wheel_calibration())
    extra = 0.01 * RADIUS_M
    # The wheels' centre is 1.7 cm ahead of the body's origin, across it is on it.
    assert steps.planar[0, 0] == pytest.approx(0.0015 + extra / 6, rel=1e-3)
    assert steps.planar[0, 2] < 0
    assert steps.residual_m[0] > 0.2 * extra
    assert steps.residual_m[1] < 1e-14


def test_fixed_wheels_are_taken_to_point_ahead() -> None:
    """What a broken encoder says of a wheel that does not steer is not used."""
    truth = rolling_wheels(ticks(3, 20.0), 0.03, 0.0)
    stray = WheelStream(truth.t_ns, truth.drive_angle_rad, truth.steer_angle_rad + 0.3)
    moved = wheel_displacements(stray, wheel_calibration(steerable=(False,) * 6))
    np.testing.assert_allclose(moved[..., 1], 0.0)


def test_chaining_equals_the_product_of_the_exponentials() -> None:
    """Loop against stack, over a random walk."""
    twists = 0.1 * stream(0, "chain").standard_normal((20, 6))
    start = SE3.from_rpy([0.1, 0.2, 0.3], [1, 2, 3])
    poses = integrate(start, twists)
    pose = start
    for k, u in enumerate(twists):
        pose = pose @ SE3.exp(u)
        np.testing.assert_allclose(poses[k + 1].matrix(), pose.matrix(), atol=1e-13)


def test_steps_between_any_two_times_compose() -> None:
    """The track's steps are those of its trajectory, and their covariance grows with the way."""
    t_ns = ticks(401, 20.0)
    start = SE3.from_rpy([0.1, -0.05, 0.4], [1, 2, 3])
    wheels = readings(rolling_wheels(t_ns, 0.05, 0.02))
    track = wheel_odometry(Measurements(calibration(start), wheels=wheels))
    truth = planar_arc(t_ns, 0.05, 0.02, start).T_world_body
    step, cov = track.between(int(t_ns[100]), int(t_ns[300]))
    expected = truth[100].inverse() @ truth[300]
    np.testing.assert_allclose(step.matrix(), expected.matrix(), atol=1e-12)
    _, longer = track.between(int(t_ns[100]), int(t_ns[400]))
    assert np.linalg.eigvalsh(cov)[0] > 0
    assert np.all(np.diag(longer) > np.diag(cov))
    standing, none = track.between(int(t_ns[100]), int(t_ns[100]))
    assert np.abs(standing.log()).max() == 0.0
    assert np.abs(none).max() == 0.0


def test_the_step_covariance_has_the_declared_sizes() -> None:
    """A straight metre: root-distance noise along and across, and the scale on top."""
    t_ns = ticks(401, 20.0)
    wheels = readings(rolling_wheels(t_ns, 0.05, 0.0))
    track = wheel_odometry(Measurements(calibration(), wheels=wheels), MotionSpec())
    declared = wheel_calibration()
    _, cov = track.between(0, int(t_ns[400]))
    along = declared.white_sigma_m_rtm**2 + declared.scale_sigma**2
    np.testing.assert_allclose(cov[0, 0], along, rtol=1e-9)
    np.testing.assert_allclose(cov[1, 1], declared.lateral_sigma_m_rtm**2, rtol=1e-9)
    np.testing.assert_allclose(cov[5, 5], declared.heading_sigma_rad_rtm**2, rtol=1e-9)


def test_missing_wheels_are_named() -> None:
    """Absent stream, absent declaration, and too few readings each get their sentence."""
    with pytest.raises(RecordingError, match="no stream 'wheels'"):
        wheel_odometry(Measurements(calibration()))
    wheels = readings(rolling_wheels(ticks(2, 20.0), 0.05, 0.0))
    with pytest.raises(RecordingError, match="declares no wheels"):
        wheel_odometry(Measurements(calibration(wheels=None), wheels=wheels))
    one = readings(rolling_wheels(ticks(1, 20.0), 0.05, 0.0))
    with pytest.raises(RecordingError, match="at least 2 readings, there are 1"):
        wheel_odometry(Measurements(calibration(), wheels=one))
