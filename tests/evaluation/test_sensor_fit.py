"""A sensor's figures come back from the sightings that were made with them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.equivalent_noise import equivalent_sigma_px
from lpet_sim.evaluation.noise_fit import fit_noise
from lpet_sim.evaluation.noise_model import NoiseFit
from lpet_sim.evaluation.sensor_fit import SensorFit, fit_sensor
from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks, since
from lpet_sim.evaluation.track_kernels import predict
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream
from tests.evaluation.tracked_landmarks import (
    IMAGES,
    STEREO,
    Errors,
    camera_path,
    sighted,
    true_path,
)
from tests.finite_difference import assert_jacobian

CLEAN = Errors()
SYSTEMATIC = Errors(fixed_px=0.4, disparity_px=0.2, focal_scale=0.005, baseline_scale=-0.01)
WRONG = Errors(wrong_share=0.1)
SETTINGS = pytest.mark.parametrize("errors", [CLEAN, SYSTEMATIC, WRONG], ids=["a", "b", "c"])


def path() -> Trajectory:
    """Give the truth."""
    return Trajectory(np.arange(IMAGES) * NS_PER_S, true_path())


@cache
def measured(errors: Errors) -> NoiseFit:
    """Measure once."""
    return fit_noise(Tracks.of(sighted(errors)), camera_path(true_path()), STEREO)


@cache
def figures(errors: Errors) -> SensorFit:
    """Measure once."""
    return fit_sensor(sighted(errors), path(), STEREO)


@SETTINGS
def test_white_noise_comes_back_within_four_standard_errors(errors: Errors) -> None:
    """Each coordinate's own, whatever else is wrong; the standard errors are below 1.5 %."""
    fit = measured(errors)
    off = fit.sigma_px[:3] - np.array(errors.sigma_px)
    assert np.all(np.abs(off) < 4 * fit.sigma_se_px[:3])
    assert np.all(fit.sigma_se_px[:3] < 0.015 * fit.sigma_px[:3])


@pytest.mark.parametrize("tails", [1.0, 3.0, 100.0])
def test_the_standard_errors_are_those_of_the_delta_rule(tails: float) -> None:
    """By finite differences of the noise by its variance, whatever the tails."""
    fit = replace(measured(CLEAN), tails=tails)
    step = 1e-6 * fit.variance_px2
    ahead, behind = (replace(fit, variance_px2=fit.variance_px2 + s) for s in (step, -step))
    slope = (ahead.sigma_px - behind.sigma_px) / (2.0 * step)
    np.testing.assert_allclose(fit.sigma_se_px[:3], (slope * fit.variance_se_px2)[:3], rtol=1e-6)


def test_a_fixed_error_is_told_from_white_noise() -> None:
    """That of the landmarks comes back where it is, and is small where it is none."""
    fixed = measured(SYSTEMATIC)
    assert abs(fixed.sigma_px[3] - SYSTEMATIC.fixed_px) < 4 * fixed.sigma_se_px[3]
    assert fixed.sigma_se_px[3] < 0.02
    assert measured(CLEAN).sigma_px[3] < 0.1


@SETTINGS
def test_errors_that_all_sightings_share_come_back(errors: Errors) -> None:
    """Disparity bias, focal length and baseline, and no turn of the camera."""
    fit = measured(errors)
    true = [errors.disparity_px, errors.focal_scale, errors.baseline_scale, 0.0, 0.0, 0.0]
    assert np.all(np.abs(fit.shared - true) < 4.5 * fit.shared_se)
    assert np.all(fit.shared_se < [0.05, 1e-3, 2e-3, 1e-3, 1e-3, 1e-3])


def test_a_camera_turned_on_its_mount_is_found() -> None:
    """Half a degree about each axis in turn, to a hundredth of one."""
    turn = SE3.exp(np.radians([0.0, 0.0, 0.0, 0.5, -0.3, 0.2]))
    believed = CameraPath.from_se3(turn.inverse() @ camera_path(true_path()).T_camera_world)
    fit = fit_noise(Tracks.of(sighted(CLEAN)), believed, STEREO)
    np.testing.assert_allclose(np.degrees(fit.shared[3:]), [0.5, -0.3, 0.2], atol=0.01)


def test_wrong_names_are_counted_and_cost_nothing() -> None:
    """A tenth of the sightings, to four sigma of a binomial; almost none where there are none."""
    count = len(sighted(WRONG).landmark_id)
    assert abs(figures(WRONG).tracks.impossible - 0.1) < 4 * np.sqrt(0.1 * 0.9 / count)
    assert figures(CLEAN).tracks.impossible < 1e-3


def test_detection_comes_back_from_landmarks_in_view() -> None:
    """Four of five that are in view are seen again in the next image."""
    seen = figures(CLEAN).tracks
    assert seen.seen_next == pytest.approx(CLEAN.detection, abs=4 * np.sqrt(0.16 / 7000))
    assert seen.lost < 0.03


