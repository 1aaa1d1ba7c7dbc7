"""Landmarks whose tracks slide: how far, along what, and who is told."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np
import pytest

from lpet_sim.geometry import SE3
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
    """Against the world: each image's point is projected into the next, and takes a step there."""
    name, image, poses = shown.landmark_id, shown.image, shown.T_world_camera
    walk = stream(1, "walks").normal(0.0, 0.2, shown.stereo_px.shape)
    out, seen = slide(shown.stereo_px, name, image, poses, walk, CAMERA)
    order = np.lexsort((image, name))
    a, b = order[:-1], order[1:]
    same = (name[a] == name[b]) & (out[a, 0] - out[a, 1] > 0.3)
    a, b = a[same & seen[a] & seen[b]], b[same & seen[a] & seen[b]]
    p_world = poses[image[a]] @ CAMERA.triangulate(out[a])
    before = CAMERA.project(poses[image[b]].inverse() @ p_world)
    np.testing.assert_allclose(out[b], before + walk[b] - walk[a], atol=1e-7)
    first = np.unique(name, return_index=True)[1]
    assert np.array_equal(out[first], shown.stereo_px[first]) and len(b) > 10_000
    assert np.mean(seen) > 0.9
    still, _ = slide(shown.stereo_px, name, image, poses, np.zeros_like(walk), CAMERA)
    np.testing.assert_allclose(still, shown.stereo_px, atol=1e-7)


def test_tracks_slide_by_what_was_asked_for(shown: ShownLandmarks) -> None:
    """Consecutive images of a landmark, near or far, old or new, over the root of the distance."""
    seen = by_row(report(shown, drift_px=DRIFT_PX))
    poses = shown.T_world_camera
    step = np.linalg.norm(np.diff(body(poses).translation, axis=0), axis=1)
    steps = []
    for k in range(5, 30, 5):
        both = [name for image, name in seen if image == k and (k - 1, name) in seen]
        here, before = (np.array([seen[i, name] for name in both]) for i in (k, k - 1))
        near = before[:, 0] - before[:, 1] > 0.5
        T_now_before = poses[k].inverse() @ poses[k - 1]
        there = CAMERA.project(T_now_before @ CAMERA.triangulate(before[near]))
        steps.append((here[near] - there) / np.sqrt(step[k - 1]))
    walked = np.concatenate(steps)
    assert len(walked) > 1000
    np.testing.assert_allclose(walked.std(axis=0), DRIFT_PX, rtol=5 / np.sqrt(2 * len(walked)))


def body(T_world_camera: SE3) -> SE3:
    """Give the body's poses."""
    return T_world_camera @ CAMERA.T_body_camera.se3().inverse()


def test_landmarks_that_are_lost_come_back_under_another_name(shown: ShownLandmarks) -> None:
    """A share of the showings but the first; places and noise stay, and names are unique."""
    noise = QUIET.model_copy(update={"sigma_left_px": 0.4})
    kept = BARE.model_copy(update={"noise": noise})
    lost = kept.model_copy(update={"loss_probability": 0.1})
    a, b = (report_sightings(shown, CAMERA, spec, SEED) for spec in (kept, lost))
    assert np.array_equal(a.stereo_px, b.stereo_px)
    image = shown.image
    order = np.lexsort((image, shown.landmark_id))
    again = np.diff(shown.landmark_id[order]) == 0
    renamed = np.diff(b.landmark_id[order])[again] != 0
    assert renamed.mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / again.sum()))
    pairs = np.unique(np.stack([a.landmark_id, b.landmark_id]), axis=1)
    assert len(np.unique(pairs[1])) == pairs.shape[1]
    assert len(pairs[1]) == len(np.unique(a.landmark_id)) + renamed.sum()


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
