"""Estimators: they read measurements alone and give a trajectory with its covariance."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from estimators.dead_reckoning import DeadReckoning
from estimators.frame_to_frame import FrameToFrame, FrameToFrameSpec
from estimators.fused_odometry import FusedOdometry, FusedOdometrySpec
from estimators.integrated_odometry import IntegratedOdometry, IntegratedOdometrySpec
from estimators.motion import MotionSpec
from estimators.peers.batch import GtsamBatch
from estimators.peers.fixed_lag import GtsamFixedLag
from estimators.peers.peer_spec import GtsamBatchSpec, GtsamFixedLagSpec
from estimators.protocol import Estimator
from estimators.slam import Slam
from estimators.slam_spec import SlamSpec
from lpet_sim.errors import UnknownNameError
from lpet_sim.spec import Spec

Registry = dict[str, tuple[type[Spec], Callable[[Any], Estimator]]]

ESTIMATORS: Registry = {
    "dead_reckoning": (MotionSpec, DeadReckoning),
    "fused_odometry": (FusedOdometrySpec, FusedOdometry),
    "odometry": (IntegratedOdometrySpec, IntegratedOdometry),
    "frame_to_frame": (FrameToFrameSpec, FrameToFrame),
    "slam": (SlamSpec, Slam),
}
"""Every estimator of our own by name: the type of its spec, and what builds it from one."""

PEERS: Registry = {
    "gtsam_fixed_lag": (GtsamFixedLagSpec, GtsamFixedLag),
    "gtsam_batch": (GtsamBatchSpec, GtsamBatch),
}
"""Those of other libraries, which run only where they are named: extra ``peers``."""


def build_estimator(name: str, spec: dict[str, Any] | None = None) -> Estimator:
    """Build an estimator.

    Args:
        name: One of `ESTIMATORS` or `PEERS`.
        spec: Fields of its spec as read from YAML; what is not given has its default.

    Raises:
        UnknownNameError: No estimator has this name; the sentence lists those there are.
        SpecError: An unknown key or a bad value.
        LpetError: A peer's library is not installed.
    """
    known = ESTIMATORS | PEERS
    if name not in known:
        raise UnknownNameError("estimator", name, known)
    kind, build = known[name]
    return build(kind.from_mapping(spec or {}, source=name))


__all__ = ["ESTIMATORS", "PEERS", "Estimator", "build_estimator"]
