"""Failures, each brought about in the physics: recognised, recorded once, ending or not."""

import logging
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.rng import stream
from lpet_sim.rover.model_spec import wheel_names
from lpet_sim.rover.scene import Scene
from lpet_sim.rover.spec import FailureSpec, ForcedSlip, RoverSpec, StuckWheel
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.spec import TerrainSpec
from tests.rover.episodes_of import Outcome, drive_over
from tests.rover.grounds import Waves

WHEELS = wheel_names("exomars")
RECORD_ONLY = FailureSpec(ends_on=())


def _soil(name: str) -> TerrainSpec:
    return TerrainSpec(soils=({"name": "plain", "area_fraction": 1.0, "soil": name},))


REGOLITH, CRUST = _soil("mars_regolith"), _soil("duricrust")
BOULDER = Waves(boulders=((1.4, 0.0, 0.9),), spec=CRUST)


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL)


@dataclass(frozen=True)
class Ledge(Waves):
    """Flat ground that drops beyond a line along x or along y."""

    edge_x_m: float = -math.inf
    edge_y_m: float = math.inf
    drop_m: float = 1.0

    def height(self, xy: np.ndarray) -> np.ndarray:
        """Give heights [m], Shape (n,)."""
        beyond = (xy[..., 0] > self.edge_x_m) & (xy[..., 1] < self.edge_y_m)
        return np.where(beyond, -self.drop_m, 0.0)


def _tilt_rad(outcome: Outcome) -> np.ndarray:
    R = np.concatenate([chunk.body.T_world_body.rotation for chunk in outcome.chunks])
    return np.arccos(np.clip(R[:, 2, 2], -1.0, 1.0))


def test_a_rover_that_drives_over_a_ledge_with_one_side_tips() -> None:
    """A metre down beside it: it rolls beyond 45 deg, and the drive ends even if not asked to."""
    ground = Ledge(edge_x_m=0.9, edge_y_m=0.1)
    outcome = drive_over(ground, failures=RECORD_ONLY)
    tilt = _tilt_rad(outcome)
    assert outcome.ending.kind == "tipped"
    assert tilt[0] < 0.01
    assert math.radians(45) < tilt[-1] < math.radians(90)
    assert "tipped over, by" in outcome.ending.text


def test_the_angle_of_tipping_is_the_specs() -> None:
    """On a cross slope of 15 deg a limit of 10 deg ends at once, and one of 20 deg does not."""
    ground = Waves(slope_y=math.tan(math.radians(15)))
    for limit_deg, kind in ((10, "tipped"), (20, "time_limit")):
        failures = FailureSpec(tip_angle_rad=math.radians(limit_deg))
        outcome = drive_over(ground, failures=failures, time_limit_s=2.0)
        assert outcome.ending.kind == kind


def test_a_rover_on_a_boulder_under_its_belly_hangs_up() -> None:
    """It stands still with turning wheels, and the event begins where the motion ended."""
    outcome = drive_over(BOULDER)
    hung = outcome.ending
    assert hung.kind == "hung_up"
    assert outcome.scene.belly_load_n > 0.1 * 310 * 3.721
    assert 10.0 <= hung.duration_s < 30.0
    assert outcome.position[-1, 0] < 1.5
    inside = outcome.t_s > hung.t_ns / NS_PER_S
    way = np.linalg.norm(outcome.position[inside][-1] - outcome.position[inside][0])
    turned = np.ptp(outcome.wheels("drive_angle_rad")[inside], axis=0)
    assert way < 0.1
    assert turned.max() * 0.1425 > 0.5


def test_a_boulder_that_passes_below_the_belly_is_no_hang_up() -> None:
    """35 cm high under 38 cm of clearance: to the goal without an event on the way."""
    outcome = drive_over(Waves(boulders=((1.4, 0.0, 0.68),), spec=CRUST))
    assert [event.kind for event in outcome.events] == ["start", "goal"]


def test_a_failure_that_does_not_end_the_drive_is_recorded_once() -> None:
    """Hung up until the time is over: one event with its whole duration, and another that ends."""
    outcome = drive_over(BOULDER, failures=RECORD_ONLY, time_limit_s=33.0)
    (hung,) = outcome.of("hung_up")
    assert not hung.ends
    assert hung.t_ns / NS_PER_S + hung.duration_s == pytest.approx(33.0)
    assert outcome.ending.kind == "time_limit"
    assert outcome.events[-1] is outcome.ending


