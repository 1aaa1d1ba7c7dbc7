"""Error series, distance driven and segment drift against closed forms."""

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.errors import (
    ARC_STEP_M,
    distance_driven_m,
    error_series,
    segment_drift,
    worst_position_ratio,
    wrap_angle,
)
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream
from tests.evaluation.trajectories import scaled, straight, winding


def _jittered(trajectory: Trajectory, sigma_m: float) -> Trajectory:
    noise = stream(1, "jitter").normal(0, sigma_m, (len(trajectory), 3))
    T = trajectory.T_world_body
    return Trajectory(trajectory.t_ns, SE3(T.rotation, T.translation + noise))


def test_distance_driven_on_a_straight_line_is_its_length_at_any_rate() -> None:
    """Chords lose nothing on a line, and the tail shorter than a chord is counted too."""
    for count in (2, 11, 5001):
        np.testing.assert_allclose(distance_driven_m(straight(10.01, count))[-1], 10.01, rtol=1e-12)


def test_distance_driven_on_a_circle_is_its_circumference() -> None:
    """Chords of 2 cm cut a circle of 1 m by (0.02)^2/24 of itself and no more."""
    angle = np.linspace(0, 2 * np.pi, 20001)
    circle = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    path = Trajectory(np.arange(20001), SE3(SE3.identity(20001).rotation, circle))
    ratio = distance_driven_m(path)[-1] / (2 * np.pi)
    assert abs(1 - ratio - ARC_STEP_M**2 / 24) < 2e-6


def test_jitter_at_a_high_rate_does_not_lengthen_the_distance_driven() -> None:
    """One millimetre of jitter at 100 Hz doubles the sum of all chords but not the distance."""
    path = _jittered(straight(10.0, 36001), 1e-3)
    assert path.arc_length_m[-1] > 20.0
    assert abs(distance_driven_m(path)[-1] / 10.0 - 1) < 0.01


def test_a_standing_rover_that_jitters_drives_nothing() -> None:
    """An hour of jitter adds less than one chord, and the distance never falls."""
    path = _jittered(straight(0.0, 36001), 1e-3)
    driven = distance_driven_m(path)
    assert driven[-1] < ARC_STEP_M
    assert np.all(np.diff(driven) >= 0)


def test_no_error_gives_zeros() -> None:
    """The truth scored against itself has no error anywhere, at any rate."""
    truth = winding(401)
    series = error_series(Trajectory(truth.t_ns[::3], truth.T_world_body[::3]), truth)
    assert np.abs(series.position_error_m).max() < 1e-12
    assert np.abs(series.xi).max() < 1e-9
    assert np.abs(series.attitude_error_rad).max() < 1e-12


def test_a_scale_error_is_its_own_share_of_the_distance_at_every_moment() -> None:
    """A wheel 2 % too large gives 2 % throughout, at other times than the truth's."""
    series = error_series(scaled(straight(20.0, 77), 1.02), straight(20.0, 1001))
    np.testing.assert_allclose(series.position_ratio[1:], 0.02, rtol=1e-6)
    np.testing.assert_allclose(series.position_error_m[-1], [0.4, 0, 0], atol=1e-12)


def test_attitude_error_is_per_axis_and_signed() -> None:
    """Estimated less true roll, pitch and yaw, across the wrap of yaw."""
    t_ns = np.array([0, 1], dtype=np.int64)
    truth = Trajectory(t_ns, SE3.from_rpy([[0.1, 0.2, 3.1]] * 2, np.zeros((2, 3))))
    estimate = Trajectory(t_ns, SE3.from_rpy([[0.11, 0.18, -3.1]] * 2, np.zeros((2, 3))))
    error = error_series(estimate, truth).attitude_error_rad[-1]
    np.testing.assert_allclose(error, [0.01, -0.02, 2 * np.pi - 6.2], atol=1e-9)


def test_xi_is_the_right_perturbation_from_estimate_to_truth() -> None:
    """T_true = T_est @ exp(xi)."""
    truth = winding(50)
    xi = stream(2, "xi").normal(0, 0.1, (50, 6))
    estimate = Trajectory(truth.t_ns, truth.T_world_body @ SE3.exp(xi).inverse())
    np.testing.assert_allclose(error_series(estimate, truth).xi, xi, atol=1e-9)


