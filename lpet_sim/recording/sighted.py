"""Sightings drawn on both images, with the tails of their tracks, while a recording grows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpet_sim.recording import layout
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.tracks import Tails, TrackTails, colours
from lpet_sim.recording.visuals import Pen

_IMAGES_AT_ONCE = 32


@dataclass(frozen=True, eq=False)
class _Sighted:
    t_ns: int
    landmark_id: Ints
    stereo_px: Array
    tails: Tails


class SightedImages:
    """Draws every n-th image's sightings, some images at once."""

    def __init__(self, pen: Pen, draw_every: int) -> None:
        """Start without a past.

        Args:
            pen: What draws.
            draw_every: Of how many images one is drawn; tails run through all of them.
        """
        self._pen = pen
        self._draw_every = draw_every
        self._seen = 0
        self._past = TrackTails()
        self._gathered: list[_Sighted] = []

    def add(self, t_ns: int, landmark_id: Ints, stereo_px: Array) -> None:
        """Add the sightings of the next image."""
        tails = self._past.add(landmark_id, stereo_px)
        if self._seen % self._draw_every == 0:
            self._gathered.append(_Sighted(t_ns, landmark_id, stereo_px, tails))
        self._seen += 1
        if len(self._gathered) >= _IMAGES_AT_ONCE:
            self.flush()

    def flush(self) -> None:
        """Draw what is left."""
        if self._gathered:
            t_ns = np.array([image.t_ns for image in self._gathered], dtype=np.int64)
            self._draw_points(t_ns)
            self._draw_tails(t_ns)
            self._gathered = []

    def _draw_points(self, t_ns: Ints) -> None:
        counts = np.array([len(image.landmark_id) for image in self._gathered])
        rgba = colours(np.concatenate([image.landmark_id for image in self._gathered]))
        px = np.concatenate([image.stereo_px for image in self._gathered])
        for eye, column in layout.EYE_COLUMNS.items():
            entity = f"{layout.CAMERAS[eye]}/sightings"
            self._pen.points_2d(entity, t_ns, px[:, [column, 2]], counts, rgba)

    def _draw_tails(self, t_ns: Ints) -> None:
        tails = [image.tails for image in self._gathered]
        counts = np.array([len(tail.lengths) for tail in tails])
        lengths = np.concatenate([tail.lengths for tail in tails])
        rgba = colours(np.concatenate([tail.landmark_id for tail in tails]))
        px = np.concatenate([tail.points_px for tail in tails])
        for eye, column in layout.EYE_COLUMNS.items():
            entity = f"{layout.CAMERAS[eye]}/tracks"
            self._pen.strips_2d(entity, t_ns, px[:, [column, 2]], lengths, counts, rgba)
