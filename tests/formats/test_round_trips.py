"""A recording that goes out in a format and comes back is the one that went out."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from estimators import build_estimator
from lpet_sim.errors import OutputError, RecordingError
from lpet_sim.formats.euroc import export_euroc
from lpet_sim.formats.euroc_read import import_euroc
from lpet_sim.formats.kitti import export_kitti, import_kitti
from lpet_sim.formats.mcap_read import import_mcap
from lpet_sim.formats.mcap_write import export_mcap
from lpet_sim.formats.parquet import export_parquet, import_parquet
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.writer import write_recording
from tests.formats.samples import (
    ROUNDING,
    STREAMS,
    assert_same_images,
    assert_same_measurements,
    assert_same_truth,
    small,
)
from tests.sweep.tiny_recordings import write_tiny

Export = Callable[[Recording, Path, Progress], None]
FORMATS: dict[str, tuple[Export, Callable[[Path], Recording], float]] = {
    "asl": (export_euroc, import_euroc, ROUNDING),
    "mcap": (export_mcap, import_mcap, ROUNDING),
    "parquet": (export_parquet, import_parquet, 0.0),
}
EXPORTS: dict[str, Export] = {name: row[0] for name, row in FORMATS.items()}
EXPORTS["kitti"] = export_kitti


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("name", FORMATS)
def test_every_stream_comes_back_equal(name: str, bits: int, tmp_path: Path) -> None:
    """Readings, sightings, encoders, increments, calibration and images to the bit."""
    export, read_back, rounding = FORMATS[name]
    given = small(bits)
    export(given, tmp_path / "out", silent)
    read = read_back(tmp_path / "out")
    assert_same_measurements(read, given)
    assert_same_truth(read, given, rounding)
    assert read.manifest == given.manifest


@pytest.mark.parametrize("name", FORMATS)
def test_a_recording_without_truth_has_none_when_it_comes_back(name: str, tmp_path: Path) -> None:
    """And nothing stands in for it."""
    export, read_back, _ = FORMATS[name]
    given = small()
    export(Recording(given.manifest, given.measurements), tmp_path / "out", silent)
    read = read_back(tmp_path / "out")
    assert read.truth is None
    assert_same_measurements(read, given)


@pytest.mark.parametrize("name", FORMATS)
def test_a_recording_with_one_stream_has_that_stream_alone(name: str, tmp_path: Path) -> None:
    """What is absent stays absent."""
    export, read_back, _ = FORMATS[name]
    given = small()
    alone = Measurements(given.measurements.calibration, imu=given.measurements.imu)
    export(Recording(given.manifest, alone, given.truth), tmp_path / "out", silent)
    read = read_back(tmp_path / "out").measurements
    assert read.imu is not None
    assert alone.imu is not None
    assert read.imu.equals(alone.imu)
    assert [stream for stream in STREAMS if getattr(read, stream) is not None] == ["imu"]
    assert read.images is None


@pytest.mark.parametrize("name", FORMATS)
def test_estimators_give_the_same_to_the_bit_on_what_came_back(name: str, tmp_path: Path) -> None:
    """Dead reckoning, frame to frame and SLAM, on a drive of 3 m, by way of an .rrd."""
    export, read_back, _ = FORMATS[name]
    given = read_recording(write_tiny(tmp_path / "tiny.rrd", 1))
    export(given, tmp_path / "out", silent)
    write_recording(tmp_path / "back.rrd", read_back(tmp_path / "out"))
    read = read_recording(tmp_path / "back.rrd")
    for estimator in ("dead_reckoning", "frame_to_frame", "slam"):
        here, there = (
            build_estimator(estimator).estimate(recording.measurements)
            for recording in (given, read)
        )
        assert here.trajectory.equals(there.trajectory)
        assert here.covariance is not None
        assert there.covariance is not None
        assert here.covariance.tobytes() == there.covariance.tobytes()


def test_kitti_brings_images_times_and_the_cameras_path_back(tmp_path: Path) -> None:
    """The body is then the camera's place, and the world the first body; distances stay."""
    given = small(12)
    export_kitti(given, tmp_path / "out")
    read = import_kitti(tmp_path / "out")
    assert_same_images(read.measurements.images, given.measurements.images)
    stereo, declared = (r.measurements.calibration.stereo for r in (read, given))
    assert stereo is not None
    assert declared is not None
    for field in ("focal_px", "cx_px", "cy_px", "width_px", "height_px"):
        assert getattr(stereo, field) == getattr(declared, field)
    assert stereo.baseline_m == pytest.approx(declared.baseline_m, rel=1e-15)
    assert read.truth is not None
    assert given.truth is not None
    assert given.measurements.images is not None
    cameras = given.truth.trajectory.at(given.measurements.images.t_ns) @ (
        declared.T_body_camera.se3()
    )
    moved = (cameras[0].inverse() @ cameras).translation
    found = read.truth.body.T_world_body.translation @ stereo.T_body_camera.se3().rotation
    np.testing.assert_allclose(found, moved, atol=1e-12)


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_never_writes_into_a_folder_that_holds_something(
    name: str, tmp_path: Path
) -> None:
    """The sentence names the folder, and nothing is left behind or lost."""
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match="out is there already; give the name of a new folder"):
        EXPORTS[name](small(), tmp_path / "out", silent)
    assert [path.name for path in tmp_path.rglob("*")] == ["out", "mine.txt"]


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_that_breaks_off_leaves_nothing(name: str, tmp_path: Path) -> None:
    """An image that cannot be read in the middle of it."""
    given = small()
    broken = Measurements(given.measurements.calibration, images=_Breaking(_Made(5)))
    with pytest.raises(RecordingError, match="cut off"):
        EXPORTS[name](Recording(given.manifest, broken, given.truth), tmp_path / "out", silent)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", EXPORTS)
