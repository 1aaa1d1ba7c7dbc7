"""The filter of the fused odometry: error states over wheel intervals, drives compiled.

State of the error: ``xi`` 0:6 (right perturbation), gyro bias 6:9, accelerometer bias 9:12 (both
in the body), scale of the wheels 12.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from estimators import gaussian
from estimators.jacobians import hat, put, se3_exp, step_jacobians
from lpet_sim.geometry.compiled import small_exp, small_log
from lpet_sim.recording.arrays import Array

SIZE = 13
_START_SIGMA = 1e-6
_REST_SIGMA = (1e-9, 1e-7)


class Inputs(NamedTuple):
    """What was measured over each of n wheel intervals, in the body.

    Attributes:
        dt: Lengths [s], Shape (n,).
        turns: Rotation by the gyro [rad], Shape (n, 3).
        speeds: Specific force integrated over time [m/s], Shape (n, 3).
        moved: Mean displacement of the contact points [m], Shape (n, 2).
        rolled: Mean distance rolled [m], Shape (n,).
        rest: Whether the rover stands, Shape (n,).
    """

    dt: Array
    turns: Array
    speeds: Array
    moved: Array
    rolled: Array
    rest: NDArray[np.bool_]

    def rows(self, rows: slice) -> Inputs:
        """Cut some intervals out."""
        dt, turns, speeds = self.dt[rows], self.turns[rows], self.speeds[rows]
        return Inputs(dt, turns, speeds, self.moved[rows], self.rolled[rows], self.rest[rows])


class Constants(NamedTuple):
    """What is declared and stays.

    Attributes:
        up: Specific force of standstill in the world [m/s^2], Shape (3,).
        contact: Mean contact point in the body [m], Shape (3,).
        variance_per_m: Of the wheels' translation [m^2/m], Shape (3,).
        scale_sigma: Of the wheels, 1 sigma.
        bias_sigma: Turn-on biases of gyro and accelerometer, Shape (2,).
        bias_walk: Their random walks, Shape (2,).
        random_walk: Angle and velocity random walk, Shape (2,).
        quantum: Of a velocity increment [m/s].
        rest_turn: Rate at which a parked rover still turns, 1 sigma [rad/s].
        rest_block: Longest rest taken as one measurement [s].
        gate: Chi-square threshold of a rest measurement (6 degrees of freedom).
    """

    up: Array
    contact: Array
    variance_per_m: Array
    scale_sigma: float
    bias_sigma: Array
    bias_walk: Array
    random_walk: Array
    quantum: float
    rest_turn: float
    rest_block: float
    gate: float


@njit(cache=True)
def turns_between(t_s: Array, edges_s: Array, gyro_radps: Array) -> Array:
    """Integrate body rates over other intervals than their own.

    A rate that straddles an edge is split in proportion to time.

    Args:
        t_s: Edges of the wanted intervals [s], Shape (n + 1,).
        edges_s: Edges of the gyro's intervals [s], Shape (m + 1,).
        gyro_radps: Mean rate over each, Shape (m, 3).

    Returns:
        Rotation vectors [rad], Shape (n, 3).
    """
    out = np.zeros((len(t_s) - 1, 3))
    j = 0
    for k in range(len(out)):
        R = np.eye(3)
        while j < len(gyro_radps) and edges_s[j + 1] <= t_s[k]:
            j += 1
        i = j
        while i < len(gyro_radps) and edges_s[i] < t_s[k + 1]:
            span = min(edges_s[i + 1], t_s[k + 1]) - max(edges_s[i], t_s[k])
            R = R @ small_exp(gyro_radps[i] * span)
            i += 1
        out[k] = small_log(R)
    return out


@njit(cache=True)
def body_twist(
    turn: Array, moved: Array, dt: float, bias: Array, scale: float, contact: Array
) -> Array:
    """Give the twist of the body over one interval, Shape (6,).

    ``phi = turn - bias dt``; the mean contact point moves by ``(1 + scale) moved`` in the plane of
    the body, so that the origin moves by ``(1 + scale) moved - phi x contact``.
    """
    out = np.empty(6)
    phi = turn - bias * dt
    out[3:] = phi
    out[:3] = hat(contact) @ phi
    out[:2] += (1.0 + scale) * moved
    return out


@njit(cache=True)
def twist_jacobians(moved: Array, dt: float, contact: Array) -> tuple[Array, Array]:
    """Give the derivatives of `body_twist` by the bias, Shape (6, 3), and the scale, (6, 1)."""
    by_bias, by_scale = np.zeros((6, 3)), np.zeros((6, 1))
    put(by_bias, 0, 0, -dt * hat(contact))
    put(by_bias, 3, 0, -dt * np.eye(3))
    by_scale[0, 0], by_scale[1, 0] = moved[0], moved[1]
    return by_bias, by_scale


@njit(cache=True)
def predict(P: Array, u: Array, moved: Array, rolled: float, dt: float, c: Constants) -> Array:
    """Carry the covariance over one driven interval: gyro, wheels and biases add their noise."""
    by_bias, by_scale = twist_jacobians(moved, dt, c.contact)
    to_next, by_twist = step_jacobians(u)
    F, B, variance = np.eye(SIZE), np.zeros((SIZE, 12)), bias_drift(dt, c)
    put(F, 0, 0, to_next)
    put(F, 0, 6, by_twist @ by_bias)
    put(F, 0, 12, by_twist @ by_scale)
    put(B, 0, 0, F[:6, 6:9])
    put(B, 0, 3, by_twist[:, :3])
    put(B, 6, 6, np.eye(6))
    for i in range(3):
        variance[i] = c.random_walk[0] ** 2 / dt
        variance[3 + i] = c.variance_per_m[i] * rolled
    return gaussian.propagate(P, F, gaussian.of_noise(B, variance))


@njit(cache=True)
def bias_drift(dt: float, c: Constants) -> Array:
    """Give the variance that an interval adds: to the six biases, after six zeros, Shape (12,)."""
    out = np.zeros(12)
    for i in range(3):
        out[6 + i], out[9 + i] = c.bias_walk[0] ** 2 * dt, c.bias_walk[1] ** 2 * dt
    return out


def drift(P: Array, dt: float, c: Constants) -> Array:
    """Carry the covariance over one interval of rest: the biases walk, the pose is held."""
    return gaussian.with_noise(P, np.append(bias_drift(dt, c), 0.0))


def rest_jacobian(R: Array, up: Array) -> Array:
    """Give the derivative of (mean rate, mean specific force) at rest by the error, (6, 13).

    The rate is the bias; the force is ``R_true^T up + bias`` and ``R_true^T up = a + hat(a) theta``
    to first order with ``a = R^T up``.
    """
    H = np.zeros((6, SIZE))
    put(H, 0, 6, np.eye(3))
    put(H, 3, 3, hat(R.T @ up))
    put(H, 3, 9, np.eye(3))
    return H


def rest_noise(duration: float, c: Constants) -> Array:
    """Give the covariance of (mean rate, mean force) over a rest, Shape (6, 6).

    ``N^2/T`` each; the velocity is read at both ends with a variance of ``q^2/12``. A floor (in
    rad/s and m/s^2) keeps the covariance positive definite for a unit that is declared perfect.
    """
    variance = np.empty(6)
    rounding = c.quantum**2 / 6.0 / duration**2
    for i in range(3):
        variance[i] = c.random_walk[0] ** 2 / duration + c.rest_turn**2 + _REST_SIGMA[0] ** 2
        variance[3 + i] = c.random_walk[1] ** 2 / duration + rounding + _REST_SIGMA[1] ** 2
    return gaussian.independent(variance)


def run(R: Array, p: Array, data: Inputs, c: Constants) -> tuple[Array, Array, Array, Array]:
    """Filter a whole traverse.

    Args:
        R: Attitude of the body at the start, Shape (3, 3).
        p: Its position [m], Shape (3,).
        data: What was measured.
        c: What is declared.

    Returns:
        Attitudes (n + 1, 3, 3), positions (n + 1, 3), covariances of ``xi`` (n + 1, 6, 6), and 1
        where a rest measurement was rejected by the gate, Shape (n + 1,).
    """
    n = len(data.dt)
    out_R, out_p, out_P = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3)), np.empty((n + 1, 6, 6))
    rejected, bias, P = np.zeros(n + 1), np.zeros(7), _start_covariance(c)
    out_R[0], out_p[0], out_P[0] = R, p, P[:6, :6]
    for first, last in _pieces(data, c):
        piece = data.rows(slice(first, last))
        rows = slice(first + 1, last + 1)
        if piece.rest[0]:
            out_R[rows], out_p[rows], out_P[rows] = R, p, P[:6, :6]
            R, p, bias, P, rejected[last] = _stand(R, p, bias, P, piece, c)
            out_R[last], out_p[last], out_P[last] = R, p, P[:6, :6]
        else:
            out_R[rows], out_p[rows], out_P[rows], P = _drive(R, p, bias, P, piece, c)
            R, p = out_R[last].copy(), out_p[last].copy()
    return out_R, out_p, out_P, rejected


def _pieces(data: Inputs, c: Constants) -> Iterator[tuple[int, int]]:
    """Cut the intervals into drives and rests, long rests into blocks of equal length."""
    changes = np.flatnonzero(np.diff(data.rest)) + 1
    for first, last in itertools.pairwise([0, *changes.tolist(), len(data.dt)]):
        blocks = math.ceil(data.dt[first:last].sum() / c.rest_block) if data.rest[first] else 1
        cuts = np.linspace(first, last, min(blocks, last - first) + 1).round().astype(int)
        yield from itertools.pairwise(cuts.tolist())


def _start_covariance(c: Constants) -> Array:
    """The start is given: a micrometre and a microradian keep the covariance positive definite."""
    sigma = np.full(SIZE, _START_SIGMA)
    sigma[6:9], sigma[9:12], sigma[12] = c.bias_sigma[0], c.bias_sigma[1], c.scale_sigma
    return gaussian.independent(sigma**2)


@njit(cache=True)
def _drive(
    R: Array, p: Array, bias: Array, P: Array, data: Inputs, c: Constants
) -> tuple[Array, Array, Array, Array]:
    """Chain the twists of one drive; give every pose, its covariance, and the last whole one."""
    n = len(data.dt)
    out_R, out_p, out_P = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 6, 6))
    for k in range(n):
        u = body_twist(data.turns[k], data.moved[k], data.dt[k], bias[:3], bias[6], c.contact)
        P = predict(P, u, data.moved[k], data.rolled[k], data.dt[k], c)
        step_R, step_p = se3_exp(u)
        p = p + R @ step_p
        R = R @ step_R
        out_R[k], out_p[k], out_P[k] = R, p, P[:6, :6]
    return out_R, out_p, out_P, P


def _stand(
    R: Array, p: Array, bias: Array, P: Array, data: Inputs, c: Constants
) -> tuple[Array, Array, Array, Array, float]:
    """Take in a rest; leave the state as it is where the measurement does not fit."""
    duration = float(data.dt.sum())
    P = drift(P, duration, c)
    H, cov = rest_jacobian(R, c.up), rest_noise(duration, c)
    mean = np.concatenate([data.turns.sum(axis=0), data.speeds.sum(axis=0)]) / duration
    innovation = mean - bias[:6] - np.concatenate([np.zeros(3), R.T @ c.up])
    S = gaussian.innovation_covariance(P, H, cov)
    if gaussian.normalised_square(innovation, S) > c.gate:
        return R, p, bias, P, 1.0
    dx, P = gaussian.update(P, H, innovation, cov)
    step_R, step_p = se3_exp(dx[:6])
    return R @ step_R, p + R @ step_p, bias + dx[6:], P, 0.0
