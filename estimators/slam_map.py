"""The landmarks of a SLAM filter, each in a slot of three rows of the state."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints

POSE = 6
"""Rows of the state before the landmarks: position and rotation."""


class LandmarkMap:
    """What is known of each landmark besides its covariance; slots are used again.

    Attributes:
        slot_of: Slot of each landmark in the state, by its id.
        id: Landmark in each slot, -1 where it is free, Shape (c,).
        x: Image coordinates in the host camera [px], Shape (c, 3).
        x_first: Their first estimate [px], Shape (c, 3).
        R_world_host: Rotation of the host camera, Shape (c, 3, 3).
        p_world_host: Its position, from where the run starts [m], Shape (c, 3).
        alive: 1.0 where there is a landmark, Shape (c,).
        unseen: Images since it was last seen, Shape (c,).
        looks: Images in which it was seen, Shape (c,).
        misfits: Sightings in a row that did not fit, Shape (c,).
        entered: Rank of its entry, Shape (c,).
        pinned: Whether it is an anchor, Shape (c,).
    """

    def __init__(self, capacity: int = 64) -> None:
        """Make an empty map with room for some landmarks."""
        self.slot_of: dict[int, int] = {}
        self._entries = 0
        self.id: Ints = np.full(capacity, -1, dtype=np.int64)
        self.x, self.x_first = np.zeros((capacity, 3)), np.zeros((capacity, 3))
        self.R_world_host = np.tile(np.eye(3), (capacity, 1, 1))
        self.p_world_host = np.zeros((capacity, 3))
        self.alive = np.zeros(capacity)
        self.unseen, self.looks, self.misfits, self.entered = (
            np.zeros(capacity, dtype=np.int64) for _ in range(4)
        )
        self.pinned: NDArray[np.bool_] = np.zeros(capacity, dtype=bool)

    def __len__(self) -> int:
        return len(self.slot_of)

    @property
    def capacity(self) -> int:
        """Number of slots."""
        return len(self.id)

    @property
    def rows(self) -> int:
        """Rows of the state, free slots counted."""
        return POSE + 3 * self.capacity

    @property
    def hosts(self) -> tuple[Array, Array]:
        """Rotations and positions of the host cameras."""
        return self.R_world_host, self.p_world_host

    def grow(self, capacity: int) -> None:
        """Make room for more landmarks."""
        wider = LandmarkMap(capacity)
        for name, array in vars(self).items():
            if isinstance(array, np.ndarray):
                kept = getattr(wider, name)
                kept[: len(array)] = array
                setattr(self, name, kept)

    def free_slots(self, count: int) -> Ints:
        """Give the first free slots, at most this many."""
        return np.flatnonzero(self.id < 0)[:count]

    def slots(self, landmark_id: Ints) -> Ints:
        """Give the slots of landmarks, -1 for those that are not in the map, Shape (n,)."""
        slot_of = self.slot_of
        found = [slot_of.get(i, -1) for i in landmark_id.tolist()]
        return np.array(found, dtype=np.int64)

    def enter(self, slot: int, landmark_id: int, x: Array, host: tuple[Array, Array]) -> None:
        """Put a landmark that is seen for the first time at x by a camera into a free slot."""
        self.slot_of[landmark_id] = slot
        self.id[slot], self.alive[slot], self.pinned[slot] = landmark_id, 1.0, False
        self.x[slot] = self.x_first[slot] = x
        self.R_world_host[slot], self.p_world_host[slot] = host
        self.unseen[slot], self.looks[slot], self.misfits[slot] = 0, 1, 0
        self._entries += 1
        self.entered[slot] = self._entries

    def leave(self, slot: int) -> None:
        """Take a landmark out of the map."""
        del self.slot_of[int(self.id[slot])]
        self.id[slot], self.alive[slot], self.pinned[slot] = -1, 0.0, False
        self.misfits[slot] = 0

    def count_image(self, accepted: Ints, rejected: Ints) -> None:
        """Bring the counters on by one image.

        Args:
            accepted: Slots of the landmarks whose sightings were taken in.
            rejected: Slots of those whose sightings did not fit.
        """
        self.unseen += 1
        self.unseen[accepted] = 0
        self.looks[accepted] += 1
        self.misfits[accepted] = 0
        self.misfits[rejected] += 1
