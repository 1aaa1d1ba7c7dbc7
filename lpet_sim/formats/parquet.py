"""Recordings as Parquet, one file for each stream, for keeping: nothing is lost.

Each column of a stream is a list of numbers; its shape stands in the field's metadata. Calibration,
manifest and events are JSON in the metadata of ``recording.parquet``. Any reader of Parquet opens
them without this package.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from lpet_sim.errors import RecordingError, SpecError
from lpet_sim.outputs import whole_folder
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import ArrayStruct, Ints
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.columns import Column, put_together, take_apart
from lpet_sim.recording.png import decode_png, encode_png
from lpet_sim.recording.recording import SCHEMA_VERSION, Manifest, Recording
from lpet_sim.recording.streams import (
    ImuStream,
    Measurements,
    OdometryStream,
    SightingStream,
    StereoImages,
    WheelStream,
)
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth

ABOUT, IMAGES = "recording.parquet", "images.parquet"
BODY_TRUTH, WHEEL_TRUTH = "truth_body", "truth_wheels"
PAIRS_AT_ONCE = 8

Struct = TypeVar("Struct", bound=ArrayStruct)
_IMAGE_SCHEMA = pa.schema(
    [("t_ns", pa.int64()), ("left_png", pa.binary()), ("right_png", pa.binary())]
)


def export_parquet(recording: Recording, folder: Path, progress: Progress = silent) -> None:
    """Write a recording as Parquet files, images a few pairs at a time.

    Args:
        recording: What to write.
        folder: A folder that is made.
        progress: Called after each pair.

    Raises:
        OutputError: The folder is there already, or cannot be written.
    """
    with whole_folder(folder) as out:
        _write_about(recording, out / ABOUT)
        for name, struct in _streams(recording):
            pq.write_table(_table(struct), out / f"{name}.parquet")
        if recording.measurements.images is not None:
            _write_images(recording.measurements.images, out / IMAGES, progress)


def import_parquet(folder: Path) -> Recording:
    """Read what `export_parquet` wrote; images stay on disk until they are asked for.

    Raises:
        RecordingError: The folder lacks a file, or a file is not valid.
    """
    about = _about(folder)
    try:
        calibration = Calibration.from_mapping(about["calibration"], str(folder / ABOUT))
        manifest = Manifest(**about["manifest"])
        events = tuple(Event(**event) for event in about["events"])
    except (SpecError, KeyError, TypeError) as error:
        raise RecordingError(f"{folder / ABOUT} is not valid: {error}") from None
    if manifest.schema != SCHEMA_VERSION:
        raise RecordingError(
            f"{folder} has schema {manifest.schema}: this version reads schema {SCHEMA_VERSION}"
        )
    body = _read(folder, BODY_TRUTH, BodyTruth)
    measurements = Measurements(
        calibration,
        imu=_read(folder, "imu", ImuStream),
        wheels=_read(folder, "wheels", WheelStream),
        sightings=_read(folder, "sightings", SightingStream),
        images=ParquetImages(folder / IMAGES) if (folder / IMAGES).exists() else None,
        odometry=_read(folder, "odometry", OdometryStream),
    )
    truth = None if body is None else Truth(body, _read(folder, WHEEL_TRUTH, WheelTruth), events)
    return Recording(manifest, measurements, truth)


class ParquetImages:
    """Image pairs of a Parquet file, one group of rows in memory at a time."""

    def __init__(self, path: Path) -> None:
        """Read the times of the pairs."""
        self._path = path
        self._t_ns: Ints = _file(path).read(columns=["t_ns"]).column("t_ns").to_numpy()
        self._group = -1
        self._pairs: list[tuple[bytes, bytes]] = []

    @property
    def t_ns(self) -> Ints:
        """Times of the pairs since the start [ns], Shape (n,)."""
        return self._t_ns

    def __len__(self) -> int:
        return len(self._t_ns)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Give the left and right image of a pair, Shape (h, w), uint8 or uint16."""
        group, row = divmod(index, PAIRS_AT_ONCE)
        if group != self._group:
            table = _file(self._path).read_row_group(group)
            left, right = (table.column(name).to_pylist() for name in ("left_png", "right_png"))
            self._group, self._pairs = group, list(zip(left, right, strict=True))
        left_png, right_png = self._pairs[row]
        return decode_png(left_png), decode_png(right_png)


