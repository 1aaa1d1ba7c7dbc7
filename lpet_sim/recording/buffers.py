"""Rows gathered into chunks of a useful size, so that a recording is quick to write and to read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.recording.arrays import Ints
from lpet_sim.recording.columns import Column

ROWS_PER_CHUNK = 16_384
BYTES_PER_CHUNK = 1 << 20
IMAGES_PER_CHUNK = 8


@dataclass
class _Pending:
    columns: list[Column] = field(default_factory=list)
    rows: int = 0
    bytes: int = 0
    last_t_ns: int = -(2**63)

    def add(self, column: Column) -> None:
        self.columns.append(column)
        self.rows += len(column.t_ns)
        self.bytes += column.values.nbytes
        if len(column.t_ns):
            self.last_t_ns = int(column.t_ns[-1])

    def full(self) -> bool:
        return self.rows >= ROWS_PER_CHUNK or self.bytes >= BYTES_PER_CHUNK

    def take(self) -> Column:
        joined = join(self.columns)
        self.columns, self.rows, self.bytes = [], 0, 0
        return joined


class ColumnBuffers:
    """Columns by entity, sent on when there is enough of one, and never out of order."""

    def __init__(self, send: Callable[[str, Column], None]) -> None:
        """Remember where full chunks go."""
        self._send = send
        self._pending: dict[str, _Pending] = {}

    def add(self, entity: str, column: Column) -> None:
        """Add rows to an entity.

        Raises:
            RecordingError: The rows do not follow those before, or are not one for each time.
        """
        if column.offsets is None and len(column.values) != len(column.t_ns):
            raise RecordingError(
                f"{entity} has {len(column.values)} rows for {len(column.t_ns)} times: "
                "they must be equal"
            )
        pending = self._pending.setdefault(entity, _Pending())
        if len(column.t_ns) and column.t_ns[0] <= pending.last_t_ns:
            raise RecordingError(
                f"{entity}: rows from {column.t_ns[0]} ns do not follow those up to "
                f"{pending.last_t_ns} ns: times must increase strictly"
            )
        for piece in split(column):
            pending.add(piece)
            if pending.full():
                self._send(entity, pending.take())

    def flush(self) -> None:
        """Send on all that is left."""
        for entity, pending in self._pending.items():
            if pending.columns:
                self._send(entity, pending.take())


class ImageBuffer:
    """Encoded image pairs, sent on a few at once."""

    def __init__(self, send: Callable[[Ints, list[bytes], list[bytes]], None]) -> None:
        """Remember where full chunks go."""
        self._send = send
        self._pairs: list[tuple[int, bytes, bytes]] = []

    def add(self, t_ns: int, left: bytes, right: bytes) -> None:
        """Add a pair."""
        self._pairs.append((t_ns, left, right))
        if len(self._pairs) >= IMAGES_PER_CHUNK:
            self.flush()

    def flush(self) -> None:
        """Send on all that is left."""
        if self._pairs:
            t_ns, left, right = zip(*self._pairs, strict=True)
            self._pairs = []
            self._send(np.array(t_ns, dtype=np.int64), list(left), list(right))


def split(column: Column) -> list[Column]:
    """Cut a column into pieces of at most `ROWS_PER_CHUNK` rows; an empty one stays as it is."""
    starts = range(0, max(len(column.t_ns), 1), ROWS_PER_CHUNK)
    return [_piece(column, start, start + ROWS_PER_CHUNK) for start in starts]


def join(columns: list[Column]) -> Column:
    """Put columns of one entity one after the other."""
    t_ns = np.concatenate([c.t_ns for c in columns])
    values = np.concatenate([c.values for c in columns])
    if columns[0].offsets is None:
        return Column(t_ns, values)
    lengths = np.concatenate([np.diff(c.offsets) for c in columns if c.offsets is not None])
    return Column(t_ns, values, np.concatenate([[0], np.cumsum(lengths)]).astype(np.int64))


def _piece(column: Column, start: int, stop: int) -> Column:
    t_ns = column.t_ns[start:stop]
    if column.offsets is None:
        return Column(t_ns, column.values[start:stop])
    offsets = column.offsets[start : stop + 1]
    return Column(t_ns, column.values[offsets[0] : offsets[-1]], offsets - offsets[0])
