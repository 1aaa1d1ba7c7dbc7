"""The front end as a whole: identities over time, sub-pixel tracks, and images with nothing."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.recording.streams import ImagesInMemory
from lpet_sim.vision.front_end import FrontEnd, sight
from lpet_sim.vision.spec import FrontEndSpec, TemporalMatchSpec
from tests.vision.synthetic import Image, Texture, camera, to_uint8

DISPARITY_PX = 9.0


def pan(count: int, step_px: float = 1.3, seed: int = 7) -> list[tuple[Image, Image]]:
    """Make pairs of a far plane that moves left by ``step_px`` from image to image."""
    texture = Texture(seed)
    return [
        (to_uint8(texture.shifted(-k * step_px)), to_uint8(texture.shifted(-k * step_px - 9.0)))
        for k in range(count)
    ]


def test_tracks_follow_a_sub_pixel_motion_without_drift() -> None:
    """After 8 steps of 1.3 px the landmarks of the first image have moved by 10.4 px."""
    front_end = FrontEnd(FrontEndSpec(), camera())
    seen = [front_end.track(*pair) for pair in pan(9)]
    _, first, last = np.intersect1d(seen[0].landmark_id, seen[-1].landmark_id, return_indices=True)
    moved = seen[-1].stereo_px[last] - seen[0].stereo_px[first]
    assert len(first) > 40
    assert np.abs(np.median(moved, axis=0) - [-10.4, -10.4, 0.0]).max() < 0.03
    assert np.median(np.abs(moved[:, 0] + 10.4)) < 0.06


@pytest.mark.parametrize("gap", [1, 4])
def test_a_landmark_that_is_covered_comes_back_under_its_name(gap: int) -> None:
    """A blind patch over some images does not end the tracks under it."""
    pairs = pan(3 + gap)
    for left, right in pairs[2 : 2 + gap]:
        left[60:180, 100:220] = right[60:180, 100:220] = 128
    front_end = FrontEnd(FrontEndSpec(), camera())
    seen = [front_end.track(*pair) for pair in pairs]
    u, _, v = seen[1].stereo_px.T
    under = seen[1].landmark_id[(u > 125) & (u < 200) & (v > 70) & (v < 170)]
    assert len(under) > 8
    assert np.isin(under, seen[2].landmark_id).sum() == 0
    assert np.isin(under, seen[-1].landmark_id).mean() > 0.5


def test_a_landmark_is_forgotten_when_its_time_to_live_is_over() -> None:
    """With a time to live of 2 a gap of 4 images ends the tracks."""
    pairs = pan(7)
    blank = np.full((240, 320), 128, np.uint8)
    pairs[2:6] = [(blank, blank)] * 4
    front_end = FrontEnd(FrontEndSpec(temporal=TemporalMatchSpec(time_to_live=2)), camera())
    seen = [front_end.track(*pair) for pair in pairs]
    assert len(seen[1].landmark_id) > 40
    assert np.isin(seen[1].landmark_id, seen[-1].landmark_id).sum() == 0


@pytest.mark.parametrize("value", [0, 77])
def test_images_with_nothing_in_them_give_no_sightings(value: int) -> None:
    """Empty images are no error, before and after images with something."""
    blank = np.full((240, 320), value, np.uint8)
    front_end = FrontEnd(FrontEndSpec(), camera())
    assert len(front_end.track(blank, blank).landmark_id) == 0
    assert len(front_end.track(*pan(1)[0]).landmark_id) > 40
    assert front_end.track(blank, blank).stereo_px.shape == (0, 3)


def test_twelve_bit_images_give_what_eight_bit_images_give() -> None:
    """The same picture in 12 bit has nearly the same landmarks."""
    left, right = pan(1)[0]
    eight = FrontEnd(FrontEndSpec(), camera()).track(left, right)
    twelve = FrontEnd(FrontEndSpec(), camera()).track(
        left.astype(np.uint16) * 16, right.astype(np.uint16) * 16
    )
    assert abs(len(twelve.landmark_id) - len(eight.landmark_id)) < 0.1 * len(eight.landmark_id)


def test_a_cap_keeps_sightings_spread_over_the_image() -> None:
    """With a cap of 40 every quarter of the image has its share."""
    front_end = FrontEnd(FrontEndSpec(sightings_max=40), camera())
    px = front_end.track(*pan(1)[0]).stereo_px
    assert len(px) == 40
    quarter = 2 * (px[:, 2] > 120) + (px[:, 0] > 160)
    assert np.bincount(quarter.astype(int), minlength=4).min() >= 5


def test_a_stream_has_unique_ids_and_is_the_same_twice() -> None:
    """Sighting a recording is deterministic to the bit, and an id stands once in an image."""
    pairs = pan(4)
    images = ImagesInMemory(
        np.arange(4) * 100, np.stack([p[0] for p in pairs]), np.stack([p[1] for p in pairs])
    )
    first, second = (sight(images, FrontEndSpec(), camera()) for _ in range(2))
    assert first.equals(second)
    for k in range(4):
        ids = first.landmark_id[first.rows(k)]
        assert len(np.unique(ids)) == len(ids) > 40
