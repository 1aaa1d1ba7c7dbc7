"""The compiled kernels against plain versions, and the common motion under false matches."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.geometry import SE3
from lpet_sim.rng import stream
from lpet_sim.vision.align import align
from lpet_sim.vision.matching import mutual_matches
from lpet_sim.vision.motion_gate import fit_motion, predict
from lpet_sim.vision.temporal import cut_templates
from tests.vision.synthetic import Texture, camera

EVERYWHERE = np.array([-1e4, 1e4, -1e4, 1e4])


def features(seed: int, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw positions sorted by v, sizes and unit descriptors."""
    rng = stream(seed, "features")
    uv = rng.uniform(0, 300, (n, 2)).astype(np.float32)
    descriptor = rng.random((n, 128)).astype(np.float32)
    descriptor /= np.linalg.norm(descriptor, axis=1, keepdims=True)
    return uv[np.argsort(uv[:, 1])], np.full(n, 3.0, np.float32), descriptor


def test_without_geometry_matching_is_mutual_nearest_neighbour_search() -> None:
    """An open window and a ratio of 1 leave what a full distance matrix says."""
    uv_a, size_a, a = features(1, 60)
    uv_b, size_b, b = features(2, 80)
    found = mutual_matches(uv_a, size_a, a, uv_b, size_b, b, EVERYWHERE, 2.0, 1.0, 10.0)
    distance = np.linalg.norm(a[:, None] - b[None], axis=2)
    nearest = distance.argmin(axis=1)
    mutual = distance.argmin(axis=0)[nearest] == np.arange(60)
    np.testing.assert_array_equal(found, np.where(mutual, nearest, -1))


def test_matches_stay_in_the_window_and_within_the_sizes() -> None:
    """No match leaves the window; another size leaves none."""
    uv_a, size_a, a = features(1, 200)
    uv_b, size_b, b = features(2, 200)
    window = np.array([-40.0, 10.0, -5.0, 5.0])
    found = mutual_matches(uv_a, size_a, a, uv_b, size_b, b, window, 1.5, 1.0, 10.0)
    moved = uv_b[found[found >= 0]] - uv_a[found >= 0]
    assert len(moved) > 20
    assert np.all((moved >= window[[0, 2]]) & (moved <= window[[1, 3]]))
    other = mutual_matches(uv_a, size_a, a, uv_b, 2 * size_b, b, window, 1.5, 1.0, 10.0)
    assert np.all(other == -1)


def test_the_second_best_must_be_further_by_the_ratio() -> None:
    """Two look-alikes at different places leave no match; at one place they do."""
    _, _, d = features(3, 2)
    one, size = d[:1], np.full(2, 3.0, np.float32)
    alike = np.concatenate([one - np.float32(1e-3), one + np.float32(1e-3)])
    near = np.array([[10.0, 10.0], [10.5, 10.5]], np.float32)
    apart = np.array([[10.0, 10.0], [50.0, 10.5]], np.float32)
    at = np.array([[10.0, 10.0]], np.float32)
    rest = (EVERYWHERE, 2.0, 0.8, 10.0)
    assert mutual_matches(at, size[:1], one, apart, size, alike, *rest)[0] == -1
    assert mutual_matches(at, size[:1], one, near, size, alike, *rest)[0] == 0


@pytest.mark.parametrize("shift", [(0.25, -0.4), (0.5, 0.5), (-0.9, 0.1)])
def test_alignment_finds_a_sub_pixel_shift(shift: tuple[float, float]) -> None:
    """Templates of a texture are found in its shifted copy without bias."""
    texture, rng = Texture(8), stream(8, "places")
    before = texture.shifted(0.0).astype(np.float32)
    after = texture.shifted(*shift).astype(np.float32)
    active, eye, error = np.array([0, 3]), np.eye(2), []
    for u, v in rng.uniform(20, 210, (80, 2)):
        template = cut_templates(before, np.array([[u, v]]), 6)[0]
        at_u, at_v, correlation, _ = align(template, after, u, v, eye, active, 12, 2.0)
        if correlation > 0.9:
            error.append((at_u - u - shift[0], at_v - v - shift[1]))
    assert len(error) > 70
    assert np.abs(np.median(error, axis=0)).max() < 0.01
    assert np.median(np.abs(error)) < 0.03


def test_alignment_that_slides_away_or_leaves_the_image_fails() -> None:
    """It says so by a correlation of -1, and gives the first guess back."""
    picture = Texture(9).shifted(0.0).astype(np.float32)
    template = cut_templates(picture, np.array([[60.0, 60.0]]), 6)[0]
    for u, v in ((2.0, 60.0), (60.0, 238.0)):
        found = align(template, picture, u, v, np.eye(2), np.array([0, 3]), 12, 1.0)
        assert found[:3] == (u, v, -1.0)


def test_the_common_motion_survives_a_third_of_false_matches() -> None:
    """It predicts the sound ones within a hundredth of a pixel."""
    rng, T = stream(4, "motion"), SE3.exp(np.array([0.05, -0.02, -0.4, 0.02, -0.05, 0.03]))
    p = rng.uniform([-2.0, -1.0, 2.0], [2.0, 1.0, 9.0], (150, 3))
    before, after = camera().project(p), camera().project(T @ p)
    false = rng.random(150) < 0.33
    after[false] += rng.uniform(-40, 40, (int(false.sum()), 3))
    found, ahead = predict(camera(), fit_motion(camera(), before, after), before)
    assert ahead.all()
    assert np.abs(found - after)[~false].max() < 0.01
