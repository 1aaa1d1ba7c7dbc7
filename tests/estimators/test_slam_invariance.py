"""What no sighting can tell, and what the SLAM filter's forms make of it."""

from __future__ import annotations

import numpy as np
import pytest

from estimators.slam_map import POSE
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from tests.estimators.slam_worlds import (
    FORMS,
    SIGHTINGS,
    STEP,
    Truth,
    block,
    dense,
    difference,
    error_of,
    live,
    moved,
    off_by,
    on_its_way,
    spread,
    still,
)
from tests.finite_difference import numerical_jacobian


@pytest.mark.parametrize("far", [False, True], ids=["near", "far"])
def test_right_invariant_sightings_are_blind_to_a_turn_of_all(far: bool) -> None:
    """However far pose and map turn together: not a bit of the derivatives, none of the image."""
    state = on_its_way("right_invariant", far)
    slots = np.array(sorted(state.landmarks.slot_of.values()))
    before = state.innovations(slots, SIGHTINGS, np.ones(3))
    assert not before.H[:, :, 3:].any()
    turn = np.zeros(len(state.P))
    turn[3:POSE] = [0.5, -0.8, 1.2]
    state.retract(turn)
    np.testing.assert_allclose(
        state.innovations(slots, SIGHTINGS, np.ones(3)).r, before.r, atol=1e-9
    )


@pytest.mark.parametrize("seed", range(3))
def test_sightings_from_keyframes_are_blind_to_any_motion_of_all(seed: int) -> None:
    """A rigid motion of poses and keyframes, small or large, at whatever estimate."""
    state = on_its_way("keyframe", keyframe_m=0.1)
    state.enter(np.array([20]), SIGHTINGS[:1] + 5.0, np.ones(1))
    state.advance(still(STEP))
    draw = stream(seed, "estimate").standard_normal(len(live(state)))
    state.retract(spread(state, 0.02 * draw))
    slots, z = np.array(sorted(state.landmarks.slot_of.values())), np.zeros((4, 3))
    before = state.innovations(slots, z, np.ones(4))
    common = np.zeros(len(state.P))
    xi = stream(seed, "motion").standard_normal(POSE)
    for first in (0, *(POSE + 3 * k for k in state.landmarks.keyframes)):
        common[first : first + POSE] = xi
    assert not before.moved_by(common).any()
    state.retract(common)
    assert np.linalg.norm(state.p) > 1.0
    after = state.innovations(slots, z, np.ones(4))
    np.testing.assert_allclose(after.r, before.r, rtol=1e-9)


@pytest.mark.parametrize(("form", "blind"), [("standard", False), ("right_invariant", True)])
def test_what_one_estimate_cannot_see_another_does_in_the_standard_form(
    form: str, blind: bool
) -> None:
    """The direction of a common turn at one estimate, looked at from a corrected one."""
    state = on_its_way(form)
    slots = np.array(sorted(state.landmarks.slot_of.values()))

    def spun(phi: Array) -> Truth:
        true = off_by(state, np.zeros(len(state.P)))
        turn = SE3(so3.exp(phi), np.zeros(3))
        true.pose, true.points = turn @ true.pose, {s: turn @ p for s, p in true.points.items()}
        return true

    direction = numerical_jacobian(lambda phi: error_of(state, spun(phi)), np.zeros(3))
    for corrected in (False, True):
        if corrected:
            state.retract(spread(state, np.full(len(live(state)), 0.05)))
        known = state.innovations(slots, SIGHTINGS, np.ones(3))
        felt = np.abs(dense(state, known.rows, known.H, known.G) @ direction).max()
        assert (felt < 1e-5) == (blind or not corrected)


def test_errors_are_taken_off_as_they_are_put_on() -> None:
    """The checker itself: `error_of` inverts `off_by` to first order, and poses exactly."""
    for form in FORMS:
        state = on_its_way(form)
        dx = spread(state, 1e-5 * stream(3, "dx").standard_normal(len(live(state))))
        np.testing.assert_allclose(error_of(state, off_by(state, dx)), dx, atol=1e-8)
        T = SE3.exp(0.3 * np.ones(6))
        xi = np.array([0.1, -0.2, 0.3, 0.4, 0.5, -0.6])
        for invariant in (True, False):
            np.testing.assert_allclose(
                difference(T, moved(T, xi, invariant), invariant), xi, atol=1e-12
            )


def test_right_invariant_corrections_move_places_as_the_group_does() -> None:
    """``exp(phi) p + J(phi) rho`` for position and places alike, however large the correction."""
    state = on_its_way("right_invariant")
    before, turned_by = off_by(state, np.zeros(len(state.P))), np.array([0.5, -0.8, 1.2])
    dx = spread(state, stream(4, "dx").standard_normal(len(live(state))))
    dx[3:POSE] = turned_by
    J, R, m = so3.left_jacobian(turned_by), so3.exp(turned_by), state.landmarks
    places = {s: R @ p + J @ m.R_world_host[s] @ block(dx, s, 3) for s, p in before.points.items()}
    state.retract(dx)
    np.testing.assert_allclose(state.p, R @ before.pose.translation + J @ dx[:3], rtol=1e-9)
    after = off_by(state, np.zeros(len(state.P)))
    for slot, place in places.items():
        np.testing.assert_allclose(after.points[slot], place, rtol=1e-9)
