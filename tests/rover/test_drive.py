"""A whole drive: its path, its events, its clock, and the truth it gives out."""

import logging
import math
from dataclasses import dataclass

import numpy as np
import pytest

from lpet_sim.errors import PlanningError, SpecError
from lpet_sim.geometry import so3
from lpet_sim.recording.truth import CONTACT_SOIL, Truth
from lpet_sim.rover.drive import drive, start_of
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import DriveSpec, ForcedSlip, RoverSpec, Stop
from lpet_sim.terrain.box import Box
from tests.rover.grounds import Waves

GROUND = Waves(amplitude_m=0.03, boulders=((2.2, 0.55, 0.16), (3.4, -0.6, 0.2)))
SPEC = DriveSpec(
    waypoints_m=((0.0, 0.0), (3.5, 0.0), (6.0, 2.0)),
    speed_mps=0.05,
    stops=(Stop(at_m=1.0, duration_s=8.0),),
    forced_slips=(ForcedSlip(start_s=50.0, duration_s=5.0),),
)


@dataclass
class Driven:
    """A drive that is over."""

    scene: Scene
    chunks: list[Truth]

    def body(self, name: str) -> np.ndarray:
        """Join an array of the body's truth."""
        return np.concatenate([getattr(chunk.body, name) for chunk in self.chunks])

    def wheels(self, name: str) -> np.ndarray:
        """Join an array of the wheels' truth."""
        return np.concatenate([getattr(chunk.wheels, name) for chunk in self.chunks])

    @property
    def position(self) -> np.ndarray:
        """Positions of the body [m]."""
        return np.concatenate([chunk.body.T_world_body.translation for chunk in self.chunks])

    @property
    def events(self) -> dict[str, float]:
        """Times of the events [s]."""
        return {event.kind: event.t_ns / 1e9 for chunk in self.chunks for event in chunk.events}


def _drive(ground: Waves, spec: DriveSpec, chunk_s: float = 10.0) -> Driven:
    start, heading = start_of(spec)
    scene = build_scene(ground, RoverSpec(), start, heading)
    return Driven(scene, list(drive(scene, spec, chunk_s)))


@pytest.fixture(scope="module")
def driven() -> Driven:
    """Drive once among rocks, with a stop and a forced slip."""
    return _drive(GROUND, SPEC)


def test_the_drive_reaches_its_goal_with_every_event(driven: Driven) -> None:
    """Within 5 cm, over at least one change of patch, and each event at its time."""
    assert math.dist(driven.position[-1, :2], SPEC.waypoints_m[-1]) < 0.05
    assert driven.scene.patch_changes >= 1
    assert list(driven.events) == ["start", "stop", "forced_slip", "goal"]
    assert driven.events["start"] == 0.0
    assert driven.events["forced_slip"] == 50.0


def test_every_time_is_a_tick_of_one_clock_across_the_chunks(driven: Driven) -> None:
    """Body at 100 Hz and wheels at 20 Hz from 0, without gap or repetition."""
    np.testing.assert_array_equal(np.diff(driven.body("t_ns")), 10_000_000)
    np.testing.assert_array_equal(np.diff(driven.wheels("t_ns")), 50_000_000)
    assert driven.body("t_ns")[0] == driven.wheels("t_ns")[0] == 0
    assert [len(chunk.body) for chunk in driven.chunks[1:-1]] == [1000] * (len(driven.chunks) - 2)


def test_velocities_are_the_derivatives_of_the_poses() -> None:
    """At the physics rate each step of the pose is the new velocity times dt, exactly."""
    ahead = ((0.0, 0.0), (3.0, 1.0))
    spec = DriveSpec(waypoints_m=ahead, imu_rate_hz=200.0, time_limit_s=5.0, settle_s=1.0)
    (truth,) = _drive(Waves(amplitude_m=0.05), spec).chunks
    step = np.diff(truth.body.T_world_body.translation, axis=0)
    np.testing.assert_allclose(step, truth.body.v_world_body_mps[1:] * 0.005, atol=1e-14)
    R = truth.body.T_world_body.rotation
    turn = so3.log(np.swapaxes(R[:-1], -1, -2) @ R[1:])
    np.testing.assert_allclose(turn, truth.body.omega_body_radps[1:] * 0.005, atol=1e-12)


