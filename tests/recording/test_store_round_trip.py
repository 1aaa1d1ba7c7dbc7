"""A recording comes back from its file equal to the bit."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.recording.reader import StoredImages, read_measurements, read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import ImuStream, Measurements, SightingStream, StereoImages
from lpet_sim.recording.truth import Truth
from lpet_sim.recording.writer import RecordingWriter, write_recording
from tests.recording import synthetic

STREAMS = ("imu", "wheels", "sightings", "odometry")


@pytest.fixture(scope="module")
def original() -> Recording:
    """Make a recording with every stream."""
    return synthetic.recording(duration_s=8.0)


@pytest.fixture(scope="module")
def written(original: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write it once."""
    path = tmp_path_factory.mktemp("store") / "run.rrd"
    write_recording(path, original)
    return path


def same_images(a: StereoImages, b: StereoImages, which: range) -> bool:
    """Tell whether images of a are those of b at some indices, in type too."""
    pairs = [(a.pair(i), b.pair(j)) for i, j in enumerate(which)]
    return all(
        x.dtype == y.dtype and np.array_equal(x, y)
        for p, q in pairs
        for x, y in zip(p, q, strict=True)
    )


def part(struct, t_from: int, t_to: int):
    """Cut the rows of a stream with times in (from, to]."""
    rows = np.flatnonzero((struct.t_ns > t_from) & (struct.t_ns <= t_to))
    names = [f for f in struct.__dataclass_fields__ if f not in struct.ragged_fields()]
    fields = {name: getattr(struct, name)[rows] for name in names}
    if isinstance(struct, SightingStream):
        low, high = (rows[0], rows[-1] + 1) if len(rows) else (0, 0)
        flat = slice(struct.offsets[low], struct.offsets[high])
        offsets = struct.offsets[low : high + 1] - struct.offsets[low]
        fields |= {"offsets": offsets, "landmark_id": struct.landmark_id[flat]}
        fields |= {"stereo_px": struct.stereo_px[flat], "sigma_px": struct.sigma_px[flat]}
    return type(struct)(**fields)


def test_every_stream_comes_back_to_the_bit(original: Recording, written: Path) -> None:
    """Measurements and truth hold the same bytes, shapes and types."""
    back = read_recording(written)
    for name in STREAMS:
        assert getattr(back.measurements, name).equals(getattr(original.measurements, name)), name
    assert back.truth.body.equals(original.truth.body)
    assert back.truth.wheels.equals(original.truth.wheels)
    assert back.truth.wheels.contact.dtype == np.uint8


def test_manifest_calibration_and_events_come_back(original: Recording, written: Path) -> None:
    """What is written as JSON is equal too, floats included."""
    back = read_recording(written)
    assert back.manifest == original.manifest
    assert back.measurements.calibration == original.measurements.calibration
    assert back.truth.events == original.truth.events


def test_special_floats_come_back_to_the_bit(tmp_path: Path, original: Recording) -> None:
    """Subnormals, negative zero, infinities and NaN survive."""
    values = np.array([[5e-324, -0.0, np.inf], [-np.inf, np.nan, 1 / 3]])
    imu = ImuStream(np.array([-7, 2**53 + 1]), values, values[::-1].copy())
    measurements = Measurements(original.measurements.calibration, imu)
    write_recording(tmp_path / "a.rrd", Recording(original.manifest, measurements))
    assert read_measurements(tmp_path / "a.rrd").imu.equals(imu)


def test_sightings_are_ragged_and_images_may_see_nothing(written: Path) -> None:
    """An image without sightings stays in its place."""
    sightings = read_measurements(written).sightings
    counts = np.diff(sightings.offsets)
    assert counts[2] == 0 and counts[-2] == 0 and counts.max() > 20
    assert len(counts) == len(sightings.t_ns)


def test_pieces_give_the_same_arrays_as_the_whole(tmp_path: Path, original: Recording) -> None:
    """Where a stream is cut while it is written does not matter."""
    m, t = original.measurements, original.truth
    edges = [-1, 10**9, 10**9 + 1, 3 * 10**9, 9 * 10**9]
    with RecordingWriter(tmp_path / "p.rrd", original.manifest, m.calibration, 0) as out:
        for low, high in pairwise(edges):
            events = tuple(e for e in t.events if low < e.t_ns <= high)
            out.log_imu(part(m.imu, low, high))
            out.log_truth(Truth(part(t.body, low, high), part(t.wheels, low, high), events))
            out.log_sightings(part(m.sightings, low, high))
            out.log_wheels(part(m.wheels, low, high))
            out.log_odometry(part(m.odometry, low, high))
    back = read_recording(tmp_path / "p.rrd")
    assert all(getattr(back.measurements, n).equals(getattr(m, n)) for n in STREAMS)
    assert back.truth.body.equals(t.body) and back.truth.wheels.equals(t.wheels)
    assert back.truth.events == t.events