ALL_STUCK = tuple(StuckWheel(wheel=name, start_s=3.0, duration_s=10.0) for name in WHEELS)


def test_a_rover_that_hardly_moves_is_stuck_and_may_come_free() -> None:
    """All wheels locked for 10 s: stuck from then until it drives on, and then the goal."""
    failures = FailureSpec(ends_on=(), stuck_window_s=4.0)
    ahead = {"waypoints_m": ((0.0, 0.0), (0.8, 0.0))}
    outcome = drive_over(Waves(), stuck_wheels=ALL_STUCK, failures=failures, **ahead)
    (stuck,) = outcome.of("stuck")
    end_s = stuck.t_ns / NS_PER_S + stuck.duration_s
    assert stuck.t_ns / NS_PER_S == pytest.approx(3.0, abs=0.6)
    assert 13.0 <= end_s <= 14.0
    assert outcome.ending.kind == "goal"
    ended = drive_over(Waves(), stuck_wheels=ALL_STUCK, failures=FailureSpec(stuck_window_s=4.0))
    assert ended.ending.kind == "stuck"
    assert ended.t_s[-1] == pytest.approx(7.0, abs=0.6)


def test_forced_slip_is_neither_stuck_nor_hung_up() -> None:
    """Ten times the window of it, and the drive goes on to its goal without a failure."""
    failures = FailureSpec(stuck_window_s=2.0)
    slip = ForcedSlip(start_s=5.0, duration_s=20.0)
    outcome = drive_over(Waves(amplitude_m=0.01), forced_slips=(slip,), failures=failures)
    assert [event.kind for event in outcome.events] == ["start", "forced_slip", "goal"]


STEEP = Waves(slope_x=0.6)


@pytest.mark.parametrize("ends_on", [(), ("sliding",)])
def test_on_a_slope_beyond_the_soil_the_rover_slides_back(ends_on: tuple[str, ...]) -> None:
    """31 deg: backwards with forward command; on the timeline, and the end where asked for."""
    failures = FailureSpec(ends_on=ends_on, sliding_window_s=2.0)
    outcome = drive_over(STEEP, failures=failures, time_limit_s=5.0)
    assert outcome.of("sliding")
    assert outcome.position[-1, 0] < outcome.position[0, 0] - 0.02
    assert outcome.ending.kind == ("sliding" if ends_on else "time_limit")


def test_a_rover_that_leaves_the_drivable_ground_ends_its_drive() -> None:
    """It slides off a map that ends 1.3 m below; no error."""
    ground = Waves(slope_x=0.7, drivable=Box(-1.3, -5.0, 6.0, 5.0))
    outcome = drive_over(ground, failures=RECORD_ONLY, time_limit_s=30.0)
    assert outcome.ending.kind == "off_ground"
    assert outcome.position[-1, 0] == pytest.approx(-1.3, abs=0.1)


def test_ground_that_cannot_be_laid_ends_the_drive_too() -> None:
    """A cliff of 20 m comes into the patch on the way."""
    ground = Ledge(edge_x_m=3.6, drop_m=20.0)
    outcome = drive_over(ground, rover=RoverSpec(patch_m=4.0))
    assert outcome.ending.kind == "off_ground"
    assert "a rover's patch may rise by less than 16 m" in outcome.ending.text


