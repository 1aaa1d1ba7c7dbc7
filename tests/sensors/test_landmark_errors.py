"""What is wrong with sightings of the landmark sensor, recovered from many of them."""

import numpy as np
import pytest

from lpet_sim.recording.streams import SightingStream
from lpet_sim.sensors.landmark_sensor import (
    ShownLandmarks,
    declared_sigma_px,
    report_sightings,
    sense_landmarks,
    show_landmarks,
)
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec, SightingNoiseSpec
from tests.sensors.landmark_worlds import (
    ALL_IN_RANGE,
    CAMERA,
    GROUND_ONLY,
    QUIET,
    MadeUpTerrain,
    camera_poses,
    sensor,
    straight_drive,
)

SEED = 3
DRIVE = straight_drive(4.0)
BARE = sensor(field=GROUND_ONLY, visibility=ALL_IN_RANGE)
NOISY = SightingNoiseSpec(sigma_left_px=0.4, sigma_right_px=0.6, sigma_v_px=0.3)


@pytest.fixture(scope="module")
def shown() -> ShownLandmarks:
    """Look once: the errors come after it."""
    return show_landmarks(DRIVE, MadeUpTerrain(), CAMERA, BARE, SEED)  # type: ignore[arg-type]


def report(shown: ShownLandmarks, spec: LandmarkSensorSpec, seed: int = SEED) -> SightingStream:
    """Report what is shown."""
    return report_sightings(shown, CAMERA, spec, seed)


def test_white_noise_has_its_size_in_each_coordinate(shown: ShownLandmarks) -> None:
    """Zero mean, the sigma asked for, no correlation, to four sigma of the sampling."""
    noise = report(shown, BARE.model_copy(update={"noise": NOISY})).stereo_px - shown.stereo_px
    n, sigma = len(noise), np.array([0.4, 0.6, 0.3])
    assert n > 10_000
    assert np.all(np.abs(noise.mean(axis=0)) < 4 * sigma / np.sqrt(n))
    assert np.all(np.abs(noise.std(axis=0) / sigma - 1) < 4 / np.sqrt(2 * n))
    assert np.all(np.abs(np.corrcoef(noise.T)[np.triu_indices(3, 1)]) < 4 / np.sqrt(n))


def test_noise_is_white_over_the_images_of_a_landmark(shown: ShownLandmarks) -> None:
    """Neighbouring images of a landmark share nothing."""
    noise = report(shown, BARE.model_copy(update={"noise": NOISY})).stereo_px - shown.stereo_px
    order = np.lexsort((shown.image, shown.landmark_id))
    same = np.diff(shown.landmark_id[order]) == 0
    u = noise[order, 0] / 0.4
    assert abs(np.mean(u[1:][same] * u[:-1][same])) < 4 / np.sqrt(same.sum())


def test_the_fixed_bias_of_a_landmark_is_the_same_in_all_images(shown: ShownLandmarks) -> None:
    """One number for each coordinate of each landmark, of the sigma asked for."""
    noise = QUIET.model_copy(update={"bias_sigma_px": 0.3})
    error = report(shown, BARE.model_copy(update={"noise": noise})).stereo_px - shown.stereo_px
    names, first, inverse = np.unique(shown.landmark_id, return_index=True, return_inverse=True)
    assert error == pytest.approx(error[first][inverse], abs=1e-9)
    assert error[first].std(axis=0) == pytest.approx(
        [0.3] * 3, abs=4 * 0.3 / np.sqrt(2 * len(names))
    )


def test_disparity_is_off_by_its_bias(shown: ShownLandmarks) -> None:
    """Measured less true disparity; u_left and v stay as they are."""
    error = report(shown, BARE.model_copy(update={"disparity_bias_px": 0.2})).stereo_px
    error = error - shown.stereo_px
    assert error[:, 0] - error[:, 1] == pytest.approx(0.2)
    assert np.all(error[:, [0, 2]] == 0.0)


def test_coordinates_are_multiples_of_the_resolution(shown: ShownLandmarks) -> None:
    """Rounded to the nearest quarter pixel."""
    noise = QUIET.model_copy(update={"resolution_px": 0.25})
    stereo_px = report(shown, BARE.model_copy(update={"noise": noise})).stereo_px
    assert np.all(stereo_px * 4 == np.round(stereo_px * 4))
    assert np.abs(stereo_px - shown.stereo_px).max() <= 0.125 + 1e-12


def test_the_share_found_is_the_detection_probability(shown: ShownLandmarks) -> None:
    """A binomial count, drawn anew for each image."""
    found = report(shown, BARE.model_copy(update={"detection_probability": 0.7}))
    n = len(shown.landmark_id)
    assert len(found.landmark_id) / n == pytest.approx(0.7, abs=4 * np.sqrt(0.21 / n))
    assert 0 < np.std(np.diff(found.offsets) / np.diff(shown.offsets)) < 0.2