def test_sampled_velocities_integrate_to_the_way_that_was_driven(driven: Driven) -> None:
    """Trapezoids at 100 Hz end within 1 mm of the pose, over rocks and a forced slip."""
    v = driven.body("v_world_body_mps")
    way = ((v[1:] + v[:-1]) / 2 * 0.01).sum(axis=0)
    np.testing.assert_allclose(way, driven.position[-1] - driven.position[0], atol=1e-3)


def test_the_clock_of_the_body_does_not_change_when_chunks_do(driven: Driven) -> None:
    """Another chunk length gives the same arrays to the bit, slip included."""
    other = _drive(GROUND, SPEC, chunk_s=33.0)
    for name in ("t_ns", "v_world_body_mps", "omega_body_radps"):
        np.testing.assert_array_equal(other.body(name), driven.body(name))
    for name in ("slip", "load_n", "drive_angle_rad", "joint_angle_rad"):
        np.testing.assert_array_equal(other.wheels(name), driven.wheels(name))


def test_during_a_forced_slip_odometry_advances_and_the_rover_does_not(driven: Driven) -> None:
    """5 s at 5 cm/s: the wheels roll 25 cm and slip by 1, the body stays within 1 cm."""
    t = driven.body("t_ns") / 1e9
    inside = driven.position[(t >= 50) & (t <= 55)]
    assert np.linalg.norm(inside[-1] - inside[0]) < 0.01
    tw = driven.wheels("t_ns") / 1e9
    angle = driven.wheels("drive_angle_rad")[(tw >= 50) & (tw <= 55)]
    np.testing.assert_allclose(0.1425 * (angle[-1] - angle[0]).mean(), 0.25, rtol=0.05)
    slip = driven.wheels("slip")[(tw >= 51) & (tw <= 55)]
    np.testing.assert_allclose(slip, 1.0, atol=0.1)  # the wheels go on steering
    np.testing.assert_allclose(slip.mean(axis=0), 1.0, atol=0.01)


def test_wheel_slip_accounts_for_the_distance_that_odometry_reads_too_much(driven: Driven) -> None:
    """Rim travel times (1 - slip) is the way that the wheels' centres went."""
    slip, angle = driven.wheels("slip"), driven.wheels("drive_angle_rad")
    rim = 0.1425 * np.diff(angle, axis=0)
    went = (rim * (1 - slip[1:])).sum(axis=0).mean()
    path = np.linalg.norm(np.diff(driven.position[::5], axis=0), axis=1).sum()
    assert went == pytest.approx(path, rel=0.03)
    assert rim.sum(axis=0).mean() > path + 0.2


def test_at_a_stop_the_body_rests(driven: Driven) -> None:
    """From 3 s after the halt: less than 0.1 mm/s and 0.1 mrad/s, and wheels that stand."""
    t = driven.body("t_ns") / 1e9
    begin = driven.events["stop"]
    rest = (t > begin + 3) & (t < begin + 8)
    assert np.abs(driven.body("v_world_body_mps")[rest]).max() < 1e-4
    assert np.abs(driven.body("omega_body_radps")[rest]).max() < 1e-4
    tw = driven.wheels("t_ns") / 1e9
    rest_w = (tw > begin + 3) & (tw < begin + 8)
    np.testing.assert_array_equal(driven.wheels("slip")[rest_w], 0.0)
    assert np.all(driven.wheels("contact")[rest_w] >= CONTACT_SOIL)