def test_gaussian_noise_is_called_gaussian() -> None:
    """Kurtosis 3, no more than 0.27 % beyond 3 sigma, no memory, and all measures of it agree."""
    noise = figures(CLEAN).noise
    assert np.all(np.abs(noise.kurtosis - 3) < 0.2)
    assert np.all(noise.beyond_3_sigma < 0.006)
    assert np.all(np.abs(noise.lag_correlation) < 0.1)
    assert noise.tails > 50
    for other in (noise.step_px, noise.rms_px, noise.core_px[:, 0]):
        np.testing.assert_allclose(noise.sigma_px, other, rtol=0.06)


def test_heavy_tails_are_seen_and_do_not_open_the_gate() -> None:
    """Student's t of 3 degrees of freedom is told, if a little lighter for what the gate cuts."""
    scale_px = 0.3
    sightings = sighted(replace(CLEAN, sigma_px=(1e-9, 1e-9, 1e-9)))
    rng = stream(5, "tails")
    shape = sightings.stereo_px.shape
    wide = np.sqrt(3.0 / rng.chisquare(3.0, shape[0]))[:, None]
    noisy = sightings.stereo_px + scale_px * wide * rng.standard_normal(shape)
    fit = fit_noise(
        Tracks.of(replace(sightings, stereo_px=noisy)), camera_path(true_path()), STEREO
    )
    assert 2.4 < fit.tails < 5.0
    np.testing.assert_allclose(np.sqrt(fit.variance_px2[:3]), scale_px, rtol=0.08)


def test_a_shaken_truth_is_settled() -> None:
    """Errors of the true poses, white from image to image, do not stay in the noise."""
    rng = stream(3, "shaken")
    shake = SE3.exp(rng.normal(0.0, [0.01] * 3 + [0.002] * 3, (IMAGES, 6)))
    shaken = CameraPath.from_se3(shake @ camera_path(true_path()).T_camera_world)
    tracks = Tracks.of(sighted(CLEAN))
    raw, settled = (fit_noise(tracks, shaken, STEREO, settle) for settle in (False, True))
    assert np.all(raw.sigma_px[:3] > 2 * np.array(CLEAN.sigma_px))
    np.testing.assert_allclose(settled.sigma_px[:3], CLEAN.sigma_px, rtol=0.06)


def test_noise_that_hurts_as_much_is_the_noise_itself_where_it_is_gaussian() -> None:
    """Declared rightly, in three dimensions; an outlier beyond the gate adds nothing."""
    px = stream(1, "equivalent").standard_normal((200_000, 3)) * [0.3, 0.3, 0.3]
    declared = np.full(len(px), 0.3)
    np.testing.assert_allclose(equivalent_sigma_px(px, declared), 0.3, rtol=0.01)
    px[::1000] = 50.0
    np.testing.assert_allclose(equivalent_sigma_px(px, declared), 0.3, rtol=0.01)


def test_the_derivative_of_a_sighting_is_that_of_its_prediction() -> None:
    """By central differences, for near and far points."""
    rng = stream(2, "derivative")
    camera = np.array([804.0, 0.15, 511.5, 511.5])
    moved = SE3.exp(rng.normal(0.0, 0.05, 6))
    for disparity_px in (60.0, 5.0, 1.0):
        q = np.array([600.0, 450.0, disparity_px])

        def sighting(at: Array) -> Array:
            px, H = np.empty(3), np.empty((3, 3))
            predict(at, moved.rotation, moved.translation, camera, px, H)
            return px

        H = np.empty((3, 3))
        predict(q, moved.rotation, moved.translation, camera, np.empty(3), H)
        assert_jacobian(sighting, q, H, tolerance=1e-5)


def test_too_few_landmarks_are_refused_in_words() -> None:
    """One image gives nothing twice; no sightings give nothing at all; image 500 is not there."""
    with pytest.raises(RecordingError, match="0 landmarks are seen more than once"):
        figures_of = sighted(CLEAN, images=1)
        fit_noise(Tracks.of(figures_of), camera_path(true_path(1)), STEREO)
    nothing = np.zeros(0, np.int64)
    empty = SightingStream(
        np.zeros(1, np.int64), np.zeros(2, np.int64), nothing, np.zeros((0, 3)), np.zeros(0)
    )
    with pytest.raises(RecordingError, match="no sightings"):
        Tracks.of(empty)
    with pytest.raises(RecordingError, match="from 0 to 119"):
        since(sighted(CLEAN), 500)


def test_the_first_images_can_be_left_out() -> None:
    """What is left are the rows of the others."""
    whole = sighted(CLEAN)
    late = since(whole, 100)
    assert len(late) == 20
    np.testing.assert_array_equal(late.stereo_px, whole.stereo_px[whole.offsets[100] :])
