"""SIFT and matching against OpenCV's own, on the same images and descriptors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import Row, Samples, compare_ms, in_turn
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.vision.detect import Features, SiftDetector
from lpet_sim.vision.front_end import FrontEnd, ImageSightings
from lpet_sim.vision.gallery import Gallery
from lpet_sim.vision.spec import FrontEndSpec
from lpet_sim.vision.stereo import match_stereo, sorted_by_row
from lpet_sim.vision.temporal import match_gallery

Pair = tuple[NDArray[Any], NDArray[Any]]

_SIFT = "OpenCV one image after the other; LPET both eyes at once, root descriptors, as arrays"
_MATCH = (
    "BFMatcher.knnMatch (k = 2) of left with right, and of remembered landmarks with the left; "
    "LPET looks in windows, checks both ways and fits a common motion"
)
_WHOLE = "against SIFT and knnMatch; LPET also aligns patches to a tenth of a pixel, keeps tracks"


@dataclass(frozen=True)
class VisionResult:
    """What was measured of the front end.

    Attributes:
        rows: For the table.
        sightings: What it saw in each pair, for the store's benchmark.
        bare: Times of OpenCV's detection and matching for a pair.
    """

    rows: list[Row]
    sightings: list[ImageSightings]
    bare: Samples


@dataclass(frozen=True)
class _Scene:
    """A pair's features, and the landmarks remembered when it came."""

    left: Features
    right: Features
    remembered: Gallery


def measure(pairs: Sequence[Pair], calibration: StereoCalibration) -> VisionResult:
    """Time detection, matching and the whole front end along a drive's image pairs."""
    spec = FrontEndSpec()
    detector, sift = SiftDetector(spec.sift), _opencv_sift(spec)
    found: list[tuple[Features, Features]] = []
    ours, bare = in_turn(
        pairs,
        lambda pair: found.append(detector.detect_pair(*pair)),
        lambda pair: [sift.detectAndCompute(image, None) for image in pair],
    )
    rows = [compare_ms("SIFT of a pair", ours, bare, note=_SIFT)]
    scenes, whole, sightings = _track(pairs, found, spec, calibration)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    mine, theirs = in_turn(
        scenes,
        lambda scene: _match(scene, spec, calibration),
        lambda scene: _match_bare(matcher, scene),
    )
    rows.append(compare_ms("matching, stereo and over time", mine, theirs, note=_MATCH))
    parts = _sum(bare, theirs)
    rows.append(compare_ms("whole front end of a pair", whole, parts, note=_WHOLE))
    return VisionResult(rows, sightings, parts)


def _opencv_sift(spec: FrontEndSpec) -> Any:
    return cv2.SIFT_create(
        nfeatures=spec.sift.keypoints_max,
        nOctaveLayers=spec.sift.octave_layers,
        contrastThreshold=spec.sift.contrast_threshold,
        edgeThreshold=spec.sift.edge_threshold,
        sigma=spec.sift.blur_sigma_px,
        enable_precise_upscale=True,
    )


def _track(
    pairs: Sequence[Pair],
    found: Sequence[tuple[Features, Features]],
    spec: FrontEndSpec,
    calibration: StereoCalibration,
) -> tuple[list[_Scene], Samples, list[ImageSightings]]:
    """Run the front end over all pairs, and keep what it remembered before each."""
    front_end, times = FrontEnd(spec, calibration), Samples()
    scenes, sightings = [], []
    for pair, (left, right) in zip(pairs, found, strict=True):
        remembered = front_end._gallery.aged(spec.temporal.time_to_live)
        scenes.append(_Scene(sorted_by_row(left), right, remembered))
        sightings.append(times.time(lambda pair=pair: front_end.track(*pair)))
    return scenes[2:], times.after(2), sightings


def _match(scene: _Scene, spec: FrontEndSpec, calibration: StereoCalibration) -> None:
    features = match_stereo(scene.left, scene.right, calibration, spec.stereo)
    match_gallery(scene.remembered, features, calibration, spec.temporal)


def _match_bare(matcher: Any, scene: _Scene) -> None:
    matcher.knnMatch(scene.left.descriptor, scene.right.descriptor, k=2)
    matcher.knnMatch(scene.remembered.descriptor, scene.left.descriptor, k=2)


def _sum(first: Samples, second: Samples) -> Samples:
    return Samples(
        [float(np.median(first.wall_s) + np.median(second.wall_s))],
        [float(np.median(first.cpu_s) + np.median(second.cpu_s))],
    )
