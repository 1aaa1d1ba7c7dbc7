"""The image pairs of a bag, read from it as they are asked for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import RecordingError
from lpet_sim.formats import ros_messages as ros
from lpet_sim.formats.mcap_file import Bag
from lpet_sim.formats.topics import TopicsSpec
from lpet_sim.recording.arrays import Ints

Pair = tuple[NDArray[Any], NDArray[Any]]


def paired_stamps(bag: Bag, left: str, right: str) -> Ints | None:
    """Find the stamps that both eyes have [ns], Shape (n,), None where there are no images.

    Raises:
        RecordingError: There is one eye only, or no stamp that both have.
    """
    held = [topic for topic in (left, right) if bag.count([topic])]
    if not held:
        return None
    if len(held) == 1:
        raise RecordingError(f"{bag.path} has {held[0]} only; {left} and {right} are expected")
    stamps: dict[str, set[int]] = {left: set(), right: set()}
    for topic, _, message in bag.messages(held):
        stamps[topic].add(ros.stamp_of(message))
    common = sorted(stamps[left] & stamps[right])
    if not common:
        raise RecordingError(f"{bag.path}: no stamp of {left} is one of {right}")
    return np.array(common, dtype=np.int64)


class BagImages:
    """Image pairs in order of time; a step back starts again at the beginning."""

    def __init__(self, bag: Bag, where: TopicsSpec, stamps: Ints, start_ns: int) -> None:
        """Remember where they are.

        Args:
            bag: The bag.
            where: Its topics.
            stamps: Stamps of the pairs [ns], Shape (n,).
            start_ns: The stamp of the recording's start [ns]; earlier pairs are left out.
        """
        self._bag, self._where = bag, where
        self._stamps = stamps[stamps >= start_ns]
        self._t_ns = self._stamps - start_ns
        self._pairs: Iterator[Pair] | None = None
        self._next = 0
        self._last: Pair = (np.zeros((0, 0), np.uint8), np.zeros((0, 0), np.uint8))

    @property
    def t_ns(self) -> Ints:
        """Times of the pairs since the start [ns], Shape (n,)."""
        return self._t_ns

    def __len__(self) -> int:
        return len(self._t_ns)

    def pair(self, index: int) -> Pair:
        """Give the left and right image of a pair, Shape (h, w), uint8 or uint16.

        Raises:
            RecordingError: There is no such pair, or an image is not grey.
        """
        if not 0 <= index < len(self):
            raise RecordingError(f"there is no image pair {index}: valid are 0 to {len(self) - 1}")
        if self._pairs is None or index < self._next - 1:
            self._pairs, self._next = self._read(), 0
        while self._next <= index:
            self._last = next(self._pairs)
            self._next += 1
        return self._last

    def _read(self) -> Iterator[Pair]:
        eyes = (self._where.left_image, self._where.right_image)
        wanted = set(self._stamps.tolist())
        waiting: dict[int, dict[str, NDArray[Any]]] = {}
        for topic, _, message in self._bag.messages(eyes):
            stamp = ros.stamp_of(message)
            if stamp in wanted:
                waiting.setdefault(stamp, {})[topic] = ros.pixels_of(message)
                if len(waiting[stamp]) == len(eyes):
                    pair = waiting.pop(stamp)
                    yield pair[eyes[0]], pair[eyes[1]]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_pairs": None, "_next": 0}
