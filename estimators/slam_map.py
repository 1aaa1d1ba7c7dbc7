"""The landmarks of a SLAM filter, each in a slot of three rows of the state."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints

POSE = 6
"""Rows of the state before the slots, and of a keyframe: position and rotation."""
FREE, KEYFRAME, ODOMETRY = -1, -2, -3
"""What stands in place of a landmark's id in a slot that is free, or of a keyframe or odometry."""
LASTING = 4
"""Lasting errors of odometry, in the first two slots: its rate of turn and its scale."""
VEHICLE = POSE + 6
"""Rows of the state before the landmarks: the pose, and the two slots of odometry."""


class LandmarkMap:
    """What is known of each landmark besides its covariance; slots are used again.

    Attributes:
        slot_of: Slot of each landmark in the state, by its id.
        id: Landmark in each slot, `FREE` or `KEYFRAME`, Shape (c,).
        x: Its three numbers in the host camera [m or px], see `slam_kernels`, Shape (c, 3).
        x_first: Their first estimate, Shape (c, 3).
        far: 1.0 where they are image coordinates, 0.0 where they are a place, Shape (c,).
        R_world_host: Rotation of the host camera in each slot, Shape (c, 3, 3).
        p_world_host: Its position, from where the run starts [m], Shape (c, 3).
        host: Slot of each landmark's host: its own, or that of a keyframe, Shape (c,).
        keyframes: Slots of the keyframes, the first one of the two that each takes, oldest first.
        alive: 1.0 where there is a landmark, Shape (c,).
        unseen: Images since it was last seen, Shape (c,).
        looks: Images in which it was seen, Shape (c,).
        misfits: Sightings in a row that did not fit, Shape (c,).
        entered: Rank of its entry, Shape (c,).
        pinned: Whether it is an anchor, Shape (c,).
    """

    def __init__(self, capacity: int = 8) -> None:
        """Make an empty map with room for some landmarks."""
        self.slot_of: dict[int, int] = {}
        self._entries = 0
        self.id: Ints = np.full(capacity, FREE, dtype=np.int64)
        self.x, self.x_first = np.zeros((capacity, 3)), np.zeros((capacity, 3))
        self.R_world_host = np.tile(np.eye(3), (capacity, 1, 1))
        self.p_world_host = np.zeros((capacity, 3))
        self.alive, self.far = np.zeros(capacity), np.zeros(capacity)
        self.unseen, self.looks, self.misfits, self.entered = (
            np.zeros(capacity, dtype=np.int64) for _ in range(4)
        )
        self.host: Ints = np.arange(capacity)
        self.keyframes: list[int] = []
        self.id[:2] = ODOMETRY
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
    def hosts(self) -> tuple[Array, Array, Ints]:
        """Rotations and positions of the host cameras, and which of them is each landmark's."""
        return self.R_world_host, self.p_world_host, self.host

    @property
    def numbers(self) -> tuple[Array, Array, Array]:
        """The three numbers of each landmark, their first estimates, and which are far."""
        return self.x, self.x_first, self.far

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
        return np.flatnonzero(self.id == FREE)[:count]

    def free_pair(self) -> int:
        """Give the first of two free slots that follow each other, -1 where there are none."""
        free = self.id == FREE
        pairs = np.flatnonzero(free[:-1] & free[1:])
        return int(pairs[0]) if len(pairs) else -1

    def slots(self, landmark_id: Ints) -> Ints:
        """Give the slots of landmarks, -1 for those that are not in the map, Shape (n,)."""
        slot_of = self.slot_of
        found = [slot_of.get(i, -1) for i in landmark_id.tolist()]
        return np.array(found, dtype=np.int64)

    def enter(
        self, slot: int, landmark_id: int, far: bool, host: tuple[Array, Array] | int
    ) -> None:
        """Put a landmark into a free slot, with a host camera or in a keyframe's slot."""
        self.slot_of[landmark_id] = slot
        self.id[slot], self.alive[slot], self.pinned[slot] = landmark_id, 1.0, False
        self.far[slot] = float(far)
        if isinstance(host, int):
            self.host[slot] = host
        else:
            self.host[slot] = slot
            self.R_world_host[slot], self.p_world_host[slot] = host
        self.unseen[slot], self.looks[slot], self.misfits[slot] = 0, 1, 0
        self._entries += 1
        self.entered[slot] = self._entries

    def leave(self, slot: int) -> None:
        """Take a landmark out of the map."""
        del self.slot_of[int(self.id[slot])]
        self.id[slot], self.alive[slot], self.pinned[slot] = FREE, 0.0, False
        self.misfits[slot] = 0

    def add_keyframe(self, slot: int, camera: tuple[Array, Array]) -> None:
        """Put the camera's pose as a keyframe into two free slots."""
        self.id[slot : slot + 2] = KEYFRAME
        self.R_world_host[slot], self.p_world_host[slot] = camera
        self.keyframes.append(slot)

    def is_near(self, slot: int, camera: tuple[Array, Array], reach: tuple[float, float]) -> bool:
        """Tell whether a keyframe is within a distance [m] and an angle [rad] of a camera."""
        away = self.p_world_host[slot] - camera[1]
        cosine = 0.5 * (np.vdot(self.R_world_host[slot], camera[0]) - 1.0)
        return bool(away @ away < reach[0] ** 2 and cosine > math.cos(reach[1]))

    def idle_keyframes(self) -> list[int]:
        """Give the slots of keyframes that host no landmark, the latest one left out."""
        hosts = set(self.host[self.alive > 0].tolist())
        return [slot for slot in self.keyframes[:-1] if slot not in hosts]

    def drop_keyframe(self, slot: int) -> None:
        """Take a keyframe out of the state."""
        self.keyframes.remove(slot)
        self.id[slot : slot + 2] = FREE

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
