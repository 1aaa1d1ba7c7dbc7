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
from lpet_sim.plugins.program import Program, ProgramSpec
from lpet_sim.plugins.python_plugin import (
    PluginSpec,
    describe,
    plugin_builder,
    plugin_code,
    plugin_names,
)
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

OUTSIDE: Registry = {"program": (ProgramSpec, Program)}
"""Programs in any language, which run only where they are named."""


def estimator_kind(name: str) -> tuple[type[Spec], Callable[[Any], Estimator]]:
    """Give the type of an estimator's spec, and what builds it from one.

    Args:
        name: One of `ESTIMATORS`, `PEERS` or `OUTSIDE`, of a plug-in that is installed, or
            ``module:Class``.

    Raises:
        UnknownNameError: No estimator has this name; the sentence lists those there are.
        SpecError: A plug-in cannot be imported or is no estimator.
    """
    known = ESTIMATORS | PEERS | OUTSIDE
    if name in known:
        return known[name]
    if ":" not in name and name not in plugin_names():
        raise UnknownNameError("estimator", name, [*known, *plugin_names()])
    return describe(name).spec, plugin_builder(name)


def outside_code(name: str, spec: dict[str, Any]) -> str:
    """Name the code, as it is now, of an estimator that is not ours; empty for our own.

    Args:
        name: See `estimator_kind`.
        spec: Its fields.
    """
    kind, _ = estimator_kind(name)
    if issubclass(kind, ProgramSpec):
        return kind.from_mapping(spec | {"code": ""}).code
    return plugin_code(name) if issubclass(kind, PluginSpec) else ""


def build_estimator(name: str, spec: dict[str, Any] | None = None) -> Estimator:
    """Build an estimator.

    Args:
        name: See `estimator_kind`.
        spec: Fields of its spec as read from YAML; what is not given has its default.

    Raises:
        UnknownNameError: No estimator has this name; the sentence lists those there are.
        SpecError: An unknown key or a bad value, or a plug-in that cannot be imported.
        LpetError: A peer's library is not installed.
    """
    kind, build = estimator_kind(name)
    return build(kind.from_mapping(spec or {}, source=name))


__all__ = ["ESTIMATORS", "OUTSIDE", "PEERS", "Estimator", "build_estimator", "estimator_kind"]
