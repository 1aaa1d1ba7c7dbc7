"""The hundred metres are what they are said to be: path, landmarks in view, noise and slip."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.sensors.s_curve import SCurveRun, SCurveSpec, ground_m, s_curve_poses, s_curve_run

SPEC = SCurveSpec()


@pytest.fixture(scope="module")
def run() -> SCurveRun:
    """Give the run of one seed."""
    return s_curve_run(SPEC, 1)


def exact_px(run: SCurveRun) -> Array:
    """Give where each sighting would be without noise, by the plain pinhole."""
    camera = (run.poses @ SPEC.stereo.T_body_camera.se3()).inverse()
    image = np.repeat(np.arange(len(run.poses)), np.diff(run.sightings.offsets))
    return SPEC.stereo.project(camera[image] @ run.p_world_landmark[run.sightings.landmark_id])


def test_the_path_is_a_hundred_metres_on_the_ground(run: SCurveRun) -> None:
    """501 poses 0.2 m apart, wheels on the ground, its normal along the body's z."""
    assert run.truth.trajectory.arc_length_m[-1] == pytest.approx(100.0, rel=0.005)
    x, y, z = run.poses.translation.T
    np.testing.assert_allclose(z, ground_m(x, y))
    step = 1e-4
    slope = [(ground_m(x + step, y) - ground_m(x - step, y)) / (2 * step),
             (ground_m(x, y + step) - ground_m(x, y - step)) / (2 * step)]  # fmt: skip
    normal = np.stack([-slope[0], -slope[1], np.ones_like(x)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    np.testing.assert_allclose(run.poses.rotation[:, :, 2], normal, atol=1e-3)


def test_about_eighty_landmarks_are_sighted_in_range(run: SCurveRun) -> None:
    """The mean over the images of some seeds, the limits of range, and the ground."""
    counts = [np.diff(s_curve_run(SPEC, seed).sightings.offsets).mean() for seed in range(1, 6)]
    assert np.mean(counts) == pytest.approx(80.0, rel=0.05)
    camera = (run.poses @ SPEC.stereo.T_body_camera.se3()).inverse()
    image = np.repeat(np.arange(len(run.poses)), np.diff(run.sightings.offsets))
    p = camera[image] @ run.p_world_landmark[run.sightings.landmark_id]
    distance = np.linalg.norm(p, axis=1)
    assert SPEC.range_min_m < distance.min() and distance.max() < SPEC.range_max_m
    x, y, z = run.p_world_landmark.T
    np.testing.assert_array_equal(z, ground_m(x, y))


def test_sightings_have_white_noise_of_half_a_pixel(run: SCurveRun) -> None:
    """Variance within its scatter in each coordinate, and no correlation between them."""
    noise = (run.sightings.stereo_px - exact_px(run)) / SPEC.sigma_px
    n = len(noise)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    assert np.all((low < noise.var(axis=0)) & (noise.var(axis=0) < high))
    assert np.abs(np.corrcoef(noise.T) - np.eye(3)).max() < 4 / np.sqrt(n)
    assert np.abs(noise.mean(axis=0)).max() < 4 / np.sqrt(n)


def test_odometry_has_scale_white_noise_and_one_slip() -> None:
    """Over seeds: the scale's scatter, each part's noise by its declared variance, one step off."""
    short = SCurveSpec(images=101)
    true = (s_curve_poses(short)[:-1].inverse() @ s_curve_poses(short)[1:]).log()
    scales, slips, squares = [], [], []
    for seed in range(60):
        odometry = s_curve_run(replace_landmarks(short), seed).odometry
        assert np.all(odometry.twist[0] == 0)
        d = (SE3.exp(true).inverse() @ SE3.exp(odometry.twist[1:])).log()
        along = d[:, 0] / true[:, 0]
        scales.append(np.median(along))
        slipped = int(np.argmax(along))
        slips.append(d[slipped, 0] - scales[-1] * true[slipped, 0])
        squares.append(np.delete(d[:, 1:] ** 2 / odometry.variance[1:, 1:], slipped, axis=0))
    assert np.std(scales) == pytest.approx(short.scale_sigma, rel=0.3)
    assert np.mean(slips) == pytest.approx(short.slip_m, abs=0.005)
    np.testing.assert_allclose(np.concatenate(squares).mean(axis=0), 1.0, atol=0.1)


def replace_landmarks(spec: SCurveSpec) -> SCurveSpec:
    """Thin the landmarks out where only the odometry is looked at."""
    return spec.model_copy(update={"landmarks_per_m2": 0.01})


def test_a_seed_gives_the_same_run_and_another_seed_another(run: SCurveRun) -> None:
    """To the bit; and what the odometry draws does not hang on the landmarks."""
    again, other = s_curve_run(SPEC, 1), s_curve_run(SPEC, 2)
    assert again.sightings.equals(run.sightings) and again.odometry.equals(run.odometry)
    assert not other.sightings.equals(run.sightings)
    assert not np.array_equal(other.odometry.twist, run.odometry.twist)
    thinned = s_curve_run(replace_landmarks(SPEC), 1)
    assert thinned.odometry.equals(run.odometry)
