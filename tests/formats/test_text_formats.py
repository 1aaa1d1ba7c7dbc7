"""Stamps, TUM trajectories, KITTI sequences and Kalibr's files: exact, and refused where wrong."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
import yaml

from lpet_sim.errors import OutputError, RecordingError
from lpet_sim.formats.clock import EPOCH_NS, seconds_text, stamp_of_text
from lpet_sim.formats.kalibr import export_kalibr
from lpet_sim.formats.kitti import export_kitti, import_kitti
from lpet_sim.formats.parquet import export_parquet, import_parquet
from lpet_sim.formats.tum import export_tum, import_tum, read_tum
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.recording import Recording
from lpet_sim.rng import stream
from tests.formats.samples import small
from tests.recording.synthetic import estimate
from tests.recording.test_kitti_import import make_folder


def test_stamps_go_to_text_and_back_to_the_nanosecond() -> None:
    """Of today, of our epoch, and of any; also in scientific notation, as KITTI writes them."""
    stamps = stream(0, "stamps").integers(0, 2 * 10**18, 500).tolist()
    for stamp in (0, 1, EPOCH_NS, EPOCH_NS + 1, 1403636579763555584, *stamps):
        assert stamp_of_text(seconds_text(stamp)) == stamp
    assert stamp_of_text("1.036224e-01") == 103_622_400
    assert stamp_of_text("1e-10") == 0
    assert stamp_of_text("6e-10") == 1
    assert stamp_of_text("-2.5") == -2_500_000_000
    assert stamp_of_text(".5") == 500_000_000


@pytest.mark.parametrize("text", ["", ".", "one", "1.2.3", "nan"])
def test_what_is_no_time_is_refused(text: str) -> None:
    """The sentence shows it."""
    with pytest.raises(RecordingError, match="is no time; seconds are expected"):
        stamp_of_text(text)


def test_seconds_of_our_stamps_keep_the_nanosecond_in_a_double() -> None:
    """Which those of today's date lose; that is why exports do not begin there."""
    for t_ns in stream(1, "stamps").integers(0, 85 * 86_400 * 10**9, 500).tolist():
        assert nearest_ns(float(seconds_text(EPOCH_NS + t_ns))) == EPOCH_NS + t_ns
        assert len(str(EPOCH_NS + t_ns)) == 16
    today = 1_763_000_000_000_000_001
    assert nearest_ns(float(seconds_text(today))) != today


def nearest_ns(seconds: float) -> int:
    """Round seconds to nanoseconds, without an error of its own."""
    return round(Fraction(seconds) * 10**9)


def test_truth_and_estimates_become_tum_files(tmp_path: Path) -> None:
    """One for each, under its own name, on the clock of the other exports."""
    given, guess = small(), estimate("frame_to_frame", 4.0)
    export_tum(given, {guess.name: guess}, tmp_path / "tum")
    assert sorted(path.name for path in (tmp_path / "tum").iterdir()) == [
        "frame_to_frame.txt",
        "truth.txt",
    ]
    back = read_tum(tmp_path / "tum" / "frame_to_frame.txt")
    assert back.t_ns.tolist() == guess.trajectory.t_ns.tolist()
    raw = np.loadtxt(tmp_path / "tum" / "truth.txt")
    assert raw[0, 0] == EPOCH_NS / 1e9
    truth = import_tum(tmp_path / "tum" / "truth.txt").truth
    assert truth is not None
    assert given.truth is not None
    assert truth.body.t_ns.tolist() == given.truth.body.t_ns.tolist()
    assert truth.body.T_world_body.translation.tobytes() == (
        given.truth.body.T_world_body.translation.tobytes()
    )


