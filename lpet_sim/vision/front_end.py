"""The vision front end: image pairs in, landmark sightings out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream, StereoImages, concatenate_slices
from lpet_sim.vision.detect import Floats, SiftDetector
from lpet_sim.vision.gallery import Gallery
from lpet_sim.vision.spec import FrontEndSpec, RefineSpec
from lpet_sim.vision.stereo import StereoFeatures, match_stereo, refine_disparity, sorted_by_row
from lpet_sim.vision.temporal import align_with_templates, cut_templates, match_gallery

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Image = NDArray[Any]

_GRID_CELLS = 8
_COPRIME = 27


@dataclass(frozen=True)
class ImageSightings:
    """The sightings of one image pair.

    Attributes:
        landmark_id: Shape (n,), unique, ascending.
        stereo_px: (u_left, u_right, v) [px], Shape (n, 3).
        sigma_px: Declared noise of each image coordinate, 1 sigma [px], Shape (n,).
    """

    landmark_id: Ints
    stereo_px: Array
    sigma_px: Array


class FrontEnd:
    """SIFT, stereo matching and matching over time, one image pair after another."""

    def __init__(self, spec: FrontEndSpec, calibration: StereoCalibration) -> None:
        """Start without landmarks.

        Args:
            spec: Parameters.
            calibration: The declared pair.
        """
        self._spec = spec
        self._calibration = calibration
        self._detector = SiftDetector(spec.sift)
        self._next_id = 0
        self._gallery = self._new(0)

    @property
    def drift_px(self) -> float:
        """The declared random walk of tracks with the distance driven [px/sqrt(m)]."""
        return self._spec.refine.drift_px

    def track(self, left: Image, right: Image) -> ImageSightings:
        """Find the landmarks of the next image pair.

        Args:
            left: Left grey image, Shape (h, w), uint8 or uint16.
            right: Right grey image, likewise.
        """
        spec = self._spec
        eye_left, eye_right = map(sorted_by_row, self._detector.detect_pair(left, right))
        features = match_stereo(eye_left, eye_right, self._calibration, spec.stereo)
        aged = self._gallery.aged(spec.temporal.time_to_live)
        gallery, match = match_gallery(aged, features, self._calibration, spec.temporal)
        seen = self._named(gallery, match, features)
        chosen = self._chosen(seen)
        eyes = left.astype(np.float32), right.astype(np.float32)
        refined, sigma_px = refine(seen.take(chosen), *eyes, spec.refine)
        others = seen.take(np.setdiff1d(np.arange(len(seen)), chosen))
        self._gallery = gallery.take(match < 0).joined(others).joined(refined)
        return self._report(refined, sigma_px)

    def _named(self, gallery: Gallery, match: Ints, features: StereoFeatures) -> Gallery:
        """Give every feature of this image its landmark: one that is known, or a new one."""
        known = gallery.take(match >= 0)
        rows_new = np.setdiff1d(np.arange(len(features)), match)
        rows = np.concatenate([match[match >= 0], rows_new])
        named = known.joined(self._new(len(rows_new)))
        return replace(
            named,
            stereo_px=features.stereo_px[rows],
            size_px=features.left.size_px[rows],
            descriptor=features.left.descriptor[rows],
            unseen=np.zeros(len(rows), np.int64),
        )

    def _new(self, count: int) -> Gallery:
        """Make landmarks that have nothing yet but an id."""
        ids = self._next_id + np.arange(count)
        self._next_id += count
        return Gallery.blank(ids, 2 * self._spec.refine.half_width_px + 3)

    def _chosen(self, seen: Gallery) -> Ints:
        """Choose who is refined and reported: spread over the image, the longest known first."""
        order = spread(seen, self._calibration)
        return order[: self._spec.sightings_max] if self._spec.sightings_max > 0 else order

    def _report(self, refined: Gallery, sigma_px: Array) -> ImageSightings:
        disparity = refined.stereo_px[:, 0] - refined.stereo_px[:, 1]
        rows = np.flatnonzero(disparity >= self._spec.stereo.disparity_min_px)
        rows = rows[np.argsort(refined.landmark_id[rows])]
        return ImageSightings(refined.landmark_id[rows], refined.stereo_px[rows], sigma_px[rows])


def refine(seen: Gallery, left: Floats, right: Floats, spec: RefineSpec) -> tuple[Gallery, Array]:
    """Refine landmarks that are seen: by their templates in the left eye, then in the right eye.

    A landmark without a template, or whose template fits no more, gets a new one at the keypoint.

    Args:
        seen: The landmarks, ``stereo_px`` at their keypoints.
        left: Left image, Shape (h, w), float32.
        right: Right image, likewise.
        spec: Parameters.

    Returns:
        The landmarks with refined coordinates and up-to-date templates, and the noise declared for
        these coordinates, 1 sigma [px], Shape (n,).
    """
    px = seen.stereo_px.copy()
    uv, sigma_uv, keep = align_with_templates(seen, left, px, spec)
    px[:, 1] += uv[:, 0] - px[:, 0]
    px[:, [0, 2]] = uv
    px[:, 1], sigma_right = refine_disparity(left, right, px, spec)
    cut = cut_templates(left, uv, spec.half_width_px + 1)
    refined = replace(
        seen,
        stereo_px=px,
        template=np.where(keep[:, None, None], seen.template, cut),
        template_disparity_px=np.where(keep, seen.template_disparity_px, px[:, 0] - px[:, 1]),
        reported=seen.reported + 1,
    )
    sigma_px = np.hypot(np.maximum(sigma_uv, sigma_right), spec.sigma_floor_px)
    return refined, np.minimum(sigma_px, spec.sigma_keypoint_px)


def spread(seen: Gallery, calibration: StereoCalibration) -> Ints:
    """Order landmarks so that any head of the list is spread over the image.

    Every cell of a grid gives its longest known landmark first, then its second, and so on.
    """
    shape = np.array([calibration.width_px, calibration.height_px])
    cell = (seen.stereo_px[:, [0, 2]] * _GRID_CELLS / shape).astype(np.int64)
    key = cell[:, 1] * _GRID_CELLS + cell[:, 0]
    by_cell = np.lexsort((seen.landmark_id, -seen.reported, key))
    starts = np.searchsorted(key[by_cell], key[by_cell])
    rank = np.empty(len(key), np.int64)
    rank[by_cell] = np.arange(len(key)) - starts
    # Cells take turns in an order that jumps about the image, for a list shorter than the grid.
    turn = key * _COPRIME % _GRID_CELLS**2
    return np.lexsort((seen.landmark_id, turn, -seen.reported, rank))


def sight(
    images: StereoImages,
    spec: FrontEndSpec,
    calibration: StereoCalibration,
    progress: Progress = silent,
) -> SightingStream:
    """Run the front end over all image pairs of a recording.

    Args:
        images: The pairs, read one at a time.
        spec: Parameters.
        calibration: The declared pair.
        progress: Called with the fraction done after each pair.
    """
    front_end = FrontEnd(spec, calibration)
    parts: list[ImageSightings] = []
    for index in track(range(len(images)), len(images), progress):
        parts.append(front_end.track(*images.pair(index)))
    return SightingStream(
        images.t_ns.copy(),
        concatenate_slices([part.landmark_id for part in parts]),
        np.concatenate([np.zeros(0, np.int64), *(part.landmark_id for part in parts)]),
        np.concatenate([np.zeros((0, 3)), *(part.stereo_px for part in parts)]),
        np.concatenate([np.zeros(0), *(part.sigma_px for part in parts)]),
        np.full(len(parts), spec.refine.drift_px),
    )
