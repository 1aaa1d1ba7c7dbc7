"""The gate, the joint innovation and the consensus of the SLAM filter against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest

from estimators import slam_gate
from estimators.gaussian import chi_square_threshold
from estimators.slam_iterate import relinearised
from estimators.slam_map import POSE
from estimators.slam_state import SlamState
from estimators.slam_values import Innovations, Joint
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from tests.estimators.slam_worlds import (
    FORMS,
    SIGHTINGS,
    STEP,
    covariance,
    dense,
    on_its_way,
    still,
)

VARIANCE = np.array([0.25, 1.0, 4.0, 2.0])
THRESHOLD = chi_square_threshold(3, 0.999)


def sighted(form: str) -> tuple[SlamState, Innovations, Array]:
    """Make a state of two keyframes (or none), what it sees, and the dense derivative of that."""
    state = on_its_way(form, keyframe_m=0.1)
    state.enter(np.array([20]), SIGHTINGS[1:2] + 9.0, np.ones(1))
    state.advance(still(STEP))
    state.P = covariance(state)
    slots = np.array([state.landmarks.slot_of[i] for i in (20, 12, 10, 11)])
    z = np.concatenate([SIGHTINGS[1:2] + 9.0, SIGHTINGS[[2, 0, 1]]])
    known = state.innovations(slots, z, VARIANCE)
    return state, known, dense(state, known.rows, known.H, known.G)


@pytest.mark.parametrize("form", FORMS)
def test_sparse_products_equal_dense_ones(form: str) -> None:
    """``H P``, ``H P H' + noise`` and each sighting's own square."""
    state, known, H = sighted(form)
    joint = state.joint(known)
    HP, S = joint.HP, joint.S
    wanted = H @ state.P @ H.T + np.diag(np.repeat(VARIANCE, 3))
    np.testing.assert_allclose(HP, H @ state.P, rtol=0, atol=1e-12 * np.abs(HP).max())
    np.testing.assert_allclose(S, wanted, rtol=0, atol=1e-12 * np.abs(S).max())
    assert np.array_equal(S, S.T)
    own = [wanted[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(4)]
    squares = [r @ np.linalg.solve(Si, r) for r, Si in zip(known.r, own, strict=True)]
    np.testing.assert_allclose(state.squared_distances(known), squares, rtol=1e-9)


def test_an_innovation_whose_covariance_is_no_covariance_passes_no_gate() -> None:
    """Its square is infinite, whichever of the three pivots fails."""
    for broken in range(3):
        state, known, _ = sighted("standard")
        variance = known.variance.copy()
        state.P[:] = 0.0
        first = int(known.rows[0][0])
        block = np.zeros((3, 3))
        block[broken, broken] = -2.0
        G = known.G[0]
        state.P[first : first + 3, first : first + 3] = np.linalg.solve(
            G, np.linalg.solve(G, block).T
        )
        variance[0] = 1.0
        known.variance = variance
        distances = state.squared_distances(known)
        assert np.isinf(distances[0])
        assert np.isfinite(distances[1:]).all()


def drawn(count: int, wrong: int, seed: int) -> tuple[Array, Array]:
    """Draw innovations of sightings that share unknowns widely, the last of them wrong.

    What all share hides the wrong ones from the gate of each by itself; one sighting tells three
    numbers, so three unknowns are shared.
    """
    rng = stream(seed, "innovations")
    A = rng.standard_normal((3 * count, 3))
    S = 900.0 * A @ A.T + np.eye(3 * count)
    r = np.linalg.cholesky(S) @ rng.standard_normal(3 * count)
    r[3 * (count - wrong) :] += rng.choice([-15.0, 15.0], 3 * wrong)
    return S, r.reshape(-1, 3)


def alone(S: Array, r: Array) -> Array:
    """Give the squared distance of each innovation by itself."""
    own = [S[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] for i in range(len(r))]
    return np.array([x @ np.linalg.solve(Si, x) for x, Si in zip(r, own, strict=True)])


def best_by_definition(S: Array, r: Array, threshold: float) -> Array:
    """Give who agrees with the sighting that most agree with, by dense conditioning."""
    best = np.zeros(len(r), bool)
    for i in range(len(r)):
        mine = slice(3 * i, 3 * i + 3)
        gain = np.linalg.solve(S[mine, mine], S[mine]).T
        left, rest = r.ravel() - gain @ r[i], S - gain @ S[mine]
        agree = np.ones(len(r), bool)
        for j in set(range(len(r))) - {i}:
            their = slice(3 * j, 3 * j + 3)
            agree[j] = left[their] @ np.linalg.solve(rest[their, their], left[their]) < threshold
        if agree.sum() > best.sum():
            best = agree
    return best


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("wrong", [0, 4, 8])
def test_the_consensus_is_that_of_conditioning_on_each_sighting(wrong: int, seed: int) -> None:
    """By its definition in dense algebra, with a gate so tight that many fail."""
    S, r = drawn(20, wrong, seed)
    for threshold in (THRESHOLD, chi_square_threshold(3, 0.5)):
        support = np.empty(20)
        count = slam_gate.consensus(S, r, threshold, support)
        wanted = best_by_definition(S, r, threshold)
        assert np.array_equal(support > 0, wanted) and count == wanted.sum()


def test_the_consensus_finds_wrong_associations_that_pass_their_gates() -> None:
    """Of 8 wrong among 40 most pass alone; together nine of ten are found, and hardly any other."""
    hidden, left, lost = 0, 0, 0
    for seed in range(10):
        S, r = drawn(40, 8, seed)
        support = np.empty(40)
        slam_gate.consensus(S, r, THRESHOLD, support)
        hidden += int((alone(S, r)[32:] < THRESHOLD).sum())
        left += int(support[32:].sum())
        lost += int(32 - support[:32].sum())
    assert hidden > 0.7 * 80
    assert left <= 0.1 * 80
    assert lost <= 0.01 * 320


def test_wrong_sightings_of_a_run_do_not_enter_the_state() -> None:
    """The rows that are taken out of S and HP are those of the wrong sightings."""
    state, known, _ = sighted("keyframe")
    good = state.innovations(known.slots, known.z - known.r, VARIANCE)
    assert np.abs(good.r).max() < 1e-9
    rows = good.rows[0] - POSE
    assert sorted(rows // 3) == sorted(state.landmarks.slot_of.values())
    picked = good.take(np.array([True, False, True, False]))
    whole, part = state.joint(good), state.joint(picked)
    cut = whole.take(np.array([True, False, True, False]))
    assert np.array_equal(part.HP, cut.HP)
    np.testing.assert_allclose(part.S, cut.S, rtol=1e-12)
    np.testing.assert_allclose(np.tril(cut.L) @ np.tril(cut.L).T, part.S, rtol=1e-12)
    assert whole.take(np.ones(4, dtype=bool)) is whole


def test_sightings_that_lead_nowhere_are_left_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where an iteration breaks the covariance, neither it nor the estimate is what comes back."""
    state, known, _ = sighted("keyframe")
    joint, before = state.joint, state.pose
    calls: list[int] = []

    def broken(seen: Innovations) -> Joint:
        calls.append(len(seen))
        found = joint(seen)
        return Joint(found.HP, -found.S) if len(calls) > 2 else found

    monkeypatch.setattr(state, "joint", broken)
    assert relinearised(state, known, known, 4) is known
    assert len(calls) == 3
    assert np.array_equal(state.pose.matrix(), before.matrix())
    monkeypatch.undo()
    assert relinearised(state, known, known, 4) is not known
