"""Who enters the state of the SLAM filter and who leaves it: the paper's policies.

A policy sees counters alone. Anchors are pinned: no policy but their own lets them go (and
sightings that do not fit, which are no policy).
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from estimators.slam_map import LandmarkMap
from estimators.slam_spec import AnchorSpec, BoundedQueue, KeepAll, TimeToLive
from lpet_sim.recording.arrays import Array, Ints


class Policy(Protocol):
    """Admission and retention."""

    def admit(self, unmapped: Ints) -> NDArray[np.bool_]:
        """Tell which of the landmarks seen outside the map may enter it, Shape (n,)."""
        ...

    def leaving(self, landmarks: LandmarkMap, entering: int, surprise: Array | None) -> Ints:
        """Give the slots of those who leave.

        Args:
            landmarks: The map after the image.
            entering: How many are about to enter.
            surprise: Summed variance of the image coordinates of each slot in its host camera
                [px^2], Shape (c,), where the policy asks for it.
        """
        ...


class Everything:
    """Full SLAM: all enter, none leaves."""

    def admit(self, unmapped: Ints) -> NDArray[np.bool_]:
        """Admit all."""
        return np.ones(len(unmapped), dtype=bool)

    def leaving(self, landmarks: LandmarkMap, entering: int, surprise: Array | None) -> Ints:  # noqa: ARG002
        """Let none go."""
        return np.zeros(0, dtype=np.int64)


class Multiframe(Everything):
    """All enter; who was unseen for M images leaves."""

    def __init__(self, spec: TimeToLive) -> None:
        self._images = spec.images

    def leaving(self, landmarks: LandmarkMap, entering: int, surprise: Array | None) -> Ints:  # noqa: ARG002
        """Let those go whose counter has come to 0."""
        expired = (landmarks.unseen >= self._images) & ~landmarks.pinned
        return np.flatnonzero(expired & (landmarks.alive > 0))


class WaitingPool:
    """Who is seen a second time enters; the queue then holds N.

    The first sighting only calls for the second: it is not taken in as a measurement, so that
    nothing is counted twice.
    """

    def __init__(self, spec: BoundedQueue) -> None:
        self._spec = spec
        self._waiting: dict[int, int] = {}
        self._image = 0

    def admit(self, unmapped: Ints) -> NDArray[np.bool_]:
        """Admit who was seen within the last images; the others begin to wait."""
        self._image += 1
        oldest = self._image - self._spec.waiting_images
        self._waiting = {i: seen for i, seen in self._waiting.items() if seen >= oldest}
        ids = unmapped.tolist()
        admitted = [i in self._waiting for i in ids]
        for i, enters in zip(ids, admitted, strict=True):
            if enters:
                del self._waiting[i]
            else:
                self._waiting[i] = self._image
        return np.array(admitted, dtype=bool)

    def leaving(self, landmarks: LandmarkMap, entering: int, surprise: Array | None) -> Ints:
        """Let as many go as are too many for the queue once the others have entered."""
        queued = np.flatnonzero((landmarks.alive > 0) & ~landmarks.pinned)
        excess = len(queued) + min(entering, self._spec.size) - self._spec.size
        if excess <= 0:
            return np.zeros(0, dtype=np.int64)
        age = landmarks.entered[queued]
        if self._spec.leave == "first_in_first_out":
            order = np.argsort(age)
        elif self._spec.leave == "shortest_time_to_live":
            order = np.lexsort((age, -landmarks.unseen[queued]))
        else:
            assert surprise is not None
            order = np.lexsort((age, -surprise[queued]))
        return queued[order[:excess]]


def build_policy(spec: KeepAll | TimeToLive | BoundedQueue) -> Policy:
    """Build the policy that belongs to a spec."""
    if isinstance(spec, TimeToLive):
        return Multiframe(spec)
    return WaitingPool(spec) if isinstance(spec, BoundedQueue) else Everything()


def choose_anchors(landmarks: LandmarkMap, disparity: Array, spec: AnchorSpec) -> Ints:
    """Give the slots of the landmarks that become anchors when the rover sets off.

    Args:
        landmarks: The map at standstill.
        disparity: Of each slot as its host camera sees it [px], Shape (c,).
        spec: How many, and which.
    """
    known = np.flatnonzero((landmarks.alive > 0) & (landmarks.looks >= spec.looks_min))
    order = np.argsort((1.0 if spec.prefer == "far" else -1.0) * disparity[known], kind="stable")
    return known[order[: spec.count_max]]


def expired_anchors(landmarks: LandmarkMap, spec: AnchorSpec) -> Ints:
    """Give the slots of the anchors that were not seen for longer than they are kept."""
    if spec.unseen_images_max is None:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(landmarks.pinned & (landmarks.unseen > spec.unseen_images_max))
