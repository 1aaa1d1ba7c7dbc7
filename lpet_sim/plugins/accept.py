"""Looking over an estimate that is not ours before it is scored."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import EstimatorFaultError
from lpet_sim.failures import BAD_COVARIANCE, MALFORMED, NO_OUTPUT, WRONG_FRAME, WRONG_LENGTH
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import STREAMS, Measurements

START_M: Final = 0.5
START_RAD: Final = 0.35
SPEED_MPS: Final = 0.5
"""A first pose further from the declared start than this, and than the rover may have driven since,
is one in another frame. All are choices."""
SLACK_NS: Final = NS_PER_S
"""An estimate may begin before and end after what was measured by so much; a choice."""
_ORTHONORMAL: Final = 1e-6
_ROUNDING: Final = 1e-9


def accepted(estimate: Estimate, measurements: Measurements) -> Estimate:
    """Give an estimate back if it can be scored; NaN poses are left to the score.

    Args:
        estimate: What somebody else's estimator gave.
        measurements: What it was made of.

    Raises:
        EstimatorFaultError: It is empty, not made of poses, or stands in another frame.
    """
    n = len(estimate.trajectory)
    if n == 0:
        raise EstimatorFaultError(NO_OUTPUT, "the estimate holds no pose")
    _hold_times(estimate.trajectory.t_ns, measurements)
    _hold_poses(estimate.trajectory.T_world_body)
    _hold_covariance(estimate, n)
    for name, values in estimate.diagnostics.items():
        if np.shape(values) != (n,):
            text = f"diagnostic '{name}' has shape {np.shape(values)}, not ({n},)"
            raise EstimatorFaultError(WRONG_LENGTH, text)
    _hold_start(estimate, measurements)
    return estimate


def _hold_times(t_ns: Ints, measurements: Measurements) -> None:
    """Hold the times to those of what was measured."""
    streams = [getattr(measurements, name) for name in STREAMS]
    measured = [np.asarray(s.t_ns) for s in streams if s is not None and len(s.t_ns)]
    if not measured:
        return
    first, last = min(0, *(t[0] for t in measured)), max(t[-1] for t in measured)
    if t_ns[0] < first - SLACK_NS or t_ns[-1] > last + SLACK_NS:
        said = [f"{t / NS_PER_S:.3f}" for t in (t_ns[0], t_ns[-1], first, last)]
        text = (
            f"the estimate spans {said[0]} to {said[1]} s, the measurements {said[2]} to {said[3]} "
            "s: times are those of the measurements, nanoseconds since the start"
        )
        raise EstimatorFaultError(MALFORMED, text)


def _hold_poses(T: SE3) -> None:
    R = T.rotation[np.isfinite(T.rotation).all(axis=(-1, -2))]
    off = np.abs(np.swapaxes(R, -1, -2) @ R - np.eye(3))
    if off.size and (off.max() > _ORTHONORMAL or np.linalg.det(R).min() < 0.0):
        raise EstimatorFaultError(MALFORMED, "a rotation of the estimate is not orthonormal")


def _hold_covariance(estimate: Estimate, n: int) -> None:
    P = estimate.covariance
    if P is None:
        return
    if P.shape != (n, 6, 6):
        text = f"the covariance has shape {P.shape}, not ({n}, 6, 6)"
        raise EstimatorFaultError(WRONG_LENGTH, text)
    bad = np.flatnonzero(~_is_covariance(P))
    if len(bad):
        text = f"the covariance of pose {bad[0]} has a negative eigenvalue or is not finite"
        raise EstimatorFaultError(BAD_COVARIANCE, text)


def _is_covariance(P: Array) -> NDArray[np.bool_]:
    """Tell which matrices are finite and positive semidefinite: the start may be known exactly."""
    good = np.asarray(np.isfinite(P).all(axis=(1, 2)))
    sizes = np.linalg.eigvalsh(P[good])
    good[good] = sizes[:, 0] >= -_ROUNDING * np.abs(sizes[:, -1])
    return good


def _hold_start(estimate: Estimate, measurements: Measurements) -> None:
    """Hold the first pose to where the rover is told to stand at the start."""
    start = measurements.calibration.T_world_body_start.se3()
    first: SE3 = estimate.trajectory.T_world_body[0]
    off = (start.inverse() @ first).log()
    if not np.isfinite(off).all():
        return
    passed_s = abs(int(estimate.trajectory.t_ns[0])) / NS_PER_S
    far_m, turned_rad = float(np.linalg.norm(off[:3])), float(np.linalg.norm(off[3:]))
    if far_m > START_M + SPEED_MPS * passed_s or turned_rad > START_RAD + SPEED_MPS * passed_s:
        text = (
            f"the first pose is {far_m:.2f} m and {np.degrees(turned_rad):.0f} deg from the "
            "declared start T_world_body_start: estimates are poses of the body in the world"
        )
        raise EstimatorFaultError(WRONG_FRAME, text)
