"""Writing a recording against the rerun SDK alone, with the same arrays and images."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from benchmarks.timing import Row, Samples, compare_ms, in_turn
from lpet_sim.recording.buffers import IMAGES_PER_CHUNK
from lpet_sim.recording.columns import Column, take_apart
from lpet_sim.recording.png import encode_png
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import ImagesInMemory, StereoImages
from lpet_sim.recording.writer import write_recording

_WITH = (
    "both encode PNG with LPET's encoder; the SDK: one send_columns for each stream, "
    "images eight at a time; LPET also "
    "draws rover, path, tracks and landmarks, lays out the view, checks and renames the file"
)


@dataclass(frozen=True)
class StoreResult:
    """What was measured of the store.

    Attributes:
        rows: For the table.
        bare: Times that the SDK needs for an image pair with its share of the streams.
    """

    rows: list[Row]
    bare: Samples


def measure(path: Path, repetitions: int) -> StoreResult:
    """Time writing a simulated recording once more, with and without its images.

    Args:
        path: The recording; copies are written beside it and removed.
        repetitions: How often each is written.
    """
    whole = _in_memory(read_recording(path))
    bare_measurements = replace(whole.measurements, images=None)
    streams = replace(whole, measurements=bare_measurements)
    count = len(whole.measurements.images or ())
    images = f".rrd with {count} image pairs and all streams"
    with_images = _time(whole, path.parent, repetitions)
    without = _time(streams, path.parent, repetitions)
    rows = [
        compare_ms(images, *with_images, note=_WITH),
        compare_ms(".rrd with all streams, no images", *without, note="as above"),
    ]
    return StoreResult(rows, with_images[1].shared_by(count))


def _time(recording: Recording, folder: Path, repetitions: int) -> tuple[Samples, Samples]:
    ours, bare = folder / "benchmark_ours.rrd", folder / "benchmark_bare.rrd"
    times = in_turn(
        range(repetitions + 1),
        lambda _: write_recording(ours, recording),
        lambda _: _write_bare(bare, recording),
    )
    ours.unlink()
    bare.unlink()
    mine, theirs = times
    return mine, theirs


def _in_memory(recording: Recording) -> Recording:
    """Decode the images ahead, so that reading is not timed."""
    images = recording.measurements.images
    assert images is not None
    pairs = [images.pair(index) for index in range(len(images))]
    left, right = (np.stack(eye) for eye in zip(*pairs, strict=True))
    held = ImagesInMemory(images.t_ns, left, right)
    return replace(recording, measurements=replace(recording.measurements, images=held))


def _write_bare(path: Path, recording: Recording) -> None:
    out = rr.RecordingStream("benchmark")
    out.save(path)
    for name, column in _columns(recording):
        _send(out, name, column)
    if recording.measurements.images is not None:
        _send_images(out, recording.measurements.images)
    out.flush()
    out.disconnect()


def _columns(recording: Recording) -> Iterator[tuple[str, Column]]:
    measurements, truth = recording.measurements, recording.truth
    assert truth is not None
    streams: dict[str, Any] = {
        "imu": measurements.imu,
        "wheels": measurements.wheels,
        "sightings": measurements.sightings,
        "body": truth.body,
        "wheel_truth": truth.wheels,
    }
    for name, stream in streams.items():
        for part, column in take_apart(stream):
            yield f"{name}/{part}", column


def _send(out: rr.RecordingStream, name: str, column: Column) -> None:
    lengths = np.diff(column.row_offsets())
    values = rr.Scalars.columns(scalars=column.values.reshape(-1).astype(float))
    out.send_columns(name, [_times(column.t_ns)], values.partition(lengths))


def _send_images(out: rr.RecordingStream, images: StereoImages) -> None:
    pairs = [images.pair(index) for index in range(len(images))]
    for side, eye in zip(("left", "right"), zip(*pairs, strict=True), strict=True):
        for first in range(0, len(eye), IMAGES_PER_CHUNK):
            part = slice(first, first + IMAGES_PER_CHUNK)
            blobs = [encode_png(image) for image in eye[part]]
            kinds = ["image/png"] * len(blobs)
            columns = rr.EncodedImage.columns(blob=blobs, media_type=kinds)
            out.send_columns(f"image/{side}", [_times(images.t_ns[part])], columns)


def _times(t_ns: Any) -> rr.TimeColumn:
    return rr.TimeColumn("time", duration=t_ns.astype("timedelta64[ns]"))
