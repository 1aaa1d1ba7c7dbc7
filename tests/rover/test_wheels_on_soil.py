"""Wheels on soil in the physics: slip on slopes, drift, parking, energy, loads, sinkage, steps."""

import math

import numpy as np
import pytest

from lpet_sim.recording.arrays import Array
from lpet_sim.rover.model_spec import wheel_names
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.wheel_soil import (
    DEEPEST,
    WheelResponse,
    WheelSoilSpec,
    WheelState,
    tabulated_law,
)
from lpet_sim.soil.load import load_soil
from lpet_sim.soil.spec import ModulusSpec, WheelSpec
from lpet_sim.terrain.spec import SoilClass, TerrainSpec
from tests.rover.drives import (
    RADIUS_M,
    Way,
    measure,
    mechanical_energy_j,
    motor_work_j,
    roll,
    start,
    steps,
)
from tests.rover.grounds import Waves, of_soil, tilted

SPEED_MPS = 0.05
WEIGHT_N = 310 * 3.721
BOULDERS = ((1.0, 0.6, 0.16), (1.3, -0.55, 0.2), (1.9, 0.5, 0.12), (2.1, -0.6, 0.1))

WHEELS = wheel_names("exomars")


def _tan(degrees: float) -> float:
    return math.tan(math.radians(degrees))


def _climb(slope_deg: float, speed_mps: float = SPEED_MPS, dt_s: float = 0.005) -> float:
    """Give the slip of a rover up a slope of the soil that is a measured table."""
    scene = start(tilted(_tan(slope_deg)), RoverSpec(physics_dt_s=dt_s))
    roll(scene, max(2.0, 0.2 / speed_mps), speed_mps)
    return 1 - measure(scene, max(3.0, 0.2 / speed_mps), speed_mps).ahead


@pytest.mark.parametrize(
    ("slope_rad", "slip"), [(0.00478, 0.0251), (0.26715, 0.3551), (0.34872, 0.7384)]
)
@pytest.mark.parametrize(("speed_mps", "dt_s"), [(0.05, 0.005), (0.05, 0.002), (0.2, 0.005)])
def test_slip_is_that_of_the_table(
    slope_rad: float, slip: float, speed_mps: float, dt_s: float
) -> None:
    """Within a point at its own slopes, whatever the speed and the step."""
    assert _climb(math.degrees(slope_rad), speed_mps, dt_s) == pytest.approx(slip, abs=0.01)


def test_on_the_steepest_slope_of_the_table_spinning_wheels_do_not_hop() -> None:
    """30 deg at 90 % slip, where friction is almost used up: slip and loads stay."""
    scene = start(tilted(math.tan(0.52619)))
    roll(scene, 3.0, SPEED_MPS)
    way = measure(scene, 3.0, SPEED_MPS)
    assert 1 - way.ahead == pytest.approx(0.8967, abs=0.01)
    assert way.forces[:, 2].std(axis=0).max() < 20


def test_a_slope_beyond_the_soil_lets_spinning_wheels_slide_back() -> None:
    """Mars regolith does not carry a rover up 25 deg: it goes back while its wheels turn ahead."""
    scene = start(tilted(_tan(25.0), soil="mars_regolith"))
    roll(scene, 4.0, SPEED_MPS)
    assert measure(scene, 4.0, SPEED_MPS).ahead < 0


def test_a_slope_beyond_the_friction_lets_braked_wheels_slide() -> None:
    """40 deg of loose GRC-1, whose holding friction is 35 deg: half a metre in 3 s."""
    scene = start(tilted(_tan(40.0)), rest_s=0.0)
    before = scene.xy
    roll(scene, 3.0, 0.0)
    assert (scene.xy - before)[0] < -0.5


def test_downhill_wheels_skid() -> None:
    """The rover goes farther than its wheels turn: slip below 0."""
    assert _climb(-15.0) < -0.01


def _steady(ground: Waves) -> Way:
    scene = start(ground)
    roll(scene, 4.0, SPEED_MPS)
    return measure(scene, 5.0, SPEED_MPS)


def _across(slope_deg: float, soil: str = "grc1_loose") -> Way:
    scene = start(tilted(0.0, _tan(slope_deg), soil))
    roll(scene, 4.0, SPEED_MPS)
    return measure(scene, 5.0, SPEED_MPS)


