"""Landmarks whose tracks slide: how far, along what, and who is told."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pytest

from lpet_sim.recording.streams import SightingStream
from lpet_sim.rng import stream
from lpet_sim.sensors.landmark_drift import sizes, slide, walks
from lpet_sim.sensors.landmark_sensor import (
    ShownLandmarks,
    report_sightings,
    sense_landmarks,
    show_landmarks,
)
from lpet_sim.sensors.landmark_spec import SightingNoiseSpec
from tests.sensors.landmark_worlds import (
    ALL_IN_RANGE,
    CAMERA,
    GROUND_ONLY,
    QUIET,
    MadeUpTerrain,
    sensor,
    straight_drive,
)

SEED = 3
DRIFT_PX = 0.3
BARE = sensor(field=GROUND_ONLY, visibility=ALL_IN_RANGE)


@pytest.fixture(scope="module")
def shown() -> ShownLandmarks:
    """Look once: the errors come after it."""
    flat: Any = MadeUpTerrain()
    return show_landmarks(straight_drive(3.0), flat, CAMERA, BARE, SEED)


def report(shown: ShownLandmarks, **noise: float) -> SightingStream:
    """Report what is shown, with noise of some sizes."""
    spec = BARE.model_copy(update={"noise": QUIET.model_copy(update=noise)})
    return report_sightings(shown, CAMERA, spec, SEED)


def test_a_sensor_whose_tracks_do_not_slide_is_what_it_was() -> None:
    """Equal to the bit to the stream that was sensed before tracks could slide."""
    noise = SightingNoiseSpec(
        sigma_left_px=0.4,
        sigma_right_px=0.6,
        sigma_v_px=0.3,
        bias_sigma_px=0.1,
        resolution_px=0.25,
    )
    spec = sensor(
        field=GROUND_ONLY,
        visibility=ALL_IN_RANGE,
        noise=noise,
        detection_probability=0.8,
        misclassification_probability=0.05,
        disparity_bias_px=0.125,
    )
    flat: Any = MadeUpTerrain()
    seen = sense_landmarks(straight_drive(2.0), flat, CAMERA, spec, SEED)
    digest = hashlib.sha256()
    for name in ("t_ns", "offsets", "landmark_id", "stereo_px", "sigma_px"):
        digest.update(np.ascontiguousarray(getattr(seen, name)).tobytes())
    assert digest.hexdigest() == "1807d345d77d7a385628ea89722ce90179354185387ef07de8b055a01864d097"
    assert not seen.drift_px.any()


def test_a_walk_has_the_variance_of_the_distance_and_steps_that_know_nothing_of_each_other() -> (
    None
):
    """20,000 walks over four images at unequal distances, to five sigma of their sampling."""
    n, distance_m = 20_000, np.array([0.0, 0.5, 0.5, 2.0])
    t_ns = np.arange(4) * 10**9
    name, image = np.repeat(np.arange(n), 4), np.tile(np.arange(4), n)
    walk = walks(name, image, t_ns, distance_m, 7).reshape(n, 4, 3)
    assert not walk[:, 0].any()
    assert np.array_equal(walk[:, 1], walk[:, 2])
    step = np.stack([walk[:, 1], walk[:, 3] - walk[:, 2]], axis=1)
    sigma = np.sqrt(np.array([[0.5], [1.5]]))
    assert np.all(np.abs(step.std(axis=0) / sigma - 1) < 5 / np.sqrt(2 * n))
    correlation = np.asarray(np.corrcoef(step.reshape(n, 6).T))[np.triu_indices(6, 1)]
    assert np.all(np.abs(correlation) < 5 / np.sqrt(n))


def test_some_landmarks_slide_further_than_others_and_the_mean_square_stays() -> None:
    """Log-normal over landmarks, to five sigma of the sampling; the same in all images of one."""
    name, spread = np.arange(200_000), 0.5
    size = sizes(name, spread, 7)
    log = np.log(size) / spread + spread
    assert abs(log.mean()) < 5 / np.sqrt(len(log))
    assert abs(log.std() - 1) < 5 / np.sqrt(2 * len(log))
    square_error = np.sqrt((np.exp(4 * spread**2) - 1) / len(log))
    assert abs(np.mean(size**2) - 1) < 5 * square_error
    assert np.array_equal(sizes(np.repeat(name[:9], 3), spread, 7), np.repeat(size[:9], 3))
    assert np.all(sizes(name, 0.0, 7) == 1.0)


def test_a_landmark_walks_on_while_it_is_not_shown() -> None:
    """Leaving rows out, all but the first, changes none of the others."""
    name, image = np.repeat(np.arange(50), 6), np.tile(np.arange(6), 50)
    t_ns, distance_m = np.arange(6) * 10**9, np.linspace(0.0, 1.0, 6)
    whole = walks(name, image, t_ns, distance_m, 7)
    some = (image == 0) | ((name + image) % 3 == 0)
    assert np.array_equal(walks(name[some], image[some], t_ns, distance_m, 7), whole[some])


def test_a_landmark_is_seen_where_it_has_walked_to(shown: ShownLandmarks) -> None:
    """Against the world: the point of the walked sighting in its first image, projected."""
    _, first = np.unique(shown.landmark_id, return_index=True)
    first = first[np.unique(shown.landmark_id, return_inverse=True)[1]]
    walk = stream(1, "walks").normal(0.0, 0.2, shown.stereo_px.shape)
    walk[first] = 0.0
    poses = shown.T_world_camera
    out, seen = slide(shown.stereo_px, shown.landmark_id, shown.image, poses, walk, CAMERA)
    p_first = CAMERA.triangulate(shown.stereo_px[first] + walk)
    p_world = poses[shown.image[first]] @ p_first
    wanted = CAMERA.project(poses[shown.image].inverse() @ p_world)
    np.testing.assert_allclose(out[seen], wanted[seen], atol=1e-7)
    assert np.mean(seen) > 0.95
    assert np.array_equal(seen, np.all((wanted >= 0) & (wanted <= 1023), axis=1))
    still, _ = slide(
        shown.stereo_px, shown.landmark_id, shown.image, poses, np.zeros_like(walk), CAMERA
    )
    np.testing.assert_allclose(still, shown.stereo_px, atol=1e-8)


def test_tracks_slide_by_what_was_asked_for(shown: ShownLandmarks) -> None:
    """Taken back into the images that showed them first, over the root of the distance driven."""
    seen = report(shown, drift_px=DRIFT_PX)
    image = np.repeat(np.arange(len(seen)), np.diff(seen.offsets))
    _, first, which = np.unique(seen.landmark_id, return_index=True, return_inverse=True)
    near = seen.stereo_px[first, 0] - seen.stereo_px[first, 1] > 4.0
    poses = shown.T_world_camera
    p_first = poses[image[first][which]].inverse() @ (
        poses[image] @ CAMERA.triangulate(seen.stereo_px)
    )
    driven_m = 0.1 * (image - image[first][which])
    later = (driven_m > 0.75) & (driven_m < 0.85) & near[which]
    walk = (CAMERA.project(p_first[later]) - seen.stereo_px[first][which][later]) / np.sqrt(
        driven_m[later, None]
    )
    assert len(walk) > 600
    np.testing.assert_allclose(walk.std(axis=0), DRIFT_PX, rtol=5 / np.sqrt(2 * len(walk)))


def test_what_slides_out_of_the_images_is_not_reported(shown: ShownLandmarks) -> None:
    """A few of them, and nothing that is reported lies outside."""
    seen = report(shown, drift_px=5.0)
    lost = 1 - len(seen.landmark_id) / len(shown.landmark_id)
    assert 0.001 < lost < 0.3
    assert seen.stereo_px.min() >= 0 and seen.stereo_px.max() <= 1023


def test_sliding_shifts_no_other_number(shown: ShownLandmarks) -> None:
    """White noise and who is found are as without it; the first showing of a track is exact."""
    found = BARE.model_copy(update={"detection_probability": 0.7})
    noisy = {"sigma_left_px": 0.4, "sigma_right_px": 0.4, "sigma_v_px": 0.4}
    streams = []
    for drift_px in (0.0, DRIFT_PX):
        noise = QUIET.model_copy(update={**noisy, "drift_px": drift_px})
        streams.append(
            report_sightings(shown, CAMERA, found.model_copy(update={"noise": noise}), SEED)
        )
    still, slid = (by_row(one) for one in streams)
    calm = by_row(report(shown, drift_px=DRIFT_PX))
    true = by_row(report(shown))
    assert slid.keys() <= still.keys() and len(slid) > 0.98 * len(still)
    for row in slid:
        np.testing.assert_allclose(slid[row] - calm[row], still[row] - true[row], atol=1e-9)


def by_row(sightings: SightingStream) -> dict[tuple[int, int], np.ndarray]:
    """Give the coordinates by image and landmark."""
    image = np.repeat(np.arange(len(sightings)), np.diff(sightings.offsets))
    keys = zip(image.tolist(), sightings.landmark_id.tolist(), strict=True)
    return dict(zip(keys, sightings.stereo_px, strict=True))


def test_the_drift_that_is_declared(shown: ShownLandmarks) -> None:
    """The true one, unless the spec says another; nought can be told of what slides."""
    assert np.all(report(shown, drift_px=DRIFT_PX).drift_px == DRIFT_PX)
    assert np.all(report(shown, drift_px=DRIFT_PX, declared_drift_px=0.0).drift_px == 0.0)
    assert np.all(report(shown, declared_drift_px=0.2).drift_px == 0.2)