def _streams(recording: Recording) -> Iterator[tuple[str, ArrayStruct]]:
    measurements, truth = recording.measurements, recording.truth
    for name in ("imu", "wheels", "odometry", "sightings"):
        struct = getattr(measurements, name)
        if struct is not None:
            yield name, struct
    if truth is not None:
        yield BODY_TRUTH, truth.body
        if truth.wheels is not None:
            yield WHEEL_TRUTH, truth.wheels


def _write_about(recording: Recording, path: Path) -> None:
    events = () if recording.truth is None else recording.truth.events
    about = {
        "calibration": recording.measurements.calibration.to_mapping(),
        "manifest": asdict(recording.manifest),
        "events": [asdict(event) for event in events],
    }
    metadata = {key: json.dumps(value) for key, value in about.items()}
    pq.write_table(pa.table({"key": list(about)}).replace_schema_metadata(metadata), path)


def _table(struct: ArrayStruct) -> pa.Table:
    names, arrays = [pa.field("t_ns", pa.int64())], [pa.array(struct.t_ns)]
    for name, column in take_apart(struct):
        about = {"shape": json.dumps(column.tail), "ragged": json.dumps(column.offsets is not None)}
        values = _lists(column)
        names.append(pa.field(name, values.type, metadata=about))
        arrays.append(values)
    return pa.table(arrays, schema=pa.schema(names))


def _lists(column: Column) -> pa.Array:
    flat = pa.array(column.values.reshape(-1))
    if not column.tail and column.offsets is None:
        return flat
    return pa.LargeListArray.from_arrays(pa.array(column.row_offsets()), flat)


def _read(folder: Path, name: str, kind: type[Struct]) -> Struct | None:
    path = folder / f"{name}.parquet"
    if not path.exists():
        return None
    table = _file(path).read().combine_chunks()
    try:
        t_ns = table.column("t_ns").to_numpy()
        fields = (field for field in table.schema if field.name != "t_ns")
        columns = {
            f"/{field.name}": _column(t_ns, field, table.column(field.name)) for field in fields
        }
        return put_together(kind, "", columns)
    except (KeyError, ValueError, TypeError) as error:
        raise RecordingError(f"{path} is no stream of a recording: {error}") from None


def _column(t_ns: Ints, field: pa.Field, held: pa.ChunkedArray) -> Column:
    tail = tuple(json.loads(field.metadata[b"shape"]))
    ragged = json.loads(field.metadata[b"ragged"])
    lists = pa.types.is_large_list(field.type)
    flat = np.concatenate(
        [np.zeros(0, (field.type.value_type if lists else field.type).to_pandas_dtype())]
        + [_flat(chunk, lists) for chunk in held.chunks]
    )
    values = flat.reshape(-1, *tail)
    if not ragged:
        return Column(t_ns, values.reshape(len(t_ns), *tail))
    lengths = [chunk.value_lengths().to_numpy(zero_copy_only=False) for chunk in held.chunks]
    size = int(np.prod(tail, dtype=np.int64))
    sums = np.cumsum(np.concatenate([np.zeros(1, np.int64), *lengths]), dtype=np.int64)
    return Column(t_ns, values, sums // size)


def _flat(chunk: pa.Array, lists: bool) -> NDArray[Any]:
    return np.asarray((chunk.flatten() if lists else chunk).to_numpy(zero_copy_only=False))


def _write_images(images: StereoImages, path: Path, progress: Progress) -> None:
    with pq.ParquetWriter(path, _IMAGE_SCHEMA, compression="none") as writer:
        rows: list[dict[str, Any]] = []
        for index in track(range(len(images)), len(images), progress):
            left, right = images.pair(index)
            pngs = {"left_png": encode_png(left), "right_png": encode_png(right)}
            rows.append({"t_ns": int(images.t_ns[index]), **pngs})
            if len(rows) == PAIRS_AT_ONCE or index == len(images) - 1:
                writer.write_table(pa.Table.from_pylist(rows, _IMAGE_SCHEMA))
                rows = []


def _about(folder: Path) -> dict[str, Any]:
    metadata = _file(folder / ABOUT).schema_arrow.metadata or {}
    return {
        key.decode(): json.loads(value)
        for key, value in metadata.items()
        if not key.startswith(b"ARROW")
    }


def _file(path: Path) -> pq.ParquetFile:
    try:
        return pq.ParquetFile(path)
    except (OSError, pa.ArrowInvalid) as error:
        reason = str(error).splitlines()[0]
        raise RecordingError(
            f"cannot read {path}: {reason}; give a folder that 'lpet export parquet' wrote"
        ) from None
