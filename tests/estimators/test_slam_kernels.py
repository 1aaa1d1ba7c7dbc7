"""Every derivative of the SLAM filter against finite differences of what it is a derivative of."""

from __future__ import annotations

import numpy as np
import pytest

from estimators import slam_kernels
from estimators.observation import camera_vector
from estimators.slam_map import LASTING, POSE
from estimators.slam_state import SlamState
from estimators.slam_values import Step
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from tests.estimators.slam_worlds import (
    CAMERA,
    FORMS,
    SIGHTINGS,
    STEP,
    Truth,
    dense,
    error_of,
    eye,
    host,
    live,
    moved,
    numbers,
    off_by,
    on_its_way,
    seen,
    spread,
    still,
    turned,
)
from tests.finite_difference import assert_jacobian, numerical_jacobian

both_kinds = pytest.mark.parametrize("far", [False, True], ids=["near", "far"])
every_form = pytest.mark.parametrize("form", FORMS)


@every_form
@both_kinds
def test_a_sighting_changes_with_every_error_as_it_says(form: str, far: bool) -> None:
    """Pose, keyframe and landmark together, from an estimate that has moved on."""
    state = on_its_way(form, far)
    slots = sorted(state.landmarks.slot_of.values())
    known = state.innovations(np.array(slots), SIGHTINGS, np.ones(3))
    rows = live(state)

    def predicted(part: Array) -> Array:
        return seen(off_by(state, spread(state, part)), slots).ravel()

    np.testing.assert_allclose(
        SIGHTINGS - known.r, predicted(np.zeros(len(rows))).reshape(3, 3), atol=1e-9
    )
    assert_jacobian(
        predicted, np.zeros(len(rows)), dense(state, known.rows, known.H, known.G)[:, rows], 1e-7
    )
    dx = spread(state, stream(0, "dx").standard_normal(len(rows)))
    np.testing.assert_allclose(
        known.moved_by(dx).ravel(), dense(state, known.rows, known.H, known.G) @ dx, rtol=1e-9
    )


@both_kinds
def test_first_estimates_are_where_derivatives_are_taken(far: bool) -> None:
    """A landmark that has been corrected is predicted where it is, derived where it began."""
    state = on_its_way("first_estimates", far)
    slots, m = sorted(state.landmarks.slot_of.values()), state.landmarks
    m.x[slots] += 0.3
    known = state.innovations(np.array(slots), SIGHTINGS, np.ones(3))
    now = seen(off_by(state, np.zeros(len(state.P))), slots)
    np.testing.assert_allclose(SIGHTINGS - known.r, now, atol=1e-9)
    m.x[slots] = m.x_first[slots]
    first = state.innovations(np.array(slots), SIGHTINGS, np.ones(3))
    assert np.array_equal(known.H, first.H) and np.array_equal(known.G, first.G)
    assert np.abs(known.r - first.r).max() > 0.1


@both_kinds
def test_the_numbers_of_a_sighting_change_with_it_as_they_say(far: bool) -> None:
    """A place by triangulation, image coordinates as they are."""
    camera, x, by_z = camera_vector(CAMERA), np.empty(3), np.empty((3, 3))

    def stand_for(z: Array) -> Array:
        return np.asarray(z if far else CAMERA.triangulate(z))

    for z in SIGHTINGS:
        slam_kernels.numbers_of(camera, float(far), z, x, by_z)
        np.testing.assert_allclose(x, stand_for(z), rtol=1e-12)
        assert_jacobian(stand_for, z, by_z, 1e-6, step=1e-4)


def entered(state: SlamState, slot: int, dx: Array, z: Array) -> Array:
    """Give the numbers of a landmark that is at z in the true camera, in its true host."""
    m, true = state.landmarks, off_by(state, dx)
    frame = true.keyframes.get(int(m.host[slot]), host(state, slot))
    if state._invariant and not m.keyframes:
        frame = turned(frame, dx[3:POSE])
    return numbers(state, slot, frame.inverse() @ (eye(true.pose) @ CAMERA.triangulate(z)))


@every_form
@both_kinds
def test_a_landmark_enters_with_the_covariance_of_what_it_comes_from(form: str, far: bool) -> None:
    """``J P J' + noise`` and ``J P``, with J by the pose and by the keyframe it enters in."""
    state = on_its_way(form, far)
    before, z, variance = state.P.copy(), np.array([500.0, 470.0, 640.0]), 0.25
    rows = live(state)
    state.enter(np.array([20]), z[None], np.array([variance]))
    slot, m = state.landmarks.slot_of[20], state.landmarks
    mine = POSE + 3 * slot + np.arange(3)
    x = m.x[slot].copy()
    del m.slot_of[20]  # Without it the state is the one that it entered.
    np.testing.assert_allclose(x, entered(state, slot, np.zeros(len(before)), z), rtol=1e-9)
    J = numerical_jacobian(lambda d: entered(state, slot, spread(state, d), z), np.zeros(len(rows)))
    D = numerical_jacobian(lambda q: entered(state, slot, np.zeros(len(before)), q), z, step=1e-4)
    own = J @ before[np.ix_(rows, rows)] @ J.T + variance * D @ D.T
    close(state.P[np.ix_(mine, mine)], own)
    close(state.P[np.ix_(mine, rows)], J @ before[np.ix_(rows, rows)])
    assert np.array_equal(state.P, state.P.T)
    assert np.array_equal(state.P[np.ix_(rows, rows)], before[np.ix_(rows, rows)])


