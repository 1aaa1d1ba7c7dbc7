"""Six-wheel steering against closed forms."""

import numpy as np
import pytest

from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.kinematics import (
    max_curvature,
    steering_of_arc,
    steering_of_point_turn,
    wheel_motion,
)
from lpet_sim.rover.spec import RoverSpec

WHEELS = rover_frames(RoverSpec()).wheel_position_body_m[:, :2]


def test_straight_ahead_all_wheels_point_ahead_at_the_speed() -> None:
    """No yaw rate, no steering."""
    angle, speed = wheel_motion(WHEELS, 0.03, 0.0)
    np.testing.assert_array_equal(angle, 0.0)
    np.testing.assert_allclose(speed, 0.03)


@pytest.mark.parametrize("curvature", [-0.6, -0.1, 1e-9, 0.3, 0.6])
def test_on_an_arc_every_axle_points_at_the_common_centre(curvature: float) -> None:
    """Each wheel's direction is perpendicular to its arm from (0, 1/k)."""
    angle = steering_of_arc(WHEELS, curvature)
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    arm = WHEELS * curvature - [0.0, 1.0]
    np.testing.assert_allclose(np.einsum("ij,ij->i", direction, arm), 0.0, atol=1e-12)


@pytest.mark.parametrize(("speed", "yaw_rate"), [(0.03, 0.01), (0.0, 0.03), (-0.02, 0.02)])
def test_wheel_speeds_and_angles_rebuild_the_rigid_motion(speed: float, yaw_rate: float) -> None:
    """``v_i = v + omega x p_i`` holds for each wheel, backwards too."""
    angle, wheel_speed = wheel_motion(WHEELS, speed, yaw_rate)
    built = wheel_speed[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    rigid = np.array([speed, 0.0]) + yaw_rate * np.stack([-WHEELS[:, 1], WHEELS[:, 0]], axis=1)
    np.testing.assert_allclose(built, rigid, atol=1e-15)


def test_a_point_turn_steers_across_the_arms_within_the_limits() -> None:
    """``tan(angle) = -x/y``, and the left wheels roll backwards in a turn to the left."""
    frames = rover_frames(RoverSpec())
    angle = steering_of_point_turn(WHEELS)
    np.testing.assert_allclose(np.tan(angle), -WHEELS[:, 0] / WHEELS[:, 1])
    assert np.all(np.abs(angle) < frames.steer_limit_rad)
    np.testing.assert_array_equal(np.sign(wheel_motion(WHEELS, 0.0, 1.0)[1]), [-1, 1] * 3)


def test_the_largest_curvature_brings_one_wheel_to_its_limit() -> None:
    """At the bound one wheel stands at the limit, and none beyond it."""
    limit = 0.9
    angle = steering_of_arc(WHEELS, max_curvature(WHEELS, limit))
    assert np.abs(angle).max() == pytest.approx(limit, abs=1e-12)
