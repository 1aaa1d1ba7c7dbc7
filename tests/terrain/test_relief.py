"""Self-affine relief has the exponent and the slope that were asked for."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lpet_sim.rng import stream
from lpet_sim.terrain.relief import LONGEST, self_affine_spectrum, structure_function, synthesise
from lpet_sim.terrain.spec import ReliefSpec, TerrainSpec
from lpet_sim.terrain.terrain import build_terrain
from tests.terrain.surfaces import exponent, grid_rms_difference

LAGS = (1, 2, 4, 8, 16)


@pytest.mark.parametrize(("hurst", "slope_deg"), [(0.7, 8.0), (0.8, 5.0), (0.9, 3.0)])
def test_exponent_and_slope_over_twenty_seeds_are_those_asked_for(
    hurst: float, slope_deg: float
) -> None:
    """Structure function at 1-16 m over 256 x 256 m: means within 10 % of what was asked."""
    spec = TerrainSpec(relief=ReliefSpec(hurst=hurst, rms_slope_rad=math.radians(slope_deg)))
    patches = [build_terrain(spec, seed).patch(-128, -128, (257, 257), 1.0) for seed in range(20)]
    rms = np.array([grid_rms_difference(patch, LAGS) for patch in patches])
    exponents = [exponent(np.array(LAGS, dtype=float), row) for row in rms]
    slopes = np.degrees(np.arctan(rms[:, 0]))
    assert abs(np.mean(exponents) / hurst - 1.0) < 0.1
    assert abs(np.mean(slopes) / slope_deg - 1.0) < 0.1


@pytest.mark.parametrize("hurst", [0.6, 0.7, 0.8, 0.9, 0.95])
def test_expected_structure_function_is_the_power_law(hurst: float) -> None:
    """``D(r) = tan(slope)^2 r^2H`` within 5 % from 0.3 m to 16 m, and exactly at 1 m."""
    spec = ReliefSpec(hurst=hurst, rms_slope_rad=0.1)
    lag = np.array([0.3, 1.0, 4.0, 16.0])
    longest = LONGEST * spec.outer_scale_m
    rms = np.sqrt(structure_function(self_affine_spectrum(spec), 0.08, longest, lag))
    assert rms == pytest.approx(math.tan(0.1) * lag**hurst, rel=0.05)
    assert rms[1] == pytest.approx(math.tan(0.1), rel=1e-4)


def test_structure_function_of_one_wave_has_its_closed_form() -> None:
    """A thin ring of frequencies with variance 1 gives ``2 - 2 J0(2 pi f r)``."""
    low, high = 0.0999, 0.1001
    density = 1.0 / (math.pi * (high**2 - low**2))
    rms = structure_function(lambda f: np.full_like(f, density), 1 / high, 1 / low, np.array([5.0]))
    assert rms[0] == pytest.approx(2.0 + 2.0 * 0.30424217764409, rel=1e-4)  # J0(pi) = -0.3042


def test_surface_has_the_variance_of_its_spectrum() -> None:
    """A flat spectrum on an annulus gives the variance that it integrates to, within 5 %."""
    bands = synthesise(lambda f: np.full_like(f, 2.0), 1.0, 8.0, stream(3, "test"))
    xy = stream(4, "test").uniform(-500.0, 500.0, (50_000, 2))
    assert bands.height(xy).var() == pytest.approx(2.0 * math.pi * (1.0 - 1 / 64), rel=0.05)


def test_relief_stays_bounded_at_any_distance() -> None:
    """The outer scale keeps heights 100 km away as large as those at home."""
    terrain = build_terrain(TerrainSpec(far=None), 5)
    xy = stream(6, "test").uniform(-1e5, 1e5, (20_000, 2))
    assert np.abs(terrain.height(xy)).max() < 40.0


def test_leaving_out_detail_leaves_the_coarse_shape() -> None:
    """A patch without detail differs from the full one by the fine roughness alone."""
    terrain = build_terrain(TerrainSpec(far=None), 7)
    full = terrain.patch(0, 0, (100, 100), 8.0)
    coarse = terrain.patch(0, 0, (100, 100), 8.0, detail_m=8.0)
    assert 0.0 < np.std(full - coarse) < 0.2 * np.std(full)
