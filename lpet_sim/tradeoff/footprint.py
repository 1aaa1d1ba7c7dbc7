"""What a camera covers of flat ground, and how much of it the next image shows again."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.tradeoff.candidate import Candidate

_RAYS = 32


@dataclass(frozen=True)
class Footprint:
    """A view's cover of flat ground.

    Attributes:
        near_m: Ground distance ahead of the eye at which the view begins [m]; infinite: it shows
            no ground.
        far_m: And at which it ends [m], at most the greatest range.
        width_m: Its width at the middle of the two [m].
        overlap: Share of the ground's pixels whose ground the next image shows, too.
        horizon_shown: Whether the image reaches up to the horizon.
    """

    near_m: float
    far_m: float
    width_m: float
    overlap: float
    horizon_shown: bool


def footprint_of(candidate: Candidate, range_max_m: float) -> Footprint:
    """Give the cover of a level rover's view.

    Args:
        candidate: The sensor.
        range_max_m: Ground that is further away counts as not seen.
    """
    half = math.atan(0.5 * candidate.height_px / candidate.focal_px)
    h, down = candidate.mast_height_m, candidate.depression_rad
    reach_m = math.sqrt(max(range_max_m**2 - h**2, 0.0))
    near_m = _ground_distance(h, candidate.lowest_ray_rad)
    far_m = min(_ground_distance(h, down - half), reach_m)
    shown = near_m < far_m
    middle = 0.5 * (near_m + far_m) if shown else 0.0
    ahead = middle * math.cos(down) + h * math.sin(down)
    width_m = 2.0 * ahead * math.tan(0.5 * candidate.field_of_view_rad) if shown else 0.0
    overlap = _overlap(candidate, reach_m) if shown else 0.0
    return Footprint(near_m if shown else math.inf, far_m, width_m, overlap, down - half <= 0.0)


def _ground_distance(height_m: float, below_rad: float) -> float:
    """Give where a ray that points so far below the horizon meets the ground [m]."""
    return height_m / math.tan(below_rad) if below_rad > 1e-6 else math.inf


def _overlap(candidate: Candidate, reach_m: float) -> float:
    xy = _ground_points(candidate)
    xy = xy[np.hypot(xy[:, 0], xy[:, 1]) <= reach_m]
    if not len(xy):
        return 0.0
    return float(_in_view(candidate, xy - [candidate.image_interval_m, 0.0]).mean())


def _ground_points(candidate: Candidate) -> Array:
    """Give where rays through an even grid of pixels meet the ground, (x ahead, y left) [m]."""
    f = candidate.focal_px
    centred = (np.arange(_RAYS) + 0.5) / _RAYS - 0.5
    u, v = np.meshgrid(candidate.resolution_px * centred / f, candidate.height_px * centred / f)
    s, c = math.sin(candidate.depression_rad), math.cos(candidate.depression_rad)
    fall = (v * c + s).ravel()
    down = fall > 1e-9
    scale = candidate.mast_height_m / fall[down]
    return np.column_stack([scale * (c - v.ravel() * s)[down], -scale * u.ravel()[down]])


def _in_view(candidate: Candidate, xy: Array) -> Array:
    """Tell which points of the ground, Shape (n, 2), lie in the image."""
    s, c, h = (
        math.sin(candidate.depression_rad),
        math.cos(candidate.depression_rad),
        candidate.mast_height_m,
    )
    z = xy[:, 0] * c + h * s
    ahead = z > 1e-9
    z = np.where(ahead, z, 1.0)
    u, v = -xy[:, 1] / z, (h * c - xy[:, 0] * s) / z
    wide, high = candidate.resolution_px, candidate.height_px
    f = candidate.focal_px
    inside = (np.abs(u) * f <= 0.5 * wide) & (np.abs(v) * f <= 0.5 * high)
    return np.asarray(ahead & inside)