def test_an_anchor_moves_the_estimate_onto_the_truth() -> None:
    """After the anchor a rigidly moved copy of the truth has no error, before it is not scored."""
    truth = winding(201)
    moved = Trajectory(truth.t_ns, SE3.exp([1, 2, 3, 0.1, 0.2, 0.3]) @ truth.T_world_body)
    assert np.linalg.norm(error_series(moved, truth).position_error_m, axis=1).min() > 0.1
    series = error_series(moved, truth, anchor_t_ns=20 * NS_PER_S)
    assert series.t_ns[0] == 20 * NS_PER_S
    assert series.distance_m[0] == 0
    assert np.abs(series.position_error_m).max() < 1e-9


def test_an_estimate_outside_the_truth_is_refused_with_both_spans() -> None:
    """The sentence names both spans of time."""
    truth = straight(1.0, 5)
    late = Trajectory(truth.t_ns + 200 * NS_PER_S, truth.T_world_body)
    with pytest.raises(RecordingError, match="200000000000 to 300000000000"):
        error_series(late, truth)


def test_the_worst_ratio_leaves_the_first_metres_out() -> None:
    """A jump of 0.1 m at 1 m and of 0.15 m at 10 m: the first is seen only without a start."""
    truth = straight(20.0, 201)
    position = truth.T_world_body.translation.copy()
    position[10, 1] += 0.1
    position[100, 1] += 0.15
    estimate = Trajectory(truth.t_ns, SE3(truth.T_world_body.rotation, position))
    series = error_series(estimate, truth)
    np.testing.assert_allclose(worst_position_ratio(series, 0.0), 0.1, rtol=1e-6)
    np.testing.assert_allclose(worst_position_ratio(series, 5.0), 0.015, rtol=1e-6)


def test_a_traverse_shorter_than_the_first_metres_is_judged_by_its_end() -> None:
    """Nothing passes because it was too short to be looked at."""
    series = error_series(scaled(straight(2.0, 21), 1.5), straight(2.0, 21))
    np.testing.assert_allclose(worst_position_ratio(series, 5.0), 0.5, rtol=1e-6)


def test_segment_drift_of_a_scale_error_is_the_scale_for_every_length() -> None:
    """Translation 3 %, rotation none, and lengths that do not fit are left out."""
    drift = segment_drift(scaled(straight(12.0, 601), 1.03), straight(12.0, 301), (1, 5, 10, 50))
    assert [d.length_m for d in drift] == [1, 5, 10]
    for d in drift:
        np.testing.assert_allclose(d.translation_ratio, 0.03, rtol=1e-6)
        assert d.rotation_radpm < 1e-7


def test_segment_drift_of_a_constant_turn_rate_error_has_its_closed_form() -> None:
    """A straight drive estimated as an arc: k rad/m, and 2 sin(kL/2)/k against L of chord."""
    k, truth = 0.01, straight(20.0, 2001)
    s = truth.T_world_body.translation[:, 0]
    arc = np.stack([np.sin(k * s) / k, (1 - np.cos(k * s)) / k, 0 * s], axis=-1)
    rpy = np.stack([0 * s, 0 * s, k * s], axis=-1)
    (drift,) = segment_drift(Trajectory(truth.t_ns, SE3.from_rpy(rpy, arc)), truth, (5.0,))
    expected = np.hypot(np.sin(k * 5) / k - 5, (1 - np.cos(k * 5)) / k) / 5
    np.testing.assert_allclose(drift.rotation_radpm, k, rtol=1e-9)
    np.testing.assert_allclose(drift.translation_ratio, expected, rtol=1e-3)


def test_segment_drift_does_not_depend_on_the_frame_of_the_world() -> None:
    """A rigid motion of the whole estimate changes nothing."""
    truth = winding()
    moved = Trajectory(truth.t_ns, SE3.exp([1, 2, 3, 0.1, 0.2, 0.3]) @ truth.T_world_body)
    for d in segment_drift(moved, truth, (1.0, 10.0)):
        assert d.translation_ratio < 1e-12


def test_angles_wrap_to_the_half_open_interval() -> None:
    """Pi stays, -pi becomes pi."""
    given = np.array([np.pi, -np.pi, 0.0, 3 * np.pi / 2, -0.1])
    np.testing.assert_allclose(wrap_angle(given), [np.pi, np.pi, 0, -np.pi / 2, -0.1], atol=1e-12)
