"""The .rrd file itself: columns, documents and images in and out, exact to the bit.

Rerun's archetypes hold float32; exact arrays go in as lists of their own type beside them. Floats
are stored as `Scalars`, so that any of them can be plotted in the viewer.
"""

from __future__ import annotations

import json
import math
import uuid
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun as rr
from rerun.chunk import Chunk, LazyStore, RrdReader, StoreEntry

from lpet_sim.errors import OutputError, RecordingError
from lpet_sim.recording.arrays import Ints
from lpet_sim.recording.columns import Column

APPLICATION = "lpet"
TIMELINE = "time"

_JSON = rr.ComponentDescriptor("Exact:json", archetype="lpet.Exact")
_SCALARS = rr.ComponentDescriptor(
    "Scalars:scalars",
    component_type="rerun.components.Scalar",
    archetype="rerun.archetypes.Scalars",
)
_BLOB = "EncodedImage:blob"


class _Batch:
    """An Arrow array as the SDK takes it."""

    def __init__(self, values: pa.Array) -> None:
        self._values = values

    def as_arrow_array(self) -> pa.Array:
        return self._values


class StoreWriter:
    """A .rrd under a temporary name in the folder of its final one, until it is complete."""

    def __init__(self, path: Path, recording_id: str | None = None) -> None:
        """Open the temporary file.

        Args:
            path: The final name.
            recording_id: Identity of the recording; a new one where None.

        Raises:
            OutputError: The folder cannot be written.
        """
        self.path = path
        self._temporary = _temporary_beside(path)
        self.stream = rr.RecordingStream(
            APPLICATION, recording_id=recording_id, send_properties=False
        )
        self.stream.save(self._temporary)
        self._laid_out: set[str] = set()

    def send(self, entity: str, column: Column) -> None:
        """Add rows to the exact column of an entity."""
        if entity not in self._laid_out:
            self._laid_out.add(entity)
            self._send_layout(entity, column)
        if len(column.t_ns) == 0:
            return
        flat = pa.array(column.values.reshape(-1))
        offsets = column.row_offsets().astype(np.int32)
        descriptor = _descriptor(column.values.dtype)
        self._send(
            entity, column.t_ns, [rr.ComponentColumn(descriptor, _Batch(flat), offsets=offsets)]
        )

    def send_json(self, entity: str, value: Any) -> None:
        """Set the JSON document of an entity."""
        text = _Batch(pa.array([json.dumps(value)]))
        self.stream.send_columns(entity, [], [rr.ComponentColumn(_JSON, text)], strict=True)

    def send_pngs(self, entity: str, t_ns: Ints, blobs: Sequence[bytes]) -> None:
        """Add PNG images to an entity, one for each time."""
        columns = rr.EncodedImage.columns(blob=list(blobs), media_type=["image/png"] * len(blobs))
        self._send(entity, t_ns, columns)

    def send_chunks(self, chunks: Iterable[Chunk]) -> None:
        """Copy chunks of another store as they are."""
        self.stream.send_chunks(chunks)

    def flush(self) -> None:
        """Wait until all that was sent is in the file, so that no queue can grow."""
        self.stream.flush()

    def commit(self) -> None:
        """Complete the file and give it its final name.

        Raises:
            OutputError: The file cannot be written.
        """
        self._close()
        try:
            _open(self._temporary)
            self._temporary.replace(self.path)
        except RecordingError:
            self.discard()
            raise OutputError(f"cannot write {self.path}: the disk may be full") from None
        except OSError as error:
            self.discard()
            raise OutputError(_unwritable(self.path, error)) from None

    def discard(self) -> None:
        """Remove the temporary file."""
        self._close()
        self._temporary.unlink(missing_ok=True)

    def _close(self) -> None:
        self.stream.disconnect()

    def _send_layout(self, entity: str, column: Column) -> None:
        dtype, ragged = column.values.dtype.name, column.offsets is not None
        self.send_json(entity, {"dtype": dtype, "shape": column.tail, "ragged": ragged})

    def _send(self, entity: str, t_ns: Ints, columns: Iterable[rr.ComponentColumn]) -> None:
        index = rr.TimeColumn(TIMELINE, duration=t_ns.astype("timedelta64[ns]"))
        self.stream.send_columns(entity, [index], columns, strict=True)


