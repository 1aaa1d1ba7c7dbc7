"""Motion from wheels: rolling, steered wheels on one rigid body; and odometry of any other kind.

The contact point of wheel i rolls by ``d_i = r dtheta_i`` along its heading ``delta_i``. On a rigid
body that moves by the planar twist ``u = (dx, dy, dpsi)`` the same point moves by
``(dx - y_i dpsi, dy + x_i dpsi)``. Two equations for each wheel, three unknowns, solved by least
squares; what is left over is slip.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, ArrayStruct, Ints
from lpet_sim.recording.calibration import WheelCalibration
from lpet_sim.recording.streams import Measurements, OdometryStream, WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.spec import Spec

PLANAR = np.array([0, 1, 5])
"""Where (dx, dy, dpsi) stand in ``xi = (translation, rotation)``."""


class MotionSpec(Spec):
    """What wheels do not measure: how uneven the ground is. Every value is this project's choice.

    Attributes:
        vertical_sigma_m_rtm: Motion along the body's z that a planar step leaves out [m/sqrt(m)].
        tilt_sigma_rad: Roll and pitch of the rover on its ground, 1 sigma [rad]: 5 deg, which is
            the slope of Mars terrain at the length of the rover.
        tilt_length_m: Distance over which roll and pitch are correlated [m]: about two rovers.
    """

    vertical_sigma_m_rtm: float = Field(default=0.02, ge=0)
    tilt_sigma_rad: float = Field(default=0.087, ge=0)
    tilt_length_m: float = Field(default=2.0, gt=0)


@dataclass(frozen=True, eq=False)
class WheelSteps(ArrayStruct):
    """The body's planar motion from one encoder reading to the next.

    Attributes:
        t_ns: End of each step since the start [ns], Shape (n,).
        planar: Twist (dx, dy, dpsi) in the body [m, m, rad], Shape (n, 3).
        rolled_m: Mean distance that the wheels rolled, never negative [m], Shape (n,).
        residual_m: RMS over the wheels of what no rigid motion explains [m], Shape (n,).
    """

    t_ns: Ints
    planar: Array
    rolled_m: Array
    residual_m: Array


@dataclass(frozen=True)
class OdometryTrack:
    """Odometry that can be asked for the motion between any two of its times.

    Attributes:
        trajectory: Poses by odometry alone, ``T_world_body``.
        rolled_m: Distance rolled up to each pose [m], Shape (n,).
        variance_per_m: Variance of ``xi`` that each metre adds, Shape (6,).
        scale_sigma: Relative error of each part of ``xi``, 1 sigma, fully correlated, Shape (6,).
        variance_per_s: Variance of ``xi`` that each second adds, Shape (6,).
        variance_so_far: Variance of ``xi`` added up to each pose beside these, Shape (n, 6); None
            adds none.
    """

    trajectory: Trajectory
    rolled_m: Array
    variance_per_m: Array
    scale_sigma: Array
    variance_per_s: Array = field(default_factory=lambda: np.zeros(6))
    variance_so_far: Array | None = None

    def between(self, t_prev_ns: int, t_curr_ns: int) -> tuple[SE3, Array]:
        """Give a step and its covariance.

        Args:
            t_prev_ns: Its start, within the track [ns].
            t_curr_ns: Its end, within the track [ns].

        Returns:
            ``T_prev_curr`` and the covariance of its right perturbation, Shape (6, 6).

        Raises:
            RecordingError: A time lies outside the track.
        """
        query = np.array([t_prev_ns, t_curr_ns], dtype=np.int64)
        T_world_body = self.trajectory.at(query)
        T_prev_curr = T_world_body[0].inverse() @ T_world_body[1]
        rolled = np.diff(np.interp(query, self.trajectory.t_ns, self.rolled_m))[0]
        variance = self.variance_per_m * rolled
        variance = variance + self.variance_per_s * (t_curr_ns - t_prev_ns) / NS_PER_S
        if self.variance_so_far is not None:
            known, summed = self.trajectory.t_ns, self.variance_so_far.T
            variance = variance + [np.diff(np.interp(query, known, s))[0] for s in summed]
        along = self.scale_sigma * T_prev_curr.log()
        return T_prev_curr, np.diag(variance) + np.outer(along, along)


def wheel_displacements(wheels: WheelStream, calibration: WheelCalibration) -> Array:
    """Give how far each contact point rolled in the body between readings.

    ``d_i (cos delta_i, sin delta_i)`` with ``delta_i`` the mean of the steering at both ends.

    Returns:
        Shape (n - 1, w, 2) [m].
    """
    distance = calibration.radius_m * np.diff(wheels.drive_angle_rad, axis=0)
    steer = wheels.steer_angle_rad * np.array(calibration.steerable, dtype=float)
    heading = 0.5 * (steer[1:] + steer[:-1])
    return np.stack([distance * np.cos(heading), distance * np.sin(heading)], axis=-1)


def rolling_matrix(position_body_m: Array) -> Array:
    """Give A with ``displacement = A (dx, dy, dpsi)`` for contact points at (w, 3).

    Returns:
        Shape (2 w, 3), the rows of each wheel in turn: along x, along y.
    """
    position = np.asarray(position_body_m, dtype=float)
    A = np.zeros((len(position), 2, 3))
    A[:, 0, 0] = A[:, 1, 1] = 1.0
    A[:, 0, 2], A[:, 1, 2] = -position[:, 1], position[:, 0]
    return A.reshape(-1, 3)


def wheel_steps(wheels: WheelStream, calibration: WheelCalibration) -> WheelSteps:
    """Fit the planar twist of a rigid body to the rolled distances, by least squares.

    Args:
        wheels: Encoder readings, at least two.
        calibration: The declared wheels.

    Returns:
        One step for each interval between readings.
    """
    moved = wheel_displacements(wheels, calibration)
    flat = moved.reshape(len(moved), -1)
    A = rolling_matrix(np.array(calibration.position_body_m))
    planar = flat @ np.linalg.pinv(A).T
    left = (flat - planar @ A.T).reshape(moved.shape)
    return WheelSteps(
        wheels.t_ns[1:].copy(),
        planar,
        np.linalg.norm(moved, axis=-1).mean(axis=1),
        np.sqrt((left**2).sum(axis=-1).mean(axis=1)),
    )


def variance_per_metre(calibration: WheelCalibration, spec: MotionSpec) -> Array:
    """Give the variance of ``xi`` that a metre of wheel odometry adds, Shape (6,).

    Scale is not in it, for it does not average out; nor does tilt grow without end, but over a
    short step it does so by ``2 sigma^2 / length``.
    """
    tilt = 2.0 * spec.tilt_sigma_rad**2 / spec.tilt_length_m
    along, across = calibration.white_sigma_m_rtm**2, calibration.lateral_sigma_m_rtm**2
    vertical, heading = spec.vertical_sigma_m_rtm**2, calibration.heading_sigma_rad_rtm**2
    return np.array([along, across, vertical, tilt, tilt, heading])


def planar_twists(planar: Array) -> Array:
    """Set planar twists (dx, dy, dpsi), Shape (n, 3), into ``xi``, Shape (n, 6)."""
    twist = np.zeros((len(planar), 6))
    twist[:, PLANAR] = planar
    return twist


def integrate(T_world_body: SE3, twists: Array) -> SE3:
    """Chain body-frame twists onto a start pose: ``T_k+1 = T_k exp(u_k)``.

    Args:
        T_world_body: The start, one pose.
        twists: ``u_k = (translation, rotation)`` [m, rad], Shape (n, 6).

    Returns:
        Poses with the start first, Shape (n + 1,).
    """
    steps = SE3.exp(twists)
    start = np.array(T_world_body.rotation), np.array(T_world_body.translation)
    rotation, translation = _chain(*start, np.array(steps.rotation), np.array(steps.translation))
    return SE3(rotation, translation)


def wheel_odometry(measurements: Measurements, spec: MotionSpec | None = None) -> OdometryTrack:
    """Integrate the wheels alone from the known start, as if the ground were one plane.

    Args:
        measurements: With wheels and their calibration.
        spec: What the wheels do not measure; default values where None.

    Raises:
        RecordingError: The recording has no wheels.
    """
    wheels, calibration = declared_wheels(measurements)
    steps = wheel_steps(wheels, calibration)
    start = measurements.calibration.T_world_body_start.se3()
    poses = integrate(start, planar_twists(steps.planar))
    return OdometryTrack(
        Trajectory(wheels.t_ns.copy(), poses),
        np.concatenate([[0.0], np.cumsum(steps.rolled_m)]),
        variance_per_metre(calibration, spec or MotionSpec()),
        np.full(6, calibration.scale_sigma),
    )


def stream_odometry(measurements: Measurements) -> OdometryTrack:
    """Chain the motion increments that some odometry of its own delivers, from the known start.

    Raises:
        RecordingError: The recording has no odometry, or no step of it.
    """
    odometry = declared_odometry(measurements)
    start = measurements.calibration.T_world_body_start.se3()
    poses = integrate(start, np.array(odometry.twist[1:]))
    length_m = np.linalg.norm(odometry.twist[:, :3], axis=-1)
    return OdometryTrack(
        Trajectory(odometry.t_ns.copy(), poses),
        np.cumsum(length_m) - length_m[0],
        np.zeros(6),
        np.array(odometry.scale_sigma[0]),
        variance_so_far=np.cumsum(odometry.variance, axis=0),
    )


def declared_odometry(measurements: Measurements) -> OdometryStream:
    """Give the stream of motion increments.

    Raises:
        RecordingError: It is absent, or there is no step.
    """
    measurements.require("odometry")
    odometry = measurements.odometry
    if odometry is None or len(odometry) < 2:
        held = 0 if odometry is None else len(odometry)
        raise RecordingError(f"odometry needs at least 2 rows, one step; there are {held}")
    return odometry


def declared_wheels(measurements: Measurements) -> tuple[WheelStream, WheelCalibration]:
    """Give the wheel stream and its calibration.

    Raises:
        RecordingError: One of them is absent, or there are fewer than two readings.
    """
    measurements.require("wheels")
    wheels, calibration = measurements.wheels, measurements.calibration.wheels
    if wheels is None or calibration is None:
        raise RecordingError("the recording declares no wheels: its calibration must name them")
    if len(wheels) < 2:
        raise RecordingError(f"wheel odometry needs at least 2 readings, there are {len(wheels)}")
    return wheels, calibration


@njit(cache=True)
def _chain(R: NDArray[np.float64], p: Array, steps_R: Array, steps_p: Array) -> tuple[Array, Array]:
    n = len(steps_p)
    out_R, out_p = np.empty((n + 1, 3, 3)), np.empty((n + 1, 3))
    out_R[0], out_p[0] = R, p
    for k in range(n):
        out_p[k + 1] = out_p[k] + out_R[k] @ steps_p[k]
        out_R[k + 1] = out_R[k] @ steps_R[k]
    return out_R, out_p