def close(found: Array, wanted: Array, tolerance: float = 1e-6) -> None:
    """Hold a matrix to another, relative to its largest entry."""
    np.testing.assert_allclose(found, wanted, rtol=0, atol=tolerance * np.abs(wanted).max())


def test_a_new_keyframe_is_a_copy_of_the_camera_with_its_errors() -> None:
    """Its rows are the pose's, and landmarks that enter later depend on it."""
    state = on_its_way("keyframe", keyframe_m=0.1)
    state.enter(np.array([20]), SIGHTINGS[:1], np.ones(1))
    first = POSE + 3 * state.landmarks.keyframes[-1]
    assert len(state.landmarks.keyframes) == 2
    copies, P = first + np.arange(POSE), state.P
    assert np.array_equal(P[copies, :], P[:POSE, :])
    assert np.array_equal(P[np.ix_(copies, copies)], P[:POSE, :POSE])
    now = eye(SE3(state.R, state.p))
    kept = host(state, state.landmarks.keyframes[-1])
    np.testing.assert_allclose(kept.matrix(), now.matrix(), atol=1e-12)


def stepped(state: SlamState, step: Step, dx: Array, noise: Array) -> Truth:
    """Move what is true as the rover truly moves where odometry reads `step`.

    What odometry does not know acts behind the step that the filter takes.
    """
    true = off_by(state, dx)
    believed = SE3.exp(step.twist + state.lasting @ step.lasting)
    unknown = (true.lasting - state.lasting) @ step.lasting + noise
    true.pose = true.pose @ believed @ SE3.exp(unknown)
    return true


def advanced(form: str, far: bool) -> tuple[SlamState, Step]:
    """Make a state before a step, with lasting errors that are partly known."""
    state = on_its_way(form, far)
    state.lasting = np.array([1e-3, -2e-3, 3e-3, 0.1])
    lasting = np.zeros((LASTING, 6))
    lasting[:3, 3:], lasting[3] = 0.7 * np.eye(3), 0.03 * STEP
    noise = 1e-2 * stream(1, "noise").standard_normal((7, 6))
    return state, Step(1.5 * STEP, noise, lasting)


@every_form
@both_kinds
def test_covariance_moves_as_errors_do(form: str, far: bool) -> None:
    """``P+ = F P F' + B B'``, F and B by differences of the errors before and after a step."""
    state, step = advanced(form, far)
    after, _ = advanced(form, far)
    after.advance(step)
    rows = live(state)

    def error(part: Array, noise: Array) -> Array:
        true = stepped(state, step, spread(state, part), noise)
        return error_of(after, true)[rows]

    zero = np.zeros(len(rows))
    assert np.abs(error(zero, np.zeros(6))).max() < 1e-9
    F = numerical_jacobian(lambda d: error(d, np.zeros(6)), zero)
    B = numerical_jacobian(lambda n: error(zero, n), np.zeros(6)) @ step.noise.T
    close(after.P[np.ix_(rows, rows)], F @ state.P[np.ix_(rows, rows)] @ F.T + B @ B.T)
    assert np.abs(after.P - after.P.T).max() < 1e-15 * np.abs(after.P).max()
    rest = np.setdiff1d(np.arange(len(after.P)), rows)
    assert not after.P[rest].any()


def test_first_estimates_carry_errors_from_prediction_to_prediction() -> None:
    """After a correction the lever arm begins at the pose that was predicted, not at the one."""
    state = on_its_way("first_estimates")
    state.P = np.zeros_like(state.P)
    state.P[3:6, 3:6] = np.eye(3)
    predicted = state.p.copy()
    state.retract(spread(state, np.full(len(live(state)), 0.1)))
    state.advance(still(STEP))
    arm = so3.hat(state.p - predicted)
    np.testing.assert_allclose(state.P[:3, :3], arm @ arm.T, atol=1e-12)
    np.testing.assert_allclose(state.P[:3, 3:6], -arm, atol=1e-12)


@every_form
@both_kinds
def test_the_covariance_of_the_pose_is_that_of_its_right_perturbation(form: str, far: bool) -> None:
    """Whatever errors the filter keeps inside."""
    state = on_its_way(form, far)
    pose = SE3(state.R, state.p)

    def right(xi: Array) -> Array:
        return np.asarray((pose.inverse() @ moved(pose, xi, state._invariant)).log())

    M = numerical_jacobian(right, np.zeros(POSE))
    close(state.pose_covariance(), M @ state.P[:POSE, :POSE] @ M.T)


@every_form
@both_kinds
def test_a_correction_by_the_error_leaves_an_error_of_second_order(form: str, far: bool) -> None:
    """A tenth of the error leaves a hundredth of the rest."""
    left = []
    for size in (1e-3, 1e-4):
        state = on_its_way(form, far)
        draw = stream(2, "dx").standard_normal(len(live(state)))
        dx = spread(state, size * draw)
        true = off_by(state, dx)
        state.retract(dx)
        left.append(np.abs(error_of(state, true)).max() / size)
    assert left[1] < 0.11 * left[0] + 1e-8  # what rounding leaves of 600 px
    assert left[0] < 0.5
