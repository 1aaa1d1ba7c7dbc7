"""The vision front end: image pairs in, landmark sightings out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream, StereoImages, concatenate_slices
from lpet_sim.vision.detect import SiftDetector
from lpet_sim.vision.gallery import Gallery
from lpet_sim.vision.spec import FrontEndSpec
from lpet_sim.vision.stereo import StereoFeatures, match_stereo, refine_disparity, sorted_by_row
from lpet_sim.vision.temporal import align_with_templates, cut_templates, match_gallery

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Image = NDArray[Any]

_GRID_CELLS = 8


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
        self._gallery = Gallery.empty(2 * spec.refine.half_width_px + 3)
        self._next_id = 0

    def track(self, left: Image, right: Image) -> ImageSightings:
        """Find the landmarks of the next image pair.

        Args:
            left: Left grey image, Shape (h, w), uint8 or uint16.
            right: Right grey image, likewise.
        """
        spec = self._spec
        eyes = map(sorted_by_row, self._detector.detect_pair(left, right))
        features = match_stereo(*eyes, self._calibration, spec.stereo)
        aged = self._gallery.aged(spec.temporal.time_to_live)
        gallery, match = match_gallery(aged, features, self._calibration, spec.temporal)
        seen, sigma_px = self._seen(gallery, match, features, np.float32(left), np.float32(right))
        self._gallery = gallery.take(match < 0).joined(seen)
        return self._chosen(seen, sigma_px)

    def _seen(
        self,
        gallery: Gallery,
        match: Ints,
        features: StereoFeatures,
        left: NDArray[np.float32],
        right: NDArray[np.float32],
    ) -> tuple[Gallery, Array]:
        """Refine what is seen: old landmarks by their templates, then all against the right eye."""
        refine = self._spec.refine
        known = gallery.take(match >= 0)
        rows = match[match >= 0]
        new = np.setdiff1d(np.arange(len(features)), rows)
        rows = np.concatenate([rows, new])
        px = features.stereo_px[rows]
        n, m = len(known), len(rows)
        kept = np.zeros(m, dtype=bool)
        sigma_uv = np.zeros(m)
        if refine.temporal:
            uv, sigma_uv[:n], kept[:n] = align_with_templates(known, left, px[:n], refine)
            px[:n, 1] += uv[:, 0] - px[:n, 0]
            px[:n, [0, 2]] = uv
        px[:, 1], sigma_right = refine_disparity(left, right, px, refine)
        template = cut_templates(left, px[:, [0, 2]], refine.half_width_px + 1)
        template[kept] = known.template[kept[:n]]
        disparity = px[:, 0] - px[:, 1]
        disparity[kept] = known.template_disparity_px[kept[:n]]
        fresh_ids = self._next_id + np.arange(m - n)
        self._next_id += m - n
        seen = Gallery(
            np.concatenate([known.landmark_id, fresh_ids]),
            px,
            features.left.size_px[rows],
            features.left.descriptor[rows],
            template,
            disparity,
            np.zeros(m, np.int64),
            np.concatenate([known.sightings, np.zeros(m - n, np.int64)]) + 1,
        )
        worst = np.maximum(sigma_uv, sigma_right)
        aligned = np.hypot(np.where(np.isfinite(worst), worst, 0.0), refine.sigma_floor_px)
        sigma = np.where(np.isfinite(worst), aligned, refine.sigma_keypoint_px)
        return seen, np.minimum(sigma, refine.sigma_keypoint_px)

    def _chosen(self, seen: Gallery, sigma_px: Array) -> ImageSightings:
        """Choose who is reported: spread over the image, the longest known first."""
        sound = seen.stereo_px[:, 0] - seen.stereo_px[:, 1] >= self._spec.stereo.disparity_min_px
        rows = np.flatnonzero(sound)
        if 0 < self._spec.sightings_max < len(rows):
            order = spread(seen.take(rows), self._calibration)
            rows = rows[order[: self._spec.sightings_max]]
        rows = rows[np.argsort(seen.landmark_id[rows])]
        return ImageSightings(seen.landmark_id[rows], seen.stereo_px[rows], sigma_px[rows])


def spread(seen: Gallery, calibration: StereoCalibration) -> Ints:
    """Order landmarks so that any head of the list is spread over the image.

    Every cell of a grid gives its longest known landmark first, then its second, and so on.
    """
    shape = np.array([calibration.width_px, calibration.height_px])
    cell = (seen.stereo_px[:, [0, 2]] * _GRID_CELLS / shape).astype(np.int64)
    key = cell[:, 1] * _GRID_CELLS + cell[:, 0]
    by_cell = np.lexsort((seen.landmark_id, -seen.sightings, key))
    starts = np.searchsorted(key[by_cell], key[by_cell])
    rank = np.empty(len(key), np.int64)
    rank[by_cell] = np.arange(len(key)) - starts
    return np.lexsort((seen.landmark_id, -seen.sightings, rank))


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
    )
