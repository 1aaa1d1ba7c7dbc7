"""What an estimator returns."""

from __future__ import annotations

from dataclasses import dataclass, field

from lpet_sim.recording.arrays import Array
from lpet_sim.recording.trajectory import Trajectory


@dataclass(frozen=True)
class Estimate:
    """An estimated trajectory with what the estimator says of its own quality.

    Attributes:
        name: The estimator's name.
        trajectory: Estimated poses ``T_world_body``.
        covariance: Covariance of the right perturbation ``xi`` of each pose, ``T_true = T_est @
            exp(xi)`` with ``xi = (translation, rotation)`` [m, rad], Shape (n, 6, 6), or None.
        diagnostics: Named arrays, one row per pose, Shape (n,), such as ``inliers`` or
            ``bridged`` (1 where vision failed and odometry stood in).
    """

    name: str
    trajectory: Trajectory
    covariance: Array | None = None
    diagnostics: dict[str, Array] = field(default_factory=dict)