def test_physics_that_breaks_down_ends_the_drive(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """MuJoCo then resets its state without a word to the caller: no such row is in the truth."""
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it runs
    refresh = Scene.refresh_soil

    def refresh_and_break(scene: Scene) -> None:
        refresh(scene)
        if scene.xy[0] > 0.5:
            scene.data.qvel[3] = 1e12

    monkeypatch.setattr(Scene, "refresh_soil", refresh_and_break)
    outcome = drive_over(Waves(amplitude_m=0.01))
    assert outcome.ending.kind == "unstable"
    assert outcome.position[-1, 0] == pytest.approx(0.5, abs=0.02)
    assert outcome.ending.t_ns / NS_PER_S == pytest.approx(outcome.t_s[-1], abs=0.1)


def test_physics_that_breaks_down_while_it_settles_ends_the_drive_at_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Nothing is driven from where MuJoCo put the rover back to."""
    monkeypatch.chdir(tmp_path)
    step = Scene.step

    def step_and_break(scene: Scene) -> None:
        if scene.step_count == 50:
            scene.data.qvel[3] = 1e12
        step(scene)

    monkeypatch.setattr(Scene, "step", step_and_break)
    outcome = drive_over(Waves(amplitude_m=0.01))
    assert [event.kind for event in outcome.events] == ["start", "unstable"]
    assert "before the drive" in outcome.ending.text


def _sinking(monkeypatch: pytest.MonkeyPatch, begin_m: float, length_m: float) -> None:
    """Let the middle left wheel stand 9 cm deep along a piece of the way."""

    def sinkage_m(scene: Scene) -> np.ndarray:
        inside = begin_m <= scene.xy[0] < begin_m + length_m
        return np.array([0.01, 0.01, 0.09 if inside else 0.01, 0.01, 0.01, 0.01])

    monkeypatch.setattr(Scene, "sinkage_m", property(sinkage_m))


def test_a_wheel_deeper_than_half_its_radius_is_entrapped(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends the drive after 2 s of it; the event begins with it and names wheel and depth."""
    _sinking(monkeypatch, 1.0, 9.0)
    outcome = drive_over(Waves())
    trapped = outcome.ending
    assert trapped.kind == "entrapped"
    assert trapped.duration_s == pytest.approx(2.0)
    assert trapped.text.startswith("the middle left wheel stands 9.0 cm deep in the soil, over ")
    assert "the limit of 7.1 cm" in trapped.text


def test_entrapment_holds_its_limit_and_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bump of 1 s does not count; 4 s do, once, where the drive goes on; a deeper limit not."""
    ahead = {"waypoints_m": ((0.0, 0.0), (1.2, 0.0))}
    _sinking(monkeypatch, 0.5, 0.1)
    assert not drive_over(Waves(), **ahead).of("entrapped")
    _sinking(monkeypatch, 0.5, 0.4)
    outcome = drive_over(Waves(), failures=RECORD_ONLY, **ahead)
    (trapped,) = outcome.of("entrapped")
    assert trapped.duration_s == pytest.approx(4.0, abs=0.5)
    assert outcome.ending.kind == "goal"
    deeper = FailureSpec(sinkage_limit_m=0.1)
    assert not drive_over(Waves(), failures=deeper, **ahead).of("entrapped")


def test_a_rover_digs_itself_in_on_a_slope_of_loose_soil_and_not_on_the_flat() -> None:
    """On 19 deg of Mars regolith slip digs the wheels in beyond half their radius."""
    slope = drive_over(Waves(slope_x=0.35, spec=REGOLITH), time_limit_s=120.0)
    assert slope.ending.kind == "entrapped"
    assert slope.wheels("sinkage_m").max() > 0.1425 / 2
    assert slope.wheels("sinkage_m")[0].max() < 0.03
    flat = drive_over(Waves(spec=REGOLITH))
    assert [event.kind for event in flat.events] == ["start", "goal"]


@pytest.mark.parametrize("run", range(4))
def test_whatever_happens_a_drive_ends_with_one_event_and_no_exception(run: int) -> None:
    """Slopes to 40 deg, boulders, locked wheels, forced slip, on a small map; truth is finite."""
    rng = stream(3, "hazards", str(run))
    slope = rng.uniform(-0.85, 0.85, 2)
    boulders = tuple((rng.uniform(1, 4), rng.uniform(-1, 1), rng.uniform(0.3, 1.2)) for _ in "xyz")
    names = rng.choice(WHEELS, 2, replace=False)
    stuck = tuple(StuckWheel(wheel=str(n), start_s=float(rng.uniform(0, 9))) for n in names)
    outcome = drive_over(
        Waves(*slope, boulders=boulders, drivable=Box(-3, -3, 6, 6)),
        waypoints_m=((0.0, 0.0), (2.5, 0.0), (3.5, 2.0)),
        stuck_wheels=stuck,
        forced_slips=(ForcedSlip(start_s=3.0, duration_s=2.0),),
        failures=FailureSpec(ends_on=("entrapped",), stuck_window_s=5.0),
        time_limit_s=12.0,
    )
    end_s = outcome.t_s[-1]
    assert outcome.ending.kind in ("goal", "time_limit", "tipped", "off_ground")
    assert np.isfinite(outcome.position).all()
    assert all(np.isfinite(outcome.wheels(name)).all() for name in ("slip", "load_n"))
    for event in outcome.events:
        assert 0 <= event.t_ns / NS_PER_S <= end_s
        if event.kind not in ("point_turn", "stop"):
            assert event.t_ns / NS_PER_S + event.duration_s <= end_s + 1e-9