def test_a_stream_of_many_chunks_keeps_its_order(tmp_path: Path, original: Recording) -> None:
    """More rows than a chunk holds come back in order of time."""
    n = 50_000
    values = np.random.default_rng(0).normal(size=(n, 3))
    imu = ImuStream(np.arange(n) * 10_000_000, values, -values)
    path = tmp_path / "long.rrd"
    with RecordingWriter(path, original.manifest, original.measurements.calibration) as out:
        for start in range(0, n, 7_001):
            rows = slice(start, start + 7_001)
            out.log_imu(ImuStream(imu.t_ns[rows], imu.gyro_radps[rows], imu.accel_mps2[rows]))
    assert read_measurements(path).imu.equals(imu)


def test_an_empty_stream_is_not_an_absent_one(tmp_path: Path, original: Recording) -> None:
    """A stream without rows comes back without rows; one never written comes back as None."""
    empty = np.zeros((0, 3))
    path = tmp_path / "e.rrd"
    with RecordingWriter(path, original.manifest, original.measurements.calibration) as out:
        out.log_imu(ImuStream(np.zeros(0, dtype=np.int64), empty, empty.copy()))
    back = read_recording(path)
    assert len(back.measurements.imu) == 0 and back.measurements.imu.gyro_radps.shape == (0, 3)
    assert back.measurements.wheels is None and back.measurements.sightings is None
    assert back.measurements.images is None and back.truth is None


def test_a_recording_without_odometry_reads_as_before(
    tmp_path: Path, original: Recording, written: Path
) -> None:
    """The stream is an addition: where it was never written it is absent, all else is the same."""
    measurements = replace(original.measurements, odometry=None)
    write_recording(tmp_path / "w.rrd", Recording(original.manifest, measurements))
    back, whole = read_measurements(tmp_path / "w.rrd"), read_measurements(written)
    assert back.odometry is None and whole.odometry is not None
    assert all(getattr(back, n).equals(getattr(whole, n)) for n in STREAMS if n != "odometry")


def test_an_imported_recording_needs_neither_wheels_nor_truth(tmp_path: Path) -> None:
    """A real data set with images alone is a recording."""
    images = synthetic.images(2.0)
    calibration = synthetic.calibration().model_copy(update={"imu": None, "wheels": None})
    whole = synthetic.recording(2.0)
    measurements = replace(
        whole.measurements, calibration=calibration, imu=None, wheels=None, sightings=None
    )
    write_recording(tmp_path / "r.rrd", Recording(replace(whole.manifest, seed=None), measurements))
    back = read_recording(tmp_path / "r.rrd")
    assert back.truth is None and back.manifest.seed is None
    assert same_images(back.measurements.images, images, range(len(images)))


@pytest.mark.parametrize("bits", [8, 12])
@pytest.mark.parametrize("keep", [0, 1, 3])
def test_images_are_kept_all_every_nth_or_none(tmp_path: Path, bits: int, keep: int) -> None:
    """Kept images are the very pixels, with the times of the images kept."""
    whole = synthetic.recording(4.0, bits=bits)
    images = synthetic.images(4.0, bits)
    write_recording(tmp_path / "i.rrd", whole, keep_images=keep)
    back = read_measurements(tmp_path / "i.rrd").images
    if keep == 0:
        assert back is None
        return
    assert np.array_equal(back.t_ns, images.t_ns[::keep])
    assert same_images(back, images, range(0, len(images), keep))


def test_images_come_in_any_order(original: Recording, written: Path) -> None:
    """Stepping back, repeating and leaping ahead give the right pairs, in another process too."""
    back, images = read_measurements(written).images, original.measurements.images
    assert isinstance(back, StoredImages)
    for index in (3, 3, 16, 0, 15, 2):
        assert np.array_equal(back.pair(index)[1], images.pair(index)[1])
    state = back.__getstate__()
    assert state["_pairs"] is None


def test_reading_measurements_leaves_the_truth_alone(written: Path) -> None:
    """What an estimator is given has no truth in it."""
    measurements = read_measurements(written)
    assert not any("truth" in name.lower() for name in vars(measurements))
