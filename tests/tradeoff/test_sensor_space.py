"""The space of sensors: how candidates are drawn, and what an empty space is told."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from lpet_sim.errors import SpecError
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.tradeoff.candidate import PARAMETERS, Candidate
from lpet_sim.tradeoff.footprint import footprint_of
from lpet_sim.tradeoff.proxies import ProxySpec, costs_of
from lpet_sim.tradeoff.space import SamplingSpec, SensorSpaceSpec, draw_candidates
from lpet_sim.tradeoff.static_world import seen_share, slope_that_sees

SPACE = SensorSpaceSpec.from_mapping(
    {
        "baseline_m": {"low": 0.1, "high": 0.5, "count": 3},
        "depression_rad": [0.2, 0.6],
        "imu": ["ln200", "tactical_mems"],
    }
)


def test_a_latin_hypercube_fills_every_stratum_once() -> None:
    """Twenty baselines in twenty equal parts of the range, and both values of a list ten times."""
    drawn = draw_candidates(SPACE, SamplingSpec(count=20), 3)
    strata = np.floor(np.array([c.baseline_m - 0.1 for c in drawn]) / 0.4 * 20)
    assert sorted(strata) == list(range(20))
    assert sum(c.depression_rad == 0.2 for c in drawn) == 10
    assert sum(c.imu == "ln200" for c in drawn) == 10
    assert drawn == draw_candidates(SPACE, SamplingSpec(count=20), 3)
    assert drawn != draw_candidates(SPACE, SamplingSpec(count=20), 4)


def test_a_grid_has_every_combination_once() -> None:
    """Three baselines, two angles, two grades."""
    drawn = draw_candidates(SPACE, SamplingSpec(kind="grid"), 0)
    assert len(drawn) == len(set(drawn)) == SPACE.grid_size == 12
    assert sorted({c.baseline_m for c in drawn}) == pytest.approx([0.1, 0.3, 0.5])
    assert SPACE.varied == ("baseline_m", "depression_rad", "imu")


@pytest.mark.parametrize(
    ("space", "said"),
    [
        ({"baseline_m": []}, "'baseline_m': is empty: give a number, a list"),
        ({"imu": []}, "imu is empty: give at least one grade"),
        ({"mast_height_m": {"low": 2.0, "high": 1.0}}, "'mast_height_m': the range is empty"),
        ({"mast_height_m": {"low": 2.0}}, "'mast_height_m': is empty"),
        ({"baseline_m": [0.1, 7.0]}, "'baseline_m': Input should be less than or equal to 5"),
        ({"imu": ["atomic"]}, "unknown IMU grade 'atomic': choose one of navigation, ln200"),
    ],
)
def test_an_empty_or_impossible_space_is_one_sentence(space: dict[str, Any], said: str) -> None:
    """It names the parameter and what would have been valid."""
    with pytest.raises(SpecError) as error:
        SensorSpaceSpec.from_mapping(space)
    assert said in str(error.value)
    assert "\n" not in str(error.value)


def test_a_camera_has_the_field_of_view_and_looks_where_it_is_told() -> None:
    """The edge of the image is half the field of view off its middle."""
    candidate = Candidate(field_of_view_rad=1.2, depression_rad=0.4, mast_height_m=1.6)
    calibration = candidate.calibration(0.3)
    edge = math.atan(0.5 * calibration.width_px / calibration.focal_px)
    assert edge == pytest.approx(0.6)
    mount = calibration.T_body_camera.se3()
    assert mount.translation[2] == pytest.approx(1.3)
    np.testing.assert_allclose(mount.rotation[:, 2], [math.cos(0.4), 0, -math.sin(0.4)], atol=1e-12)
    np.testing.assert_allclose(mount.rotation[:, 0], [0, -1, 0], atol=1e-12)
    assert np.linalg.det(mount.rotation) == pytest.approx(1.0)


def test_a_candidate_changes_the_landmark_sensor_by_what_it_is() -> None:
    """Period from interval and speed, noise from matching, range from the focal length."""
    candidate = Candidate(image_interval_m=0.1, matching_sigma_px=0.3, field_of_view_rad=0.7)
    sensor = candidate.landmark_sensor(LandmarkSensorSpec(), 0.05)
    assert sensor.period_s == pytest.approx(2.0)
    assert sensor.noise.sigma_v_px == 0.3
    assert sensor.visibility.range_full_m == pytest.approx(2.0 * candidate.focal_px / 804.0)


def test_the_proxies_are_their_formulas() -> None:
    """Data, computing and mass of a sensor by hand."""
    candidate = Candidate(resolution_px=500, image_interval_m=0.25, mast_height_m=1.9, aspect=0.8)
    costs = costs_of(candidate, 80.0, ProxySpec())
    assert costs.data_bit_per_m == pytest.approx(2 * 500 * 400 * 8 / 0.25)
    assert costs.compute_s_per_m == pytest.approx((400_000 * 1.8e-7 + 4 * 2.7e-3) / 0.25)
    assert costs.mass_kg == pytest.approx(0.44 + 4.0 * 1.0 + 2.0 * 0.15 + 0.75)


def test_a_footprint_begins_and_ends_where_the_edges_meet_the_ground() -> None:
    """Of a view of 0.4 rad, 0.5 rad down, from 2 m; and all of it is shown again without a step."""
    candidate = Candidate(
        field_of_view_rad=0.4, depression_rad=0.5, mast_height_m=2.0, image_interval_m=1e-9
    )
    found = footprint_of(candidate, 20.0)
    assert found.near_m == pytest.approx(2.0 / math.tan(0.7))
    assert found.far_m == pytest.approx(2.0 / math.tan(0.3))
    assert found.overlap == pytest.approx(1.0)
    steps = [candidate.model_copy(update={"image_interval_m": d}) for d in (0.5, 1.0, 2.0, 9.0)]
    overlaps = [footprint_of(step, 20.0).overlap for step in steps]
    assert overlaps == sorted(overlaps, reverse=True)
    assert overlaps[-1] == 0.0


def test_shadowing_is_smiths_function_and_falls_with_rocks() -> None:
    """Against its integral over slopes; rocks hide more; the inverse gives the slope back."""
    terrain = load_terrain_spec("exomars")
    bare = terrain.model_copy(update={"rocks": None})
    s, mu = bare.relief.rms_slope_rad, 0.08
    tail = quad(lambda q: (q - mu) * math.exp(-0.5 * (q / s) ** 2), mu, np.inf)[0]
    lam = tail / (mu * s * math.sqrt(2 * math.pi))
    below = 0.5 * (1 + math.erf(mu / s / math.sqrt(2)))
    share = float(seen_share(np.array([mu]), bare)[0])
    assert share == pytest.approx(below / (1 + lam), rel=1e-6)
    assert float(seen_share(np.array([mu]), terrain)[0]) < share
    assert float(slope_that_sees(np.array([share]), bare)[0]) == pytest.approx(mu, rel=0.01)


def test_every_parameter_is_a_field_of_candidate_and_space() -> None:
    """One list for all tables."""
    assert set(PARAMETERS) <= set(Candidate.model_fields)
    assert set(PARAMETERS) <= set(SensorSpaceSpec.model_fields)
