"""Absolute and relative pose errors as the literature on SLAM states them, beside our own scores.

``lpet evaluate`` scores an estimate unaligned, since a rover is given its start; papers often align
it with the truth first. Here are both, pose by pose.

Reference:
    Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (2012), section 5.
    Umeyama, Least-squares estimation of transformation parameters (1991).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.errors import error_series
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.trajectory import Trajectory

Alignment = Literal["none", "origin", "all"]


@dataclass(frozen=True, eq=False)
class PoseErrors:
    """Sizes of errors.

    Attributes:
        position_m: Length of the translation error [m], Shape (n,).
        angle_rad: Angle of the rotation error [rad], Shape (n,).
    """

    position_m: Array
    angle_rad: Array

    @property
    def rmse_m(self) -> float:
        """Root of the mean square of the translation errors [m]."""
        return float(np.sqrt(np.mean(self.position_m**2)))

    @property
    def rmse_rad(self) -> float:
        """Root of the mean square of the rotation errors [rad]."""
        return float(np.sqrt(np.mean(self.angle_rad**2)))


def absolute_errors(
    estimate: Trajectory, truth: Trajectory, alignment: Alignment = "none"
) -> PoseErrors:
    """Give the absolute errors ``T_true^-1 A T_est`` of every pose; their RMS is the ATE.

    Args:
        estimate: Estimated poses; those outside the truth are left out.
        truth: True poses, interpolated at the times of the estimate.
        alignment: What A is: ``none`` the identity, as a rover's start is given; ``origin`` lays
            the first pose on the true one; ``all`` is the rigid motion that makes the positions'
            squared errors least.

    Raises:
        RecordingError: Estimate and truth do not overlap in time.
    """
    if alignment == "all":
        estimate = _aligned(estimate, truth)
    anchor = int(max(estimate.t_ns[0], truth.t_ns[0])) if alignment == "origin" else None
    series = error_series(estimate, truth, anchor)
    position_m = np.linalg.norm(series.position_error_m, axis=-1)
    return PoseErrors(position_m, np.linalg.norm(series.xi[:, 3:], axis=-1))


def relative_errors(estimate: Trajectory, truth: Trajectory, pairs: Ints) -> PoseErrors:
    """Give the errors of the motion between poses, as `segment_drift` averages them.

    ``E = (T_est_i^-1 T_est_j)^-1 (T_true_i^-1 T_true_j)``.

    Args:
        estimate: Estimated poses.
        truth: True poses, interpolated at the times of the estimate.
        pairs: Indices (i, j) into the estimate, Shape (m, 2).

    Raises:
        RecordingError: A pose of the estimate lies outside the truth.
    """
    T_est, T_true = estimate.T_world_body, truth.at(estimate.t_ns)
    i, j = np.asarray(pairs).T
    step_est, step_true = T_est[i].inverse() @ T_est[j], T_true[i].inverse() @ T_true[j]
    xi = (step_est.inverse() @ step_true).log()
    moved = (step_est.inverse() @ step_true).translation
    return PoseErrors(np.linalg.norm(moved, axis=-1), np.linalg.norm(xi[:, 3:], axis=-1))


def every_pair(count: int, step: int) -> Ints:
    """Give the pairs (i, i + step) of so many poses, Shape (count - step, 2)."""
    first = np.arange(max(count - step, 0))
    return np.stack([first, first + step], axis=-1)


def _aligned(estimate: Trajectory, truth: Trajectory) -> Trajectory:
    inside = (estimate.t_ns >= truth.t_ns[0]) & (estimate.t_ns <= truth.t_ns[-1])
    if inside.sum() < 3:
        raise RecordingError(
            f"{inside.sum()} poses of the estimate lie within the truth's time: 3 are the least "
            "that can be aligned"
        )
    at = truth.at(estimate.t_ns[inside])
    A = rigid_fit(estimate.T_world_body.translation[inside], at.translation)
    return Trajectory(estimate.t_ns.copy(), A @ estimate.T_world_body)


def rigid_fit(p_from: Array, p_to: Array) -> SE3:
    """Find the rigid motion A that makes ``sum |p_to - A p_from|^2`` least.

    Args:
        p_from: Points [m], Shape (n, 3).
        p_to: Where they are to lie [m], Shape (n, 3).

    Reference:
        Umeyama (1991), eq. 34 to 42, without scale.
    """
    mean_from, mean_to = p_from.mean(axis=0), p_to.mean(axis=0)
    u, _, vt = np.linalg.svd((p_to - mean_to).T @ (p_from - mean_from))
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(u) * np.linalg.det(vt))])
    rotation = u @ turn @ vt
    return SE3(rotation, mean_to - rotation @ mean_from)
