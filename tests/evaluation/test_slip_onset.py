"""Slip found by comparing vision with the wheels, on drives whose slip is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.slip_match import match_slips
from lpet_sim.evaluation.slip_onset import SlipOnsetSpec, SlipReport, find_slip
from lpet_sim.evaluation.slip_series import STEP_SIGMA, SlipSeriesSpec, slip_series
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.calibration import WheelCalibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Event, Truth
from lpet_sim.rng import stream

SPEED_MPS, INTERVAL_S, DURATION_S = 100.0 / 3600.0, 3.6, 900.0
STEP_S = 0.1
FORCED_S = 5.0
VISION_SIGMA_M = 0.001
# An interval in which the rover stood for less than this is not counted to a slip beside it.
CUT_S = SlipOnsetSpec().neighbour_share * INTERVAL_S
WHEELS = WheelCalibration(
    names=("w",), position_body_m=((0.0, 0.0, 0.0),), radius_m=0.1, steerable=(True,)
)
TIMES_S = np.arange(0.0, DURATION_S, STEP_S)


def _path(speed_mps: np.ndarray, t_s: np.ndarray, tilt_rad: float = 0.0) -> Trajectory:
    """Drive along a heading of 30 deg, at a speed told every 0.1 s, as known at some times."""
    way = np.interp(t_s, TIMES_S, np.concatenate([[0.0], np.cumsum(STEP_S * speed_mps[1:])]))
    rpy = np.tile([0.0, tilt_rad, np.radians(30.0)], (len(t_s), 1))
    rotation = SE3.from_rpy(rpy, np.zeros((len(t_s), 3))).rotation
    t_ns = np.round(t_s * NS_PER_S).astype(np.int64)
    return Trajectory(t_ns, SE3(rotation, way[:, None] * rotation[:, :, 0]))


def _drive(
    slip: np.ndarray, wheel_mps: float = SPEED_MPS, noise_seed: int | None = None
) -> tuple[Estimate, Estimate, Trajectory]:
    """Give vision, dead reckoning and truth of a drive with a slip told every 0.1 s.

    The ground is tilted, as dead reckoning does not know.
    """
    turned = np.full(len(TIMES_S), wheel_mps)
    true = turned * (1.0 - slip)
    images_s = np.arange(0.0, DURATION_S, INTERVAL_S)
    seen = _path(true, images_s, tilt_rad=-0.1)
    if noise_seed is not None:
        rng = stream(noise_seed, "test", "vision")
        p = seen.T_world_body.translation + rng.normal(0, VISION_SIGMA_M, (len(seen), 3))
        seen = Trajectory(seen.t_ns, SE3(seen.T_world_body.rotation, p))
    diagnostics = {
        STEP_SIGMA: np.full(len(seen), np.sqrt(2) * VISION_SIGMA_M),
        "bridged": np.zeros(len(seen)),
    }
    vision = Estimate("frame_to_frame", seen, None, diagnostics)
    return vision, Estimate("dead_reckoning", _path(turned, TIMES_S)), _path(true, TIMES_S, -0.1)


def _forced(start_s: float, length_s: float = FORCED_S, ordinary: float = 0.04) -> np.ndarray:
    since_s = TIMES_S - start_s
    return np.where((since_s > 1e-9) & (since_s <= length_s + 1e-9), 1.0, ordinary)


def _event(start_s: float) -> Event:
    return Event(round(start_s * NS_PER_S), "forced_slip", FORCED_S)


def _truth(path: Trajectory, *events: Event) -> Truth:
    zero = np.zeros((len(path), 3))
    return Truth(BodyTruth(path.t_ns, path.T_world_body, zero, zero.copy()), None, events)


def _find(
    slip: np.ndarray, wheel_mps: float = SPEED_MPS, noise_seed: int | None = None
) -> SlipReport:
    vision, wheels, _ = _drive(slip, wheel_mps, noise_seed)
    return find_slip(vision, wheels, WHEELS)


@pytest.mark.parametrize("start_s", 300.0 + np.arange(0.0, 3.6, 0.4))
def test_a_forced_slip_is_found_wherever_in_an_interval_it_begins(start_s: float) -> None:
    """Onset within one image; of the lost motion at most what is cut off beside the window."""
    vision, wheels, path = _drive(_forced(start_s), noise_seed=3)
    report = find_slip(vision, wheels, WHEELS)
    (match,) = match_slips(report, _truth(path, _event(start_s)), wheels)
    assert match.found is not None and match.within_one_image
    assert match.found.between_ns[0] <= match.found.onset_ns <= match.found.between_ns[1]
    np.testing.assert_allclose(match.lost_true_m, SPEED_MPS * FORCED_S, atol=2e-3)
    np.testing.assert_allclose(match.found.lost_m, match.lost_true_m, atol=2 * CUT_S * SPEED_MPS)


def test_a_long_slip_is_one_and_tells_its_ends() -> None:
    """Of a minute's slip, onset, end and lost motion come out, ordinary slip apart."""
    (found,) = _find(_forced(401.0, 60.0)).found
    np.testing.assert_allclose(found.onset_ns / NS_PER_S, 401.0, atol=CUT_S)
    np.testing.assert_allclose(found.end_ns / NS_PER_S, 461.0, atol=CUT_S)
    np.testing.assert_allclose(found.lost_m, 60.0 * SPEED_MPS, atol=2 * CUT_S * SPEED_MPS)
    assert found.alarm_ns > found.onset_ns and found.slip > 0.99