def test_a_tum_file_of_others_begins_with_its_first_row(tmp_path: Path) -> None:
    """Quaternions need not be of unit length, and any white space will do."""
    path = tmp_path / "groundtruth.txt"
    path.write_text("# by hand\n1305031098.6659 1 2 3 0 0 0 2\n\n1305031098.7659\t1 2 4 0 0 0 1\n")
    read = import_tum(path)
    assert read.truth is not None
    assert read.truth.body.t_ns.tolist() == [0, 100_000_000]
    np.testing.assert_allclose(read.truth.body.T_world_body.rotation, np.eye(3)[None] + [[[0]]] * 2)
    start = read.measurements.calibration.T_world_body_start
    assert start.translation_m == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "holds no pose"),
        ("# nothing\n", "holds no pose"),
        ("1 2 3\n", "line 1: 'time x y z qx qy qz qw' is expected"),
        ("1 0 0 0 0 0 0 one\n", "line 1: could not convert"),
        ("1 0 0 0 0 0 0 nan\n", "all finite"),
        ("1 0 0 0 0 0 0 0\n", "a quaternion that is not zero"),
        ("1400000000000000000 0 0 0 0 0 0 1\n", "line 1: .* these look like nanoseconds"),
        ("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n", "bad.txt, row 2 .* must increase"),
    ],
)
def test_a_file_that_is_no_trajectory_is_refused(text: str, said: str, tmp_path: Path) -> None:
    """In one sentence that says what is expected."""
    (tmp_path / "bad.txt").write_text(text)
    with pytest.raises(RecordingError, match=said):
        read_tum(tmp_path / "bad.txt")


def test_a_mark_of_the_byte_order_is_passed_over(tmp_path: Path) -> None:
    """As editors of Windows write one."""
    (tmp_path / "bom.txt").write_text("\ufeff# time x\n1 0 0 0 0 0 0 1\n", encoding="utf-8")
    assert len(read_tum(tmp_path / "bom.txt")) == 1