def test_the_motion_shows_no_spike_where_the_patch_changes() -> None:
    """Velocity changes from sample to sample as little there as elsewhere."""
    spec = DriveSpec(waypoints_m=((0.0, 0.0), (4.5, 0.0)), speed_mps=0.1, imu_rate_hz=200.0)
    scene = build_scene(Waves(amplitude_m=0.02), RoverSpec(patch_m=4.0))
    changes, v, count = [], [], 0
    for chunk in drive(scene, spec, chunk_s=0.1):
        v.append(chunk.body.v_world_body_mps)
        if scene.patch_changes > count:
            count = scene.patch_changes
            changes.append(sum(map(len, v)) - len(chunk.body))
    step = np.linalg.norm(np.diff(np.concatenate(v), axis=0), axis=1)
    near = np.concatenate([step[max(0, k - 2) : k + 22] for k in changes])
    assert len(changes) >= 4
    assert near.max() <= np.quantile(step, 0.999)
    assert np.median(near) < 2 * np.median(step)


def test_a_rover_before_a_wall_is_stuck_and_says_so(caplog: pytest.LogCaptureFixture) -> None:
    """Rocks of a metre and a half across the way: the drive ends, with an event and no error."""
    wall = tuple((2.0, y, 1.5) for y in (-1.0, 0.0, 1.0))
    spec = DriveSpec(waypoints_m=((0.0, 0.0), (5.0, 0.0)), speed_mps=0.1)
    with caplog.at_level(logging.CRITICAL):
        driven = _drive(Waves(amplitude_m=0.01, boulders=wall), spec)
    assert list(driven.events)[-1] in ("stuck", "hung_up", "tipped")
    assert driven.position[-1, 0] < 2.0


def test_a_drive_that_takes_too_long_is_ended(caplog: pytest.LogCaptureFixture) -> None:
    """The limit is kept to a control tick, and the last chunk carries the event."""
    spec = DriveSpec(waypoints_m=((0.0, 0.0), (5.0, 0.0)), time_limit_s=3.0)
    with caplog.at_level(logging.CRITICAL):
        driven = _drive(Waves(amplitude_m=0.01), spec)
    assert driven.events["time_limit"] == 3.0
    assert driven.body("t_ns")[-1] == 3_000_000_000


@pytest.mark.parametrize(("chunk_s", "rates"), [(1.0, (100.0, 10.0)), (0.5, (4.0, 10.0))])
def test_an_end_on_the_edge_of_a_chunk_is_not_lost(
    chunk_s: float, rates: tuple[float, float], caplog: pytest.LogCaptureFixture
) -> None:
    """The event is there, no chunk is without rows, also where the body is sampled less often."""
    spec = DriveSpec(
        waypoints_m=((0.0, 0.0), (5.0, 0.0)),
        time_limit_s=3.0,
        settle_s=1.0,
        imu_rate_hz=rates[0],
        control_rate_hz=rates[1],
    )
    with caplog.at_level(logging.CRITICAL):
        driven = _drive(Waves(amplitude_m=0.01), spec, chunk_s)
    assert driven.events["time_limit"] == 3.0
    assert all(len(chunk.body) for chunk in driven.chunks)
    np.testing.assert_allclose(np.diff(driven.body("t_ns")), 1e9 / rates[0])


def test_bad_drives_are_refused_before_they_begin() -> None:
    """A rate that does not divide the clock, a path off the map, a rover elsewhere, bad specs."""
    scene = build_scene(Waves(drivable=Box(-5, -5, 5, 5)), RoverSpec())
    ahead = ((0.0, 0.0), (2.0, 0.0))
    with pytest.raises(SpecError, match="imu_rate_hz 60 must divide the physics rate: 200, 100"):
        drive(scene, DriveSpec(waypoints_m=ahead, imu_rate_hz=60.0))
    with pytest.raises(PlanningError, match="outside the drivable ground"):
        drive(scene, DriveSpec(waypoints_m=((0.0, 0.0), (9.0, 0.0))))
    with pytest.raises(PlanningError, match="from the first waypoint"):
        drive(scene, DriveSpec(waypoints_m=((2.0, 0.0), (3.0, 0.0))))
    overlapping = [{"start_s": 3.0}, {"start_s": 5.0}]
    with pytest.raises(SpecError, match="begins before"):
        DriveSpec.from_mapping({"waypoints_m": ahead, "forced_slips": overlapping})
    with pytest.raises(SpecError, match="unknown key 'speed'; valid keys are waypoints_m"):
        DriveSpec.from_mapping({"waypoints_m": ahead, "speed": 1.0})