def test_loose_soil_is_measured_but_raises_no_alarm() -> None:
    """Slip that grows from 5 to 30 percent and back is told, to the noise, and is no alarm."""
    slip = 0.05 + 0.25 * np.sin(np.pi * TIMES_S / DURATION_S) ** 2
    report = _find(slip, noise_seed=5)
    assert report.found == ()
    middle = (report.series.t_ns + report.series.begin_ns) / 2 / NS_PER_S
    expected = np.interp(middle, TIMES_S, slip)
    np.testing.assert_allclose(report.series.slip, expected, atol=6 * VISION_SIGMA_M * 1.5 / 0.1)
    np.testing.assert_allclose(np.mean(report.series.slip - expected), 0.0, atol=2e-3)


def test_the_wheels_own_scatter_raises_no_alarm_and_more_than_declared_does() -> None:
    """Ten traverses with the declared white noise of the wheels, and with four times it."""

    def alarms(factor: float) -> int:
        count = 0
        for seed in range(10):
            rng = stream(seed, "test", "wheels")
            vision, _, _ = _drive(np.zeros(len(TIMES_S)))
            d = STEP_S * SPEED_MPS
            noise = factor * WHEELS.white_sigma_m_rtm * np.sqrt(d) * rng.normal(size=len(TIMES_S))
            moved = _path(SPEED_MPS + noise / STEP_S, TIMES_S)
            count += len(find_slip(vision, Estimate("w", moved), WHEELS).found)
        return count

    assert alarms(1.0) <= 1
    assert alarms(4.0) > 10


def test_a_threshold_of_four_sigma_is_rarely_passed_by_chance() -> None:
    """What the spec's documentation says of 4 sigma: one in forty traverses of 800 windows."""
    chance = 800 * norm.sf(SlipOnsetSpec().alarm_sigmas)
    np.testing.assert_allclose(chance, 1 / 40, rtol=0.05)


def test_a_drive_that_slips_half_all_along_still_raises_the_alarm() -> None:
    """What is ordinary has its limit: a rover that hardly gets on is told of."""
    assert len(_find(np.full(len(TIMES_S), 0.8)).found) >= 1


