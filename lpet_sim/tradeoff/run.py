"""The whole trade-off: static analysis, simulation of the survivors, recommendation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lpet_sim.outputs import output_folder
from lpet_sim.progress import Count, Progress, silent, uncounted
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.tradeoff.recommend import (
    Efficiency,
    Judged,
    Recommendation,
    RecommendedSensor,
    allowed,
    assumed,
    cost_table,
    judge,
    pareto,
    recommend,
    survivors,
    weighted_costs,
)
from lpet_sim.tradeoff.sensitivity import Sensitivity, sensitivities
from lpet_sim.tradeoff.simulated import SimulatedCandidate, simulate_candidates
from lpet_sim.tradeoff.space import draw_candidates
from lpet_sim.tradeoff.spec import TradeoffSpec
from lpet_sim.tradeoff.static import Prediction, predict_all, setting_of

_PREDICTED = 0.85


@dataclass(frozen=True, eq=False)
class TradeoffResult:
    """What a trade-off has found.

    Attributes:
        spec: The trade-off.
        predictions: Of all candidates.
        allowed: Indices of those that keep to the constraints.
        front: Indices of the Pareto set among them.
        judged: Those held to the requirement: all allowed ones, or the simulated ones if there are.
        simulated: What the simulation of survivors gave, by the index of the candidate.
        recommendation: The sensor that the rule picks.
        sensitivity: What each parameter does.
    """

    spec: TradeoffSpec
    predictions: tuple[Prediction, ...]
    allowed: Ints
    front: Ints
    judged: tuple[Judged, ...]
    simulated: Mapping[int, SimulatedCandidate]
    recommendation: Recommendation
    sensitivity: tuple[Sensitivity, ...]

    @property
    def sensor(self) -> RecommendedSensor:
        """The recommended sensor as the rest of LPET takes it."""
        return RecommendedSensor.of(self.recommendation.candidate, self.spec.site)


def run_tradeoff(
    spec: TradeoffSpec,
    folder: Path,
    seed: int = 0,
    pool: Pool | None = None,
    static_only: bool = False,
    progress: Progress = silent,
    count: Count = uncounted,
) -> TradeoffResult:
    """Run a trade-off; `tradeoff_files.write_tradeoff` writes what it finds.

    Args:
        spec: The trade-off.
        folder: Where simulated runs are kept: the same call after a kill goes on where it was.
        seed: Of the candidates drawn and the static landmarks, and first seed of the simulation.
        pool: Who simulates; one process if None.
        static_only: Leave the simulation out although the spec has one.
        progress: Called with the share of the static analysis done.
        count: Called as simulated runs end.

    Raises:
        LpetError: The space is empty, a recording cannot be used, or the folder not written.
    """
    home = output_folder(folder)
    setting = setting_of(spec, seed)
    candidates = draw_candidates(spec.space, spec.sampling, seed)
    predictions = predict_all(candidates, setting, lambda x: progress(_PREDICTED * x))
    kept: Ints = np.flatnonzero(allowed(predictions, spec))
    front = kept[pareto(cost_table([predictions[i] for i in kept]))]
    costs = weighted_costs(predictions, spec.rule)
    judged = _judged({int(i): assumed(spec.rule) for i in kept}, predictions, costs, spec)
    picked = recommend(judged, spec)
    simulated: dict[int, SimulatedCandidate] = {}
    if spec.simulation is not None and not static_only:
        chosen = survivors(judged, front, picked.judged, spec)
        told_of = {int(i): predictions[i].candidate for i in chosen}
        simulated = simulate_candidates(spec, told_of, home, seed, pool or Pool(), count)
    if simulated:
        told = {i: s.efficiency for i, s in simulated.items()}
        judged = _judged(told, predictions, costs, spec)
        picked = recommend(judged, spec)
    rest = lambda x: progress(_PREDICTED + (1.0 - _PREDICTED) * x)  # noqa: E731
    found = sensitivities(predictions, picked.candidate, spec.space, setting, rest)
    progress(1.0)
    return TradeoffResult(spec, tuple(predictions), kept, front, judged, simulated, picked, found)


def _judged(
    efficiencies: Mapping[int, Efficiency],
    predictions: list[Prediction],
    costs: Array,
    spec: TradeoffSpec,
) -> tuple[Judged, ...]:
    return tuple(
        judge(i, predictions[i], told, float(costs[i]), spec) for i, told in efficiencies.items()
    )
