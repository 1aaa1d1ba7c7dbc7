"""Reading a recording back, to the bit."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from lpet_sim.errors import RecordingError
from lpet_sim.recording import layout
from lpet_sim.recording.arrays import Ints
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.columns import put_together
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.png import decode_png
from lpet_sim.recording.recording import SCHEMA_VERSION, Manifest, Recording
from lpet_sim.recording.store import StoreReader
from lpet_sim.recording.streams import (
    ImuStream,
    Measurements,
    OdometryStream,
    SightingStream,
    WheelStream,
)
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth


def read_recording(path: Path | str) -> Recording:
    """Read a whole recording; images stay in the file until they are asked for.

    Raises:
        RecordingError: The file is missing, truncated, or not a recording of this schema.
    """
    store = open_store(path)
    return Recording(read_manifest(store), _measurements(store), _truth(store))


def read_measurements(path: Path | str) -> Measurements:
    """Read what an estimator may know; the truth is not touched.

    Raises:
        RecordingError: The file is missing, truncated, or not a recording of this schema.
    """
    return _measurements(open_store(path))


def read_estimates(path: Path | str) -> dict[str, Estimate]:
    """Read the estimates that were added to a recording, by name.

    Raises:
        RecordingError: The file is missing, truncated, or not a recording of this schema.
    """
    store = open_store(path)
    found = [_estimate(store, prefix) for prefix in estimate_entities(store)]
    return {estimate.name: estimate for estimate in found}


def open_store(path: Path | str) -> StoreReader:
    """Open a .rrd and hold it to be a recording of this schema.

    Raises:
        RecordingError: It is not.
    """
    store = StoreReader(Path(path))
    manifest = store.json(layout.MANIFEST)
    if not isinstance(manifest, dict) or "schema" not in manifest:
        raise RecordingError(
            f"{path} is an .rrd but not an LPET recording (it has no manifest): "
            "give one written by 'lpet simulate' or 'lpet import'"
        )
    if manifest["schema"] != SCHEMA_VERSION:
        raise RecordingError(
            f"{path} has schema {manifest['schema']}: this version reads schema {SCHEMA_VERSION}"
        )
    return store


def estimate_entities(store: StoreReader) -> list[str]:
    """Name the entities under which estimates are stored."""
    depth = layout.ESTIMATES.count("/") + 1
    under = (e for e in store.entities() if e.startswith(f"{layout.ESTIMATES}/"))
    return sorted({"/".join(e.split("/")[: depth + 1]) for e in under})


class StoredImages:
    """The image pairs of a recording, read from the file as they are asked for.

    In order of time they come at the speed of the disk; a step back starts again at the beginning.
    It can be sent to another process, which then reads the file itself.
    """

    def __init__(self, path: Path, t_ns: Ints) -> None:
        """Remember the file and the times of its pairs [ns], Shape (n,)."""
        self._path = path
        self._t_ns = t_ns
        self._pairs: Iterator[tuple[bytes, bytes]] | None = None
        self._next = 0
        self._last: tuple[bytes, bytes] = (b"", b"")

    @property
    def t_ns(self) -> Ints:
        """Times of the pairs since the start [ns], Shape (n,)."""
        return self._t_ns

    def __len__(self) -> int:
        return len(self._t_ns)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Give the left and right image of a pair, Shape (h, w), uint8 or uint16.

        Raises:
            RecordingError: There is no such pair.
        """
        if not 0 <= index < len(self):
            raise RecordingError(f"there is no image pair {index}: valid are 0 to {len(self) - 1}")
        left, right = self._blobs(index)
        return decode_png(left), decode_png(right)

    def _blobs(self, index: int) -> tuple[bytes, bytes]:
        if self._pairs is None or index < self._next - 1:
            store = StoreReader(self._path)
            eyes = (store.pngs(layout.image("left")), store.pngs(layout.image("right")))
            self._pairs, self._next = zip(*eyes, strict=True), 0
        while self._next <= index:
            self._last = next(self._pairs)
            self._next += 1
        return self._last

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_pairs": None, "_next": 0}


def read_manifest(store: StoreReader) -> Manifest:
    """Read where a recording comes from."""
    return Manifest(**store.json(layout.MANIFEST))


def read_body_truth(store: StoreReader) -> BodyTruth | None:
    """Read how the body really moved, None where nobody knows."""
    columns = store.columns(f"{layout.TRUTH_BODY}/**")
    return put_together(BodyTruth, layout.TRUTH_BODY, columns)


def _measurements(store: StoreReader) -> Measurements:
    columns = store.columns("/measurements/**")
    images = columns.get(layout.IMAGE_INDEX)
    return Measurements(
        calibration=Calibration.from_mapping(store.json(layout.CALIBRATION), "calibration"),
        imu=put_together(ImuStream, layout.IMU, columns),
        wheels=put_together(WheelStream, layout.WHEELS, columns),
        sightings=put_together(SightingStream, layout.SIGHTINGS, columns),
        images=None if images is None else StoredImages(store.path, images.t_ns),
        odometry=put_together(OdometryStream, layout.ODOMETRY, columns),
    )


def _truth(store: StoreReader) -> Truth | None:
    columns = store.columns("/truth/**")
    body = put_together(BodyTruth, layout.TRUTH_BODY, columns)
    if body is None:
        return None
    events = tuple(Event(**event) for event in store.json(layout.EVENTS))
    return Truth(body, put_together(WheelTruth, layout.TRUTH_WHEELS, columns), events)


def _estimate(store: StoreReader, prefix: str) -> Estimate:
    about = store.json(prefix)
    columns = store.columns(f"{prefix}/**")
    trajectory = put_together(Trajectory, f"{prefix}/trajectory", columns)
    if trajectory is None:
        raise RecordingError(f"{store.path}: the estimate '{about['name']}' has no trajectory")
    covariance = columns.get(f"{prefix}/covariance")
    diagnostics = {key: columns[f"{prefix}/{entity}"].values for key, entity in about["rows"]}
    return Estimate(
        about["name"], trajectory, None if covariance is None else covariance.values, diagnostics
    )
