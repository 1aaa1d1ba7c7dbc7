"""How the error of a pose becomes that of the next by odometry, for the Cramer-Rao bound."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.streams import OdometryStream

_POSE = 6
_ANYWHERE = np.repeat([1e4, 10.0], 3)


@dataclass(frozen=True)
class OdometryStep:
    """How the error of a pose becomes that of the next: ``F xi + u s + noise``.

    Attributes:
        back: Inverse of the transition of (pose error, lasting errors), Shape (6 + c, 6 + c).
        variance: Variance of the noise, Shape (6,).
    """

    back: Array
    variance: Array


def lasting_errors(
    truth_poses: SE3, odometry: OdometryStream | None, rate_sigma_radps: float
) -> Array:
    """Give what the odometry's lasting errors of unit variance add to steps, Shape (n - 1, 6, c).

    ``diag(scale_sigma) u`` by a relative error of all parts, and a turn of ``rate_sigma dt`` about
    each axis; those that are declared to be zero are left out.
    """
    count = len(truth_poses) - 1
    if odometry is None:
        return np.zeros((count, _POSE, 0))
    twist = (truth_poses[:-1].inverse() @ truth_poses[1:]).log()
    turn = np.zeros((count, _POSE, 3))
    turn[:, 3:] = np.eye(3) * (rate_sigma_radps * np.diff(odometry.t_s))[:, None, None]
    scaled = (odometry.scale_sigma[1:] * twist)[:, :, None]
    kept = [scaled] if np.any(odometry.scale_sigma[:1] > 0) else []
    kept += [turn] if rate_sigma_radps > 0 else []
    return np.concatenate([*kept, np.zeros((count, _POSE, 0))], axis=2)


def odometry_steps(
    truth_poses: SE3, odometry: OdometryStream | None, lasting: Array
) -> Iterator[OdometryStep]:
    """Give the steps between the images.

    ``T_next = T T_prev_curr``, so ``xi_next = Ad(T_prev_curr^-1) xi + d + lasting s`` with lasting
    errors s of unit variance.
    """
    T_prev_curr = truth_poses[:-1].inverse() @ truth_poses[1:]
    forward = T_prev_curr.adjoint()  # The inverse of Ad(T_prev_curr^-1).
    for k in range(len(forward)):
        back = np.eye(_POSE + lasting.shape[2])
        back[:_POSE, :_POSE] = forward[k]
        back[:_POSE, _POSE:] = -forward[k] @ lasting[k]
        yield OdometryStep(back, _ANYWHERE if odometry is None else odometry.variance[k + 1])
