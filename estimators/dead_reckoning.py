"""Wheel dead reckoning: planar steps chained in space from the known start."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numba import njit

from estimators import gaussian
from estimators.jacobians import step_jacobians
from estimators.motion import (
    MotionSpec,
    declared_wheels,
    integrate,
    planar_twists,
    variance_per_metre,
    wheel_steps,
)
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.trajectory import Trajectory

_ROLL_PITCH = slice(3, 5)


@dataclass(frozen=True)
class DeadReckoning:
    """Wheel odometry alone: the baseline that every other estimator has to beat.

    Roll and pitch stay those of the start. The covariance has the pose error and the scale error
    of the wheels as states; roll and pitch errors are a first-order Gauss-Markov process along the
    distance, so that they stay as large as the ground is uneven.

    Attributes:
        spec: How uneven the ground is.
        name: The name under which results are reported.
        needs: The streams without which it cannot run.
    """

    spec: MotionSpec = field(default_factory=MotionSpec)
    name: str = "dead_reckoning"
    needs: ClassVar[tuple[str, ...]] = ("wheels",)

    def estimate(self, measurements: Measurements) -> Estimate:
        """Chain the wheels' planar steps; see `Estimator`."""
        wheels, calibration = declared_wheels(measurements)
        steps = wheel_steps(wheels, calibration)
        twists = planar_twists(steps.planar)
        poses = integrate(measurements.calibration.T_world_body_start.se3(), twists)
        per_metre = variance_per_metre(calibration, self.spec)
        per_metre[_ROLL_PITCH] = 0.0
        tilt = self.spec.tilt_sigma_rad, self.spec.tilt_length_m
        covariance = _covariances(twists, steps.rolled_m, per_metre, calibration.scale_sigma, *tilt)
        residual = np.concatenate([[0.0], steps.residual_m])
        return Estimate(
            self.name,
            Trajectory(wheels.t_ns.copy(), poses),
            covariance,
            {"wheel_residual_m": residual},
        )


@njit(cache=True)
def _covariances(
    twists: Array,
    rolled_m: Array,
    per_metre: Array,
    scale_sigma: float,
    tilt_sigma: float,
    tilt_length: float,
) -> Array:
    """Propagate (xi, scale), Shape (7,), along the steps; give the covariance of xi.

    A scale error s is ``du = s u``, and ``J_r(u) u = u``. The start is given: a micrometre and a
    microradian stand for it, so that every covariance is positive definite.
    """
    start = np.full(7, 1e-12)
    start[6] = scale_sigma**2
    P = gaussian.independent(start)
    out = np.zeros((len(twists) + 1, 6, 6))
    out[0] = P[:6, :6]
    added = np.zeros(7)
    for k in range(len(twists)):
        F = np.eye(7)
        F[:6, :6], _ = step_jacobians(twists[k])
        F[:6, 6] = twists[k]
        kept = np.exp(-rolled_m[k] / tilt_length)
        F[3:5] *= kept
        added[:6] = per_metre * rolled_m[k]
        added[3:5] = tilt_sigma**2 * (1.0 - kept**2)
        P = gaussian.propagate(P, F, gaussian.independent(added))
        out[k + 1] = P[:6, :6]
    return out
