"""Measurements and estimates as plain files, for an estimator that runs in a process of its own.

The files hold what `Measurements` holds and nothing of where it comes from: no truth, no seed, no
spec.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import ArrayStruct, Ints
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import (
    ImuStream,
    Measurements,
    OdometryStream,
    SightingStream,
    StereoImages,
    WheelStream,
)
from lpet_sim.recording.trajectory import Trajectory

STREAMS: Final[dict[str, type[ArrayStruct]]] = {
    "imu": ImuStream,
    "wheels": WheelStream,
    "odometry": OdometryStream,
    "sightings": SightingStream,
}
_CALIBRATION: Final = "calibration.json"
_EYES: Final = ("left", "right")


def write_measurements(measurements: Measurements, folder: Path, with_images: bool) -> None:
    """Write measurements into a folder.

    Args:
        measurements: What is handed over.
        folder: An empty folder.
        with_images: Whether the images go with them; they are large.
    """
    (folder / _CALIBRATION).write_text(json.dumps(measurements.calibration.to_mapping()))
    for name in STREAMS:
        stream = getattr(measurements, name)
        if stream is not None:
            np.savez(folder / f"{name}.npz", **_arrays(stream))
    if with_images and measurements.images is not None:
        _write_images(measurements.images, folder)


def read_measurements(folder: Path) -> Measurements:
    """Read what `write_measurements` wrote; images are read when they are asked for."""
    mapping = json.loads((folder / _CALIBRATION).read_text())
    streams: dict[str, Any] = {
        name: _stream(kind, folder / f"{name}.npz")
        for name, kind in STREAMS.items()
        if (folder / f"{name}.npz").exists()
    }
    if (folder / "images_t_ns.npy").exists():
        streams["images"] = ImagesInFiles(folder)
    return Measurements(Calibration.from_mapping(mapping), **streams)


@dataclass(frozen=True)
class ImagesInFiles:
    """Image pairs in two arrays on the disk, each page read when it is looked at.

    Attributes:
        folder: Where they are.
    """

    folder: Path

    @property
    def t_ns(self) -> Ints:
        """Times of the pairs since the start [ns], Shape (n,)."""
        return np.asarray(np.load(self.folder / "images_t_ns.npy"))

    def __len__(self) -> int:
        return len(self.t_ns)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Give the left and right grey image of a pair, Shape (h, w)."""
        left, right = (np.load(self.folder / f"{eye}.npy", mmap_mode="r") for eye in _EYES)
        return np.array(left[index]), np.array(right[index])


def write_estimate(estimate: Estimate, path: Path) -> None:
    """Write an estimate into one file."""
    T = estimate.trajectory.T_world_body
    arrays: dict[str, Any] = {"t_ns": estimate.trajectory.t_ns, "R": T.rotation, "p": T.translation}
    if estimate.covariance is not None:
        arrays["covariance"] = np.asarray(estimate.covariance)
    arrays |= {f"diagnostic_{name}": np.asarray(a) for name, a in estimate.diagnostics.items()}
    np.savez(path, **arrays)


def read_estimate(name: str, path: Path) -> Estimate:
    """Read what `write_estimate` wrote.

    Raises:
        RecordingError: Times are out of order, or lengths differ.
        ValueError: It is no such file, or arrays are missing.
    """
    with np.load(path, allow_pickle=False) as held:
        missing = {"t_ns", "R", "p"} - set(held.files)
        if missing:
            raise ValueError(f"{path.name} lacks {', '.join(sorted(missing))}")
        trajectory = Trajectory(held["t_ns"].astype(np.int64), SE3(held["R"], held["p"]))
        covariance = held["covariance"] if "covariance" in held.files else None
        named = _named(held.files)
        return Estimate(name, trajectory, covariance, {k: held[f] for k, f in named.items()})


def _named(files: Iterable[str]) -> dict[str, str]:
    prefix = "diagnostic_"
    return {name.removeprefix(prefix): name for name in files if name.startswith(prefix)}


def _arrays(stream: ArrayStruct) -> dict[str, Any]:
    return {field.name: getattr(stream, field.name) for field in fields(stream)}  # type: ignore[arg-type]


def _stream(kind: type[ArrayStruct], path: Path) -> ArrayStruct:
    with np.load(path, allow_pickle=False) as held:
        return kind(**{name: held[name] for name in held.files})


def _write_images(images: StereoImages, folder: Path) -> None:
    """Write the pairs one by one into two arrays that are never in memory as a whole."""
    np.save(folder / "images_t_ns.npy", np.asarray(images.t_ns))
    if not len(images):
        return
    first = images.pair(0)[0]
    shape = (len(images), *first.shape)
    eyes = [
        np.lib.format.open_memmap(folder / f"{eye}.npy", "w+", first.dtype, shape) for eye in _EYES
    ]
    for index in range(len(images)):
        for array, image in zip(eyes, images.pair(index), strict=True):
            array[index] = image