def test_there_must_be_something_to_export(tmp_path: Path) -> None:
    """TUM wants a truth or an estimate, KITTI images, Kalibr sensors."""
    given = small()
    bare = Recording(given.manifest, type(given.measurements)(Calibration()))
    with pytest.raises(RecordingError, match="no truth and no estimate; run 'lpet estimate'"):
        export_tum(bare, {}, tmp_path / "out")
    with pytest.raises(RecordingError, match="no stream 'images'"):
        export_kitti(bare, tmp_path / "out")
    with pytest.raises(RecordingError, match="neither cameras nor an inertial unit"):
        export_kalibr(Calibration(), tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_sequence_without_poses_has_no_truth(tmp_path: Path) -> None:
    """As those that KITTI keeps the truth of."""
    given = small()
    export_kitti(Recording(given.manifest, given.measurements), tmp_path / "kitti")
    assert not (tmp_path / "kitti" / "poses.txt").exists()
    assert import_kitti(tmp_path / "kitti").truth is None


KITTI_DAMAGES = {
    "calib.txt": ("P0: 1 2 3\n", "12 numbers"),
    "calib.txt of unequal eyes": (
        "P0: 100 0 32 0 0 100 24 0 0 0 1 0\nP1: 100 0 40 -20 0 100 24 0 0 0 1 0\n",
        "rectify both to one focal length",
    ),
    "times.txt": ("0.0\n0.5\n", "9 image pairs but 2 times"),
    "poses.txt": ("1 0 0 0 0 1 0 0 0 0 1 0\n", "9 image pairs but 1 poses"),
}


@pytest.mark.parametrize("name", KITTI_DAMAGES)
def test_what_is_wrong_with_a_sequence_is_said(name: str, tmp_path: Path) -> None:
    """With the file or the counts."""
    export_kitti(small(), tmp_path / "kitti")
    text, said = KITTI_DAMAGES[name]
    (tmp_path / "kitti" / name.split()[0]).write_text(text)
    with pytest.raises(RecordingError, match=said):
        import_kitti(tmp_path / "kitti")


def test_a_folder_that_does_not_say_its_baseline_asks_for_it(tmp_path: Path) -> None:
    """A camera matrix alone has no scale; what is given is taken."""
    folder = make_folder(tmp_path)
    with pytest.raises(RecordingError, match="does not say how far apart the eyes are"):
        import_kitti(folder)
    stereo = import_kitti(folder, baseline_m=0.12).measurements.calibration.stereo
    assert stereo is not None and stereo.baseline_m == 0.12


def test_the_truth_is_of_the_body_that_the_camera_is_declared_to_sit_in(tmp_path: Path) -> None:
    """A drive of our own, out and in with its camera's mount: the true motion comes back."""
    given = small()
    export_kitti(given, tmp_path / "kitti")
    stereo = given.measurements.calibration.stereo
    assert given.truth is not None and given.measurements.images is not None
    back = import_kitti(tmp_path / "kitti", Calibration(stereo=stereo)).truth
    assert back is not None
    true = given.truth.trajectory.at(given.measurements.images.t_ns)
    moved = true[0].inverse() @ true
    off = back.body.T_world_body.inverse() @ moved
    assert np.abs(off.log()).max() < 1e-9


def test_a_sequence_that_lacks_a_file_is_told_what_there_should_be(tmp_path: Path) -> None:
    """Both layouts are named."""
    export_kitti(small(), tmp_path / "kitti")
    (tmp_path / "kitti" / "calib.txt").unlink()
    with pytest.raises(RecordingError, match=r"lacks calib.txt; expected are image_0/.* or left/"):
        import_kitti(tmp_path / "kitti")


def test_kalibrs_files_place_the_cameras_in_the_inertial_unit(tmp_path: Path) -> None:
    """``T_cam_imu`` takes a point of the unit into the camera; the right one stands at -b of it."""
    given = small().measurements.calibration
    imu = given.imu
    assert imu is not None
    assert given.stereo is not None
    placed = type(given.stereo.T_body_camera)(
        translation_m=(0.1, 0.2, 0.3), q_wxyz=(0.5, 0.5, 0.5, 0.5)
    )
    moved = given.model_copy(update={"imu": imu.model_copy(update={"T_body_imu": placed})})
    export_kalibr(moved, tmp_path / "kalibr")
    chain = yaml.safe_load((tmp_path / "kalibr" / "camchain-imucam.yaml").read_text())
    p_body = np.array([5.0, 1.0, 0.5])
    p_imu = placed.se3().inverse() @ p_body
    p_left = given.stereo.T_body_camera.se3().inverse() @ p_body
    for name, apart in (("cam0", 0.0), ("cam1", given.stereo.baseline_m)):
        found = SE3.from_matrix(chain[name]["T_cam_imu"]) @ p_imu
        np.testing.assert_allclose(found, p_left - [apart, 0, 0], atol=1e-12)
    noise = yaml.safe_load((tmp_path / "kalibr" / "imu.yaml").read_text())
    assert noise["gyroscope_noise_density"] == imu.gyro_random_walk_radps_rthz
    assert noise["update_rate"] == imu.rate_hz


def test_parquet_files_open_without_us(tmp_path: Path) -> None:
    """Names, units and values as any reader of Parquet sees them."""
    import pyarrow.parquet as pq

    given = small()
    export_parquet(given, tmp_path / "out")
    table = pq.read_table(tmp_path / "out" / "imu.parquet")
    assert table.column_names == ["t_ns", "gyro_radps", "accel_mps2"]
    assert given.measurements.imu is not None
    assert table.column("gyro_radps")[7].as_py() == given.measurements.imu.gyro_radps[7].tolist()


@pytest.mark.parametrize("name", ["recording.parquet", "imu.parquet"])
def test_parquet_files_that_are_cut_are_refused(name: str, tmp_path: Path) -> None:
    """With the file that is."""
    export_parquet(small(), tmp_path / "out")
    path = tmp_path / "out" / name
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(RecordingError, match=rf"cannot read .*{name}"):
        import_parquet(tmp_path / "out")


def test_a_folder_that_cannot_be_made_is_said(tmp_path: Path) -> None:
    """A file stands where the folder would."""
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file"):
        export_parquet(small(), tmp_path / "file" / "out")
