"""Synthetic traverses with known truth: rigid rovers that roll without slip, and one with noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimators.motion import integrate
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.calibration import Calibration, PoseSpec, WheelCalibration
from lpet_sim.recording.streams import WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, WheelTruth

NAMES = ("front_left", "front_right", "middle_left", "middle_right", "rear_left", "rear_right")
CONTACTS = tuple((x, y, -0.35) for x in (0.62, 0.01, -0.58) for y in (0.6, -0.6))
RADIUS_M = 0.1425
GRAVITY_MPS2 = 3.721
MOUNT = SE3.from_rpy([0.1, -0.2, 0.4], [0.2, -0.1, 0.25])


def ticks(count: int, rate_hz: float) -> np.ndarray:
    """Give evenly spaced times [ns], Shape (count,)."""
    return np.arange(count, dtype=np.int64) * round(NS_PER_S / rate_hz)


def wheel_calibration(**more: object) -> WheelCalibration:
    """Declare the wheels as they truly are."""
    known: dict[str, object] = {
        "names": NAMES,
        "position_body_m": CONTACTS,
        "radius_m": RADIUS_M,
        "steerable": (True,) * 6,
    }
    return WheelCalibration.model_validate(known | more)


def calibration(start: SE3 | None = None, **more: object) -> Calibration:
    """Declare a suite; the start is the origin unless given."""
    known: dict[str, object] = {
        "wheels": wheel_calibration(),
        "T_world_body_start": PoseSpec.from_se3(SE3.identity() if start is None else start),
        "gravity_mps2": GRAVITY_MPS2,
    }
    return Calibration.model_validate(known | more)


def rolling_wheels(t_ns: np.ndarray, speed: float, yaw_rate: float) -> WheelTruth:
    """Give the wheels of a rover that moves by a constant planar twist without slip."""
    x, y = np.array(CONTACTS)[:, 0], np.array(CONTACTS)[:, 1]
    vx, vy = speed - yaw_rate * y, yaw_rate * x
    sign = np.where(vx < 0, -1.0, 1.0)
    angle = np.outer(t_ns / NS_PER_S, sign * np.hypot(vx, vy)) / RADIUS_M
    steer = np.broadcast_to(np.arctan2(sign * vy, sign * vx), angle.shape).copy()
    return wheel_truth(t_ns, angle, steer)


def wheel_truth(t_ns: np.ndarray, drive: Array, steer: Array) -> WheelTruth:
    """Dress wheel angles as truth."""
    none = [np.zeros(drive.shape) for _ in range(5)]  # slip, load, traction, sinkage, slip angle
    contact = np.ones(drive.shape, dtype=np.uint8)
    return WheelTruth(t_ns, drive, steer, *none, contact, np.zeros((len(t_ns), 0)))


def readings(truth: WheelTruth) -> WheelStream:
    """Read the wheels without error."""
    return WheelStream(truth.t_ns, truth.drive_angle_rad, truth.steer_angle_rad)


def planar_arc(t_ns: np.ndarray, speed: float, yaw_rate: float, start: SE3) -> Trajectory:
    """Give the closed form: a circle (or a line) in the plane of the body at the start."""
    t = t_ns / NS_PER_S
    yaw = yaw_rate * t
    if yaw_rate == 0.0:
        p = np.stack([speed * t, 0 * t, 0 * t], axis=-1)
    else:
        radius = speed / yaw_rate
        p = np.stack([radius * np.sin(yaw), radius * (1 - np.cos(yaw)), 0 * t], axis=-1)
    return Trajectory(t_ns, start @ SE3.from_rpy(np.stack([0 * t, 0 * t, yaw], axis=-1), p))


def tumbling_circle(count: int, rate_hz: float) -> BodyTruth:
    """Give a body on a circle that rolls and pitches about tilted axes, in closed form.

    ``p = r (cos wt, sin wt, 0)``, ``R = exp(w t z) exp(a)``: rate ``R^T w z`` exactly.
    """
    t_ns = ticks(count, rate_hz)
    t, r, w = t_ns / NS_PER_S, 3.0, 0.4
    c, s, o = np.cos(w * t), np.sin(w * t), 0 * t
    turn = SE3.exp(np.stack([o, o, o, o, o, w * t], axis=-1))
    rotation = turn.rotation @ SE3.from_rpy([0.3, -0.2, 0.1], np.zeros(3)).rotation
    position = r * np.stack([c, s, o], axis=-1)
    velocity = r * w * np.stack([-s, c, o], axis=-1)
    omega = np.einsum("nji,j->ni", rotation, np.array([0.0, 0.0, w]))
    return BodyTruth(t_ns, SE3(rotation, position), velocity, omega)


@dataclass(frozen=True)
class NoisyDrive:
    """One random traverse of the very model that the fused odometry believes in.

    Attributes:
        body: Truth at the rate of the inertial unit.
        wheels: What the encoders read, Shape of WheelStream.
    """

    body: BodyTruth
    wheels: WheelStream


PLAN = ((8.0, 0.0, 0.0), (60.0, 0.1, 0.02), (8.0, 0.0, 0.0), (60.0, 0.1, -0.03))
"""Pieces of the drive: duration [s], speed [m/s], yaw rate [rad/s]."""
PER_WHEEL = 5


def noisy_drive(
    rng: np.random.Generator, declared: WheelCalibration, vertical: float
) -> NoisyDrive:
    """Drive the plan at 100 Hz with wheels at 20 Hz, over ground that tilts the body.

    Wheels report the plan; the body truly moves by ``(1 + scale) moved + noise - phi x contact`` in
    each wheel interval, noise growing with the distance as declared.
    """
    speed, rates = _plan(rng)
    sigma = np.array([declared.white_sigma_m_rtm, declared.lateral_sigma_m_rtm, vertical])
    scale = 1.0 + declared.scale_sigma * rng.standard_normal()
    dt = 0.01
    moved = speed * dt
    noise = rng.standard_normal((len(speed), 3)) * sigma * np.sqrt(np.abs(moved))[:, None]
    turn = rates * dt
    step = scale * moved[:, None] * [1, 0, 0] + noise
    step = step - np.cross(turn, np.mean(CONTACTS, axis=0))
    T = _chained(np.concatenate([step, turn], axis=1))
    velocity = np.einsum("nij,nj->ni", T.rotation[:-1], step / dt)
    velocity = np.concatenate([velocity, velocity[-1:]])
    rates = np.concatenate([rates, rates[-1:]])
    body = BodyTruth(ticks(len(T), 100.0), T, velocity, rates)
    return NoisyDrive(body, _reported(moved))


def _plan(rng: np.random.Generator) -> tuple[Array, Array]:
    speeds, rates = [], []
    for duration, speed, yaw_rate in PLAN:
        t = np.arange(round(duration * 100)) * 0.01
        # A whole number of sine periods, whatever its phase, brings the tilt back.
        swing = 0.05 * np.sin(2 * np.pi * t[:, None] / duration * [4, 6] + rng.uniform(0, 6, 2))
        yaw = np.full((len(t), 1), yaw_rate)
        rates.append(np.concatenate([swing * (speed > 0), yaw], axis=1))
        speeds.append(np.full(len(t), speed))
    return np.concatenate(speeds), np.concatenate(rates)


def _chained(twists: Array) -> SE3:
    """Chain the steps; the function is held to the product of exponentials by a test of its own."""
    return integrate(SE3.from_rpy([0.05, -0.08, 0.3], [1.0, 2.0, 0.5]), twists)


def _reported(moved: Array) -> WheelStream:
    angle = np.concatenate([[0.0], np.cumsum(moved)])[::PER_WHEEL] / RADIUS_M
    drive = np.repeat(angle[:, None], 6, axis=1)
    return WheelStream(ticks(len(angle), 20.0), drive, np.zeros(drive.shape))
