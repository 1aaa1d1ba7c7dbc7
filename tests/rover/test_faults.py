"""Wheels that are locked: what the rover then does, and what the truth says of it."""

import numpy as np
import pytest

from lpet_sim.errors import SpecError, UnknownNameError
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.rover.mjcf import bare_model
from lpet_sim.rover.model_spec import wheel_names
from lpet_sim.rover.spec import DriveSpec, ForcedSlip, StuckWheel
from lpet_sim.sweep.traverse import TraverseSpec
from tests.rover.episodes_of import THREE_METRES, drive_over
from tests.rover.grounds import Waves

GROUND = Waves(amplitude_m=0.01)


def test_the_description_names_the_wheels_as_the_model_does() -> None:
    """In the order of its motors."""
    model = bare_model("exomars")
    motors = [model.actuator(k).name for k in range(model.nu)]
    assert tuple(motors[:6]) == tuple(f"drive_{name}" for name in wheel_names("exomars"))


def test_a_stuck_wheel_stands_and_is_dragged_to_the_goal() -> None:
    """Its angle stays within the drive's reach while the others roll; then it turns again."""
    stuck = StuckWheel(wheel="middle_left", start_s=5.0, duration_s=12.0)
    outcome = drive_over(GROUND, stuck_wheels=(stuck,))
    (event,) = outcome.of("stuck_wheel")
    assert (event.t_ns, event.duration_s) == (5 * NS_PER_S, 12.0)
    assert "middle left wheel's drive is locked for 12 s" in event.text
    assert outcome.ending.kind == "goal"
    t_s, angle = outcome.t_s, outcome.wheels("drive_angle_rad")
    during = angle[(t_s > 5.5) & (t_s < 17)]
    others = np.delete(during[-1] - during[0], 2)
    assert np.ptp(during[:, 2]) < 0.03
    assert others.min() > 7
    assert angle[-1, 2] - during[-1, 2] > 5


def test_a_dragged_rear_wheel_makes_the_others_slip_and_turns_the_rover() -> None:
    """Against the same drive without: more slip, and a yaw that the path follower corrects."""
    stuck = StuckWheel(wheel="rear_left", start_s=2.0)
    free, dragged = drive_over(GROUND), drive_over(GROUND, stuck_wheels=(stuck,))
    assert dragged.ending.kind == "goal"
    driving = np.delete(dragged.wheels("slip")[100:250], 4, axis=1)
    assert driving.mean() > free.wheels("slip")[100:250].mean() + 0.02
    cross = dragged.position[:, 1]
    assert np.abs(cross).max() < 0.1
    assert np.abs(cross).max() > 5 * np.abs(free.position[:, 1]).max()
    (event,) = dragged.of("stuck_wheel")
    assert event.t_ns / NS_PER_S + event.duration_s == pytest.approx(dragged.t_s[-1])


def test_a_fault_that_outlasts_the_drive_lasts_as_long_as_the_drive() -> None:
    """Its event has the duration that it had, not the one that was asked for."""
    slip = ForcedSlip(start_s=2.0, duration_s=30.0)
    outcome = drive_over(GROUND, forced_slips=(slip,), time_limit_s=6.0)
    (event,) = outcome.of("forced_slip")
    assert (event.t_ns, event.duration_s) == (2 * NS_PER_S, 4.0)
    assert outcome.ending.kind == "time_limit"


def test_bad_faults_are_refused_with_what_would_be_valid() -> None:
    """A wheel that there is not, a kind that there is not, two locks of one wheel at once."""
    ahead = {"waypoints_m": THREE_METRES}
    left = {**ahead, "stuck_wheels": [{"wheel": "left", "start_s": 1}]}
    with pytest.raises(SpecError, match=r"stuck_wheels.0 'left': .*front_left, front_right"):
        TraverseSpec.from_mapping({"terrain": "exomars", "drive": left})
    with pytest.raises(UnknownNameError, match=r"stuck_wheels.0 'left': .*front_left"):
        drive_over(GROUND, stuck_wheels=(StuckWheel(wheel="left", start_s=1.0),))
    with pytest.raises(SpecError, match=r"failures.ends_on.0.*'tipped', 'entrapped', 'hung_up'"):
        DriveSpec.from_mapping({**ahead, "failures": {"ends_on": ["rolled"]}})
    twice = [{"wheel": "rear_left", "start_s": s} for s in (1.0, 9.0)]
    with pytest.raises(SpecError, match=r"rear_left at 9\.0 s begins before the one at 1\.0 s"):
        DriveSpec.from_mapping({**ahead, "stuck_wheels": twice})
    apart = [{"wheel": w, "start_s": 1.0} for w in ("rear_left", "rear_right")]
    assert len(DriveSpec.from_mapping({**ahead, "stuck_wheels": apart}).stuck_wheels) == 2
