"""The MCAP file itself: ROS 2 messages in and out, with the library's own classes kept in here."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mcap.exceptions import McapError
from mcap.reader import McapReader, make_reader
from mcap.records import Schema
from mcap.summary import Summary
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer

from lpet_sim.errors import RecordingError
from lpet_sim.formats.ros_types import definition


@dataclass
class TopicCount:
    """What a bag holds of a topic.

    Attributes:
        kind: Type of its messages.
        messages: How many there are.
    """

    kind: str
    messages: int = 0


@dataclass
class Span:
    """The messages of a bag.

    Attributes:
        topics: What it holds, by topic.
        first_ns: Stamp of the first message [ns].
        last_ns: Stamp of the last message [ns].
    """

    topics: dict[str, TopicCount] = field(default_factory=dict)
    first_ns: int = 2**63 - 1
    last_ns: int = 0

    @property
    def messages(self) -> int:
        """How many messages there are."""
        return sum(topic.messages for topic in self.topics.values())


class BagWriter:
    """Writes one MCAP file, as a context manager."""

    def __init__(self, path: Path) -> None:
        """Open the file."""
        self.span = Span()
        self._file = path.open("wb")
        self._writer = Writer(self._file)
        self._schemas: dict[str, Schema] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the file."""
        if kind is None:
            self._writer.finish()
        self._file.close()

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Add texts by name that belong to no message."""
        self._writer.add_metadata(name, dict(values))

    def write(self, topic: str, kind: str, stamp_ns: int, message: Mapping[str, Any]) -> None:
        """Add a message.

        Args:
            topic: Where it would be published.
            kind: Its type.
            stamp_ns: When [ns].
            message: Its fields by name.
        """
        if kind not in self._schemas:
            self._schemas[kind] = self._writer.register_msgdef(kind, definition(kind))
        self._writer.write_message(topic, self._schemas[kind], message, stamp_ns)
        self.span.topics.setdefault(topic, TopicCount(kind)).messages += 1
        self.span.first_ns = min(self.span.first_ns, stamp_ns)
        self.span.last_ns = max(self.span.last_ns, stamp_ns)


class Bag:
    """An MCAP file of ROS 2 messages."""

    def __init__(self, path: Path) -> None:
        """Read its index.

        Args:
            path: The file, or the folder of a bag that holds one.

        Raises:
            RecordingError: There is no such file, or it is no complete MCAP file.
        """
        self.path = _mcap_of(path)
        with self._opened() as reader:
            summary = reader.get_summary()
            if summary is None or summary.statistics is None:
                raise RecordingError(f"{self.path} has no index; repair it with 'mcap recover'")
            self.topics = _topics(summary)
            self._notes = {note.name: dict(note.metadata) for note in reader.iter_metadata()}

    def notes(self, name: str) -> dict[str, str]:
        """Give the texts that were added under a name; none where there are none."""
        return self._notes.get(name, {})

    def count(self, topics: Iterable[str]) -> int:
        """Count the messages of some topics."""
        return sum(self.topics[topic].messages for topic in topics if topic in self.topics)

    def messages(self, topics: Iterable[str]) -> Iterator[tuple[str, int, Any]]:
        """Give topic, stamp [ns] and fields of the messages of some topics, in order of time.

        Raises:
            RecordingError: A message cannot be decoded.
        """
        wanted = list(topics)
        if not wanted:
            return
        with self._opened() as reader:
            for _, channel, message, fields in reader.iter_decoded_messages(wanted):
                yield channel.topic, message.log_time, fields

    @contextmanager
    def _opened(self) -> Iterator[McapReader]:
        try:
            with self.path.open("rb") as file:
                yield make_reader(file, decoder_factories=[DecoderFactory()])
        except (McapError, OSError, EOFError, ValueError) as error:
            reason = str(error) or type(error).__name__
            raise RecordingError(
                f"cannot read {self.path}: {reason}; give a complete MCAP file of ROS 2 messages"
            ) from None


def _mcap_of(path: Path) -> Path:
    if not path.is_dir():
        if not path.is_file():
            raise RecordingError(f"there is no file {path}: give an MCAP file, or a bag's folder")
        return path
    files = sorted(path.glob("*.mcap"))
    if len(files) != 1:
        raise RecordingError(f"{path} holds {len(files)} MCAP files; give a bag that has one")
    return files[0]


def _topics(summary: Summary) -> dict[str, TopicCount]:
    assert summary.statistics is not None
    counts = summary.statistics.channel_message_counts
    found: dict[str, TopicCount] = {}
    for key, channel in summary.channels.items():
        schema = summary.schemas.get(channel.schema_id)
        known = found.setdefault(channel.topic, TopicCount("" if schema is None else schema.name))
        known.messages += counts.get(key, 0)
    return found
