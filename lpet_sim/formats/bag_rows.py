"""Messages of a bag gathered as rows of numbers, eight bytes for each."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats.mcap_file import Bag
from lpet_sim.progress import Progress, track
from lpet_sim.recording.arrays import Array, Ints


class Gathered:
    """The rows of a topic."""

    def __init__(self, topic: str) -> None:
        """Start without rows."""
        self._topic = topic
        self._stamps = array("q")
        self._values = array("d")
        self._ends = array("q", [0])

    def add(self, stamp: int, values: list[float]) -> None:
        """Add a row."""
        self._stamps.append(stamp)
        self._values.extend(values)
        self._ends.append(len(self._values))

    def t_ns(self) -> Ints:
        """Give the stamps [ns], Shape (n,)."""
        return np.array(self._stamps, dtype=np.int64)

    def table(self) -> Array:
        """Give the rows, Shape (n, k).

        Raises:
            RecordingError: They are not equally long.
        """
        lengths = np.unique(np.diff(np.array(self._ends)))
        if len(lengths) != 1:
            raise RecordingError(f"the messages of {self._topic} have different lengths")
        return np.array(self._values).reshape(-1, int(lengths[0]))

    def ragged(self) -> list[Array]:
        """Give each row by itself."""
        return np.split(np.array(self._values), np.array(self._ends)[1:-1])


def gather(
    bag: Bag,
    readers: Mapping[str, Callable[[Any, int], tuple[int, list[float]]]],
    progress: Progress,
) -> dict[str, Gathered]:
    """Read topics into rows.

    Args:
        bag: The bag.
        readers: For each topic, what makes a stamp [ns] and a row of a message and the stamp at
            which it was written; a topic that the bag does not hold is left out.
        progress: Called after some messages.

    Raises:
        RecordingError: A message is not what its topic holds.
    """
    held = [topic for topic in readers if bag.count([topic])]
    rows = {topic: Gathered(topic) for topic in held}
    for topic, stamp, message in track(bag.messages(held), max(bag.count(held), 1), progress):
        try:
            rows[topic].add(*readers[topic](message, stamp))
        except (AttributeError, TypeError, ValueError) as error:
            raise RecordingError(
                f"{bag.path}: a message of {topic} is a {bag.topics[topic].kind}, which is not "
                f"what belongs there ({error})"
            ) from None
    return rows
