"""The landmarks a front end remembers."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lpet_sim.vision.detect import DESCRIPTOR_LENGTH, Floats

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Gallery:
    """Landmarks seen lately, one row each.

    Attributes:
        landmark_id: Shape (n,).
        stereo_px: Where each was last seen, moved on to where it should be now [px], Shape (n, 3).
        size_px: Size of the keypoint [px], Shape (n,).
        descriptor: As last seen, Shape (n, d).
        template: Patch of the left image where the landmark's place was fixed, Shape (n, k, k).
        template_disparity_px: Disparity in that image [px], Shape (n,); NaN where there is no
            template yet.
        unseen: Images since it was last seen, Shape (n,).
        reported: How often it was reported, Shape (n,).
    """

    landmark_id: Ints
    stereo_px: Array
    size_px: Floats
    descriptor: Floats
    template: Floats
    template_disparity_px: Array
    unseen: Ints
    reported: Ints

    @classmethod
    def blank(cls, landmark_id: Ints, patch_px: int) -> Gallery:
        """Make landmarks of which nothing is known yet but their ids.

        Args:
            landmark_id: Shape (n,); none for an empty gallery.
            patch_px: Templates are ``patch_px`` squared.
        """
        n = len(landmark_id)
        return cls(
            landmark_id.astype(np.int64),
            np.zeros((n, 3)),
            np.zeros(n, np.float32),
            np.zeros((n, DESCRIPTOR_LENGTH), np.float32),
            np.zeros((n, patch_px, patch_px), np.float32),
            np.full(n, np.nan),
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
        )

    def __len__(self) -> int:
        return len(self.landmark_id)

    def take(self, rows: NDArray[Any]) -> Self:
        """Give some rows."""
        return replace(self, **{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    def joined(self, other: Gallery) -> Gallery:
        """Append another gallery's rows."""
        names = [f.name for f in fields(self)]
        return Gallery(
            **{name: np.concatenate([getattr(self, name), getattr(other, name)]) for name in names}
        )

    def aged(self, time_to_live: int) -> Gallery:
        """Let an image go by: count it as unseen, and forget who was not seen for too long."""
        older = replace(self, unseen=self.unseen + 1)
        return older.take(older.unseen <= time_to_live)