class StoreReader:
    """A complete .rrd, read without a server."""

    def __init__(self, path: Path) -> None:
        """Open the file and read its index.

        Raises:
            RecordingError: The file is missing, truncated, or not an .rrd.
        """
        self.path = path
        if not path.is_file():
            raise RecordingError(f"there is no file {path}: give the path of a .rrd recording")
        self._store, entry, self.has_blueprint = _open(path)
        self.recording_id: str = entry.recording_id

    def entities(self) -> frozenset[str]:
        """Name all entities."""
        with _reading(self.path):
            return frozenset(line.split(" ", 1)[0] for line in self._store.summary().splitlines())

    def chunks(self, *content: str, drop: Sequence[str] = ()) -> Iterator[Chunk]:
        """Give the chunks of the entities that match, read as they are asked for."""
        with _reading(self.path):
            stream = self._store.stream()
            stream = stream.filter(content=list(content)) if content else stream
            yield from stream.drop(content=list(drop)) if drop else stream

    def json(self, entity: str) -> Any:
        """Give the JSON document of an entity, None where there is none."""
        return _document(chunk.to_record_batch() for chunk in self.chunks(entity))

    def columns(self, *content: str) -> dict[str, Column]:
        """Read the exact columns of all entities that match, by entity."""
        batches: dict[str, list[pa.RecordBatch]] = {}
        for chunk in self.chunks(*content):
            batches.setdefault(chunk.entity_path, []).append(chunk.to_record_batch())
        with _reading(self.path):
            found = {entity: _column(parts) for entity, parts in batches.items()}
        return {entity: column for entity, column in found.items() if column is not None}

    def pngs(self, entity: str) -> Iterator[bytes]:
        """Read the PNG images of an entity in order of time, a few in memory at once."""
        for chunk in self.chunks(entity):
            batch = chunk.to_record_batch()
            if _BLOB in batch.schema.names:
                for row in batch.column(_BLOB):
                    yield row.values.flatten().to_numpy().tobytes()


def _descriptor(kind: np.dtype[Any]) -> rr.ComponentDescriptor:
    if kind == np.float64:
        return _SCALARS
    return rr.ComponentDescriptor(f"Exact:{kind.name}", archetype="lpet.Exact")


def _column(batches: list[pa.RecordBatch]) -> Column | None:
    """Join the chunks of an entity; None where it holds no exact column."""
    layout = _document(batches)
    if layout is None or "dtype" not in layout:
        return None
    name = _descriptor(np.dtype(layout["dtype"])).component
    rows = [b for b in batches if name in b.schema.names and b.num_rows]
    rows.sort(key=lambda batch: int(_times(batch)[0]))
    tail = tuple(layout["shape"])
    flat = [b.column(name).flatten().to_numpy(zero_copy_only=False) for b in rows]
    values = np.concatenate([np.zeros(0, dtype=layout["dtype"]), *flat])
    t_ns = np.concatenate([np.zeros(0, dtype=np.int64), *map(_times, rows)])
    if not layout["ragged"]:
        return Column(t_ns, values.reshape(len(t_ns), *tail))
    lengths = [b.column(name).value_lengths().to_numpy(zero_copy_only=False) for b in rows]
    sizes = np.concatenate([np.zeros(1, dtype=np.int64), *lengths])
    offsets = np.cumsum(sizes, dtype=np.int64) // _size(tail)
    return Column(t_ns, values.reshape(-1, *tail), offsets)


def _document(batches: Iterable[pa.RecordBatch]) -> Any:
    for batch in batches:
        if _JSON.component in batch.schema.names:
            return json.loads(batch.column(_JSON.component)[0][0].as_py())
    return None


def _size(tail: tuple[int, ...]) -> int:
    return math.prod(tail)


def _times(batch: pa.RecordBatch) -> Ints:
    return np.asarray(batch.column(TIMELINE).to_numpy(zero_copy_only=False)).astype(np.int64)


@contextmanager
def _reading(path: Path) -> Iterator[None]:
    try:
        yield
    except (RuntimeError, ValueError, OSError, Warning, KeyError) as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise RecordingError(
            f"{path} is truncated or not a recording ({reason}): "
            "give a complete .rrd written by 'lpet simulate' or 'lpet import'"
        ) from None


def _open(path: Path) -> tuple[LazyStore, StoreEntry, bool]:
    """Open the index; a file without one is incomplete, which the SDK only warns about."""
    with _reading(path), warnings.catch_warnings():
        warnings.simplefilter("error")
        reader = RrdReader(path)
        store = reader.store()
        return store, reader.recordings()[0], bool(reader.blueprints())


def _temporary_beside(path: Path) -> Path:
    """Make an empty hidden file in the folder of the final name, where renaming is atomic."""
    if path.is_dir():
        raise OutputError(f"cannot write {path}: it is a folder; give the name of a .rrd file")
    temporary = path.with_name(f".{path.name}.{uuid.uuid4().hex[:12]}.part")
    try:
        temporary.touch(exist_ok=False)
    except OSError as error:
        raise OutputError(_unwritable(path, error)) from None
    return temporary


def _unwritable(path: Path, error: OSError) -> str:
    reason = error.strerror or str(error)
    return f"cannot write {path}: {reason}; give a file in an existing, writable folder"
