"""Estimators: they read measurements alone and give a trajectory with its covariance."""

from __future__ import annotations

from collections.abc import Callable

from estimators.dead_reckoning import DeadReckoning
from estimators.frame_to_frame import FrameToFrame
from estimators.fused_odometry import FusedOdometry
from estimators.protocol import Estimator
from lpet_sim.errors import UnknownNameError

ESTIMATORS: dict[str, Callable[[], Estimator]] = {
    "dead_reckoning": DeadReckoning,
    "fused_odometry": FusedOdometry,
    "frame_to_frame": FrameToFrame,
}
"""Every estimator by name, as a builder that takes the default spec."""


def build_estimator(name: str) -> Estimator:
    """Build an estimator with its default spec.

    Args:
        name: One of `ESTIMATORS`.

    Raises:
        UnknownNameError: No estimator has this name; the sentence lists those there are.
    """
    if name not in ESTIMATORS:
        raise UnknownNameError("estimator", name, ESTIMATORS)
    return ESTIMATORS[name]()


__all__ = ["ESTIMATORS", "Estimator", "build_estimator"]
