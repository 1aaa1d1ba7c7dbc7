"""Soils cover their shares; albedo loses detail with the texel and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.terrain.spec import SoilClass, TerrainSpec
from lpet_sim.terrain.terrain import Terrain, build_terrain

SOILS = tuple(
    SoilClass(name=name, area_fraction=share, tone=tone)
    for name, share, tone in [("rock", 0.2, 1.1), ("crust", 0.5, 1.0), ("sand", 0.3, 0.9)]
)


@pytest.fixture(scope="module")
def ground() -> Terrain:
    """Give a terrain with three soils."""
    return build_terrain(TerrainSpec(soils=SOILS, far=None), 2)


def texels(n: int, texel_m: float) -> Array:
    """Give the centres of n x n texels, Shape (n * n, 2)."""
    axis = (np.arange(n) + 0.5) * texel_m
    return np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)


def test_soils_cover_the_shares_asked_for(ground: Terrain) -> None:
    """Over 2 x 2 km each soil covers its area fraction within two points."""
    soil = ground.soil(stream(1, "test").uniform(-1000.0, 1000.0, (100_000, 2)))
    shares = np.bincount(soil, minlength=3) / len(soil)
    assert shares == pytest.approx([0.2, 0.5, 0.3], abs=0.02)


def test_soils_lie_in_patches(ground: Terrain) -> None:
    """Two points 0.1 m apart mostly share their soil; two far apart do not."""
    xy = stream(3, "test").uniform(-500.0, 500.0, (20_000, 2))
    here = ground.soil(xy)
    assert np.mean(here == ground.soil(xy + np.array([0.1, 0.0]))) > 0.97
    chance = 0.2**2 + 0.5**2 + 0.3**2
    assert np.mean(here == ground.soil(xy + np.array([300.0, 0.0]))) == pytest.approx(
        chance, abs=0.05
    )


def test_soils_show_in_the_albedo(ground: Terrain) -> None:
    """Mean albedo over each soil goes with its tone."""
    xy = stream(4, "test").uniform(-300.0, 300.0, (100_000, 2))
    soil, albedo = ground.soil(xy), ground.albedo(xy, 0.01)
    means = np.array([albedo[soil == index].mean() for index in range(3)])
    assert means / means[1] == pytest.approx([1.1, 1.0, 0.9], abs=0.04)


def test_coarse_texels_are_the_mean_of_fine_ones(ground: Terrain) -> None:
    """Blocks of 2 mm texels average to what is given at 32 mm: nothing aliases."""
    fine = ground.albedo(texels(1024, 0.002), 0.002).reshape(64, 16, 64, 16).mean(axis=(1, 3))
    coarse = ground.albedo(texels(64, 0.032), 0.032).reshape(64, 64)
    sampled = ground.albedo(texels(64, 0.032), 0.002).reshape(64, 64)
    assert np.mean(coarse - fine) == pytest.approx(0.0, abs=0.004)
    assert np.std(coarse - fine) < 0.5 * np.std(sampled - fine)


@pytest.mark.parametrize("texel_m", [0.004, 0.016, 0.064, 0.256])
def test_neighbouring_texels_are_alike(ground: Terrain, texel_m: float) -> None:
    """At any texel, a shift by half a one changes less than half of what chance would."""
    here = ground.albedo(texels(200, texel_m), texel_m)
    shifted = ground.albedo(texels(200, texel_m) + np.array([0.5 * texel_m, 0.0]), texel_m)
    assert np.std(here - shifted) < 0.5 * np.sqrt(2.0) * np.std(here)


def test_mean_and_range_of_the_albedo(ground: Terrain) -> None:
    """The mean is the spec's at any texel; values are an albedo's."""
    xy = stream(5, "test").uniform(-400.0, 400.0, (200_000, 2))
    for texel_m in (0.002, 0.02, 0.5):
        albedo = ground.albedo(xy, texel_m)
        assert albedo.mean() == pytest.approx(0.25, rel=0.03)
        assert 0.0 < albedo.min() < albedo.max() < 1.0


def test_order_of_questions_does_not_matter() -> None:
    """Texels asked for coarse first or fine first, whole or in parts, are equal to the bit."""
    one, two = build_terrain(TerrainSpec(), 6), build_terrain(TerrainSpec(), 6)
    xy = texels(60, 0.005)
    one.albedo(xy, 0.1)
    first = one.albedo(xy, 0.005)
    parts = np.concatenate([two.albedo(part, 0.005) for part in np.array_split(xy, 7)])
    assert np.array_equal(first, parts)
