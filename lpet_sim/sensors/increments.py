"""Increments of angle and velocity, true and as an inertial triad delivers them.

Every sample is computed by the same scalar operations in the same order, so that results do not
depend on how a traverse is cut into chunks.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from lpet_sim.geometry.compiled import small_exp, small_log, times, times_transposed
from lpet_sim.recording.arrays import Array


@njit(cache=True)
def _site_velocity(R: Array, v: Array, omega: Array, r: Array) -> Array:
    """Give ``v + R (omega x r)``, the velocity in the world of a point r of the body."""
    x = omega[1] * r[2] - omega[2] * r[1]
    y = omega[2] * r[0] - omega[0] * r[2]
    z = omega[0] * r[1] - omega[1] * r[0]
    return v + times(R, np.array([x, y, z]))


@njit(cache=True)
def true_increments(
    dt: Array,
    R_world_body: Array,
    v_world_body: Array,
    omega_body: Array,
    R_body_imu: Array,
    p_body_imu: Array,
    gravity_mps2: float,
) -> tuple[Array, Array]:
    """Give what an ideal unit integrates between consecutive samples of the truth.

    ``delta_theta = log(R_k^T R_k+1)`` and ``delta_v = R_mid^T (v_k+1 - v_k + g dt e_z)``, both in
    the unit's frame, with v the velocity of the unit's site and ``R_mid = R_k exp(delta_theta/2)``
    the attitude amid the interval.

    Args:
        dt: Intervals [s], Shape (n - 1,).
        R_world_body: Shape (n, 3, 3).
        v_world_body: Velocity of the body's origin in the world [m/s], Shape (n, 3).
        omega_body: Body rate in the body [rad/s], Shape (n, 3).
        R_body_imu: Attitude of the unit in the body, Shape (3, 3).
        p_body_imu: Its place in the body [m], Shape (3,).
        gravity_mps2: Magnitude of gravity [m/s^2].

    Returns:
        delta_theta [rad] and delta_v [m/s], both Shape (n - 1, 3).
    """
    theta, speed = np.empty((len(dt), 3)), np.empty((len(dt), 3))
    up = np.array([0.0, 0.0, gravity_mps2])
    for k in range(len(dt)):
        R_now, R_next = R_world_body[k], R_world_body[k + 1]
        before = _site_velocity(R_now, v_world_body[k], omega_body[k], p_body_imu)
        after = _site_velocity(R_next, v_world_body[k + 1], omega_body[k + 1], p_body_imu)
        turn = small_log(times_transposed(R_now, R_next))
        force_body = times(R_now.T, after - before + up * dt[k])
        force_mid = times(small_exp(-0.5 * turn), force_body)
        theta[k], speed[k] = times(R_body_imu.T, turn), times(R_body_imu.T, force_mid)
    return theta, speed


@dataclass(frozen=True)
class TriadErrors:
    """The errors of three gyros or three accelerometers, and where they stand.

    ``delta_meas = axes @ delta + (bias + walk) dt + N sqrt(dt) n``; their sum, with jitter on it,
    is rounded to whole quanta, and the differences of the count are delivered.

    Attributes:
        axes: What the sensitive axes pick up: scale and misalignment, Shape (3, 3).
        bias: Turn-on bias, Shape (3,).
        random_walk: N, Shape (3,).
        bias_walk: K, Shape (3,).
        quantum: Of an increment, 0 for none, Shape (3,).
        jitter: Noise of the sum of increments, 1 sigma, Shape (3,).
        state: The bias walk, the sum of increments and what of it was delivered, Shape (3, 3).
    """

    axes: Array
    bias: Array
    random_walk: Array
    bias_walk: Array
    quantum: Array
    jitter: Array
    state: Array = field(default_factory=lambda: np.zeros((3, 3)))

    def rates(self, increments: Array, dt: Array, normals: Array) -> Array:
        """Give the mean rate over each interval, with errors, and remember where they stand.

        Args:
            increments: True increments, Shape (n, 3).
            dt: Intervals [s], Shape (n,).
            normals: Standard normal numbers, Shape (n, 9).

        Returns:
            Shape (n, 3).
        """
        axes, size = np.array(self.axes), (self.random_walk, self.bias_walk)
        coarse = self.quantum, self.jitter
        return _rates(increments, dt, normals, axes, self.bias, *size, *coarse, self.state)


@njit(cache=True)
def _rates(
    increments: Array,
    dt: Array,
    normals: Array,
    axes: Array,
    bias: Array,
    random_walk: Array,
    bias_walk: Array,
    quantum: Array,
    jitter: Array,
    state: Array,
) -> Array:
    out = np.empty(increments.shape)
    walk, total, delivered = state[0], state[1], state[2]
    for k in range(len(dt)):
        root = np.sqrt(dt[k])
        sensed = times(axes, increments[k])
        for i in range(3):
            walk[i] += bias_walk[i] * root * normals[k, 3 + i]
            error = (bias[i] + walk[i]) * dt[k] + random_walk[i] * root * normals[k, i]
            total[i] += sensed[i] + error
            reading = total[i] + jitter[i] * normals[k, 6 + i]
            if quantum[i] > 0.0:
                reading = quantum[i] * np.floor(reading / quantum[i] + 0.5)
            out[k, i] = (reading - delivered[i]) / dt[k]
            delivered[i] = reading
    return out