def test_the_memory_of_an_export_does_not_grow_with_its_images(name: str, tmp_path: Path) -> None:
    """Forty pairs take as much as sixteen, though all of them are four times the difference."""
    peaks = []
    for count in (16, 16, 40):
        given = small()
        lazy = Recording(
            given.manifest, Measurements(given.measurements.calibration, images=_Made(count))
        )
        tracemalloc.start()
        EXPORTS[name](lazy, tmp_path / f"{count}_{len(peaks)}", silent)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    added = (40 - 16) * 2 * _Made.SIDE**2
    assert peaks[2] - peaks[1] < 0.1 * added


IMPORTS: dict[str, Callable[[Path], Recording]] = {name: row[1] for name, row in FORMATS.items()}
IMPORTS["kitti"] = import_kitti


@pytest.mark.parametrize("name", IMPORTS)
def test_the_memory_of_an_import_does_not_grow_with_its_images(name: str, tmp_path: Path) -> None:
    """As for the export, with every pair read once, the way it goes into a recording."""
    peaks = []
    for count in (16, 16, 40):
        given, folder = small(), tmp_path / f"{count}_{len(peaks)}"
        stereo = given.measurements.calibration.stereo
        assert stereo is not None
        size = {"width_px": _Made.SIDE, "height_px": _Made.SIDE}
        calibration = given.measurements.calibration.model_copy(
            update={"stereo": stereo.model_copy(update=size)}
        )
        made = Recording(given.manifest, Measurements(calibration, images=_Made(count)))
        EXPORTS[name](made, folder, silent)
        tracemalloc.start()
        images = IMPORTS[name](folder).measurements.images
        assert images is not None
        sums = [int(eye.sum()) for k in range(count) for eye in images.pair(k)]
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert len(set(sums)) > 1
    added = (40 - 16) * 2 * _Made.SIDE**2
    assert peaks[2] - peaks[1] < 0.1 * added


class _Made:
    """Image pairs of noise, made when they are asked for."""

    SIDE = 256

    def __init__(self, count: int) -> None:
        self.t_ns = np.arange(count) * 100_000_000

    def __len__(self) -> int:
        return len(self.t_ns)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        rows = np.arange(self.SIDE**2, dtype=np.uint64) * np.uint64(2654435761 + 2 * index)
        left = (rows >> np.uint64(13)).astype(np.uint8).reshape(self.SIDE, self.SIDE)
        return left, left[::-1]


class _Breaking:
    """Image pairs of which the third cannot be read."""

    def __init__(self, images: _Made) -> None:
        self._images, self.t_ns = images, images.t_ns

    def __len__(self) -> int:
        return len(self._images)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        if index == 2:
            raise RecordingError("the file is cut off")
        return self._images.pair(index)
