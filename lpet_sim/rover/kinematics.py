"""Steering: wheel angles and speeds for a motion of the body in its own plane.

Every steered wheel rolls along its own circle about one common centre (double Ackermann steering).
Forward is x, left is y; a wheel's steering angle is positive to the left.
"""

from __future__ import annotations

import numpy as np

from lpet_sim.recording.arrays import Array


def wheel_motion(position_xy: Array, speed: float, yaw_rate: float) -> tuple[Array, Array]:
    """Give steering angles and ground speeds of wheels that roll without side slip.

    ``v_i = (speed - yaw_rate y_i, yaw_rate x_i)``; the angle is that of ``v_i``, folded into
    +-90 deg, and the ground speed is negative where it was folded.

    Args:
        position_xy: Wheels in the body [m], Shape (n, 2).
        speed: Forward speed of the body's origin [m/s].
        yaw_rate: Body rate about z [rad/s].

    Returns:
        Steering angles [rad] and ground speeds [m/s], Shape (n,) each.
    """
    forward = speed - yaw_rate * position_xy[:, 1]
    sideways = yaw_rate * position_xy[:, 0]
    sign = np.where(forward < 0, -1.0, 1.0)
    angle = np.arctan2(sign * sideways, sign * forward)
    return angle, sign * np.hypot(forward, sideways)


def steering_of_arc(position_xy: Array, curvature: float) -> Array:
    """Give the steering angles [rad], Shape (n,), of an arc of the body's origin [1/m]."""
    return wheel_motion(position_xy, 1.0, curvature)[0]


def steering_of_point_turn(position_xy: Array) -> Array:
    """Give the steering angles [rad], Shape (n,), of a turn about the body's origin."""
    return wheel_motion(position_xy, 0.0, 1.0)[0]


def max_curvature(position_xy: Array, steer_limit_rad: float) -> float:
    """Give the largest curvature of the body's origin that the steering range allows [1/m].

    Wheel i needs ``tan(angle) = k |x_i| / (1 - k |y_i|)``, so
    ``k = tan(limit) / (|x_i| + |y_i| tan(limit))``, the least over the wheels.

    Args:
        position_xy: Wheels in the body [m], Shape (n, 2).
        steer_limit_rad: Largest steering angle, below 90 deg [rad].
    """
    tangent = np.tan(steer_limit_rad)
    reach = np.abs(position_xy[:, 0]) + np.abs(position_xy[:, 1]) * tangent
    return float(np.min(tangent / reach))
