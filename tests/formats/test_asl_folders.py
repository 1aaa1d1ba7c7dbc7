"""ASL folders: what is in them, what other people's say, and what is wrong with one."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from scipy.ndimage import gaussian_filter

from lpet_sim.errors import RecordingError
from lpet_sim.formats.asl import TRUTH
from lpet_sim.formats.clock import EPOCH_NS
from lpet_sim.formats.csv_files import read_csv, write_csv
from lpet_sim.formats.euroc import export_euroc, write_measurements
from lpet_sim.formats.euroc_read import import_euroc
from lpet_sim.formats.rectify import Eye, RectifiedImages, rectified
from lpet_sim.formats.sensor_yaml import imu_of
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration, PoseSpec
from lpet_sim.recording.kitti import StereoFolder
from lpet_sim.rng import stream
from tests.formats.samples import assert_same_measurements, small


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    """Export a recording with every stream."""
    export_euroc(small(), tmp_path / "asl")
    return tmp_path / "asl"


def as_of_others(folder: Path) -> Path:
    """Take everything of our own out of a folder."""
    root = folder / "mav0"
    for path in root.glob("lpet_*"):
        shutil.rmtree(path)
    (root / "lpet.yaml").unlink()
    for path in root.glob("*/sensor.yaml"):
        said = yaml.safe_load(path.read_text())
        said.pop("lpet", None)
        path.write_text(yaml.safe_dump(said))
    return folder


def test_the_folder_has_the_names_and_columns_of_euroc(exported: Path) -> None:
    """Stamps name the images, and heads of tables are those of the data set."""
    root = exported / "mav0"
    stamp = str(EPOCH_NS + 500_000_000)
    assert (root / "cam1" / "data" / f"{stamp}.png").is_file()
    assert f"\n{stamp},{stamp}.png\n" in (root / "cam1" / "data.csv").read_text()
    head = (root / "imu0" / "data.csv").read_text().splitlines()[0]
    assert head.startswith("#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1]")
    truth = (root / "state_groundtruth_estimate0" / "data.csv").read_text().splitlines()
    assert truth[0].split(",")[4] == "q_RS_w []"
    assert len(truth[1].split(",")) == 17
    with Image.open(root / "cam0" / "data" / f"{stamp}.png") as image:
        np.testing.assert_array_equal(np.asarray(image), small().measurements.images.pair(1)[0])


def test_the_measurements_alone_hold_no_truth(tmp_path: Path) -> None:
    """No file of the truth, no manifest, and no number of it, is in such a folder."""
    given = small()
    write_measurements(given.measurements, tmp_path)
    names = {path.name for path in (tmp_path / "mav0").iterdir()}
    assert names.isdisjoint(TRUTH)
    assert given.truth is not None
    secret = repr(float(given.truth.body.T_world_body.translation[77, 0]))
    tables = [path.read_text() for path in tmp_path.rglob("*.csv")]
    assert not any(secret in table for table in tables)
    read = import_euroc(tmp_path)
    assert read.truth is None
    assert read.manifest.specs == {}
    assert_same_measurements(read, given)


def test_calibration_is_read_from_sensor_yaml_where_nothing_of_ours_is(exported: Path) -> None:
    """Places, intrinsics and noise densities carry over; turn-on biases have no key there."""
    given = small().measurements.calibration
    read = import_euroc(as_of_others(exported)).measurements.calibration
    assert read.stereo is not None
    assert given.stereo is not None
    np.testing.assert_allclose(
        read.stereo.T_body_camera.se3().matrix(),
        given.stereo.T_body_camera.se3().matrix(),
        atol=1e-14,
    )
    assert read.stereo.focal_px == given.stereo.focal_px
    assert read.stereo.baseline_m == pytest.approx(given.stereo.baseline_m, rel=1e-12)
    assert read.imu is not None
    assert given.imu is not None
    assert read.imu.rate_hz == given.imu.rate_hz
    assert read.imu.gyro_random_walk_radps_rthz == given.imu.gyro_random_walk_radps_rthz
    assert read.imu.gyro_bias_radps == 0.0
    assert read.gravity_mps2 == 9.81
    assert read.wheels is None


def test_what_the_user_declares_stands_in_place_of_what_the_folder_says(exported: Path) -> None:
    """And the rest stays."""
    imu = small().measurements.calibration.imu
    declared = Calibration(imu=imu, gravity_mps2=3.7)
    read = import_euroc(as_of_others(exported), declared).measurements.calibration
    assert read.imu == imu
    assert read.gravity_mps2 == 3.7
    assert read.stereo is not None


def test_a_folder_of_others_begins_where_its_truth_does(exported: Path) -> None:
    """The first image after the truth's beginning is time zero, and starts at its true pose."""
    table = as_of_others(exported) / "mav0/state_groundtruth_estimate0/data.csv"
    stamps, values = read_csv(table, 16)
    late = stamps >= EPOCH_NS + 700_000_000
    write_csv(table, ["timestamp"] * 17, stamps[late] + 3, values[late])
    read, given = import_euroc(exported), small()
    assert read.truth is not None
    assert given.truth is not None
    assert read.measurements.images is not None
    assert read.measurements.images.t_ns[0] == 0
    assert len(read.measurements.images) == len(given.measurements.images) - 2
    assert read.truth.body.t_ns[0] == 3
    true = given.truth.trajectory.at([1_000_000_000 - 3])[0]
    start = read.measurements.calibration.T_world_body_start.se3()
    np.testing.assert_allclose((true.inverse() @ start).log(), 0.0, atol=1e-12)
    assert read.measurements.imu is not None
    assert read.measurements.imu.t_ns[0] == 0


