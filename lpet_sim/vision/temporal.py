"""Matching over time: who among the landmarks remembered is seen again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.vision.align import align, inside, sample
from lpet_sim.vision.detect import Floats
from lpet_sim.vision.gallery import Gallery
from lpet_sim.vision.matching import mutual_matches
from lpet_sim.vision.motion_gate import fit_motion, predict
from lpet_sim.vision.spec import RefineSpec, TemporalMatchSpec
from lpet_sim.vision.stereo import StereoFeatures

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# All of an affine map: ground nearby is seen under a changing slant, not only larger.
_AFFINE = np.arange(6)
# A template seen at another scale than this is cut anew: its texture is no longer the same.
_TEMPLATE_SCALE_MAX = 1.5


def match_gallery(
    gallery: Gallery,
    features: StereoFeatures,
    calibration: StereoCalibration,
    spec: TemporalMatchSpec,
) -> tuple[Gallery, Ints]:
    """Match landmarks with the features of a new image.

    First those of the last image, in a wide window. A rigid motion fitted to these throws out what
    does not move along and tells where the others should be now; the features still free are then
    matched with these, in a narrow window.

    Args:
        gallery: The landmarks; ``unseen`` counts this image already.
        features: Features of this image, sorted by v.
        calibration: The declared pair.
        spec: Parameters.

    Returns:
        The gallery with every landmark moved on to where it should be now, and for each the row of
        its feature, -1 where it is not seen, Shape (n,).
    """
    match = np.full(len(gallery), -1)
    recent = np.flatnonzero(gallery.unseen == 1)
    wide = (spec.search_width * calibration.width_px, spec.search_height * calibration.height_px)
    match[recent] = _match(gallery.take(recent), features, wide, spec)
    seen = np.flatnonzero(match >= 0)
    if len(seen) < spec.matches_min:
        return gallery, match
    before, after = gallery.stereo_px[seen], features.stereo_px[match[seen]]
    motion = fit_motion(calibration, before, after)
    now_px, ahead = predict(calibration, motion, gallery.stereo_px)
    off = np.abs(now_px[seen] - after).max(axis=1) > spec.gate_px
    match[seen[off]] = -1
    moved = replace(gallery, stereo_px=np.where(ahead[:, None], now_px, gallery.stereo_px))
    free = np.setdiff1d(np.arange(len(features)), match)
    lost = np.flatnonzero((match < 0) & ahead)
    again = _match(moved.take(lost), features.take(free), (spec.gate_px, spec.gate_px), spec)
    match[lost[again >= 0]] = free[again[again >= 0]]
    return moved, match


def _match(
    gallery: Gallery,
    features: StereoFeatures,
    reach_px: tuple[float, float],
    spec: TemporalMatchSpec,
) -> Ints:
    u, v = reach_px
    return mutual_matches(
        gallery.stereo_px[:, [0, 2]].astype(np.float32),
        gallery.size_px,
        gallery.descriptor,
        features.stereo_px[:, [0, 2]].astype(np.float32),
        features.left.size_px,
        features.left.descriptor,
        np.array([-u, u, -v, v]),
        spec.scale_ratio_max,
        spec.ratio_max,
        spec.distance_max,
    )


def align_with_templates(
    gallery: Gallery, left: Floats, stereo_px: Array, spec: RefineSpec
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Refine where landmarks are by aligning each one's template with the left image.

    The template is that of the image where the landmark's place was fixed, not of the last one, so
    that errors do not add up from image to image. The alignment is affine and starts from the scale
    that the ratio of the disparities tells.

    Args:
        gallery: The landmarks, one for each row of ``stereo_px``.
        left: Left image, Shape (h, w), float32.
        stereo_px: First guesses [px], Shape (n, 3).
        spec: Parameters.

    Returns:
        (u_left, v) [px], Shape (n, 2); their standard deviation [px], Shape (n,), 0 where there was
        no template and the keypoint is the landmark's place, inf where the alignment failed; and
        whether the template should be kept, Shape (n,).
    """
    scale = (stereo_px[:, 0] - stereo_px[:, 1]) / gallery.template_disparity_px
    uv, sigma = stereo_px[:, [0, 2]].copy(), np.zeros(len(stereo_px))
    rows = np.flatnonzero(np.isfinite(scale)) if spec.temporal else np.zeros(0, np.int64)
    settings = (spec.iterations_max, spec.shift_max_px, spec.correlation_min, _AFFINE)
    uv[rows], sigma[rows] = _align_all(
        gallery.template[rows], scale[rows], left, uv[rows], *settings
    )
    fresh = (scale < _TEMPLATE_SCALE_MAX) & (scale > 1 / _TEMPLATE_SCALE_MAX)
    aligned = (sigma > 0) & np.isfinite(sigma)
    return uv, sigma, fresh & aligned


@njit(cache=True, nogil=True)
def _align_all(
    templates: Floats,
    scale: Array,
    left: Floats,
    uv: Array,
    iterations_max: int,
    shift_max_px: float,
    correlation_min: float,
    active: Ints,
) -> tuple[Array, Array]:
    sigma = np.full(len(uv), np.inf)
    for i in range(len(uv)):
        warp = np.eye(2) * min(max(scale[i], 0.5), 2.0)
        u, v, correlation, spread = align(
            templates[i], left, uv[i, 0], uv[i, 1], warp, active, iterations_max, shift_max_px
        )
        if correlation >= correlation_min:
            uv[i, 0], uv[i, 1], sigma[i] = u, v, spread
    return uv, sigma


@njit(cache=True, nogil=True)
def cut_templates(left: Floats, uv: Array, half: int) -> Floats:
    """Cut patches of ``2 half + 1`` squared around points; flat ones where they leave the image."""
    out = np.zeros((len(uv), 2 * half + 1, 2 * half + 1), np.float32)
    for i in range(len(uv)):
        if inside(left, uv[i, 0], uv[i, 1], half):
            out[i] = sample(left, uv[i, 0], uv[i, 1], half, np.eye(2))
    return out
