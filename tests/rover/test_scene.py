"""The scene: loads, suspension, slip, forced slip, and a ground that moves unfelt."""

import math

import numpy as np
import psutil
import pytest

from lpet_sim.errors import PlanningError, UnknownNameError
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.terrain.box import Box
from tests.rover.grounds import Waves, tilted

RATE_RADPS = 0.0278 / 0.1425
BUMPS = Waves(amplitude_m=0.03)


def _rest(scene: Scene, seconds: float = 2.0) -> None:
    for _ in range(round(seconds / scene.spec.physics_dt_s)):
        scene.step()


def _roll(scene: Scene, seconds: float, rate_radps: float = RATE_RADPS) -> np.ndarray:
    """Drive straight ahead; give the body's row at each step."""
    rows = []
    for k in range(round(seconds / scene.spec.physics_dt_s)):
        if k % 20 == 0:
            scene.command(np.zeros(6), np.full(6, rate_radps))
        scene.step()
        rows.append(scene.body_row())
    return np.array(rows)


def test_the_loads_of_the_wheels_sum_to_the_weight() -> None:
    """At rest on the flat each wheel carries a sixth, but for what the joints' friction holds."""
    scene = build_scene(Waves(), RoverSpec())
    _rest(scene)
    load = scene.wheel_state().load_n
    weight = scene.frames.mass_kg * scene.frames.gravity_mps2
    assert load.sum() == pytest.approx(weight, rel=1e-3)
    np.testing.assert_allclose(load, weight / 6, rtol=0.03)


def test_on_a_slope_traction_and_load_carry_the_weight() -> None:
    """``sum T = W sin(slope)`` and ``sum N = W cos(slope)`` for a rover parked uphill."""
    slope = math.radians(12)
    scene = build_scene(Waves(slope_x=math.tan(slope), amplitude_m=0.01), RoverSpec())
    _rest(scene)
    rows = _roll(scene, 4.0)
    state = scene.wheel_state()
    weight = scene.frames.mass_kg * scene.frames.gravity_mps2
    assert np.ptp(rows[-100:, 7]) < 0.01
    assert state.load_n.sum() == pytest.approx(weight * math.cos(slope), rel=0.03)
    assert state.traction_n.sum() == pytest.approx(weight * math.sin(slope), rel=0.1)


@pytest.mark.parametrize(("slope_deg", "slip"), [(0.0, 0.024), (10.0, 0.104), (15.0, 0.340)])
def test_slip_emerges_from_the_slope_as_the_table_says(slope_deg: float, slip: float) -> None:
    """Distance over wheel turn against the table at ``tan(slope)``, within 1 point."""
    slope = math.radians(slope_deg)
    scene = build_scene(tilted(math.tan(slope)), RoverSpec())
    _rest(scene)
    _roll(scene, 3.0)
    before, turned = scene.xy, scene.wheel_row()[:6]
    _roll(scene, 15.0)
    rolled = 0.1425 * (scene.wheel_row()[:6] - turned).mean()
    assert 1 - (scene.xy - before)[0] / math.cos(slope) / rolled == pytest.approx(slip, abs=0.01)


@pytest.mark.parametrize("slope_deg", [0.0, 15.0])
def test_in_a_forced_slip_the_wheels_turn_and_the_rover_stays(slope_deg: float) -> None:
    """Within 4 mm over 5 s, nearly all while the slip builds up, and not back down a slope."""
    scene = build_scene(Waves(slope_x=math.tan(math.radians(slope_deg))), RoverSpec())
    _rest(scene)
    _roll(scene, 2.0)
    before, turned = scene.xy, scene.wheel_row()[:6]
    scene.hold(True)
    _roll(scene, 0.5)
    built_up = scene.xy
    _roll(scene, 4.5)
    assert np.linalg.norm(scene.xy - before) < 0.004
    assert np.linalg.norm(scene.xy - built_up) < 0.0005
    assert 0.1425 * (scene.wheel_row()[:6] - turned).mean() == pytest.approx(5 * 0.0278, rel=0.01)