def test_an_image_without_its_other_eye_is_left_out(exported: Path) -> None:
    """As it happens in real folders."""
    table = exported / "mav0/cam1/data.csv"
    lines = table.read_text().splitlines()
    table.write_text("\n".join([*lines[:2], *lines[3:]]) + "\n")
    read = import_euroc(exported).measurements.images
    assert read is not None
    assert 500_000_000 not in read.t_ns
    assert len(read) == len(small().measurements.images) - 1


DAMAGES = {
    "a folder that is none": ("mav0", None, "is no ASL folder; expected is mav0/"),
    "one eye": ("mav0/cam1", None, "has cam0 only"),
    "no calibration": ("mav0/cam0/sensor.yaml", None, "cannot read .*sensor.yaml"),
    "no YAML": ("mav0/imu0/sensor.yaml", "a: [", "not valid YAML"),
    "a row too short": ("mav0/imu0/data.csv", "1,2,3\n", "line 1: a stamp and 6 numbers"),
    "no number": ("mav0/imu0/data.csv", "1,2,3,4,5,6,seven\n", "line 1: could not convert"),
    "no order": ("mav0/imu0/data.csv", "2,2,3,4,5,6,7\n1,2,3,4,5,6,7\n", "data.csv, row 2 .* incr"),
    "no layout": ("mav0/lpet_wheels0/data.csv", "1,2\n", "has no line '#lpet"),
    "no image": ("mav0/cam0/data.csv", "x,y\n", "a stamp and a file's name are expected"),
    "events that are none": ("mav0/lpet_truth0/events.json", "{", "is not valid JSON"),
    "events that are a number": ("mav0/lpet_truth0/events.json", "1", "is no list of events"),
    "an event of others": ("mav0/lpet_truth0/events.json", '[{"a": 1}]', "is no list of events"),
    "no attitude": ("mav0/state_groundtruth_estimate0/data.csv", f"1{',0' * 16}\n", "pose 1 has"),
    "an empty table": ("mav0/imu0/data.csv", "", "is empty; leave the folder out"),
}


@pytest.mark.parametrize("case", DAMAGES)
def test_what_is_wrong_with_a_folder_is_said_in_one_sentence(exported: Path, case: str) -> None:
    """It names the file, and what is expected."""
    name, text, said = DAMAGES[case]
    path = exported / name
    if text is not None:
        path.write_text(text)
    elif path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()
    with pytest.raises(RecordingError, match=said) as refused:
        import_euroc(exported)
    assert "\n" not in str(refused.value)


