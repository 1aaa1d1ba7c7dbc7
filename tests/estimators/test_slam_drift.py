"""Landmarks whose tracks slide, and images with more sightings than are taken."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimators.observation import transfer
from estimators.slam import Slam
from estimators.slam_spec import KeepAll, SlamSpec
from estimators.thinning import spread_over_image
from lpet_sim.evaluation.consistency import anees
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.streams import Measurements, SightingStream
from lpet_sim.rng import stream
from tests.estimators.peer_runs import error, recorded
from tests.estimators.slam_worlds import CAMERA, FORMS, STEP, block, numbers, on_its_way, still
from tests.estimators.stereo_traverse import STEP_M, scene
from tests.finite_difference import numerical_jacobian

DRIFT_PX = 1.0
RUNS, IMAGES = 40, 8


@pytest.mark.parametrize("far", [False, True], ids=["near", "far"])
@pytest.mark.parametrize("form", FORMS)
def test_landmarks_walk_in_their_hosts_images_as_far_as_the_rover_drives(
    form: str, far: bool
) -> None:
    """The covariance grows by ``B B'``, B by finite differences of what a sighting stands for."""
    without, state = on_its_way(form, far), on_its_way(form, far)
    without.advance(still(STEP))
    state.advance(replace(still(STEP), drift_px=DRIFT_PX))
    m, wanted = state.landmarks, np.zeros_like(state.P)
    variance = DRIFT_PX**2 * float(np.linalg.norm(STEP[:3]))
    for slot in m.slot_of.values():
        seen = m.x_first[slot] if m.far[slot] else CAMERA.project(m.x_first[slot])

        def stands_for(z: Array, slot: int = slot) -> Array:
            return numbers(state, slot, CAMERA.triangulate(z))

        B = numerical_jacobian(stands_for, seen, 1e-3)
        rows = block(np.arange(len(wanted)), slot, 3)
        wanted[np.ix_(rows, rows)] = variance * B @ B.T
    grown = state.P - without.P
    np.testing.assert_allclose(grown, wanted, rtol=1e-5, atol=1e-9 * np.abs(wanted).max())


def sliding(seed: int) -> Measurements:
    """Let what each track stands for walk in the image that showed it first, and declare it."""
    given = recorded(seed, IMAGES)
    seen, cameras = given.sightings, scene(IMAGES).T_world_body @ CAMERA.T_body_camera.se3()
    assert seen is not None
    rng, px = stream(seed, "slide"), seen.stereo_px.copy()
    image = np.repeat(np.arange(IMAGES), np.diff(seen.offsets))
    for name in np.unique(seen.landmark_id):
        rows = np.flatnonzero(seen.landmark_id == name)
        z, last = seen.stereo_px[rows[:1]], image[rows[0]]
        walk = np.zeros(3)
        for row in rows[1:]:
            size = DRIFT_PX * np.sqrt(STEP_M * (image[row] - last))
            walk, last = walk + size * rng.standard_normal(3), image[row]
            T = cameras[image[rows[0]]].inverse() @ cameras[last]
            px[row] += (transfer(CAMERA, T, z + walk) - transfer(CAMERA, T, z))[0]
    slid = replace(seen, stereo_px=px, drift_px=np.full(IMAGES, DRIFT_PX))
    return replace(given, sightings=slid.chosen(seen.landmark_id % 3 == 0))


def anees_of(told: float, form: str) -> tuple[float, bool]:
    """Give the ANEES of the last pose, and whether it is in its band, told so much of the drift."""
    nees = []
    spec = SlamSpec.from_mapping(
        {"retention": KeepAll().to_mapping(), "association_check": "none", "formulation": form}
    )
    for seed in range(RUNS):
        given = sliding(seed)
        assert given.sightings is not None
        drift_px = told * given.sightings.drift_px
        given = replace(given, sightings=replace(given.sightings, drift_px=drift_px))
        found = Slam(spec).estimate(given)
        assert found.covariance is not None
        xi = error(found)[-1]
        nees.append(float(xi @ np.linalg.solve(found.covariance[-1], xi)))
    found_mean = anees(nees, 6)
    return found_mean.value, found_mean.is_consistent


@pytest.mark.parametrize("form", ["right_invariant", "standard"])
def test_a_filter_that_is_told_of_the_drift_is_consistent_and_one_that_is_not_is_not(
    form: str,
) -> None:
    """40 short runs with tracks that slide by 0.45 px an image, at 0.5 px of white noise."""
    assert anees_of(1.0, form)[1]
    assert anees_of(0.0, form)[0] > 18.0


def crowd(count: int, known: float) -> tuple[Array, Array]:
    """Draw sightings that crowd to one side, and which of them are in the map."""
    rng = stream(3, "crowd")
    u, v = 1000.0 * rng.uniform(size=count) ** 3, rng.uniform(0.0, 800.0, count)
    return np.stack([u, u - 10.0, v], axis=1), rng.uniform(size=count) < known


def test_few_sightings_are_all_taken_and_many_are_spread_over_the_image() -> None:
    """Of 1,000, half of them in a fifth of the width, 100 lie in nearly as many cells."""
    px, known = crowd(1000, 0.5)
    assert spread_over_image(px[:90], known[:90], (1000, 800), 100).tolist() == list(range(90))
    rows = spread_over_image(px, known, (1000, 800), 100)
    assert len(rows) == 100 and (np.diff(rows) > 0).all()
    cells = {(int(u // 100), int(v // 80)) for u, _, v in px[rows]}
    occupied = {(int(u // 100), int(v // 80)) for u, _, v in px}
    assert len(cells) == min(len(occupied), 100)


def test_landmarks_in_the_map_come_first_in_their_cell() -> None:
    """No cell gives a stranger while it has an acquaintance left."""
    px, known = crowd(1000, 0.3)
    rows = spread_over_image(px, known, (1000, 800), 150)
    cell = (px[:, 0] // 100).astype(int) * 10 + (px[:, 2] // 80).astype(int)
    taken = np.isin(np.arange(len(px)), rows)
    for c in np.unique(cell[taken & ~known]):
        assert not ((cell == c) & known & ~taken).any()


def test_the_filter_looks_at_no_more_sightings_than_its_spec_allows() -> None:
    """And still runs on what is left."""
    found = Slam(SlamSpec.from_mapping({"sightings_max": 20})).estimate(recorded(0, IMAGES))
    assert (found.diagnostics["sightings"] == 20).all()
    assert np.abs(error(found)[-1, :3]).max() < 0.1


def test_a_stream_is_cut_by_images_and_by_rows() -> None:
    """Both keep offsets, names and what is declared together."""
    seen = recorded(0, IMAGES).sightings
    assert seen is not None
    seen = replace(seen, drift_px=np.arange(float(IMAGES)))
    part = seen.images(2, 5)
    assert isinstance(part, SightingStream)
    assert part.landmark_id[part.rows(1)].tolist() == seen.landmark_id[seen.rows(3)].tolist()
    assert part.drift_px.tolist() == [2.0, 3.0, 4.0]
    even = seen.chosen(seen.landmark_id % 2 == 0)
    mine = seen.landmark_id[seen.rows(4)]
    assert even.landmark_id[even.rows(4)].tolist() == mine[mine % 2 == 0].tolist()
    assert even.drift_px.tolist() == seen.drift_px.tolist()
