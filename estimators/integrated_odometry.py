"""Odometry alone: the recording's own motion increments chained in space from the known start."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numba import njit

from estimators import gaussian
from estimators.jacobians import step_jacobians
from estimators.motion import declared_odometry, stream_odometry
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.spec import Spec


class IntegratedOdometrySpec(Spec):
    """Integrated odometry has no parameters: the recording declares what its odometry is worth."""


@dataclass(frozen=True)
class IntegratedOdometry:
    """Motion increments chained: the baseline of recordings whose odometry is not wheels.

    Attributes:
        spec: Without parameters.
        name: The name under which results are reported.
        needs: The streams without which it cannot run.
    """

    spec: IntegratedOdometrySpec = field(default_factory=IntegratedOdometrySpec)
    name: str = "odometry"
    needs: ClassVar[tuple[str, ...]] = ("odometry",)

    def estimate(self, measurements: Measurements) -> Estimate:
        """Chain the increments, ``T_k = T_k-1 exp(u_k)``; see `Estimator`."""
        odometry = declared_odometry(measurements)
        trajectory = stream_odometry(measurements).trajectory
        scale_sigma = np.array(odometry.scale_sigma[0])
        covariance = _covariances(
            np.array(odometry.twist), np.array(odometry.variance), scale_sigma
        )
        return Estimate(self.name, trajectory, covariance, {})


@njit(cache=True)
def _covariances(twists: Array, variance: Array, scale_sigma: Array) -> Array:
    """Propagate (xi, scale), Shape (7,), along the steps; give the covariance of xi, (n, 6, 6).

    One scale error s of unit variance, shared by all steps and parts: ``du = s sigma u``. The start
    is given: a micrometre and a microradian stand for it, so that every covariance is positive
    definite.
    """
    start = np.full(7, 1e-12)
    start[6] = 1.0
    P = gaussian.independent(start)
    out = np.zeros((len(twists), 6, 6))
    out[0] = P[:6, :6]
    added = np.zeros(7)
    for k in range(1, len(twists)):
        F = np.eye(7)
        F[:6, :6], by_twist = step_jacobians(twists[k])
        F[:6, 6] = by_twist @ (scale_sigma * twists[k])
        added[:6] = variance[k]
        P = gaussian.propagate(P, F, gaussian.independent(added))
        out[k] = P[:6, :6]
    return out
