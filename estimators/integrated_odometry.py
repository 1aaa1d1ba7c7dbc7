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
        """Chain the increments, ``T_k = T_k-1 exp(u_k)``; see `Estimator`.

        Where an inertial unit is declared its turn-on bias stays in the increments all the way.
        """
        odometry = declared_odometry(measurements)
        trajectory = stream_odometry(measurements).trajectory
        scale_sigma = np.array(odometry.scale_sigma[0])
        imu = measurements.calibration.imu
        covariance = _covariances(
            np.array(odometry.twist),
            np.array(odometry.variance),
            np.diff(odometry.t_s, prepend=0.0),
            scale_sigma,
            0.0 if imu is None else imu.gyro_bias_radps,
        )
        return Estimate(self.name, trajectory, covariance, {})


@njit(cache=True)
def _covariances(
    twists: Array, variance: Array, seconds: Array, scale_sigma: Array, rate_sigma: float
) -> Array:
    """Propagate (xi, scale, rate of turn), Shape (10,), along the steps; give xi's, (n, 6, 6).

    One scale error s of unit variance, shared by all steps and parts, and one rate of turn r:
    ``du = s sigma u + (0, r dt)``. The start is given: a micrometre and a microradian stand for it,
    so that every covariance is positive definite.
    """
    start = np.full(10, 1e-12)
    start[6], start[7:] = 1.0, rate_sigma**2
    P = gaussian.independent(start)
    out = np.zeros((len(twists), 6, 6))
    out[0] = P[:6, :6]
    added = np.zeros(10)
    for k in range(1, len(twists)):
        F = np.eye(10)
        F[:6, :6], by_twist = step_jacobians(twists[k])
        F[:6, 6] = by_twist @ (scale_sigma * twists[k])
        F[:6, 7:] = by_twist[:, 3:] * seconds[k]
        added[:6] = variance[k]
        P = gaussian.propagate(P, F, gaussian.independent(added))
        out[k] = P[:6, :6]
    return out