@pytest.mark.parametrize("detection", [1.0, 0.8])
def test_the_share_misnamed_is_what_was_asked_for(shown: ShownLandmarks, detection: float) -> None:
    """Names are those of others shown in the same image, and each stands there once."""
    right = BARE.model_copy(update={"detection_probability": detection})
    wrong = right.model_copy(update={"misclassification_probability": 0.1})
    a, b = report(shown, right), report(shown, wrong)
    n = len(a.landmark_id)
    assert np.array_equal(a.stereo_px, b.stereo_px)
    swapped = a.landmark_id != b.landmark_id
    assert np.mean(swapped) == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / n))
    for image in range(len(b)):
        names = b.landmark_id[b.rows(image)]
        there = shown.landmark_id[shown.offsets[image] : shown.offsets[image + 1]]
        assert len(np.unique(names)) == len(names)
        assert np.isin(names, there).all()


def test_few_sightings_are_misnamed_as_often() -> None:
    """Where one alone is drawn in an image it takes the name of a landmark that was missed."""
    field = GROUND_ONLY.model_copy(update={"ground_per_m2": 0.05})
    changes = {"field": field, "visibility": ALL_IN_RANGE, "detection_probability": 0.7}
    right = sensor(period_s=0.1, **changes)
    seen = show_landmarks(DRIVE, MadeUpTerrain(), CAMERA, right, SEED)  # type: ignore[arg-type]
    wrong = right.model_copy(update={"misclassification_probability": 0.1})
    a, b = report(seen, right), report(seen, wrong)
    swapped = a.landmark_id != b.landmark_id
    assert np.diff(a.offsets).mean() < 20
    assert swapped.mean() == pytest.approx(0.1, abs=4 * np.sqrt(0.09 / len(swapped)))


def test_errors_of_focal_length_and_baseline_come_back_from_the_sightings() -> None:
    """Declared over true less 1, fitted to sightings of points that are known."""
    spec = sensor(
        field=GROUND_ONLY,
        visibility=ALL_IN_RANGE,
        focal_scale_error=0.02,
        baseline_scale_error=-0.01,
    )
    args = (DRIVE, MadeUpTerrain(), CAMERA, spec, SEED)
    shown, seen = show_landmarks(*args), sense_landmarks(*args)  # type: ignore[arg-type]
    poses = camera_poses(DRIVE, seen.t_ns)
    p = shown.p_world - poses.translation[shown.image]
    x, _, z = np.einsum("nij,ni->jn", poses.rotation[shown.image], p)
    focal = np.sum((seen.stereo_px[:, 0] - CAMERA.cx_px) * x / z) / np.sum((x / z) ** 2)
    disparity = seen.stereo_px[:, 0] - seen.stereo_px[:, 1]
    baseline = np.mean(disparity * z) / focal
    assert CAMERA.focal_px / focal - 1 == pytest.approx(0.02, abs=1e-9)
    assert CAMERA.baseline_m / baseline - 1 == pytest.approx(-0.01, abs=1e-9)


def test_arms_share_what_they_do_not_change(shown: ShownLandmarks) -> None:
    """Fewer found are some of those found before; more noise is the same noise, scaled."""
    half = SightingNoiseSpec(sigma_left_px=0.2, sigma_right_px=0.3, sigma_v_px=0.15)
    rare = BARE.model_copy(update={"detection_probability": 0.6, "noise": half})
    often = BARE.model_copy(update={"detection_probability": 0.8, "noise": NOISY})
    a, b = (rows_of(report(shown, spec)) for spec in (rare, often))
    true = dict(zip(zip(shown.image, shown.landmark_id, strict=True), shown.stereo_px, strict=True))
    assert a.keys() < b.keys()
    for key, stereo_px in a.items():
        assert 2 * (stereo_px - true[key]) == pytest.approx(b[key] - true[key], abs=1e-9)


def rows_of(sightings: SightingStream) -> dict[tuple[int, int], np.ndarray]:
    """Give the coordinates by image and landmark."""
    image = np.repeat(np.arange(len(sightings)), np.diff(sightings.offsets))
    keys = zip(image, sightings.landmark_id, strict=True)
    return dict(zip(keys, sightings.stereo_px, strict=True))


def test_the_noise_that_is_declared() -> None:
    """What the spec says; else the white noise's RMS; without any, what the calibration says."""
    assert declared_sigma_px(QUIET, CAMERA) == CAMERA.sigma_px
    assert declared_sigma_px(NOISY, CAMERA) == pytest.approx(np.sqrt((0.16 + 0.36 + 0.09) / 3))
    told = NOISY.model_copy(update={"declared_sigma_px": 0.9})
    assert declared_sigma_px(told, CAMERA) == 0.9
