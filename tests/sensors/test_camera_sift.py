"""What SIFT makes of rendered ground, against the four real images of data/mars_images."""

from __future__ import annotations

import math
from typing import NamedTuple

import cv2
import numpy as np
import pytest

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.rng import stream
from lpet_sim.sensors.camera import StereoRenderer
from lpet_sim.sensors.camera_spec import StereoCameraSpec
from lpet_sim.sensors.image_chain import expose
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.terrain import build_terrain

FEWEST, MOST = 1_240, 5_071
"""Keypoints of the real images at OpenCV's defaults."""

PITCH = math.radians(18.0)
MAST = SE3(
    np.array(
        [
            [0.0, -math.sin(PITCH), math.cos(PITCH)],
            [-1.0, 0.0, 0.0],
            [0.0, -math.cos(PITCH), -math.sin(PITCH)],
        ]
    ),
    np.array([0.3, 0.075, 2.0]),
)


class View(NamedTuple):
    """A pair at one place, the left image 20 cm on, and the truth between them."""

    left: np.ndarray
    right: np.ndarray
    later: np.ndarray
    depth: np.ndarray
    T_later_first: SE3
    calibration: StereoCalibration


@pytest.fixture(scope="module")
def view() -> View:
    """Render the exomars preset with the default camera and image chain."""
    terrain, spec = build_terrain(load_terrain_spec("exomars"), seed=3), StereoCameraSpec()
    z = terrain.height(np.array([[0.0, 0.0], [0.2, 0.0]]))
    first, later = (
        SE3(np.eye(3), np.array([x, 0.0, h])) for x, h in zip((0.0, 0.2), z, strict=True)
    )
    with StereoRenderer(terrain, spec, MAST) as renderer:
        clean = [*renderer.render(first), renderer.render(later)[0]]
        depth = renderer.depth(first)
    images = [
        expose(image, spec.chain, spec.focal_px, stream(3, "image", k))
        for k, image in enumerate(clean)
    ]
    between = (later @ MAST).inverse() @ (first @ MAST)
    return View(*images, depth, between, spec.true_calibration(MAST))


def sift(image: np.ndarray, precise: bool = False) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Give keypoints [px], octaves and descriptors at OpenCV's defaults.

    By default OpenCV's keypoints lie a quarter of a pixel off in u and v; on sloping ground that
    shows as a disparity error, so that the precise upscaling is for measuring.
    """
    detector = cv2.SIFT_create(enable_precise_upscale=precise)
    keypoints, descriptors = detector.detectAndCompute(image, None)
    octaves = (np.array([k.octave & 255 for k in keypoints]) + 128) % 256 - 128
    return np.array([k.pt for k in keypoints]), octaves, descriptors


def at(depth: np.ndarray, px: np.ndarray) -> np.ndarray:
    """Read the depth at keypoints."""
    return depth[np.rint(px[:, 1]).astype(int), np.rint(px[:, 0]).astype(int)]


def test_sift_finds_as_many_points_as_in_real_images_over_the_same_octaves(view: View) -> None:
    """The count is in the real range, and the shares of octaves are near the real ones.

    Real images: 59-82 % in octave -1, 15-27 % in octave 0, 2-9 % in octave 1.
    """
    _, octaves, _ = sift(view.left)
    assert FEWEST <= len(octaves) <= MOST
    shares = [np.mean(octaves == octave) for octave in (-1, 0, 1)]
    assert 0.55 < shares[0] < 0.85
    assert 0.12 < shares[1] < 0.30
    assert 0.01 < shares[2] < 0.12


def test_most_points_are_found_again_20_cm_on(view: View) -> None:
    """Of the keypoints still in view at least 60 % are matched to the right place, few wrongly."""
    here, _, first = sift(view.left)
    there, _, second = sift(view.later)
    z = at(view.depth, here).astype(float)
    seen = np.isfinite(z)
    c = view.calibration
    rays = np.column_stack([(here - [c.cx_px, c.cy_px]) / c.focal_px, np.ones(len(here))])
    p = view.T_later_first @ (rays * np.where(seen, z, 1.0)[:, None])
    expected = c.project(p)[:, [0, 2]]
    seen &= np.all((expected > 5) & (expected < 1018), axis=1)
    pairs = cv2.BFMatcher().knnMatch(first, second, k=2)
    kept = [(a.queryIdx, a.trainIdx) for a, b in pairs if a.distance < 0.8 * b.distance]
    query, train = np.array([pair for pair in kept if seen[pair[0]]]).T
    right = np.linalg.norm(there[train] - expected[query], axis=1) < 2.0
    assert right.sum() / seen.sum() > 0.6
    assert right.mean() > 0.95


def test_disparities_have_no_bias(view: View) -> None:
    """Medians of the errors of disparity, near and far, and of rows are within 0.03 px."""
    left, _, first = sift(view.left, precise=True)
    right, _, second = sift(view.right, precise=True)
    matches = cv2.BFMatcher(crossCheck=True).match(first, second)
    query = np.array([match.queryIdx for match in matches])
    train = np.array([match.trainIdx for match in matches])
    z = at(view.depth, left[query])
    step = left[query] - right[train]
    error = step[:, 0] - view.calibration.focal_px * view.calibration.baseline_m / z
    fair = (np.abs(error) < 2.0) & (np.abs(step[:, 1]) < 2.0)
    assert fair.mean() > 0.9
    for low, high in ((0.0, 3.0), (3.0, 6.0), (6.0, 15.0)):
        ring = fair & (z > low) & (z < high)
        assert ring.sum() > 100
        assert abs(np.median(error[ring])) < 0.03
        assert abs(np.median(step[ring, 1])) < 0.03
