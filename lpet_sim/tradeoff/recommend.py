"""Which sensor: the Pareto set, the rule that picks one, and what the rest of LPET takes of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lpet_sim.errors import SpecError
from lpet_sim.evaluation import Requirement
from lpet_sim.evaluation.requirement import AXES
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sensors.suite import SensorSuiteSpec
from lpet_sim.spec import Spec
from lpet_sim.sweep.traverse import ImagesSpec, TraverseSpec
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.grades import imu_grade
from lpet_sim.tradeoff.spec import ConstraintSpec, RuleSpec, SiteSpec, TradeoffSpec
from lpet_sim.tradeoff.static import Prediction


@dataclass(frozen=True)
class Efficiency:
    """How much worse than its prediction a real estimator is.

    Attributes:
        ratio: RMS position error over the predicted one.
        upper: The upper end of its interval.
        attitude_upper: The same of the attitude.
        runs: Runs that it comes from; 0: it is assumed.
        failed: How many of them failed.
    """

    ratio: float
    upper: float
    attitude_upper: float
    runs: int = 0
    failed: int = 0


@dataclass(frozen=True)
class Judged:
    """A candidate held to the requirement.

    Attributes:
        index: Its place among all candidates.
        prediction: What the static analysis says.
        efficiency: How much worse real estimators are, assumed or measured.
        upper_ratio: Upper end of the position error at the end, as a share of the distance.
        upper_attitude_rad: Upper ends of roll, pitch and yaw errors [rad].
        cost: Weighted sum of the proxies over their medians.
        meets: Whether all upper ends leave the margin.
    """

    index: int
    prediction: Prediction
    efficiency: Efficiency
    upper_ratio: float
    upper_attitude_rad: tuple[float, float, float]
    cost: float
    meets: bool


@dataclass(frozen=True)
class Recommendation:
    """The sensor that the rule picks.

    Attributes:
        judged: The candidate with its figures.
        reason: One sentence on why it is this one.
        worst_line: The line of the requirement with the least room, such as ``position``.
        worst_use: Its upper end over its limit less the margin; above 1 it fails.
    """

    judged: Judged
    reason: str
    worst_line: str
    worst_use: float

    @property
    def meets(self) -> bool:
        """Whether the recommended sensor meets the requirement."""
        return self.judged.meets

    @property
    def candidate(self) -> Candidate:
        """The sensor."""
        return self.judged.prediction.candidate


class RecommendedSensor(Spec):
    """The recommended sensor as the rest of LPET takes it.

    Attributes:
        candidate: Its parameters.
        sensors: The suite, as a traverse's ``sensors``.
        period_s: Time between image pairs at the speed of the trade-off, as a traverse's
            ``images.period_s``.
        landmarks: The landmark-level sensor that stands for the camera, as ``lpet sense`` and a
            sweep's arm take it.
    """

    candidate: Candidate
    sensors: SensorSuiteSpec
    period_s: Annotated[float, Field(gt=0.0)]
    landmarks: LandmarkSensorSpec

    @classmethod
    def of(cls, candidate: Candidate, site: SiteSpec) -> RecommendedSensor:
        """Write a candidate out for a site."""
        return cls(
            candidate=candidate,
            sensors=suite_of(candidate, site),
            period_s=candidate.period_s(site.speed_mps),
            landmarks=candidate.landmark_sensor(site.landmarks, site.speed_mps),
        )

    def on(self, traverse: TraverseSpec) -> TraverseSpec:
        """Give a traverse with this sensor in place of its own."""
        images: ImagesSpec | None = traverse.images
        if images is not None:
            images = images.model_copy(update={"period_s": self.period_s})
        return traverse.model_copy(update={"sensors": self.sensors, "images": images})


def suite_of(candidate: Candidate, site: SiteSpec) -> SensorSuiteSpec:
    """Give the whole suite of sensors of a candidate."""
    return SensorSuiteSpec(
        imu=imu_grade(candidate.imu).spec,
        wheels=site.wheels,
        stereo=candidate.camera(site.ride_height_m),
    )


def pareto(costs: Array) -> NDArray[np.bool_]:
    """Tell which rows no other row beats: none is as good in all columns and better in one.

    Args:
        costs: Less is better, Shape (n, c).
    """
    keep = np.ones(len(costs), dtype=bool)
    for i, row in enumerate(costs):
        beaten = np.all(costs <= row, axis=1) & np.any(costs < row, axis=1)
        keep[i] = not beaten.any()
    return keep


def cost_table(predictions: Sequence[Prediction]) -> Array:
    """Give (error ratio, data, computing, mass) of each prediction, Shape (n, 4)."""
    rows = [(p.error_ratio, *_proxies(p)) for p in predictions]
    return np.array(rows, dtype=float).reshape(-1, 4)


def _proxies(prediction: Prediction) -> tuple[float, float, float]:
    costs = prediction.costs
    return costs.data_bit_per_m, costs.compute_s_per_m, costs.mass_kg


def allowed(predictions: Sequence[Prediction], spec: TradeoffSpec) -> NDArray[np.bool_]:
    """Tell which candidates keep to the constraints and see any landmarks at all.

    Raises:
        SpecError: None does; the sentence counts what each constraint left over.
    """
    held = spec.constraints
    tests = {
        "see landmarks": np.array([p.sightings > 0 for p in predictions]),
        **_limits_kept(predictions, held, spec.site.speed_mps),
    }
    keep = np.all(list(tests.values()), axis=0)
    if not keep.any():
        counts = ", ".join(f"{int(kept.sum())} {name}" for name, kept in tests.items())
        raise SpecError(
            f"no sensor of the space is left: of {len(predictions)} candidates {counts}; widen "
            "the space or the constraints"
        )
    return np.asarray(keep)


def _limits_kept(
    predictions: Sequence[Prediction], held: ConstraintSpec, speed_mps: float
) -> dict[str, NDArray[np.bool_]]:
    data, compute, mass = cost_table(predictions)[:, 1:].T
    found = {
        "keep to data_bit_per_m": (data, held.data_bit_per_m),
        "keep to data_rate_bitps": (data * speed_mps, held.data_rate_bitps),
        "keep to compute_s_per_m": (compute, held.compute_s_per_m),
        "keep to mass_kg": (mass, held.mass_kg),
    }
    return {n: values <= limit for n, (values, limit) in found.items() if limit is not None}


def weighted_costs(predictions: Sequence[Prediction], rule: RuleSpec) -> Array:
    """Give the weighted sum of the proxies, each over its median, Shape (n,)."""
    table = cost_table(predictions)[:, 1:]
    weights = np.array([rule.data_weight, rule.compute_weight, rule.mass_weight])
    return np.asarray((table / np.median(table, axis=0)) @ weights)


def assumed(rule: RuleSpec) -> Efficiency:
    """Give the efficiency of candidates that were not simulated."""
    return Efficiency(rule.efficiency, rule.efficiency, rule.efficiency)


def judge(
    index: int, prediction: Prediction, efficiency: Efficiency, cost: float, spec: TradeoffSpec
) -> Judged:
    """Hold a candidate to the requirement.

    ``upper = spread * efficiency * predicted RMS``; a failed run makes it infinite.
    """
    spread = spec.rule.spread if efficiency.failed == 0 else math.inf
    ratio = spread * efficiency.upper * prediction.error_ratio
    x, y, z = (spread * efficiency.attitude_upper * a for a in prediction.attitude_rms_rad)
    used = max(_uses(ratio, (x, y, z), spec).values())
    return Judged(index, prediction, efficiency, ratio, (x, y, z), cost, used <= 1.0)


def _uses(
    ratio: float, attitude_rad: tuple[float, float, float], spec: TradeoffSpec
) -> dict[str, float]:
    """Give each upper end over its limit less the margin."""
    required: Requirement = spec.requirement
    room = 1.0 - spec.rule.margin
    angles = zip(AXES, attitude_rad, required.attitude_rad, strict=True)
    return {
        "position": ratio / (room * required.position_ratio),
        **{axis: value / (room * limit) for axis, value, limit in angles},
    }


def recommend(judged: Sequence[Judged], spec: TradeoffSpec) -> Recommendation:
    """Pick one sensor.

    The cheapest candidate whose upper ends all leave the margin; of those within `tie_ratio` of
    its cost, the most accurate. If none does, the one with the least upper position error.

    Args:
        judged: The candidates, at least one.
        spec: The trade-off.
    """
    good = [j for j in judged if j.meets]
    if good:
        least = min(j.cost for j in good)
        tied = [j for j in good if j.cost <= (1.0 + spec.rule.tie_ratio) * least]
        chosen = min(tied, key=lambda j: (j.upper_ratio, j.index))
        best = f"of the {len(tied)} cheapest of them it is the most accurate"
        reason = (
            f"{len(good)} of {len(judged)} candidates meet the requirement with a margin of "
            f"{spec.rule.margin:.0%}; {best if len(tied) > 1 else 'it is the cheapest of them'}"
        )
    else:
        chosen = min(judged, key=lambda j: (j.upper_ratio, j.prediction.error_ratio, j.index))
        reason = (
            f"none of {len(judged)} candidates meets the requirement with a margin of "
            f"{spec.rule.margin:.0%}; it is the most accurate of them"
        )
    uses = _uses(chosen.upper_ratio, chosen.upper_attitude_rad, spec)
    line = max(uses, key=lambda name: uses[name])
    return Recommendation(chosen, reason, line, uses[line])


def survivors(static: Sequence[Judged], on_front: Ints, first: Judged, spec: TradeoffSpec) -> Ints:
    """Pick the candidates to simulate.

    The one recommended so far; for half of the places those nearest to it in cost that would meet
    the requirement if the estimator lost nothing, for they are what simulation is to decide on;
    and the Pareto set, thinned evenly in the order of the predicted error.

    Args:
        static: The candidates that keep to the constraints, judged by the static prediction.
        on_front: Indices of the Pareto set.
        first: The one recommended so far.
        spec: The trade-off; its `SimulationSpec` says how many to pick at most.

    Returns:
        Indices in the order of all candidates.
    """
    assert spec.simulation is not None
    places = spec.simulation.survivors_max - 1
    able = [j for j in static if j.index != first.index and _could_meet(j, spec)]
    able.sort(key=lambda j: (abs(math.log(j.cost / first.cost)), j.index))
    near = [j.index for j in able[: (places + 1) // 2]]
    error = {j.index: j.prediction.error_ratio for j in static}
    rest = sorted({int(i) for i in on_front} - {first.index, *near}, key=error.__getitem__)
    at = np.linspace(0, len(rest) - 1, min(len(rest), places - len(near))).round()
    return np.array(sorted({first.index, *near, *(rest[int(i)] for i in at)}), dtype=np.int64)


def _could_meet(judged: Judged, spec: TradeoffSpec) -> bool:
    """Tell whether a candidate would meet the requirement if the estimator lost nothing."""
    lossless = Efficiency(1.0, 1.0, 1.0)
    return judge(judged.index, judged.prediction, lossless, judged.cost, spec).meets