@pytest.mark.parametrize("soil", ["grc1_loose", "mars_regolith"])
def test_across_a_slope_the_rover_drifts_down_the_more_the_steeper(soil: str) -> None:
    """None on the flat, and on grc1_loose about 15 % of the way at 15 deg."""
    drift = [-_across(slope, soil).left for slope in (0.0, 8.0, 15.0, 20.0)]
    assert abs(drift[0]) < 1e-3
    assert np.all(np.diff(drift) > 0.02)


def _fast(values: Array) -> float:
    """Give the RMS of what is faster than 10 Hz, over the wheels."""
    spectrum = 2 * np.abs(np.fft.rfft(values - values.mean(axis=0), axis=0)) / len(values)
    fast = np.fft.rfftfreq(len(values), 0.005) > 10.0
    return float(np.sqrt((spectrum[fast] ** 2 / 2).sum(axis=0).mean()))


def test_slipping_along_and_across_at_once_does_not_chatter() -> None:
    """Across 15 deg load and wheel rate scatter no more above 10 Hz than on the flat."""
    flat, sloped = _across(0.0), _across(15.0)
    assert _fast(sloped.forces[:, 2]) < 1.5 * _fast(flat.forces[:, 2])
    assert _fast(sloped.forces[:, 3]) < 1.5 * _fast(flat.forces[:, 3])
    assert _fast(sloped.forces[:, 1]) < 10.0


@pytest.mark.parametrize(("slope_x", "slope_y"), [(15.0, 0.0), (-15.0, 0.0), (0.0, 15.0)])
def test_a_rover_parked_on_a_slope_stays(slope_x: float, slope_y: float) -> None:
    """After a drive: 15 s on 15 deg move it by less than 1 mm a quarter of an hour."""
    scene = start(tilted(_tan(slope_x), _tan(slope_y)))
    roll(scene, 2.0, SPEED_MPS)
    roll(scene, 3.0, 0.0)
    before = scene.body_row()[:3]
    roll(scene, 15.0, 0.0)
    assert np.linalg.norm(scene.body_row()[:3] - before) < 2.5e-5


@pytest.mark.parametrize(
    "ground",
    [
        tilted(_tan(12.0), soil="mars_sand"),
        tilted(_tan(-12.0), soil="mars_sand"),
        tilted(0.0, _tan(12.0), soil="mars_sand"),
        Waves(amplitude_m=0.08, spec=of_soil("mars_regolith")),
        Waves(amplitude_m=0.03, boulders=BOULDERS, spec=of_soil("mars_regolith")),
    ],
    ids=["up", "down", "across", "wavy", "rocky"],
)
def test_no_energy_is_gained(ground: Waves) -> None:
    """In every second the motors put in more than the rover's energy grows by."""
    scene = start(ground)
    roll(scene, 2.0, SPEED_MPS)
    lost = []
    for _ in range(10):
        before = mechanical_energy_j(scene)
        work = motor_work_j(scene, 1.0, SPEED_MPS)
        lost.append(work - (mechanical_energy_j(scene) - before))
    assert min(lost) > 0
    assert np.mean(lost) > 0.02 * WEIGHT_N * SPEED_MPS  # no rolling is for free


def test_on_a_plane_traction_follows_load() -> None:
    """Wheels that move together slip alike, and so bear alike for their load, which differs."""
    way = _steady(tilted(_tan(15.0)))
    traction, _, load, _ = way.forces.mean(axis=0)
    assert load.max() > 1.8 * load.min()
    np.testing.assert_allclose(traction / load, _tan(15.0), rtol=0.05)


def test_on_rough_ground_each_wheel_slips_for_its_own_forces() -> None:
    """Its slip goes up and down with its traction over load; those of the others explain less."""
    scene = start(Waves(slope_x=_tan(8.0), amplitude_m=0.12, spec=of_soil("grc1_loose")))
    roll(scene, 4.0, SPEED_MPS)
    slip, ratio = [], []
    for _ in steps(scene, 30.0, SPEED_MPS):
        slip.append(scene.contact.motion[0].copy())
        told = scene.contact.wheels
        ratio.append(told.traction_n / told.load_n)
    own = np.corrcoef(np.array(slip).T, np.array(ratio).T)[:6, 6:]
    assert np.diag(own).min() > 0.9
    assert np.ptp(slip, axis=0).min() > 0.05