def test_a_parked_rover_neither_creeps_nor_shakes() -> None:
    """On 10 deg for 10 s: less than 0.1 mm, and below 1e-4 m/s."""
    scene = build_scene(Waves(slope_y=math.tan(math.radians(10)), amplitude_m=0.02), RoverSpec())
    _rest(scene, 4.0)
    rows = _roll(scene, 10.0, rate_radps=0.0)
    assert np.linalg.norm(rows[-1, :3] - rows[0, :3]) < 1e-4
    assert np.abs(rows[:, 7:10]).max() < 1e-4


def test_the_suspension_climbs_a_rock_as_high_as_the_wheels_radius() -> None:
    """One side crosses a rock of 0.15 m: the bogie gives, and the body tilts less than a wheel."""
    ground = Waves(amplitude_m=0.005, boulders=((1.25, 0.6, 0.30),))
    scene = build_scene(ground, RoverSpec())
    _rest(scene)
    joints, tilt, top = [], [], []
    for _ in range(45):
        _roll(scene, 0.6, rate_radps=4 * RATE_RADPS)
        row = scene.wheel_row()
        joints.append(row[78:])
        top.append(row[24:42].reshape(6, 3)[:, 2].max())
        tilt.append(math.degrees(math.acos(scene.up)))
    assert scene.xy[0] > 2.5
    assert max(top) > 0.1425 + 0.10
    assert np.degrees(np.abs(joints).max(axis=0))[0] > 8
    assert max(tilt) < 12


def test_a_patch_change_is_not_felt() -> None:
    """With and without it the motion agrees, and what is felt is far below what driving makes."""
    plain, moved = build_scene(BUMPS, RoverSpec()), build_scene(BUMPS, RoverSpec())
    for scene in (plain, moved):
        _rest(scene)
        _roll(scene, 3.0)
    moved.recentre()
    a, b = _roll(plain, 1.0), _roll(moved, 1.0)
    # MuJoCo finds contacts to 1e-6 m; the quantum of the inertial unit is some 5e-4 m/s.
    np.testing.assert_allclose(b[:5], a[:5], atol=1e-6)
    np.testing.assert_allclose(b[:, :7], a[:, :7], atol=1e-5)
    felt = np.abs(b[:20, 7:] - a[:20, 7:]).max()
    assert felt < 0.01 * np.abs(np.diff(a[:, 7:], axis=0)).max()


def test_two_runs_are_equal_to_the_bit() -> None:
    """Patch changes and rocks included."""
    ground = Waves(amplitude_m=0.05, boulders=((0.9, 0.6, 0.2), (1.1, -0.5, 0.15)))
    runs = []
    for _ in range(2):
        scene = build_scene(ground, RoverSpec())
        first = _roll(scene, 3.0)
        scene.recentre()
        runs.append(np.concatenate([first, _roll(scene, 3.0)]))
    np.testing.assert_array_equal(runs[0], runs[1])


def test_memory_stays_flat_over_many_patches() -> None:
    """Sixty patches with rocks, as many as 150 m of driving need: less than 4 MB more."""
    rng = np.random.default_rng(2)
    rocks = np.column_stack([rng.uniform(-4, 4, (60, 2)), rng.uniform(0.1, 0.3, 60)])
    scene = build_scene(Waves(boulders=tuple(map(tuple, rocks))), RoverSpec(patch_m=4.0))
    used = []
    for _ in range(90):
        scene.recentre()
        used.append(psutil.Process().memory_info().rss / 2**20)
    assert used[-1] - used[29] < 4


def test_an_unknown_rover_and_a_start_off_the_map_are_named() -> None:
    """One sentence each, with what would be valid."""
    with pytest.raises(UnknownNameError, match="choose one of exomars"):
        build_scene(Waves(), RoverSpec(model="sojourner"))
    with pytest.raises(PlanningError, match=r"x from -3\.8 to 3\.8"):
        build_scene(Waves(drivable=Box(-5, -5, 5, 5)), RoverSpec(), (4.5, 0.0))
