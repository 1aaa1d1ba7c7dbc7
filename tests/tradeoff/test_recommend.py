"""The Pareto set, the rule that recommends, and a planted optimum that it has to find."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.errors import SpecError
from lpet_sim.rng import stream
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.recommend import (
    Efficiency,
    Judged,
    RecommendedSensor,
    allowed,
    assumed,
    judge,
    pareto,
    recommend,
    survivors,
)
from lpet_sim.tradeoff.run import run_tradeoff
from lpet_sim.tradeoff.sensitivity import first_order_share
from lpet_sim.tradeoff.spec import TradeoffSpec
from lpet_sim.tradeoff.static import Prediction, predict
from tests.tradeoff.tradeoffs import FLAT, SENSOR, small_setting, spec_of

SCENARIOS = Path(__file__).parents[2] / "scenarios" / "tradeoff"


@pytest.fixture(scope="module")
def prediction() -> Prediction:
    """Predict one sensor."""
    return predict(SENSOR, small_setting())


def at_ratio(prediction: Prediction, ratio: float) -> Prediction:
    """Give the prediction with another position error and hardly any of the attitude."""
    sigma = ratio * prediction.distance_m / math.sqrt(3.0)
    covariance = np.diag([sigma**2] * 3 + [1e-12] * 3)
    return replace(prediction, covariance=covariance)


def judged_at(prediction: Prediction, ratio: float, cost: float, index: int) -> Judged:
    """Judge a candidate of some error and cost."""
    spec = spec_of()
    return judge(index, at_ratio(prediction, ratio), assumed(spec.rule), cost, spec)


def test_the_pareto_set_is_what_nothing_beats() -> None:
    """Against the definition, row by row; of two equal rows both stay."""
    costs = stream(1, "test", "pareto").integers(0, 6, (60, 3)).astype(float)
    expected = [not any(all(b <= a) and any(b < a) for b in costs) for a in costs]
    assert pareto(costs).tolist() == expected
    assert pareto(np.ones((2, 3))).all()


def test_the_cheapest_that_meets_the_requirement_is_recommended(prediction: Prediction) -> None:
    """Upper ends are 2.94 times the prediction, and 0.8 % is left of 1 %: 0.272 % just meets it."""
    ones = [
        judged_at(prediction, 0.0001, 9.0, 0),
        judged_at(prediction, 0.0027, 5.0, 1),
        judged_at(prediction, 0.0028, 1.0, 2),
    ]
    assert [one.meets for one in ones] == [True, True, False]
    picked = recommend(ones, spec_of())
    assert picked.judged.index == 1 and picked.meets
    assert picked.worst_line == "position" and picked.worst_use == pytest.approx(0.992, abs=2e-3)


def test_of_candidates_that_cost_about_the_same_the_most_accurate_is_taken(
    prediction: Prediction,
) -> None:
    """Within a tenth of the least cost."""
    ones = [
        judged_at(prediction, 0.0020, 5.0, 0),
        judged_at(prediction, 0.0010, 5.4, 1),
        judged_at(prediction, 0.0001, 5.6, 2),
    ]
    assert recommend(ones, spec_of()).judged.index == 1


def test_where_none_meets_it_the_most_accurate_is_named_and_fails(prediction: Prediction) -> None:
    """An honest FAIL, with the line that has least room."""
    ones = [judged_at(prediction, ratio, 1.0, i) for i, ratio in enumerate((0.02, 0.01, 0.03))]
    picked = recommend(ones, spec_of())
    assert picked.judged.index == 1 and not picked.meets
    assert "none of 3 candidates" in picked.reason


def test_a_failed_run_keeps_a_candidate_from_being_recommended(prediction: Prediction) -> None:
    """However small its error."""
    spec = spec_of()
    lost = judge(0, at_ratio(prediction, 1e-5), Efficiency(1.0, 1.0, 1.0, 5, 1), 1.0, spec)
    assert not lost.meets
    assert recommend([lost, judged_at(prediction, 0.002, 7.0, 1)], spec).judged.index == 1


def test_survivors_are_those_near_the_decision_and_the_front_thinned(
    prediction: Prediction,
) -> None:
    """Nearest in cost of those that could meet 0.8 % with a spread of 1.96; ends of the front."""
    spec = spec_of(simulation={"recordings": ["x.rrd"], "survivors_max": 6})
    ones = [judged_at(prediction, 0.0003 * (i + 1), 20.0 / (i + 1), i) for i in range(20)]
    first = recommend(ones, spec).judged
    assert first.index == 8
    chosen = survivors(ones, np.arange(0, 20, 2), first, spec)
    assert chosen.tolist() == [0, 7, 8, 9, 10, 18]
    few = spec_of(simulation={"recordings": ["x.rrd"], "survivors_max": 1})
    assert survivors(ones, np.arange(0, 20, 2), first, few).tolist() == [8]


def test_constraints_that_nothing_keeps_to_are_one_sentence(prediction: Prediction) -> None:
    """It counts what each of them left over."""
    spec = spec_of(constraints={"mass_kg": 0.1, "data_bit_per_m": 1e12})
    with pytest.raises(SpecError, match="of 1 candidates 1 see landmarks, 1 keep to data_bit"):
        allowed([prediction], spec)


def test_the_share_of_variance_is_that_of_a_known_sum() -> None:
    """``y = 3 a + 4 b``: 0.36 and 0.64; of a bystander nothing."""
    x = stream(2, "test", "shares").random((4000, 3))
    y = 3 * x[:, 0] + 4 * x[:, 1]
    shares = [first_order_share(x[:, i], y) for i in range(3)]
    assert shares == pytest.approx([0.36, 0.64, 0.0], abs=0.03)


@pytest.mark.parametrize("seed", range(5))
def test_a_planted_depression_angle_is_found_by_every_seed(seed: int, tmp_path: Path) -> None:
    """Landmarks are to be seen in a ring alone, and one angle of the grid looks at its middle."""
    spec = TradeoffSpec.from_yaml(SCENARIOS / "interior.yaml")
    middle = 0.5 * (math.asin(1.5 / 2.5) + math.asin(1.5 / 4.0))
    found = run_tradeoff(spec, tmp_path, seed)
    best = found.recommendation.candidate.depression_rad
    assert best == pytest.approx(0.51) and abs(best - middle) < 0.05
    curve = found.sensitivity[0].error_ratio
    assert np.all(np.diff(curve[: np.argmin(curve) + 1]) <= 0)
    assert np.all(np.diff(curve[np.argmin(curve) :]) >= 0)


def test_the_recommended_sensor_goes_onto_a_traverse(tmp_path: Path) -> None:
    """Through YAML: camera, mount, unit and the period between images."""
    spec = spec_of()
    sensor = RecommendedSensor.of(Candidate(image_interval_m=0.1, baseline_m=0.33), spec.site)
    sensor.to_yaml(tmp_path / "sensor.yaml")
    assert RecommendedSensor.from_yaml(tmp_path / "sensor.yaml") == sensor
    traverse = TraverseSpec.from_mapping(
        {"terrain": FLAT, "drive": {"waypoints_m": [[0, 0], [5, 0]]}}
    )
    fitted = sensor.on(traverse)
    assert fitted.sensors.stereo is not None and fitted.images is not None
    assert fitted.sensors.stereo.baseline_m == 0.33
    assert fitted.images.period_s == pytest.approx(3.6)
    assert TraverseSpec.from_mapping(fitted.to_mapping()) == fitted


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_file_in_the_folder_of_trade_offs_is_one(path: Path) -> None:
    """It loads, is called what its file is called, and goes to YAML and back unchanged."""
    spec = TradeoffSpec.from_yaml(path)
    assert spec.name in (path.stem, f"tradeoff_{path.stem}")
    assert TradeoffSpec.from_mapping(spec.to_mapping()) == spec