def test_wheels_stand_as_deep_as_they_sink_and_the_rover_with_them() -> None:
    """Mean depth is what the body stands lower by; without `sinks` it is recorded only."""
    soft = Waves(spec=of_soil("mars_sand"))
    deep = start(soft)
    shown = start(soft, RoverSpec(wheel_soil=WheelSoilSpec(sinks=False)))
    depth = deep.sinkage_m
    lower = shown.body_row()[2] - deep.body_row()[2]
    assert lower == pytest.approx(depth.mean(), abs=5e-4)
    np.testing.assert_allclose(shown.sinkage_m, depth, rtol=0.05)
    assert depth.min() > 0.005


def test_a_change_of_patch_carries_the_wheels_over() -> None:
    """Depth, slip, creep, radius, friction and surface velocity are equal to the bit."""
    scene = start(Waves(slope_y=_tan(10.0), amplitude_m=0.05))
    roll(scene, 5.0, SPEED_MPS)
    names = ("geom_size", "geom_friction", "geom_surfacevel")
    geoms = [scene.model.geom(f"wheel_{name}").id for name in WHEELS]
    before = [getattr(scene.model, name)[geoms].copy() for name in names]
    motion, row = scene.contact.motion.copy(), scene.wheel_row()
    scene.recentre()
    geoms = [scene.model.geom(f"wheel_{name}").id for name in WHEELS]
    for name, values in zip(names, before, strict=True):
        np.testing.assert_array_equal(getattr(scene.model, name)[geoms], values)
    np.testing.assert_array_equal(scene.contact.motion, motion)
    np.testing.assert_array_equal(scene.wheel_row(), row)


def test_halving_the_step_does_not_change_the_slip() -> None:
    """3 m over waves uphill at 5 and at 2.5 ms: within 0.2 points."""
    ground = Waves(slope_x=_tan(6.0), amplitude_m=0.08, spec=of_soil("mars_regolith"))
    slip = []
    for dt_s in (0.005, 0.0025):
        scene = start(ground, RoverSpec(physics_dt_s=dt_s))
        roll(scene, 2.0, 0.1)
        slip.append(1 - measure(scene, 30.0, 0.1).ahead)
    assert slip[1] == pytest.approx(slip[0], abs=0.002)


def test_on_soil_that_bears_nothing_wheels_sink_no_deeper_than_near_their_axles() -> None:
    """The rover comes to rest on it: no wheel's radius runs out, and no load is thrown about."""
    soft = load_soil("mars_sand").model_copy(update={"pressure": ModulusSpec(k=1e3)})
    spec = TerrainSpec(soils=(SoilClass(name="mush", soil=soft),))
    scene = start(Waves(spec=spec))
    assert scene.sinkage_m == pytest.approx(DEEPEST * RADIUS_M)
    roll(scene, 2.0, SPEED_MPS)
    assert scene.sinkage_m.max() <= DEEPEST * RADIUS_M + 1e-12
    assert scene.contact.read()[2].sum() == pytest.approx(WEIGHT_N, rel=0.05)


def test_a_grousered_wheels_law_sinks_in_proportion_to_its_tips() -> None:
    """Slip and sinkage of a law are those of the tips' circle, not of the rim's."""
    soil, share_n = load_soil("cmu_sand"), WEIGHT_N / 6
    rover = WheelSpec(radius_m=0.1425, width_m=0.12)
    tall = WheelSpec(radius_m=0.1, width_m=0.12, grouser_height_m=0.0425, grouser_count=16)
    depths = []
    for wheel in (rover, tall):
        law = tabulated_law(WheelSoilSpec(wheel=wheel), [soil], rover, share_n, 3.721)
        told, answer = WheelState.of(6), WheelResponse.of(6)
        told.load_n[:] = share_n
        law.respond(told, answer)
        depths.append(answer.sinkage_m[0])
    assert depths[1] == pytest.approx(depths[0], rel=1e-6)
