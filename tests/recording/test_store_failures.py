"""What is wrong is told in one sentence, and nothing half-written stays behind."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.errors import LpetError, OutputError, RecordingError
from lpet_sim.recording.overlay import add_estimate
from lpet_sim.recording.reader import read_measurements, read_recording
from lpet_sim.recording.streams import ImuStream
from lpet_sim.recording.view import has_display, view
from lpet_sim.recording.writer import RecordingWriter, write_recording
from tests.recording import synthetic


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a small recording."""
    path = tmp_path_factory.mktemp("failures") / "run.rrd"
    write_recording(path, synthetic.recording(2.0))
    return path


def assert_one_sentence(error: LpetError) -> None:
    """Hold a message to one line that says what to do."""
    text = str(error)
    assert "\n" not in text and ("give" in text or "reads" in text)


@pytest.mark.parametrize(
    "share", [0.0, 1e-5, 1e-4, 3e-4, 0.001, 0.01, 0.1, 0.3, 0.5, 0.7, 0.9, 0.99, 0.999, 0.9999, 1.0]
)
def test_a_truncated_recording_is_refused(tmp_path: Path, written: Path, share: float) -> None:
    """A file cut anywhere, the last byte included, is not read."""
    data = written.read_bytes()
    path = tmp_path / "cut.rrd"
    path.write_bytes(data[: min(int(share * len(data)), len(data) - 1)])
    with pytest.raises(RecordingError, match="truncated or not a recording") as caught:
        read_recording(path)
    assert_one_sentence(caught.value)


@pytest.mark.parametrize("cut", [1, 2, 8, 12, 13, 31, 32, 33, 64, 100, 1000])
def test_a_missing_tail_is_noticed(tmp_path: Path, written: Path, cut: int) -> None:
    """A few bytes off the end are enough."""
    path = tmp_path / "cut.rrd"
    path.write_bytes(written.read_bytes()[:-cut])
    with pytest.raises(RecordingError, match="truncated or not a recording"):
        read_measurements(path)


@pytest.mark.parametrize("data", [b"", b"hello\n" * 500, bytes(range(256)) * 40, b"RRF2" * 99])
def test_what_is_not_an_rrd_is_refused(tmp_path: Path, data: bytes) -> None:
    """Text and noise are told apart from recordings."""
    path = tmp_path / "noise.rrd"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="not a recording") as caught:
        read_recording(path)
    assert_one_sentence(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    """The sentence holds the path."""
    with pytest.raises(RecordingError, match=r"there is no file .*absent\.rrd"):
        read_recording(tmp_path / "absent.rrd")
    with pytest.raises(RecordingError, match="there is no file"):
        read_recording(tmp_path)


def test_another_schema_is_refused(tmp_path: Path) -> None:
    """The sentence names the schema that would be read."""
    recording = synthetic.recording(1.0)
    other = replace(recording, manifest=replace(recording.manifest, schema=99))
    write_recording(tmp_path / "new.rrd", other)
    with pytest.raises(RecordingError, match="has schema 99: this version reads schema 2"):
        read_recording(tmp_path / "new.rrd")


def test_an_exception_leaves_nothing_behind(tmp_path: Path) -> None:
    """Neither the final name nor the temporary one is there, and an older file stays as it was."""
    path = tmp_path / "run.rrd"
    path.write_bytes(b"older")
    recording = synthetic.recording(1.0)
    with (
        pytest.raises(KeyboardInterrupt),
        RecordingWriter(path, recording.manifest, recording.measurements.calibration) as out,
    ):
        out.log_truth(recording.truth)
        assert path.read_bytes() == b"older"
        raise KeyboardInterrupt
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]
    assert path.read_bytes() == b"older"


def test_the_final_name_appears_only_when_all_is_written(tmp_path: Path) -> None:
    """While it is written, a recording has another name in the same folder."""
    recording = synthetic.recording(1.0)
    path = tmp_path / "run.rrd"
    with RecordingWriter(path, recording.manifest, recording.measurements.calibration) as out:
        out.log_truth(recording.truth)
        assert not path.exists() and len(list(tmp_path.iterdir())) == 1
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]


def test_a_failed_overlay_leaves_the_recording_as_it_was(tmp_path: Path, written: Path) -> None:
    """An estimate that cannot be stored does not harm the file."""
    path = tmp_path / "run.rrd"
    path.write_bytes(written.read_bytes())
    bad = replace(synthetic.estimate(duration_s=2.0), diagnostics={"inliers": np.zeros(2)})
    with pytest.raises(RecordingError, match="has 2 rows for 5 times"):
        add_estimate(path, bad)
    assert path.read_bytes() == written.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    """A folder that is missing, or a folder in place of a file, gets one sentence."""
    recording = synthetic.recording(1.0)
    for path in (tmp_path / "absent" / "run.rrd", tmp_path):
        with pytest.raises(OutputError, match="cannot write") as caught:
            write_recording(path, recording)
        assert_one_sentence(caught.value)


@pytest.mark.skipif(os.geteuid() == 0, reason="root writes anywhere")
def test_a_read_only_folder_is_refused(tmp_path: Path) -> None:
    """A folder without write permission gets one sentence."""
    tmp_path.chmod(0o500)
    with pytest.raises(OutputError, match="Permission denied"):
        write_recording(tmp_path / "run.rrd", synthetic.recording(1.0))


def test_pieces_out_of_order_are_refused(tmp_path: Path) -> None:
    """A piece that does not follow the last one raises, and no file is made."""
    recording = synthetic.recording(1.0)
    imu = recording.measurements.imu
    again = ImuStream(imu.t_ns[:5].copy(), imu.gyro_radps[:5].copy(), imu.accel_mps2[:5].copy())
    with (
        pytest.raises(RecordingError, match="times must increase strictly"),
        RecordingWriter(
            tmp_path / "r.rrd", recording.manifest, recording.measurements.calibration
        ) as out,
    ):
        out.log_imu(imu)
        out.log_imu(again)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "image", [np.zeros((4, 4, 3), np.uint8), np.zeros((4, 4)), np.zeros((0, 4), np.uint8)]
)
def test_only_grey_integer_images_are_taken(tmp_path: Path, image: np.ndarray) -> None:
    """Colour, floats and nothing are refused."""
    recording = synthetic.recording(1.0)
    with (
        pytest.raises(RecordingError, match="valid are grey images"),
        RecordingWriter(
            tmp_path / "r.rrd", recording.manifest, recording.measurements.calibration
        ) as out,
    ):
        out.log_images(0, image, image)


def test_an_image_out_of_range_is_refused(written: Path) -> None:
    """The sentence names the valid indices."""
    images = read_measurements(written).images
    with pytest.raises(RecordingError, match="valid are 0 to 4"):
        images.pair(5)


def test_viewing_without_a_display_names_other_ways(
    written: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One sentence, and no viewer is started."""
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setattr("sys.platform", "linux")
    with pytest.raises(OutputError, match="--web-viewer"):
        view(written)
    assert has_display({"DISPLAY": ":0"}, "linux") and has_display({}, "darwin")
