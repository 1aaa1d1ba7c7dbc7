"""Simple traverses with known errors, for the tests of the evaluation."""

from __future__ import annotations

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Truth


def straight(length_m: float, count: int, duration_s: float = 100.0) -> Trajectory:
    """Make a straight traverse along x at constant speed."""
    t_ns = np.linspace(0, duration_s * NS_PER_S, count).astype(np.int64)
    position = np.zeros((count, 3))
    position[:, 0] = length_m * t_ns / t_ns[-1]
    return Trajectory(t_ns, SE3(SE3.identity(count).rotation, position))


def winding(count: int = 401) -> Trajectory:
    """Make a traverse of about 25 m that turns, climbs and tilts."""
    t = np.linspace(0, 100, count)
    rpy = np.stack([0.1 * np.sin(0.3 * t), 0.1 * np.cos(0.2 * t), np.sin(0.1 * t)], axis=-1)
    position = np.stack([0.25 * t, 2 * np.sin(0.1 * t), 0.3 * np.cos(0.1 * t)], axis=-1)
    return Trajectory((t * NS_PER_S).astype(np.int64), SE3.from_rpy(rpy, position))


def as_truth(trajectory: Trajectory) -> Truth:
    """Dress a trajectory as a truth."""
    zero = np.zeros((len(trajectory), 3))
    return Truth(BodyTruth(trajectory.t_ns, trajectory.T_world_body, zero, zero.copy()))


def as_estimate(trajectory: Trajectory, **more: object) -> Estimate:
    """Dress a trajectory as an estimate."""
    return Estimate("candidate", trajectory, **more)  # type: ignore[arg-type]


def scaled(trajectory: Trajectory, factor: float) -> Trajectory:
    """Stretch a traverse, as a wheel of wrong radius would."""
    T = trajectory.T_world_body
    return Trajectory(trajectory.t_ns, SE3(T.rotation, factor * T.translation))
