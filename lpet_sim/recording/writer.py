"""Writing a recording piece by piece, with memory that does not grow with the traverse."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording import layout
from lpet_sim.recording.arrays import ArrayStruct, Ints
from lpet_sim.recording.buffers import ColumnBuffers, ImageBuffer
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.columns import Column, take_apart
from lpet_sim.recording.overview import Overview
from lpet_sim.recording.png import encode_png
from lpet_sim.recording.publish import publish
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.scene import DrawnLink, Mesh
from lpet_sim.recording.sketch import Sketch
from lpet_sim.recording.store import StoreWriter
from lpet_sim.recording.streams import ImuStream, OdometryStream, SightingStream, WheelStream
from lpet_sim.recording.truth import Event, Truth, in_order
from lpet_sim.recording.visuals import Pen


class RecordingWriter:
    """Writes one recording, as a context manager.

    The file grows under a temporary name and takes its final one when the context ends well; when
    it ends with an exception, nothing is left behind. Pieces of a stream must follow each other in
    time; streams may interleave in any order.
    """

    def __init__(
        self,
        path: Path | str,
        manifest: Manifest,
        calibration: Calibration,
        keep_images: int = 1,
        draw_sightings_every: int | None = None,
    ) -> None:
        """Open the file.

        Args:
            path: The final name, ending in .rrd.
            manifest: Where the recording comes from.
            calibration: What is declared of the sensors.
            keep_images: 1 keeps all image pairs, n every n-th, 0 none.
            draw_sightings_every: Of how many image pairs one has its sightings drawn; as
                ``keep_images`` says where None, and one of ten where no images are kept. All
                sightings are stored in any case.

        Raises:
            OutputError: The folder cannot be written.
        """
        self._store = StoreWriter(Path(path))
        self._manifest = manifest
        self._keep_images = keep_images
        self._images_seen = 0
        self._events: list[Event] = []
        self._has_truth = False
        self._columns = ColumnBuffers(self._store.send)
        self._images = ImageBuffer(self._send_images)
        self._store.send_json(layout.MANIFEST, asdict(manifest))
        self._store.send_json(layout.CALIBRATION, calibration.to_mapping())
        every = draw_sightings_every or keep_images or 10
        self._sketch = Sketch(Pen(self._store.stream), calibration, every, Overview())
        self._sketch.cameras()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Complete the file, or remove it where the context ends with an exception."""
        if kind is not None:
            self._store.discard()
            return
        try:
            self._complete()
        except BaseException:
            self._store.discard()
            raise

    def log_truth(self, truth: Truth) -> None:
        """Add a piece of the truth."""
        self._has_truth = True
        self._log(layout.TRUTH_BODY, truth.body)
        self._sketch.body(truth.body)
        if truth.wheels is not None:
            self._log(layout.TRUTH_WHEELS, truth.wheels)
            self._sketch.wheels(truth.wheels)
        self._events.extend(truth.events)

    def log_imu(self, imu: ImuStream) -> None:
        """Add a piece of the inertial measurements."""
        self._log(layout.IMU, imu)

    def log_wheels(self, wheels: WheelStream) -> None:
        """Add a piece of the encoder readings."""
        self._log(layout.WHEELS, wheels)

    def log_odometry(self, odometry: OdometryStream) -> None:
        """Add a piece of the motion increments."""
        self._log(layout.ODOMETRY, odometry)

    def log_sightings(self, sightings: SightingStream) -> None:
        """Add the sightings of some image pairs."""
        self._log(layout.SIGHTINGS, sightings)
        self._sketch.sightings(sightings)

    def log_images(self, t_ns: int, left: NDArray[Any], right: NDArray[Any]) -> bool:
        """Add an image pair, or pass over it as ``keep_images`` says.

        Args:
            t_ns: Time since the start [ns].
            left: Grey image, Shape (h, w), uint8 or uint16.
            right: Likewise.

        Returns:
            Whether the pair was kept.

        Raises:
            RecordingError: An image has another shape or type.
        """
        index = self._images_seen
        kept = self._keep_images > 0 and index % self._keep_images == 0
        self._images_seen += 1
        if kept:
            times, indices = np.array([t_ns], np.int64), np.array([index], np.int64)
            self._columns.add(layout.IMAGE_INDEX, Column(times, indices))
            self._sketch.image(times)
            self._images.add(int(t_ns), encode_png(left), encode_png(right))
        return kept

    def draw_mesh(self, name: str, mesh: Mesh) -> None:
        """Draw a part of the ground or its rocks; another mesh of the same name replaces it."""
        self._sketch.mesh(name, mesh)

    def draw_rover(self, links: Sequence[DrawnLink]) -> None:
        """Draw the parts of the rover, parents before what hangs on them."""
        self._sketch.links(links)

    def draw_motion(self, t_ns: Ints, motions: Mapping[str, SE3]) -> None:
        """Move parts of the rover; the body itself moves with the truth.

        Args:
            t_ns: Times [ns], Shape (n,); rows are thinned to five a second.
            motions: ``T_parent_link`` by the part's name, Shape (n,) each.
        """
        self._sketch.motion(t_ns, motions)

    def _log(self, prefix: str, struct: ArrayStruct) -> None:
        for name, column in take_apart(struct):
            self._columns.add(f"{prefix}/{name}", column)

    def _send_images(self, t_ns: Ints, left: list[bytes], right: list[bytes]) -> None:
        self._store.send_pngs(layout.image("left"), t_ns, left)
        self._store.send_pngs(layout.image("right"), t_ns, right)
        self._store.flush()

    def _complete(self) -> None:
        self._columns.flush()
        self._images.flush()
        events = in_order(self._events)  # one that lasts is known when it is over
        if self._has_truth:
            self._store.send_json(layout.EVENTS, [asdict(event) for event in events])
        self._sketch.finish(events)
        publish(self._store, self._sketch.overview, self._manifest)
        self._store.commit()


def write_recording(
    path: Path | str, recording: Recording, keep_images: int = 1, progress: Progress = silent
) -> None:
    """Write a whole recording at once, its images one pair at a time.

    Args:
        path: The final name, ending in .rrd.
        recording: What to write.
        keep_images: 1 keeps all image pairs, n every n-th, 0 none.
        progress: Called after each pair.

    Raises:
        OutputError: The folder cannot be written.
    """
    measurements = recording.measurements
    with RecordingWriter(path, recording.manifest, measurements.calibration, keep_images) as out:
        if recording.truth is not None:
            out.log_truth(recording.truth)
        if measurements.imu is not None:
            out.log_imu(measurements.imu)
        if measurements.wheels is not None:
            out.log_wheels(measurements.wheels)
        if measurements.odometry is not None:
            out.log_odometry(measurements.odometry)
        if measurements.images is not None:
            times = measurements.images.t_ns
            for index, t_ns in track(enumerate(times), len(times), progress):
                out.log_images(int(t_ns), *measurements.images.pair(index))
        if measurements.sightings is not None:
            out.log_sightings(measurements.sightings)
