"""Dead reckoning's error by cause, on planar drives whose causes are known exactly."""

import dataclasses

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.attribution import CAUSES, attribute_error, counterfactual_streams
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.streams import WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth

RADIUS_M, SPEED_MPS, SCALE, SLIP = 0.14, 0.1, 1.02, 0.10
FORCED = Event(t_ns=round(20.03 * NS_PER_S), kind="forced_slip", duration_s=5.02)


def _reckon(wheels: WheelStream) -> Trajectory:
    """Reckon a drive without turns from the mean over the wheels."""
    rolled = RADIUS_M * np.diff(wheels.drive_angle_rad, axis=0)
    heading = 0.5 * (wheels.steer_angle_rad[1:] + wheels.steer_angle_rad[:-1])
    x, y = (
        np.concatenate([[0.0], np.cumsum((rolled * part(heading)).mean(axis=1))])
        for part in (np.cos, np.sin)
    )
    position = np.stack([x, y, 0 * x], axis=-1)
    return Trajectory(wheels.t_ns, SE3(SE3.identity(len(x)).rotation, position))


def _drive(
    side_m: float = 0.0, told_share: float = 1.0, backwards: bool = False
) -> tuple[WheelStream, Truth]:
    """Drive 100 s at constant wheel speed: slip, one forced slip, a slide to the side.

    Of the slide the wheels' truth tells a share.
    """
    t = np.arange(2001) / 20
    t_ns = np.round(t * NS_PER_S).astype(np.int64)
    forced_s = np.clip(t - FORCED.t_ns / NS_PER_S, 0, FORCED.duration_s)
    angle = np.tile((SPEED_MPS * t / RADIUS_M)[:, None], (1, 6))
    # Firm ground in the first half, with the forced slip in it; soft ground in the second.
    slip = np.tile(np.where(np.arange(2001) > 1000, SLIP, 0.0)[:, None], (1, 6))
    free = SPEED_MPS * np.diff(t - forced_s, prepend=0.0)
    x = np.cumsum(free * (1 - slip[:, 0]))
    slip_angle = np.tile(np.arctan(told_share * side_m / x[-1]), (2001, 6))
    position = np.stack([-x if backwards else x, side_m * x / x[-1], 0 * x], axis=-1)
    angle = -angle if backwards else angle
    zero = np.zeros((2001, 3))
    body = BodyTruth(t_ns, SE3(SE3.identity(2001).rotation, position), zero, zero.copy())
    contact = np.ones((2001, 6), dtype=np.uint8)
    none = [0 * angle for _ in range(4)]  # steering, load, traction, sinkage
    joints = np.zeros((2001, 3))
    wheels = WheelTruth(t_ns, angle, none[0], slip, *none[1:], slip_angle, contact, joints)
    measured = WheelStream(t_ns, SCALE * angle, 0 * angle)
    return measured, Truth(body, wheels, (FORCED,))


def test_the_parts_sum_to_the_whole() -> None:
    """The contributions are vectors whose sum is the endpoint error."""
    measured, truth = _drive(side_m=0.3)
    split = attribute_error(measured, truth, _reckon)
    np.testing.assert_allclose(
        sum(np.array(v) for v in split.contributions_m.values()), split.total_m
    )
    assert tuple(split.contributions_m) == CAUSES
    error = _reckon(measured).T_world_body.translation[-1] - truth.body.T_world_body.translation[-1]
    np.testing.assert_allclose(split.total_m, error, atol=1e-12)


def test_each_cause_gets_its_closed_form() -> None:
    """Scale, forced slip, slip and a slide to the side, told or not, each its own metres."""
    measured, truth = _drive(side_m=0.3, told_share=0.8)
    parts = attribute_error(measured, truth, _reckon).contributions_m
    forced_m = SPEED_MPS * FORCED.duration_s
    np.testing.assert_allclose(parts["scale"], [(SCALE - 1) * 10.0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(parts["forced_slip"], [forced_m, 0, 0], atol=1e-9)
    np.testing.assert_allclose(parts["slip"], [SLIP * 5.0, 0, 0], atol=1e-9)
    np.testing.assert_allclose(parts["side_slip"], [0, -0.8 * 0.3, 0], atol=1e-9)
    np.testing.assert_allclose(parts["model"], [0, -0.2 * 0.3, 0], atol=1e-9)


def test_a_slide_to_the_left_is_one_whichever_way_the_wheels_turn() -> None:
    """Backwards a slip angle to the left still moves the wheel to its left."""
    measured, truth = _drive(side_m=0.3, backwards=True)
    parts = attribute_error(measured, truth, _reckon).contributions_m
    np.testing.assert_allclose(parts["side_slip"], [0, -0.3, 0], atol=1e-9)
    np.testing.assert_allclose(parts["model"], [0, 0, 0], atol=1e-9)


def test_each_interval_is_steered_by_its_own_slip_angle() -> None:
    """Angles that differ from sample to sample are not averaged with their neighbours'."""
    _, truth = _drive(side_m=0.3)
    assert truth.wheels is not None
    rng = np.random.default_rng(1)
    angle = rng.uniform(-1, 1, truth.wheels.slip_angle_rad.shape)
    wheels = dataclasses.replace(truth.wheels, slip_angle_rad=angle)
    *_, gripping, as_moved = counterfactual_streams(wheels, [])
    along = np.diff(_reckon(gripping).T_world_body.translation[:, 0])
    turns = RADIUS_M * np.diff(gripping.drive_angle_rad, axis=0)
    across = (np.abs(turns) * np.tan(angle[1:])).mean(axis=1)
    moved = np.diff(_reckon(as_moved).T_world_body.translation[::2], axis=0)
    np.testing.assert_allclose(moved[:, 0], along, atol=1e-12)
    np.testing.assert_allclose(moved[:, 1], across, atol=1e-12)


def test_a_slip_is_that_of_the_interval_before_its_sample() -> None:
    """A slip told half an interval late would leave a residue in the model's part."""
    measured, truth = _drive()
    assert truth.wheels is not None
    late = dataclasses.replace(truth.wheels, slip=np.roll(truth.wheels.slip, 1, axis=0))
    parts = attribute_error(measured, dataclasses.replace(truth, wheels=late), _reckon)
    assert abs(parts.contributions_m["model"][0]) > 1e-4


def test_ratios_are_of_the_true_distance() -> None:
    """Lengths over the distance driven."""
    measured, truth = _drive()
    split = attribute_error(measured, truth, _reckon)
    np.testing.assert_allclose(split.distance_m, 9.498 - SLIP * 5.0, rtol=1e-9)
    np.testing.assert_allclose(split.ratios["scale"], 0.2 / split.distance_m, rtol=1e-9)


def test_without_true_wheels_nothing_can_be_attributed() -> None:
    """Imported data say so."""
    measured, truth = _drive()
    with pytest.raises(RecordingError, match="no wheels"):
        attribute_error(measured, Truth(truth.body), _reckon)
