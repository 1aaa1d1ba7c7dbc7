"""Rovers of one's own in the physics: slip by the law, parking, steering of every kind."""

import logging
import math
from pathlib import Path

import numpy as np
import pytest

from estimators.motion import rolling_matrix
from lpet_sim.errors import PlanningError, SpecError
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.truth import Truth
from lpet_sim.rig.files import write_slope_csv
from lpet_sim.rig.slope import SlopeReport, drive_point, slope_spec
from lpet_sim.rover.drive import drive, start_of
from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.path import plan_legs
from lpet_sim.rover.scene import build_scene
from lpet_sim.rover.spec import DriveSpec, RoverSpec, StuckWheel
from lpet_sim.rover.steering import Steering
from lpet_sim.soil.load import load_soil
from tests.rover.grounds import Waves, tilted
from tests.rover.own_models import changed, description, foreign_exomars

WAVY = Waves(amplitude_m=0.02)
TABLE_SLIP_AT_026715_RAD = 0.3551


class Driven:
    """A drive that is over."""

    def __init__(self, ground: Waves, model: str, spec: DriveSpec) -> None:
        """Drive."""
        self.frames = rover_frames(RoverSpec(model=model))
        scene = build_scene(ground, RoverSpec(model=model), *start_of(spec))
        self.chunks: list[Truth] = list(drive(scene, spec))

    def wheels(self, name: str) -> Array:
        """Join an array of the wheels' truth."""
        found = [getattr(c.wheels, name) for c in self.chunks if c.wheels is not None]
        return np.concatenate(found)

    @property
    def position(self) -> Array:
        """Positions of the body [m]."""
        return np.concatenate([c.body.T_world_body.translation for c in self.chunks])

    @property
    def velocity(self) -> Array:
        """Velocities of the body [m/s]."""
        return np.concatenate([c.body.v_world_body_mps for c in self.chunks])

    @property
    def ending(self) -> str:
        """How it ended."""
        return next(event.kind for c in self.chunks for event in c.events if event.ends)


def _path(*waypoints: tuple[float, float], speed_mps: float = 0.05, **more: float) -> DriveSpec:
    return DriveSpec(waypoints_m=waypoints, speed_mps=speed_mps, **more)


@pytest.mark.parametrize("model", ["prospector", "scout"])
def test_slip_on_a_slope_is_that_of_the_soils_table(model: str) -> None:
    """Up 15.3 deg of the measured soil: within a point, whatever the rover's size and gravity."""
    slope = 0.26715
    driven = Driven(tilted(math.tan(slope)), model, _path((0.0, 0.0), (1.2, 0.0), speed_mps=0.1))
    angle, p = driven.wheels("drive_angle_rad"), driven.position
    half = len(angle) // 2
    rim = driven.frames.wheel_radius_m * (angle[-40] - angle[half]).mean()
    way = float(np.linalg.norm(p[5 * (len(angle) - 40)] - p[5 * half]))
    assert 1 - way / rim == pytest.approx(TABLE_SLIP_AT_026715_RAD, abs=0.01)
    slip = driven.wheels("slip")[half:-40]
    assert np.median(slip) == pytest.approx(TABLE_SLIP_AT_026715_RAD, abs=0.01)


@pytest.mark.parametrize("model", ["prospector", "scout"])
def test_a_parked_rover_stays_and_its_wheels_carry_its_weight(model: str) -> None:
    """Half a minute on 10 deg: less than 0.2 mm; loads add up to m g cos in 2 %, unflickering."""
    slope = math.radians(10.0)
    scene = build_scene(tilted(math.tan(slope)), RoverSpec(model=model))
    for _ in range(1000):
        scene.step()
    before, loads = scene.body_row()[:3], []
    for step in range(6_000):
        scene.step()
        if step % 100 == 0:
            loads.append(scene.wheel_state().load_n)
    assert np.linalg.norm(scene.body_row()[:3] - before) < 2e-4
    weight = scene.frames.mass_kg * scene.frames.gravity_mps2 * math.cos(slope)
    sums = np.sum(loads, axis=1)
    np.testing.assert_allclose(sums, weight, rtol=0.02)
    assert np.std(loads, axis=0).max() < 0.05 * scene.frames.wheel_share_n
    assert np.abs(scene.body_row()[7:13]).max() < 1e-3


