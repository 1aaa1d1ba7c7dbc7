"""Stereo matching against disparities that are known exactly."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lpet_sim.rng import stream
from lpet_sim.vision.detect import SiftDetector
from lpet_sim.vision.spec import FrontEndSpec
from lpet_sim.vision.stereo import StereoFeatures, match_stereo, refine_disparity, sorted_by_row
from tests.vision.synthetic import Texture, camera, to_uint8

SPEC = FrontEndSpec()


def matched(left: NDArray[np.uint8], right: NDArray[np.uint8]) -> StereoFeatures:
    """Detect and match a pair at default settings."""
    eye_left, eye_right = map(sorted_by_row, SiftDetector(SPEC.sift).detect_pair(left, right))
    return match_stereo(eye_left, eye_right, camera(), SPEC.stereo)


@pytest.mark.parametrize("disparity_px", [5.1, 12.35, 20.5])
def test_refined_disparities_are_unbiased_and_better_than_a_twentieth_of_a_pixel(
    disparity_px: float,
) -> None:
    """A sub-pixel shift by Fourier phase is found again under noise, better than by SIFT."""
    texture, noise = Texture(1), stream(1, "noise").normal(0.0, 3.0, (2, 240, 320))
    left = to_uint8(texture.shifted(0.0) + noise[0])
    right = to_uint8(0.9 * texture.shifted(-disparity_px) + noise[1])
    found = matched(left, right)
    u_right, sigma_px = refine_disparity(
        left.astype(np.float32), right.astype(np.float32), found.stereo_px, SPEC.refine
    )
    aligned = np.isfinite(sigma_px)
    error = (found.stereo_px[:, 0] - u_right - disparity_px)[aligned]
    bare = (found.stereo_px[:, 0] - found.stereo_px[:, 1] - disparity_px)[aligned]
    assert aligned.sum() > 60
    assert abs(np.median(error)) < 0.02
    assert np.median(np.abs(error)) < 0.05
    assert np.median(np.abs(error)) < np.median(np.abs(bare))


def test_a_slanted_ground_does_not_bias_the_disparity() -> None:
    """Rows that shift by 0.1 px each, as on ground before a rover, keep their own disparity."""
    texture = Texture(2)
    left = texture.shifted(0.0)
    disparity = 6.0 + 0.1 * np.arange(240)
    right = np.stack([texture.shifted(-d)[row] for row, d in enumerate(disparity)])
    found = matched(to_uint8(left), to_uint8(right))
    u_right, sigma_px = refine_disparity(
        left.astype(np.float32), right.astype(np.float32), found.stereo_px, SPEC.refine
    )
    truth = np.interp(found.stereo_px[:, 2], np.arange(240), disparity)
    error = (found.stereo_px[:, 0] - u_right - truth)[np.isfinite(sigma_px)]
    assert len(error) > 50
    assert abs(np.median(error)) < 0.03
    assert np.median(np.abs(error)) < 0.06


def test_what_only_the_left_eye_sees_is_not_matched() -> None:
    """Where the right image is covered by other texture, no match stands."""
    texture, cover = Texture(3), Texture(4)
    left, right = texture.shifted(0.0), texture.shifted(-10.0)
    right[60:180, 100:200] = cover.shifted(0.0)[60:180, 100:200]
    found = matched(to_uint8(left), to_uint8(right)).stereo_px
    hidden = (found[:, 2] > 68) & (found[:, 2] < 172) & (found[:, 0] > 118) & (found[:, 0] < 202)
    wrong = hidden & (np.abs(found[:, 0] - found[:, 1] - 10.0) > 1.5)
    assert len(found) > 60
    assert wrong.sum() <= 3


def test_matches_keep_to_the_epipolar_band_and_to_positive_disparity() -> None:
    """Moved down by 4 px, or to the wrong side, one match in a hundred is left."""
    texture = Texture(5)
    left = to_uint8(texture.shifted(0.0))
    sound = len(matched(left, to_uint8(texture.shifted(-8.0))))
    assert sound > 1000
    assert len(matched(left, to_uint8(texture.shifted(-8.0, 4.0)))) < 0.01 * sound
    assert len(matched(left, to_uint8(texture.shifted(8.0)))) < 0.01 * sound


def test_one_place_is_sighted_once() -> None:
    """SIFT gives one keypoint for each orientation; they stand at the same place."""
    texture = Texture(6)
    found = matched(to_uint8(texture.shifted(0.0)), to_uint8(texture.shifted(-7.0)))
    assert len(np.unique(found.left.uv_px, axis=0)) == len(found)