def test_images_of_another_size_than_declared_are_refused(exported: Path) -> None:
    """With the size of the file and the one that is declared, from others as from us."""
    for path in (exported / "mav0/cam0/sensor.yaml", exported / "mav0/cam1/sensor.yaml"):
        path.write_text(path.read_text().replace("[64, 48]", "[752, 480]"))
        if "lpet" in path.read_text():
            path.write_text(path.read_text().replace("width_px: 64", "width_px: 752"))
            path.write_text(path.read_text().replace("height_px: 48", "height_px: 480"))
    for folder in (exported, as_of_others(exported)):
        with pytest.raises(RecordingError, match=r"is 64 x 48 px, but .* of 752 x 480"):
            import_euroc(folder)


def test_a_unit_of_others_without_readings_is_refused(exported: Path) -> None:
    """Its folder alone tells nothing; without the folder there is no unit."""
    folder = as_of_others(exported)
    (folder / "mav0/imu0/data.csv").unlink()
    with pytest.raises(RecordingError, match=r"imu0 has no data.csv; leave the folder out"):
        import_euroc(folder)
    shutil.rmtree(folder / "mav0/imu0")
    assert import_euroc(folder).measurements.imu is None


def test_other_ways_to_write_a_matrix_and_coefficients_are_read(exported: Path) -> None:
    """Nested lists, as Kalibr has them, and matrices as OpenCV writes them."""
    root = as_of_others(exported) / "mav0"
    paths = [root / eye / "sensor.yaml" for eye in ("cam0", "cam1")]
    plain = import_euroc(exported).measurements.calibration.stereo
    for path in paths:
        said = yaml.safe_load(path.read_text())
        said["T_BS"] = np.reshape(said["T_BS"]["data"], (4, 4)).tolist()
        bent = said.get("distortion_coefficients", [0.0] * 4)
        said["distortion_coefficients"] = {"rows": 1, "cols": 4, "dt": "d", "data": bent}
        path.write_text(yaml.safe_dump(said))
    assert import_euroc(exported).measurements.calibration.stereo == plain


def test_a_calibration_that_contradicts_itself_is_refused(exported: Path) -> None:
    """Whoever edits one part of a file is told of the other."""
    path = exported / "mav0/cam1/sensor.yaml"
    path.write_text(path.read_text().replace("51.2, 51.2", "55.0, 55.0"))
    with pytest.raises(RecordingError, match="'intrinsics' and the part under 'lpet' contradict"):
        import_euroc(exported)


def eye(rpy: tuple[float, float, float], x_m: float, coefficients: tuple[float, ...]) -> Eye:
    """Make a camera that is a little turned, and bends what it sees."""
    pose = SE3.from_rpy(np.array(rpy), np.array([x_m, 0.002 * (x_m > 0), -0.001 * (x_m > 0)]))
    intrinsics = (210.0 + 5 * x_m, 212.0, 159.0 + 9 * x_m, 121.0)
    kind = "equidistant" if coefficients[2] > 0.001 else "radial-tangential"
    return Eye(pose, intrinsics, kind, coefficients, (320, 240))


BENT = {
    "radial-tangential": (-0.28, 0.07, 0.0002, -0.0001),
    "equidistant": (-0.02, 0.01, 0.002, 0.0005),
}


@pytest.mark.parametrize("kind", BENT)
def test_rectified_images_show_a_point_where_the_calibration_says(kind: str) -> None:
    """Spots drawn where the real eyes see points lie, rectified, at the projections of those."""
    left, right = (
        eye((0.01, -0.02, 0.015), 0.0, BENT[kind]),
        eye((-0.02, 0.01, -0.01), 0.11, BENT[kind]),
    )
    stereo, maps = rectified(left, right)
    assert stereo.baseline_m == pytest.approx(np.linalg.norm([0.11, 0.002, 0.001]), rel=1e-2)
    camera = stereo.T_body_camera.se3()
    for p in stream(0, "rectify").uniform([-0.8, -0.6, 2.0], [0.8, 0.6, 3.0], (6, 3)):
        spots = [spot(e, e.T_body_eye.inverse() @ p) for e in (left, right)]
        images = RectifiedImages(_OnePair(spots[0], spots[1]), maps)
        seen = [centre(image) for image in images.pair(0)]
        u_left, u_right, v = stereo.project(camera.inverse() @ p)
        np.testing.assert_allclose(seen[0], (u_left, v), atol=0.05)
        np.testing.assert_allclose(seen[1], (u_right, v), atol=0.05)


