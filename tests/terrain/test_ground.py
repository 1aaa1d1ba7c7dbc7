"""The ground answers for any patch at any resolution, the same answer each time."""

from __future__ import annotations

import gc
import weakref

import numpy as np
import pytest

from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.spec import CraterSpec, ReliefSpec, TerrainSpec
from lpet_sim.terrain.terrain import Terrain, build_terrain

STEP = 1e-4


@pytest.fixture(scope="module")
def cratered() -> Terrain:
    """Give a terrain with craters and hills."""
    return build_terrain(load_terrain_spec("mer_spirit"), 3)


def test_overlapping_patches_are_equal_to_the_bit(cratered: Terrain) -> None:
    """Two patches share 50 x 30 nodes and give the same bits there."""
    one = cratered.patch(-20, 1000, (80, 90), 0.03)
    two = cratered.patch(20, 1050, (60, 60), 0.03)
    assert np.array_equal(one[50:80, 40:90], two[:30, :50])


def test_patch_is_the_height_at_its_nodes(cratered: Terrain) -> None:
    """Asked point by point, in another order, the ground gives the patch's bits."""
    patch = cratered.patch(7, -9, (12, 11), 0.05)
    rows, columns = np.indices(patch.shape)
    xy = np.column_stack([((7 + columns) * 0.05).ravel(), ((rows - 9) * 0.05).ravel()])
    order = stream(1, "test").permutation(len(xy))
    assert np.array_equal(cratered.height(xy[order]), patch.ravel()[order])


def test_equal_seeds_give_equal_bits_and_another_seed_does_not(cratered: Terrain) -> None:
    """Height, soil and albedo repeat with the seed and change with it."""
    xy = stream(2, "test").uniform(-50.0, 50.0, (500, 2))
    same = build_terrain(load_terrain_spec("mer_spirit"), 3)
    other = build_terrain(load_terrain_spec("mer_spirit"), 4)
    assert np.array_equal(cratered.height(xy), same.height(xy))
    assert np.array_equal(cratered.soil(xy), same.soil(xy))
    assert np.array_equal(cratered.albedo(xy, 0.004), same.albedo(xy, 0.004))
    assert not np.any(cratered.height(xy) == other.height(xy))
    assert np.any(cratered.soil(xy) != other.soil(xy))
    assert not np.any(cratered.albedo(xy, 0.004) == other.albedo(xy, 0.004))


def slopes_by_differences(terrain: Terrain, xy: Array) -> Array:
    """Give (dz/dx, dz/dy) by central differences, Shape (n, 2)."""
    slopes = [
        (terrain.height(xy + step) - terrain.height(xy - step)) / (2.0 * STEP)
        for step in np.eye(2) * STEP
    ]
    return np.column_stack(slopes)


@pytest.mark.parametrize("reach_m", [50.0, 5000.0])
def test_normals_agree_with_finite_differences(cratered: Terrain, reach_m: float) -> None:
    """Near the origin among craters, and far out among hills; unit length, upwards."""
    xy = stream(5, "test").uniform(-reach_m, reach_m, (4000, 2))
    normal = cratered.normal(xy)
    slopes = -normal[:, :2] / normal[:, 2:]
    assert slopes == pytest.approx(slopes_by_differences(cratered, xy), abs=2e-5)
    assert np.linalg.norm(normal, axis=1) == pytest.approx(1.0)


def test_skyline_is_not_flat_and_the_clear_circle_is(cratered: Terrain) -> None:
    """Hills stand up to 8 deg over the horizon somewhere, and none reaches the clear circle."""
    plain = build_terrain(cratered.spec.model_copy(update={"far": None}), 3)
    bearing = np.linspace(0.0, 2.0 * np.pi, 721)
    distance = np.arange(50.0, 6000.0, 25.0)[:, None]
    xy = np.stack([distance * np.cos(bearing), distance * np.sin(bearing)], axis=-1).reshape(-1, 2)
    hills = (cratered.height(xy) - plain.height(xy)).reshape(len(distance), -1)
    skyline = np.degrees(np.max(np.arctan2(hills, distance), axis=0))
    assert np.all(hills[distance[:, 0] < 400.0] == 0.0)
    assert np.mean(skyline > 0.3) > 0.3
    assert 1.0 < skyline.max() < 15.0


def test_flat_ground_can_be_asked_for() -> None:
    """No slope, no craters, no hills: height 0 and normals up."""
    terrain = build_terrain(TerrainSpec(relief=ReliefSpec(rms_slope_rad=0.0), far=None), 1)
    xy = stream(8, "test").uniform(-9.0, 9.0, (50, 2))
    assert np.all(terrain.height(xy) == 0.0)
    assert np.all(terrain.normal(xy) == [0.0, 0.0, 1.0])


def test_craters_far_away_are_as_at_home() -> None:
    """A point 300 km away answers at once, with craters around it as at home."""
    spec = TerrainSpec(
        relief=ReliefSpec(rms_slope_rad=0.0),
        craters=CraterSpec(density_1m_per_m2=0.05, diameter_max_m=6.0),
        far=None,
    )
    terrain = build_terrain(spec, 9)
    home = terrain.patch(0, 0, (300, 300), 0.5).std()
    away = terrain.patch(600_000, -600_000, (300, 300), 0.5).std()
    assert 0.8 < away / home < 1.25


def test_a_terrain_let_go_leaves_memory_at_once() -> None:
    """Nothing in a terrain holds it in a cycle, so that a sweep over many stays small."""
    terrain = build_terrain(load_terrain_spec("exomars"), 1)
    terrain.rocks(Box.around(0.0, 0.0, 3.0))
    watch = weakref.ref(terrain)
    gc.disable()
    del terrain
    gone = watch() is None
    gc.enable()
    assert gone
