"""The ground patch: the same surface wherever it is cut."""

import mujoco
import numpy as np
import pytest

from lpet_sim.errors import PlanningError
from lpet_sim.rover.ground import CELL_M, cut_patch
from lpet_sim.rover.scene import build_scene
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.terrain import build_terrain
from tests.rover.grounds import Waves

WAVES = Waves(slope_x=0.21, slope_y=-0.1, amplitude_m=0.3, level_m=-4512.3)


def test_overlapping_patches_are_equal_to_the_bit() -> None:
    """Also where their floors lie at different metres, and on a synthesised terrain."""
    for ground in (WAVES, build_terrain(load_terrain_spec("exomars"), 3)):
        shift = 60
        a = cut_patch(ground, np.array([812.0, -333.0]), 8.0)
        b = cut_patch(ground, np.array([812.0 + shift * CELL_M, -333.0]), 8.0)
        np.testing.assert_array_equal(a.height_m[:, shift:], b.height_m[:, :-shift])
    assert cut_patch(WAVES, np.zeros(2), 8.0).base_m != cut_patch(WAVES, np.ones(2) * 9, 8.0).base_m


def test_patch_heights_are_the_terrains_to_half_a_micrometre() -> None:
    """Rounding to 2^-20 m is all that lies between the terrain and the patch."""
    patch = cut_patch(WAVES, np.array([100.0, 50.0]), 8.0)
    offset = (np.arange(len(patch.data)) - len(patch.data) // 2) * CELL_M
    x, y = np.meshgrid(patch.centre_xy[0] + offset, patch.centre_xy[1] + offset)
    height = WAVES.height(np.stack([x, y], axis=-1))
    assert np.abs(patch.height_m - height).max() <= 2.0**-21 + 1e-12


def test_a_cliff_is_refused_with_one_sentence() -> None:
    """A rise of more than 16 m within a patch does not fit."""
    with pytest.raises(PlanningError, match=r"rises by .* m within 8 m"):
        cut_patch(Waves(slope_x=3.0), np.zeros(2), 8.0)


def _height_under(scene: object, xy: np.ndarray) -> float:
    """Shoot a ray down onto the ground that MuJoCo collides with."""
    hit = np.zeros(1, dtype=np.int32)
    start = np.array([*xy, 20.0])
    only_ground = np.array([1, 0, 0, 0, 0, 0], dtype=np.uint8)
    model, data = scene.model, scene.data  # type: ignore[attr-defined]
    mujoco.mj_forward(model, data)
    down = np.array([0.0, 0.0, -1.0])
    return 20.0 - float(mujoco.mj_ray(model, data, start, down, only_ground, 1, -1, hit))


def test_the_height_under_the_wheels_is_continuous_when_the_patch_moves() -> None:
    """The surface that MuJoCo sees differs by less than 1e-9 m before and after a change."""
    ground = Waves(slope_x=0.05, amplitude_m=0.2)
    scene = build_scene(ground, RoverSpec(), (40.0, -17.0))
    spots = scene.xy + np.random.default_rng(1).uniform(-1, 1, (40, 2))
    before = [_height_under(scene, spot) for spot in spots]
    centre = scene.model.geom("ground").pos.copy()
    scene._qpos[:2] += [2.0, 1.3]
    scene.recentre()
    assert np.abs(scene.model.geom("ground").pos - centre)[:2].min() > 1.0
    after = [_height_under(scene, spot) for spot in spots]
    np.testing.assert_allclose(after, before, atol=1e-9)
    np.testing.assert_allclose(after, ground.height(spots), atol=2e-3)
