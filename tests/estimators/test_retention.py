"""Who enters the SLAM filter's map and who leaves it, by the counters that tell it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from estimators.retention import (
    Multiframe,
    WaitingPool,
    build_policy,
    expired_anchors,
)
from estimators.slam import SlamRun
from estimators.slam_map import LandmarkMap
from estimators.slam_spec import AnchorSpec, BoundedQueue, KeepAll, SlamSpec, TimeToLive
from estimators.slam_values import Step
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rng import stream
from tests.estimators.slam_worlds import CAMERA, FORMS, eye, spec

POINTS = stream(0, "points").uniform([-3.0, -1.0, 4.0], [3.0, 1.0, 12.0], (40, 3))
"""In the camera of a rover that stands [m]."""
STANDS = Step(np.zeros(6), np.zeros((0, 6)), np.zeros((4, 6)))
MOVES = Step(np.array([0.05, 0, 0, 0, 0, 0]), np.zeros((0, 6)), np.zeros((4, 6)))
EXACT: dict[str, Any] = {"association_check": "none", "slip_probability": 0.0}


def standing(**values: object) -> SlamRun:
    """Start a filter on a rover that stands."""
    return SlamRun(SlamSpec.from_mapping(EXACT | values), SE3.identity(), CAMERA)


def look(run: SlamRun, ids: list[int], step: Step = STANDS) -> None:
    """Sight some of the points without noise, after a step that odometry tells without error."""
    run.advance(step)
    points = eye(run.state.pose).inverse() @ (eye(SE3.identity()) @ POINTS[ids])
    z = CAMERA.project(points).reshape(-1, 3)
    run.see(np.array(ids, dtype=np.int64), z, np.full(len(ids), 0.5))


def mapped(run: SlamRun) -> set[int]:
    """Give the landmarks in the state."""
    return set(run.landmarks.slot_of)


@pytest.mark.parametrize("images", [1, 2, 5])
def test_a_landmark_lives_m_images_past_its_last_sighting(images: int) -> None:
    """Its counter is set to M when it is seen and lowered when not: at 0 it is gone."""
    run = standing(retention=TimeToLive(images=images).to_mapping())
    for _ in range(3):
        look(run, [0, 1])  # Seen in every image it stays, whatever M.
    for unseen in range(1, images + 1):
        assert 0 in mapped(run)
        look(run, [1])
        assert (0 in mapped(run)) == (unseen < images)
    assert mapped(run) == {1}


def test_a_sighting_sets_the_counter_anew() -> None:
    """Seen every second image it stays at M = 2, and goes at M = 1."""
    for images, stays in ((1, False), (2, True)):
        run = standing(retention=TimeToLive(images=images).to_mapping())
        for k in range(9):
            look(run, [0, 1] if k % 2 == 0 else [1])
        assert (int(run.landmarks.entered[run.landmarks.slot_of[0]]) == 1) == stays


def test_a_landmark_that_has_left_and_is_seen_again_is_new() -> None:
    """It enters with its sighting, is no match, and is placed anew."""
    run = standing(retention=TimeToLive(images=1).to_mapping())
    for ids in ([0, 1], [1], [0, 1], [0, 1]):
        look(run, ids)
    log = run.diagnostics()
    assert log["new"].tolist() == [2, 0, 1, 0]
    assert log["matched"].tolist() == [0, 1, 1, 2]
    assert log["dropped"].tolist() == [0, 1, 0, 0]
    assert run.landmarks.looks[run.landmarks.slot_of[0]] == 2


@pytest.mark.parametrize(
    "leave", ["first_in_first_out", "shortest_time_to_live", "least_confidence"]
)
@pytest.mark.parametrize("size", [1, 5, 12])
def test_the_queue_never_holds_more_than_n(size: int, leave: str) -> None:
    """Whoever is seen, and with everyone seen at once; anchors are not in the queue."""
    anchors = AnchorSpec(count_max=3, looks_min=2).to_mapping()
    for more in ({}, {"anchors": anchors}):
        queue = {"kind": "bounded_queue", "size": size, "leave": leave}
        run = standing(retention=queue, **more)
        rng = stream(size, "seen")
        for k in range(20):
            ids = np.flatnonzero(rng.random(40) < (1.0 if k in (2, 9) else 0.5)).tolist()
            look(run, ids, MOVES if k >= 3 else STANDS)
            m = run.landmarks
            pinned = int((m.pinned & (m.alive > 0)).sum())
            if not run._standing:
                assert len(m) - pinned <= size
                assert pinned == (3 if more else 0)
        assert run.diagnostics()["landmarks"][-1] == len(m) > 0


def test_a_landmark_enters_the_queue_with_its_second_sighting() -> None:
    """The first one only makes it wait; it is no match until it is in the state."""
    run = standing(retention=BoundedQueue(size=5).to_mapping())
    for ids, inside in (([0, 1], set()), ([0], {0}), ([0, 1], {0, 1})):
        look(run, ids)
        assert mapped(run) == inside
    assert run.diagnostics()["matched"].tolist() == [0, 0, 1]


def test_the_waiting_pool_forgets() -> None:
    """Seen again within so many images it enters, later it begins to wait anew."""
    pool = WaitingPool(BoundedQueue(size=5, waiting_images=3))
    nobody, one = np.zeros(0, dtype=np.int64), np.array([7])
    assert not pool.admit(one).any()
    pool.admit(nobody)
    pool.admit(nobody)
    assert pool.admit(one).all()  # The third image after.
    assert not pool.admit(one).any()  # A first sighting is used once.
    for _ in range(3):
        pool.admit(nobody)
    assert not pool.admit(one).any()
    assert pool.admit(one).all()


def filled(unseen: list[int], pinned: tuple[int, ...] = ()) -> LandmarkMap:
    """Make a map of landmarks that entered in turn, with their counters."""
    landmarks = LandmarkMap(16)
    for i, images in enumerate(unseen):
        slot = int(landmarks.free_slots(1)[0])
        landmarks.enter(slot, i, False, (np.eye(3), np.zeros(3)))
        landmarks.unseen[slot], landmarks.pinned[slot] = images, i in pinned
    return landmarks


def gone(landmarks: LandmarkMap, slots: Ints) -> list[int]:
    """Give the landmarks in slots."""
    return [int(i) for i in landmarks.id[slots]]


@pytest.mark.parametrize(
    ("leave", "who"),
    [
        ("first_in_first_out", [0, 1]),
        ("shortest_time_to_live", [3, 1]),
        ("least_confidence", [4, 2]),
    ],
)
def test_each_queue_lets_those_go_that_it_should(leave: str, who: list[int]) -> None:
    """The first come, the longest unseen (of two the first come), the least sure; no anchor."""
    landmarks = filled([0, 2, 0, 5, 2, 9], pinned=(5,))
    surprise = np.zeros(16)
    for i, s in enumerate([1.0, 0.5, 3.0, 2.0, 8.0, 99.0]):
        surprise[landmarks.slot_of[i]] = s
    queue = WaitingPool(BoundedQueue.from_mapping({"size": 5, "leave": leave}))
    assert gone(landmarks, queue.leaving(landmarks, 2, surprise)) == who
    assert not len(queue.leaving(landmarks, 0, surprise))
    assert len(queue.leaving(landmarks, 99, surprise)) == 5


def test_expiry_is_for_those_who_live_and_are_no_anchors() -> None:
    """Counters of free slots and of anchors say nothing."""
    landmarks = filled([0, 2, 3, 4], pinned=(3,))
    landmarks.leave(landmarks.slot_of[2])
    policy = build_policy(TimeToLive(images=2))
    assert isinstance(policy, Multiframe)
    assert gone(landmarks, policy.leaving(landmarks, 0, None)) == [1]
    assert not len(build_policy(KeepAll()).leaving(landmarks, 0, None))
    assert gone(landmarks, expired_anchors(landmarks, AnchorSpec(unseen_images_max=3))) == [3]
    assert not len(expired_anchors(landmarks, AnchorSpec(unseen_images_max=4)))
    assert not len(expired_anchors(landmarks, AnchorSpec()))


def set_off(form: str, prefer: str, unseen_images_max: int | None = None) -> SlamRun:
    """Look at points of all distances at standstill, and at none of them once on the way."""
    anchors = {"count_max": 6, "looks_min": 3, "prefer": prefer}
    if unseen_images_max:
        anchors["unseen_images_max"] = unseen_images_max
    chosen = spec(form, anchors=anchors, retention=TimeToLive(images=2).to_mapping(), **EXACT)
    # Some are far enough to be held as image coordinates in forms that hold the others as places.
    run = SlamRun(chosen.model_copy(update={"far_disparity_sigmas": 18.0}), SE3.identity(), CAMERA)
    for _ in range(3):
        look(run, list(range(30)))
    look(run, list(range(35)))  # Five come too late to become anchors.
    look(run, [], MOVES)
    look(run, [])
    return run


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("prefer", ["far", "near"])
def test_anchors_are_the_farthest_or_the_nearest(form: str, prefer: str) -> None:
    """By their depth, whatever the filter holds landmarks as; they alone outlive the policy."""
    run = set_off(form, prefer)
    order = np.argsort(POINTS[:30, 2] if prefer == "near" else -POINTS[:30, 2])
    assert mapped(run) == set(order[:6].tolist())
    assert run.landmarks.pinned.sum() == 6
    if form != "keyframe":
        far = run.landmarks.far[run.landmarks.alive > 0]
        assert far.all() if prefer == "far" else not far.any()


def test_an_anchor_unseen_for_too_long_leaves() -> None:
    """After one image more than it may be unseen, and it is counted as dropped."""
    run = set_off("keyframe", "far", unseen_images_max=4)
    look(run, [])
    look(run, [])
    assert len(mapped(run)) == 6
    look(run, [])
    assert mapped(run) == set()
    assert run.diagnostics()["dropped"][-1] == 6


def test_anchors_are_chosen_when_the_rover_sets_off_and_all_enter_before() -> None:
    """Standing, a queue of two holds everyone; then only anchors and two more."""
    anchors = AnchorSpec(count_max=3, looks_min=2).to_mapping()
    run = standing(retention=BoundedQueue(size=2).to_mapping(), anchors=anchors)
    for _ in range(3):
        look(run, list(range(10)))
        assert len(mapped(run)) == 10
    look(run, [], MOVES)
    assert len(mapped(run)) == 5


@pytest.mark.parametrize("moves", [0, 3, 30])
def test_a_rover_may_settle_before_it_stands_but_not_for_ever(moves: int) -> None:
    """Anchors are mapped after some images of motion; a rover that never stops has none."""
    run = standing(anchors=AnchorSpec(count_max=3, looks_min=4).to_mapping())
    for _ in range(moves):
        look(run, list(range(10)), MOVES)
    for _ in range(6):
        look(run, list(range(10)))
    look(run, list(range(10)), MOVES)
    assert run.landmarks.pinned.sum() == (3 if moves < 20 else 0)


@pytest.mark.parametrize("form", FORMS)
def test_confidence_is_that_of_image_coordinates_in_every_form(form: str) -> None:
    """At entry at the start a landmark is as sure as its sighting, near or far: 3 sigma^2."""
    run = SlamRun(spec(form, **EXACT), SE3.identity(), CAMERA)
    look(run, list(range(10)))
    state, slots = run.state, run.landmarks.slots(np.arange(10))
    disparity, variance = state.in_hosts()
    np.testing.assert_allclose(variance[slots], 3 * 0.5**2, rtol=1e-3)
    z: Array = CAMERA.project(POINTS[:10])
    np.testing.assert_allclose(disparity[slots], z[:, 0] - z[:, 1], rtol=1e-9)
    assert not np.delete(variance, slots).any()
