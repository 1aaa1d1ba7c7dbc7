"""Poses over time: interpolation and its limits."""

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream


def _trajectory(count: int = 20) -> Trajectory:
    rng = stream(1, "trajectory")
    t_ns = np.cumsum(rng.integers(1, 10**9, count)).astype(np.int64)
    return Trajectory(t_ns, SE3.exp(rng.normal(size=(count, 6))))


def test_at_its_own_times_a_trajectory_gives_its_own_poses() -> None:
    """First and last included, and in any order."""
    path = _trajectory()
    for index in (np.arange(20), np.array([19, 0, 7, 7])):
        T = path.at(path.t_ns[index])
        np.testing.assert_allclose(T.matrix(), path.T_world_body[index].matrix(), atol=1e-14)


def test_between_two_poses_the_motion_is_even() -> None:
    """At a third of the time a third of the way and of the turn."""
    t_ns = np.array([0, 3_000_000_000], dtype=np.int64)
    ends = SE3.from_rpy([[0, 0, 0.2], [0, 0, 1.1]], [[0, 0, 0], [3, 6, -9]])
    middle = Trajectory(t_ns, ends).at([1_000_000_000])
    np.testing.assert_allclose(middle.translation, [[1, 2, -3]], atol=1e-15)
    np.testing.assert_allclose(middle.rpy(), [[0, 0, 0.5]], atol=1e-14)


def test_the_turn_takes_the_short_way_across_the_wrap() -> None:
    """From 170 to -170 degrees of yaw it goes through 180."""
    ends = SE3.from_rpy(np.radians([[0, 0, 170], [0, 0, -170]]), np.zeros((2, 3)))
    middle = Trajectory(np.array([0, 2], dtype=np.int64), ends).at([1])
    np.testing.assert_allclose(np.abs(middle.rpy()[0, 2]), np.pi, atol=1e-12)


def test_a_constant_motion_is_interpolated_exactly_in_a_moved_frame() -> None:
    """Interpolation commutes with a motion of the world."""
    path, T = _trajectory(), SE3.exp([1, 2, 3, 0.4, 0.5, 0.6])
    query = np.linspace(path.t_ns[0], path.t_ns[-1], 57).astype(np.int64)
    moved = Trajectory(path.t_ns, T @ path.T_world_body).at(query)
    np.testing.assert_allclose(moved.matrix(), (T @ path.at(query)).matrix(), atol=1e-12)


def test_long_times_keep_their_nanoseconds() -> None:
    """After ten days the fraction of a millisecond is still exact."""
    start = 864_000 * 10**9
    t_ns = np.array([start, start + 1_000_000], dtype=np.int64)
    path = Trajectory(t_ns, SE3.from_rpy(np.zeros((2, 3)), [[0, 0, 0], [1.0, 0, 0]]))
    np.testing.assert_allclose(path.at([start + 1]).translation[0, 0], 1e-6, rtol=1e-9)


def test_times_outside_are_refused_with_the_span() -> None:
    """Nothing is extrapolated."""
    path = _trajectory()
    for outside in (path.t_ns[0] - 1, path.t_ns[-1] + 1):
        with pytest.raises(RecordingError, match=f"spans {path.t_ns[0]} to {path.t_ns[-1]} ns"):
            path.at([outside])
    assert len(path.at(np.zeros(0, dtype=np.int64))) == 0


def test_a_single_pose_is_given_at_its_own_time() -> None:
    """A trajectory of one pose has no interval to interpolate in."""
    path = _trajectory()
    one = Trajectory(path.t_ns[:1], path.T_world_body[:1])
    np.testing.assert_array_equal(one.at(path.t_ns[:1]).matrix(), one.T_world_body.matrix())
    assert one.arc_length_m.tolist() == [0.0]


def test_arc_length_is_the_sum_of_the_chords() -> None:
    """3, then 4 m."""
    T = SE3.from_rpy(np.zeros((3, 3)), [[0, 0, 0], [3, 0, 0], [3, 4, 0]])
    assert Trajectory(np.arange(3), T).arc_length_m.tolist() == [0, 3, 7]