def test_what_vision_did_not_see_is_neither_slip_nor_grip() -> None:
    """Steps bridged by the wheels themselves have no slip, and none is found in them."""
    vision, wheels, path = _drive(_forced(300.0))
    vision.diagnostics["bridged"][:] = 1.0
    report = find_slip(vision, wheels, WHEELS)
    assert report.found == () and np.isnan(report.series.slip).all()
    (match,) = match_slips(report, _truth(path, _event(300.0)), wheels)
    assert match.found is None and not match.within_one_image and "not found" in match.text


def test_vision_that_declares_no_error_is_given_one() -> None:
    """A larger assumed error makes for fewer sigmas."""
    vision, wheels, _ = _drive(_forced(300.0))
    blind = Estimate("vision", vision.trajectory)
    (sure,), (unsure,) = (find_slip(v, wheels, WHEELS).found for v in (vision, blind))
    assert unsure.sigmas < sure.sigmas and unsure.onset_ns == sure.onset_ns


def test_standing_and_turning_on_the_spot_are_no_slip() -> None:
    """Where the wheels do not move the body no slip is given, whatever vision sees."""
    report = _find(np.zeros(len(TIMES_S)), wheel_mps=0.0, noise_seed=7)
    assert np.isnan(report.series.slip).all() and report.found == ()


def test_sliding_on_is_a_slip_below_zero() -> None:
    """A rover that moves further than its wheels has a negative slip, backwards too."""
    for wheel_mps in (SPEED_MPS, -SPEED_MPS):
        report = _find(np.full(len(TIMES_S), -0.2), wheel_mps=wheel_mps)
        np.testing.assert_allclose(report.series.slip, -0.2, atol=0.01)
        assert report.found == () and not report.series.ordinary.any()


def test_a_slip_that_nothing_forced_stands_beside_those_that_something_did() -> None:
    """Two slips, one of them an event: both are listed, in order of time."""
    slip = np.maximum(_forced(300.0), _forced(600.0, 20.0))
    vision, wheels, path = _drive(slip)
    report = find_slip(vision, wheels, WHEELS)
    forced, own = match_slips(report, _truth(path, _event(300.0)), wheels)
    assert forced.text.startswith("forced slip at 300.0 s for 5.0 s -> found at 30")
    assert "within one image interval 3.6 s" in forced.text and "0.139 m true" in forced.text
    assert own.event is None and own.late_s is None and own.text.startswith("no forced slip")
    np.testing.assert_allclose(own.lost_true_m, 20.0 * SPEED_MPS, atol=2 * CUT_S * SPEED_MPS)


def test_an_event_that_is_not_there_is_not_matched() -> None:
    """Negative control: told that the slip was elsewhere, the match fails."""
    vision, wheels, path = _drive(_forced(300.0))
    report = find_slip(vision, wheels, WHEELS)
    matches = match_slips(report, _truth(path, _event(500.0)), wheels)
    assert [match.within_one_image for match in matches] == [False, False]
    assert [match.event is None for match in matches] == [True, False]


@pytest.mark.parametrize(("least_m", "harmless"), [(0.02, False), (0.2, True)])
def test_a_slip_is_harmless_by_the_least_step_that_it_was_looked_for_with(
    least_m: float, harmless: bool
) -> None:
    """The forced slip loses 0.139 m."""
    vision, wheels, path = _drive(_forced(300.0))
    spec = SlipOnsetSpec(series=SlipSeriesSpec(min_step_m=least_m))
    report = find_slip(vision, wheels, WHEELS, spec)
    match = match_slips(report, _truth(path, _event(300.0)), wheels)[0]
    assert match.harmless is harmless


def test_estimates_that_share_no_images_cannot_be_compared() -> None:
    """The sentence names both."""
    vision, wheels, _ = _drive(np.zeros(len(TIMES_S)))
    late = Trajectory(vision.trajectory.t_ns + 10**13, vision.trajectory.T_world_body)
    with pytest.raises(RecordingError, match="'late' and 'dead_reckoning' share 0 images"):
        slip_series(Estimate("late", late), wheels)