def spot(camera: Eye, p_eye: np.ndarray) -> np.ndarray:
    """Draw a soft spot where a camera sees a point."""
    u, v = camera.pixels(p_eye)
    picture = np.zeros((240, 320))
    low_u, low_v = int(u), int(v)
    for dv, weight_v in ((0, 1 - (v - low_v)), (1, v - low_v)):
        for du, weight_u in ((0, 1 - (u - low_u)), (1, u - low_u)):
            picture[low_v + dv, low_u + du] = weight_v * weight_u
    return np.rint(gaussian_filter(picture, 2.0) * 1.2e6).astype(np.uint16)


def centre(picture: np.ndarray) -> tuple[float, float]:
    """Give the centroid of a spot."""
    v, u = np.mgrid[: picture.shape[0], : picture.shape[1]]
    weight = picture / picture.sum()
    return float((u * weight).sum()), float((v * weight).sum())


class _OnePair:
    def __init__(self, left: np.ndarray, right: np.ndarray) -> None:
        self.t_ns, self._pair = np.zeros(1, np.int64), (left, right)

    def __len__(self) -> int:
        return 1

    def pair(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        return self._pair


def test_a_folder_that_is_not_rectified_is_rectified_on_import(exported: Path) -> None:
    """Distorted, turned cameras become a rectified pair whose images are made when asked for."""
    root = as_of_others(exported) / "mav0"
    for name, turned in (("cam0", 0.0), ("cam1", 0.02)):
        path = root / name / "sensor.yaml"
        said = yaml.safe_load(path.read_text())
        pose = SE3.from_matrix(np.reshape(said["T_BS"]["data"], (4, 4)))
        pose = pose @ SE3.from_rpy(np.array([0.0, turned, 0.0]), np.zeros(3))
        said["T_BS"]["data"] = pose.matrix().ravel().tolist()
        said["distortion_coefficients"] = [-0.1, 0.01, 0.0, 0.0]
        path.write_text(yaml.safe_dump(said))
    read = import_euroc(exported).measurements
    assert isinstance(read.images, RectifiedImages)
    assert isinstance(read.images.raw, StereoFolder)
    assert read.images.pair(1)[0].shape == (48, 64)
    assert read.calibration.stereo is not None
    assert read.calibration.stereo.T_body_camera != PoseSpec()


def test_eyes_in_the_wrong_order_are_refused() -> None:
    """The right eye must be to the right."""
    left, right = eye((0, 0, 0), 0.0, BENT["equidistant"]), eye((0, 0, 0), 0.1, BENT["equidistant"])
    with pytest.raises(RecordingError, match="must stand to its right"):
        rectified(right, left)


IMU_OF_OTHERS = """
# Default settings of an inertial unit
sensor_type: imu
comment: a small one
T_BS:
  cols: 4
  rows: 4
  data: [1.0, 0.0, 0.0, 0.5,
         0.0, 0.0, -1.0, 0.0,
         0.0, 1.0, 0.0, 0.0,
         0.0, 0.0, 0.0, 1.0]
rate_hz: 200
gyroscope_noise_density: 1.5e-04     # [ rad / s / sqrt(Hz) ]
gyroscope_random_walk: 2e-05         # [ rad / s^2 / sqrt(Hz) ]
accelerometer_noise_density: 2e-3
accelerometer_random_walk: 3.0000e-3
"""


def test_an_inertial_unit_of_others_is_read_with_its_units(tmp_path: Path) -> None:
    """Numbers that YAML takes for words, such as 2e-3, are numbers here."""
    path = tmp_path / "sensor.yaml"
    path.write_text(IMU_OF_OTHERS)
    read = imu_of(path)
    assert (read.rate_hz, read.gyro_random_walk_radps_rthz) == (200.0, 1.5e-4)
    assert read.accel_random_walk_mps2_rthz == 2e-3
    np.testing.assert_allclose(read.T_body_imu.se3() @ np.array([0, 0, 1.0]), [0.5, -1.0, 0.0])
    path.write_text(IMU_OF_OTHERS.replace("rate_hz: 200", ""))
    with pytest.raises(RecordingError, match="'rate_hz' must be a number"):
        imu_of(path)
