"""What sightings look like on the images: a colour for each landmark and the tail of its track."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.streams import SightingStream

TAIL_IMAGES = 6
_GOLDEN = 0.618033988749895


@dataclass(frozen=True, eq=False)
class Tails:
    """Polylines of one image, newest point first.

    Attributes:
        points_px: (u_left, u_right, v) of all polylines [px], Shape (k, 3).
        lengths: Number of points of each polyline, at least 2, Shape (s,).
        landmark_id: Whose they are, Shape (s,).
    """

    points_px: Array
    lengths: Ints
    landmark_id: Ints


class TrackTails:
    """Remembers the last images, so that tails can be drawn while a recording grows."""

    def __init__(self, images: int = TAIL_IMAGES) -> None:
        """Start without a past.

        Args:
            images: How many images a tail reaches back.
        """
        self._past: deque[tuple[Ints, Array]] = deque(maxlen=images)

    def add(self, landmark_id: Ints, stereo_px: Array) -> Tails:
        """Take the sightings of the next image and give the tails that end in it.

        Args:
            landmark_id: Shape (m,), unique.
            stereo_px: (u_left, u_right, v) [px], Shape (m, 3).
        """
        order = np.argsort(landmark_id, kind="stable")
        ids, px = landmark_id[order], stereo_px[order]
        layers = np.stack([px, *(_find(ids, *past) for past in self._past)], axis=1)
        self._past.appendleft((ids, px))
        known = ~np.isnan(layers[..., 0])
        drawn = known.sum(axis=1) >= 2
        return Tails(layers[drawn][known[drawn]], known[drawn].sum(axis=1), ids[drawn])


def colours(landmark_id: Ints) -> NDArray[np.uint32]:
    """Give each landmark a bright colour of its own as 0xRRGGBBAA, Shape (m,).

    The hue of id k is k times the golden ratio modulo 1, so that neighbours differ widely.
    """
    hue = 6.0 * ((np.asarray(landmark_id) * _GOLDEN) % 1.0)
    offsets = np.array([5.0, 3.0, 1.0])
    k = (hue[:, None] + offsets) % 6.0
    rgb = 1.0 - 0.85 * np.clip(np.minimum(k, 4.0 - k), 0.0, 1.0)
    channels = (255 * rgb).astype(np.uint32)
    return (channels[:, 0] << 24) | (channels[:, 1] << 16) | (channels[:, 2] << 8) | np.uint32(255)


def images_of(sightings: SightingStream) -> list[tuple[int, Ints, Array]]:
    """Cut a stream into its images: time [ns], landmark ids and image coordinates."""
    rows = [sightings.rows(i) for i in range(len(sightings))]
    return [
        (int(t), sightings.landmark_id[r], sightings.stereo_px[r])
        for t, r in zip(sightings.t_ns, rows, strict=True)
    ]


def _find(ids: Ints, past_ids: Ints, past_px: Array) -> Array:
    """Look up where landmarks were in a past image, NaN where they were not seen."""
    out = np.full((len(ids), 3), np.nan)
    if len(past_ids):
        at = np.minimum(np.searchsorted(past_ids, ids), len(past_ids) - 1)
        seen = past_ids[at] == ids
        out[seen] = past_px[at[seen]]
    return out
