"""Baked light and shadow: closed forms, and tiles that do not depend on who asks."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lpet_sim.sensors.camera_spec import GroundDetailSpec
from lpet_sim.sensors.clipmap import make_levels
from lpet_sim.sensors.ground_texture import GroundTexture, cast_shadows, pyramid
from lpet_sim.sensors.rock_look import dome_places, pack
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks
from lpet_sim.terrain.spec import ReliefSpec, SunSpec, TerrainSpec
from lpet_sim.terrain.terrain import Terrain

LEVEL = make_levels(GroundDetailSpec(texel_m=0.0125, tile_texels=128))[0]


def one_rock() -> Rocks:
    """A rock of 0.4 m in the middle of tile (0, 0), which spans 1.6 m."""
    return Rocks(
        id=np.array([1]),
        p_world_rock=np.array([[0.8, 0.8, 0.0]]),
        diameter_m=np.array([0.4]),
        height_m=np.array([0.25]),
        buried_fraction=np.array([0.5]),
        width_ratio=np.array([1.0]),
        yaw_rad=np.array([0.0]),
        shape=np.array([3]),
        albedo=np.array([0.15]),
    )


class RockyPlain(Terrain):
    """Flat ground with one rock."""

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> Rocks:
        rocks = one_rock()
        inside = box.contains(rocks.p_world_rock[:, :2]) & (rocks.diameter_m >= min_diameter_m)
        return rocks.select(inside)


def plain(azimuth_deg: float = 0.0, rms_slope_rad: float = 0.0) -> RockyPlain:
    """Make the plain under a sun 30 deg high."""
    sun = SunSpec(azimuth_rad=math.radians(azimuth_deg), elevation_rad=math.radians(30.0))
    spec = TerrainSpec(relief=ReliefSpec(rms_slope_rad=rms_slope_rad), sun=sun, far=None)
    return RockyPlain(spec, seed=2)


@pytest.mark.parametrize("azimuth_deg", [0, 37, 90, 135, 200, 270, 301])
def test_a_post_casts_a_shadow_of_its_height_over_the_tangent(azimuth_deg: float) -> None:
    """The shadow on flat ground ends h / tan(e) away from the sun, whatever the azimuth."""
    a, elevation = math.radians(azimuth_deg), math.radians(25.0)
    flat = math.cos(elevation)
    sun = np.array([flat * math.cos(a), flat * math.sin(a), math.sin(elevation)])
    y, x = (np.mgrid[:401, :401] - 200) * 0.01
    height = np.where(np.hypot(x, y) < 0.2, 0.5, 0.0)
    dark = (cast_shadows(height, 0.01, sun) > height) & (height == 0)
    along = -(x * math.cos(a) + y * math.sin(a))[dark]
    across = (-x * math.sin(a) + y * math.cos(a))[dark]
    assert along.min() > -0.1
    assert along.max() == pytest.approx(0.5 / math.tan(elevation) + 0.2, abs=0.06)
    assert np.abs(across).max() < 0.26


@pytest.mark.parametrize("azimuth_deg", [10, 100, 190, 280])
def test_a_rocks_shadow_falls_on_the_side_away_from_the_sun(azimuth_deg: float) -> None:
    """Ground behind the rock is far darker than ground in front of it."""
    radiance = GroundTexture(plain(azimuth_deg)).bake(LEVEL, (0, 0), 0.1)
    y, x = (np.mgrid[:128, :128] + 0.5) * LEVEL.texel_m - 0.8
    toward = x * math.cos(math.radians(azimuth_deg)) + y * math.sin(math.radians(azimuth_deg))
    across = np.abs(
        -x * math.sin(math.radians(azimuth_deg)) + y * math.cos(math.radians(azimuth_deg))
    )
    behind = (across < 0.06) & (toward < -0.26) & (toward > -0.40)
    before = (across < 0.06) & (toward > 0.26) & (toward < 0.40)
    assert radiance[behind].mean() < 0.6 * radiance[before].mean()


def test_flat_ground_reflects_what_lamberts_law_says() -> None:
    """Radiance is albedo times light on a plane, less what grain and pebbles shade: under 20 %."""
    terrain = plain()
    radiance = GroundTexture(terrain).bake(LEVEL, (5, 5), 0.1)
    expected = terrain.spec.albedo.mean * (0.25 + 0.75 * math.sin(math.radians(30.0)))
    assert 0.8 * expected < radiance.mean() < expected


def test_a_tile_is_the_same_to_the_bit_whoever_asks() -> None:
    """Another baker, that has made other tiles before, makes the same tile."""
    first = GroundTexture(plain(rms_slope_rad=0.1)).bake(LEVEL, (-3, 7), 0.1)
    other = GroundTexture(plain(rms_slope_rad=0.1))
    other.bake(LEVEL, (4, 4), 0.1)
    np.testing.assert_array_equal(first, other.bake(LEVEL, (-3, 7), 0.1))


def test_light_runs_on_across_the_border_of_two_tiles() -> None:
    """The step between tiles is no larger than between texels of one tile."""
    texture = GroundTexture(plain(rms_slope_rad=0.1))
    left, right = (texture.bake(LEVEL, (k, 3), 0.1) for k in (3, 4))
    inside = np.abs(np.diff(left, axis=1)).mean()
    assert np.abs(right[:, 0] - left[:, -1]).mean() < 1.3 * inside


def test_a_pyramid_keeps_the_mean_and_leaves_zero_to_the_sky() -> None:
    """Each halving has the mean of the tile; black ground is 1, not 0."""
    tile = np.linspace(0, 0.5, 64 * 64, dtype=np.float32).reshape(64, 64)
    images = pyramid(tile)
    assert [len(image) for image in images] == [64, 32, 16, 8, 4, 2, 1]
    assert images[0].min() == 1
    for image in images:
        assert image.mean() == pytest.approx(0.25 * 65535, rel=1e-3)


def test_rock_images_do_not_overlap_in_the_atlas() -> None:
    """Squares of falling sizes tile the atlas; what does not fit is left out."""
    sizes = [64, 64, 32, 32, 32, 16, 8, 8, 8] + [8] * 200
    taken = np.zeros((128, 128), dtype=int)
    spots = pack(sizes, 128)
    for size, spot in zip(sizes, spots, strict=True):
        if spot is not None:
            taken[spot[1] : spot[1] + size, spot[0] : spot[0] + size] += 1
    assert taken.max() == 1
    assert taken.min() == 1
    assert None in spots


def test_the_dome_keeps_areas_and_puts_the_zenith_in_the_middle() -> None:
    """Half of the solid angle lies within half of the disc's area."""
    directions = np.random.default_rng(0).normal(size=(20_000, 3))
    places = dome_places(directions)
    radius = np.linalg.norm(places - 0.5, axis=1)
    np.testing.assert_allclose(dome_places(np.array([[0.0, 0.0, 2.0]])), [[0.5, 0.5]])
    assert np.mean(radius < 0.49 / math.sqrt(2)) == pytest.approx(0.5, abs=0.01)