def test_a_smooth_drive_shows_no_jitter() -> None:
    """Over waves at 5 cm/s the body's acceleration stays below 2 cm/s2 RMS in each axis."""
    driven = Driven(WAVY, "prospector", _path((0.0, 0.0), (1.5, 0.0)))
    step = 100.0 * np.diff(driven.velocity, axis=0)
    rolling = step[len(step) // 4 : -len(step) // 4]
    assert np.sqrt(np.mean(rolling**2, axis=0)).max() < 0.02
    load = driven.wheels("load_n")[200:-100]
    assert (load.std(axis=0) / load.mean(axis=0)).max() < 0.1


def test_a_foreign_model_of_our_rover_drives_as_ours_does(tmp_path: Path) -> None:
    """The same two metres over waves and a rock: the body within 1 mm, the loads' means in 1 %."""
    ground = Waves(amplitude_m=0.02, boulders=((1.4, 0.55, 0.14),))
    spec = _path((0.0, 0.0), (2.0, 0.2), speed_mps=0.1)
    ours, theirs = (Driven(ground, name, spec) for name in ("exomars", foreign_exomars(tmp_path)))
    n = min(len(ours.position), len(theirs.position))
    np.testing.assert_allclose(theirs.position[:n], ours.position[:n], atol=1e-3)
    loads = [each.wheels("load_n").mean(axis=0) for each in (ours, theirs)]
    np.testing.assert_allclose(loads[1], loads[0], rtol=0.01)
    assert theirs.wheels("joint_angle_rad").shape[1] == 3


def test_four_steered_wheels_follow_an_arc_and_turn_on_the_spot() -> None:
    """The wheels point along their circles, the rockers tilt as one, and the goal is met."""
    driven = Driven(WAVY, "prospector", _path((0.0, 0.0), (1.0, 0.0), (0.2, 1.5)))
    steer = driven.wheels("steer_angle_rad")
    assert driven.ending == "goal"
    assert math.dist(driven.position[-1, :2], (0.2, 1.5)) < 0.05
    assert "point_turn" in [event.kind for c in driven.chunks for event in c.events]
    turning = steer[np.abs(steer[:, 0]).argmax()]
    lean = math.atan2(0.6, 0.65)
    np.testing.assert_allclose(turning, [-lean, lean, lean, -lean], atol=0.02)
    tilt = driven.wheels("joint_angle_rad")
    np.testing.assert_allclose(tilt[:, 0], tilt[:, 1], atol=2e-3)  # their axes are opposite


def test_a_rover_that_cannot_steer_turns_by_skidding() -> None:
    """On the spot its sides roll against each other, and it faces the goal at the end."""
    driven = Driven(WAVY, "scout", _path((0.0, 0.0), (0.5, 0.0), (0.5, 2.5), speed_mps=0.1))
    assert driven.ending == "goal"
    assert math.dist(driven.position[-1, :2], (0.5, 2.5)) < 0.1
    np.testing.assert_array_equal(driven.wheels("steer_angle_rad"), 0.0)
    rate = np.diff(driven.wheels("drive_angle_rad"), axis=0)
    against = (rate[:, 0] < -1e-3) & (rate[:, 1] > 1e-3)
    assert against.sum() > 50
    np.testing.assert_allclose(rate[against][:, 0], rate[against][:, 2], atol=0.02)


def _front_steered(folder: Path, x_m: float) -> str:
    """Describe the prospector with rear wheels that do not steer, and its origin at x."""
    wheels = description("prospector")["wheels"]
    fixed = [{k: v for k, v in wheel.items() if k != "steer"} for wheel in wheels[2:]]
    body = {"translation_m": [x_m, 0.0, 0.0]}
    return changed(folder, "prospector", wheels=[*wheels[:2], *fixed], body=body)


def test_the_axle_that_does_not_steer_must_pass_under_the_origin(tmp_path: Path) -> None:
    """The sentence says by how much to move it."""
    with pytest.raises(SpecError, match=r"-0.60 m ahead .* by -0.600 m more in x of body"):
        rover_frames(RoverSpec(model=_front_steered(tmp_path, 0.0)))


def test_fixed_wheels_on_several_axles_beside_steered_ones_are_refused(tmp_path: Path) -> None:
    """A rover with one steered wheel of four would skid; it has to say that none steers."""
    wheels = description("prospector")["wheels"]
    fixed = [{k: v for k, v in wheel.items() if k != "steer"} for wheel in wheels[1:]]
    path = changed(tmp_path, "prospector", wheels=[wheels[0], *fixed])
    with pytest.raises(SpecError, match=r"stand on several axles .*: steer all but one axle"):
        rover_frames(RoverSpec(model=path))


def test_a_rover_steered_in_front_follows_arcs_and_refuses_what_it_cannot(tmp_path: Path) -> None:
    """Its fixed wheels roll; a turn on the spot and too tight an arc are refused in a sentence."""
    model = _front_steered(tmp_path, -0.6)
    around = ((0.0, 0.0), (2.5, 0.0), (4.0, 1.5))
    driven = Driven(Waves(), model, _path(*around, speed_mps=0.1, corner_cut_m=0.6))
    assert driven.ending == "goal"
    assert math.dist(driven.position[-1, :2], (4.0, 1.5)) < 0.05
    steer = driven.wheels("steer_angle_rad")
    assert steer[:, 0].max() > 0.2
    np.testing.assert_array_equal(steer[:, 2:], 0.0)
    (leg,) = plan_legs(around, 1.5, 0.6)
    away = [np.linalg.norm(leg.xy - p, axis=1).min() for p in driven.position[::50, :2]]
    assert max(away) < 0.05
    rover = RoverSpec(model=model)
    scene = build_scene(Waves(), rover)
    with pytest.raises(
        PlanningError, match=r"cannot turn on the spot, .*\(1.0, 0.0\) m: wheel front"
    ):
        drive(scene, _path((0.0, 0.0), (1.0, 0.0), (1.0, 1.0)))
    tight = _path((0.0, 0.0), (3.0, 0.0), (3.0, 3.0), min_turn_radius_m=1.0, corner_cut_m=0.42)
    with pytest.raises(PlanningError, match=r"arc of 1\.01 m .* tightest is 1\.3\d m: give min"):
        drive(scene, tight)


def test_the_tightest_arc_is_where_the_inner_front_wheel_meets_its_limit(tmp_path: Path) -> None:
    """Of the front-steered rover: ``tan(limit) = k x / (1 - k y)``."""
    steering = Steering(rover_frames(RoverSpec(model=_front_steered(tmp_path, -0.6))))
    k = steering.max_curvature
    assert math.atan2(k * 1.2, 1 - k * 0.65) == pytest.approx(math.radians(60.0))
    assert steering.arc(k).max() == pytest.approx(math.radians(60.0))
    np.testing.assert_allclose(steering.speeds(0.1, 0.0), 0.1)


def test_odometry_reads_the_arc_that_a_skidding_rover_is_asked_for() -> None:
    """The least squares of the wheels' speeds is the motion that was asked."""
    frames = rover_frames(RoverSpec(model="scout"))
    speeds = Steering(frames).speeds(0.05, 0.02)
    rows = np.stack([speeds, np.zeros(4)], axis=1).ravel()
    A = rolling_matrix(frames.contact_body_m)
    motion = np.linalg.lstsq(A, rows, rcond=None)[0]
    np.testing.assert_allclose(motion, [0.05, 0.0, 0.02], atol=1e-12)


def test_a_wheel_of_another_rover_can_be_stuck(caplog: pytest.LogCaptureFixture) -> None:
    """By its name in the description; it stands while the others roll."""
    stuck = (StuckWheel(wheel="rear_right", start_s=4.0),)
    spec = DriveSpec(waypoints_m=((0.0, 0.0), (1.0, 0.0)), speed_mps=0.1, stuck_wheels=stuck)
    with caplog.at_level(logging.CRITICAL):
        driven = Driven(Waves(), "prospector", spec)
    angle = driven.wheels("drive_angle_rad")
    assert np.ptp(angle[100:, 3]) < 0.03
    assert np.ptp(angle[100:, 0]) > 1.0


def test_the_slope_rig_takes_any_rover(tmp_path: Path) -> None:
    """A point of a four-wheel rover, with columns of its own wheels."""
    spec = slope_spec(load_soil("grc1_loose"), rover="scout", slopes_rad=(0.1,))
    point = drive_point(spec, 0.1, "up")
    assert point.ended == "steady"
    assert len(point.wheel_slip) == 4
    write_slope_csv(SlopeReport(spec, (point,)), tmp_path / "slope.csv")
    header = (tmp_path / "slope.csv").read_text().splitlines()[0]
    assert header.count("front_left_") == 4
    assert "middle_left" not in header
