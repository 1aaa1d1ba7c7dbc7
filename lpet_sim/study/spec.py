"""What a study is: from requirement, ground, rover and goal to the sensors and algorithms tried."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field

from lpet_sim.evaluation import Requirement
from lpet_sim.planning.reach_spec import ReachSpec
from lpet_sim.spec import Spec
from lpet_sim.sweep.sweep_spec import VariantSpec
from lpet_sim.tradeoff.proxies import ProxySpec
from lpet_sim.tradeoff.space import SamplingSpec, SensorSpaceSpec
from lpet_sim.tradeoff.spec import ConstraintSpec, RuleSpec, SiteSpec, StaticSpec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class DrivesSpec(Spec):
    """Which ways are driven, and what happens on them.

    Attributes:
        worst: How many of the worst ways that reachability found.
        random: How many others, drawn at random, to compare them with.
        speed_mps: Speed of the rover; 100 m/h (the paper).
        standstill_s: How long the rover stands at the start, in which an observable filter maps its
            anchors; 50 images of the paper's rate.
        forced_slip_s: Length of the slip that is forced on each drive, in its second half; the
            paper's is 5 s; 0: none.
    """

    worst: Annotated[int, Field(ge=1)] = 3
    random: Annotated[int, Field(ge=0)] = 3
    speed_mps: Annotated[float, Field(gt=0.0, le=0.5)] = 100.0 / 3600.0
    standstill_s: NotNegative = 36.0
    forced_slip_s: NotNegative = 5.0


class SensorChoiceSpec(Spec):
    """How the sensor is chosen.

    Attributes:
        space: The sensors to choose from.
        sampling: How candidates are drawn from it.
        static: How closely the static analysis looks.
        proxies: What sensors cost.
        constraints: What they must not exceed.
        rule: How one is recommended.
        survivors: Most candidates that are simulated on the drives; 0: the static analysis decides.
        draws: Draws of each drive in that simulation.
        estimators: Those that it runs; the first one's error decides.
    """

    space: SensorSpaceSpec = SensorSpaceSpec()
    sampling: SamplingSpec = SamplingSpec()
    static: StaticSpec = StaticSpec()
    proxies: ProxySpec = ProxySpec()
    constraints: ConstraintSpec = ConstraintSpec()
    rule: RuleSpec = RuleSpec()
    survivors: Annotated[int, Field(ge=0)] = 6
    draws: Annotated[int, Field(ge=1)] = 2
    estimators: Annotated[tuple[VariantSpec, ...], Field(min_length=1)] = (
        VariantSpec(estimator="slam"),
    )


_MULTIFRAME = VariantSpec(
    estimator="slam",
    spec={"retention": {"kind": "time_to_live"}},
    sweep={"retention.images": [1, 3, 10]},
)
_BOUNDED = VariantSpec(
    estimator="slam",
    spec={"retention": {"kind": "bounded_queue"}},
    sweep={"retention.size": [20, 40, 80]},
)


class StudySpec(Spec):
    """A study: the chain of the paper's figure 1 in one file.

    Attributes:
        name: What it is called.
        requirement: What localization is held to.
        reachable_min: Share of the starts from which the goal is to be reachable.
        reach: Ground, goal, starts and rover.
        drives: Which ways are driven.
        distance_m: Distance after which a sensor's predicted error counts; None: the mean length of
            the drives.
        sensors: How the sensor is chosen.
        algorithms: The estimators to choose from.
        draws: How often the chosen sensor is drawn on each drive, with all its noise.
    """

    name: Annotated[str, Field(min_length=1)]
    requirement: Requirement = Requirement()
    reachable_min: Share = 0.9
    reach: ReachSpec
    drives: DrivesSpec = DrivesSpec()
    distance_m: Annotated[float, Field(ge=2.0)] | None = None
    sensors: SensorChoiceSpec = SensorChoiceSpec()
    algorithms: Annotated[tuple[VariantSpec, ...], Field(min_length=1)] = (
        VariantSpec(estimator="fused_odometry"),
        VariantSpec(estimator="frame_to_frame"),
        _MULTIFRAME,
        _BOUNDED,
    )
    draws: Annotated[int, Field(ge=1)] = 10

    @classmethod
    def files_beside(cls, mapping: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Find the files of terrain and soils."""
        if not isinstance(reach := mapping.get("reach"), dict):
            return mapping
        return mapping | {"reach": ReachSpec.files_beside(reach, folder)}

    def site(self, distance_m: float) -> SiteSpec:
        """Say where the sensor is used, for a distance [m]."""
        return SiteSpec(
            terrain=self.reach.terrain,
            speed_mps=self.drives.speed_mps,
            distance_m=distance_m,
            standstill_s=self.drives.standstill_s,
        )

    def parts(self, *names: str) -> dict[str, Any]:
        """Give some of its parts as plain values, for what a stage depends on."""
        whole = self.to_mapping()
        return {name: whole[name] for name in names}
