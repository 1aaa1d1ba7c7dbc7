"""Matching the left eye with the right in rectified images."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.vision.align import align, inside, sample
from lpet_sim.vision.detect import Features, Floats
from lpet_sim.vision.matching import mutual_matches
from lpet_sim.vision.spec import RefineSpec, StereoMatchSpec

Array = NDArray[np.float64]

# Disparity, and its slope along and across the rows: the ground is not fronto-parallel.
_DISPARITY_PLANE = np.array([0, 1, 2])


@dataclass(frozen=True)
class StereoFeatures:
    """Features of the left eye that were found in the right.

    Attributes:
        left: The features of the left eye.
        stereo_px: (u_left, u_right, v) [px], Shape (n, 3).
    """

    left: Features
    stereo_px: Array

    def __len__(self) -> int:
        return len(self.stereo_px)

    def take(self, rows: NDArray[np.int64]) -> StereoFeatures:
        """Give the features of some rows."""
        return StereoFeatures(self.left.take(rows), self.stereo_px[rows])


def match_stereo(
    left: Features, right: Features, calibration: StereoCalibration, spec: StereoMatchSpec
) -> StereoFeatures:
    """Match the eyes: epipolar band, range of disparity, ratio test, left-right check.

    Of several keypoints at one place (SIFT makes one for each orientation) one is kept.

    Args:
        left: Features of the left eye.
        right: Features of the right eye.
        calibration: The declared pair; it bounds the disparity.
        spec: Parameters.
    """
    disparity_max_px = calibration.focal_px * calibration.baseline_m / spec.range_min_m
    band = spec.epipolar_px
    window = np.array([-disparity_max_px, -spec.disparity_min_px, -band, band])
    right = sorted_by_row(right)
    match = mutual_matches(
        left.uv_px,
        left.size_px,
        left.descriptor,
        right.uv_px,
        right.size_px,
        right.descriptor,
        window,
        spec.scale_ratio_max,
        spec.ratio_max,
        spec.distance_max,
    )
    rows = np.flatnonzero(match >= 0)
    rows = rows[np.sort(np.unique(left.uv_px[rows], axis=0, return_index=True)[1])]
    u_left, v = left.uv_px[rows].T.astype(float)
    u_right = right.uv_px[match[rows], 0].astype(float)
    return StereoFeatures(left.take(rows), np.stack([u_left, u_right, v], axis=1))


def sorted_by_row(features: Features) -> Features:
    """Sort features by v, as the matcher wants them."""
    return features.take(np.argsort(features.uv_px[:, 1], kind="stable"))


def refine_disparity(
    left: Floats, right: Floats, stereo_px: Array, spec: RefineSpec
) -> tuple[Array, Array]:
    """Refine u_right by aligning each left patch with the right image.

    Args:
        left: Left image, Shape (h, w), float32.
        right: Right image, likewise.
        stereo_px: Shape (n, 3).
        spec: Parameters.

    Returns:
        u_right [px], Shape (n,); its standard deviation [px], Shape (n,), inf where the alignment
        failed and u_right is the one given.
    """
    settings = (spec.half_width_px, spec.iterations_max, spec.shift_max_px, spec.correlation_min)
    return _refine_disparity(left, right, stereo_px, *settings)


@njit(cache=True, nogil=True)
def _refine_disparity(
    left: Floats,
    right: Floats,
    stereo_px: Array,
    half: int,
    iterations_max: int,
    shift_max_px: float,
    correlation_min: float,
) -> tuple[Array, Array]:
    n = len(stereo_px)
    u_right, sigma = stereo_px[:, 1].copy(), np.full(n, np.inf)
    eye = np.eye(2)
    for i in range(n):
        u, v = stereo_px[i, 0], stereo_px[i, 2]
        if not inside(left, u, v, half + 1):
            continue
        template = sample(left, u, v, half + 1, eye)
        found, _, correlation, spread = align(
            template, right, u_right[i], v, eye, _DISPARITY_PLANE, iterations_max, shift_max_px
        )
        if correlation >= correlation_min:
            u_right[i], sigma[i] = found, spread
    return u_right, sigma
