"""Bags: ours in the readers of others, those of others in ours, and what is wrong with one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.formats import ros_types
from lpet_sim.formats.clock import EPOCH_NS
from lpet_sim.formats.mcap_file import Bag
from lpet_sim.formats.mcap_read import import_mcap
from lpet_sim.formats.mcap_write import export_mcap
from lpet_sim.formats.topics import TopicsSpec
from lpet_sim.recording.calibration import Calibration
from tests.formats.samples import small

STARTED_S = 1_700_000_000
"""When the bag of others was recorded: a stamp of today, which a double does not hold to the ns."""


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Export a recording with every stream."""
    folder = tmp_path_factory.mktemp("bag") / "run"
    export_mcap(small(), folder)
    return folder


def typestore() -> Any:
    """Give the message types of rosbags, or skip where it is not installed."""
    typesys = pytest.importorskip("rosbags.typesys", reason="pip install 'lpet[dev]'")
    return typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)


def test_rosbags_reads_every_message_of_ours(bag: Path) -> None:
    """By its own message types and its own decoder, with the bag's counts and times."""
    types = typestore()
    from rosbags.rosbag2 import Reader

    given = small()
    images = given.measurements.images
    assert images is not None
    assert given.truth is not None
    assert given.measurements.imu is not None
    seen: dict[str, list[Any]] = {}
    with Reader(bag) as reader:
        assert reader.start_time == EPOCH_NS
        assert reader.duration == given.truth.body.t_ns[-1] + 1
        for connection, stamp, raw in reader.messages():
            message = types.deserialize_cdr(raw, connection.msgtype)
            seen.setdefault(connection.topic, []).append((stamp, message))
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert counts == {topic: len(found) for topic, found in seen.items()}
    stamp, image = seen["/stereo/right/image_rect"][3]
    assert stamp == EPOCH_NS + images.t_ns[3]
    assert image.header.stamp.sec * 10**9 + image.header.stamp.nanosec == stamp
    np.testing.assert_array_equal(image.data.reshape(48, 64), images.pair(3)[1])
    info = seen["/stereo/right/camera_info"][0][1]
    assert info.p.reshape(3, 4)[0, 3] == -51.2 * 0.15
    inertial = seen["/imu/data"][10][1]
    gyro = (getattr(inertial.angular_velocity, axis) for axis in "xyz")
    assert list(gyro) == given.measurements.imu.gyro_radps[10].tolist()
    assert inertial.orientation_covariance[0] == -1.0
    joints = seen["/joint_states"][0][1]
    assert joints.name[:2] == ["front_left_drive", "front_right_drive"]
    odometry = seen["/ground_truth/odometry"][50][1]
    pose = given.truth.body.T_world_body[50]
    assert odometry.pose.pose.position.y == pose.translation[1]
    assert odometry.child_frame_id == "body"
    frames = {moved.child_frame_id for moved in seen["/tf_static"][0][1].transforms}
    assert frames == {"camera", "camera_right", "imu"}


def test_our_message_types_are_those_of_ros() -> None:
    """The same fields, types and order as rosbags has them, hashed as ROS 2 does."""
    types = typestore()
    from rosbags.typesys import get_types_from_msg

    kinds = [value for name, value in vars(ros_types).items() if name.isupper()]
    for kind in (kind for kind in kinds if isinstance(kind, str) and "/msg/" in kind):
        ours = get_types_from_msg(ros_types.definition(kind), kind)
        for name, (_, fields) in ours.items():
            assert [field for field, _ in fields] == [
                field for field, _ in types.get_msgdef(name).fields
            ], name
        fresh = type(types)()
        fresh.register(ours)
        assert fresh.hash_rihs01(kind) == types.hash_rihs01(kind), kind


def test_rerun_opens_ours_by_its_own_importer(bag: Path, tmp_path: Path) -> None:
    """Its images, cameras and frames are found; no message is left undecoded."""
    rerun = Path(sys.executable).with_name("rerun")
    file, out = bag / "run_0.mcap", tmp_path / "out.rrd"
    done = subprocess.run(
        [rerun, "mcap", "convert", file, "-o", out], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    said = subprocess.run([rerun, "rrd", "print", out], capture_output=True, text=True).stdout
    for entity, component in (
        ("/stereo/left/image_rect", "Image:buffer"),
        ("/stereo/right/camera_info", "Pinhole:image_from_camera"),
        ("/tf", "Transform3D:translation"),
        ("/tf_static", "Transform3D:quaternion"),
    ):
        found = [line for line in said.splitlines() if f" - {entity} - " in line]
        assert any(component in line for line in found), (entity, found)


def write_bag_of_others(folder: Path, types: Any) -> TopicsSpec:
    """Write a bag as somebody else would: other topics, frames and stamps, by rosbags."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    given = small()
    images, truth = given.measurements.images, given.truth
    imu, wheels = given.measurements.imu, given.measurements.wheels
    assert images is not None
    assert truth is not None
    assert imu is not None
    assert wheels is not None
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        send = _Sender(writer, types)
        send.places()
        for k, t_ns in enumerate(images.t_ns.tolist()):
            for eye, pixels in zip(("left", "right"), images.pair(k), strict=True):
                send.camera(eye, t_ns, pixels)
        for k, t_ns in enumerate(imu.t_ns.tolist()):
            send.inertial(t_ns, imu.gyro_radps[k], imu.accel_mps2[k])
        for k, t_ns in enumerate(truth.body.t_ns.tolist()):
            send.pose(t_ns, truth.body.T_world_body[k])
    return TopicsSpec(
        left_image="/cam/left",
        right_image="/cam/right",
        left_info="/cam/left/info",
        right_info="/cam/right/info",
        imu="/xsens",
        truth="/mocap",
        body_frame="base_link",
    )


class _Sender:
    """Writes messages by rosbags' own types."""

    def __init__(self, writer: Any, types: Any) -> None:
        self._writer, self._types, self._topics = writer, types, {}

    def message(self, kind: str, **fields: Any) -> Any:
        return self._types.types[kind](**fields)

    def header(self, t_ns: int, frame: str) -> Any:
        seconds, rest = divmod(t_ns + 7, 10**9)
        stamp = self.message("builtin_interfaces/msg/Time", sec=STARTED_S + seconds, nanosec=rest)
        return self.message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def send(self, topic: str, kind: str, t_ns: int, **fields: Any) -> None:
        if topic not in self._topics:
            self._topics[topic] = self._writer.add_connection(topic, kind, typestore=self._types)
        raw = self._types.serialize_cdr(self.message(kind, **fields), kind)
        # A message is written some time after its stamp.
        self._writer.write(self._topics[topic], STARTED_S * 10**9 + t_ns + 2_000_000, raw)

    def vector(self, kind: str, values: Any) -> Any:
        return self.message(f"geometry_msgs/msg/{kind}", **dict(zip("xyz", values, strict=False)))

    def rotation(self, pose: Any) -> Any:
        w, x, y, z = pose.quat_wxyz().tolist()
        return self.message("geometry_msgs/msg/Quaternion", x=x, y=y, z=z, w=w)

    def places(self) -> None:
        stereo = small().measurements.calibration.stereo
        assert stereo is not None
        mast, camera = _halves(stereo.T_body_camera.se3())
        chain = (("base_link", "mast", mast), ("mast", "left_optical", camera))
        moved = [
            self.message(
                "geometry_msgs/msg/TransformStamped",
                header=self.header(0, parent),
                child_frame_id=child,
                transform=self.message(
                    "geometry_msgs/msg/Transform",
                    translation=self.vector("Vector3", pose.translation.tolist()),
                    rotation=self.rotation(pose),
                ),
            )
            for parent, child, pose in chain
        ]
        self.send("/tf_static", "tf2_msgs/msg/TFMessage", 0, transforms=moved)

    def camera(self, eye: str, t_ns: int, pixels: Any) -> None:
        head = self.header(t_ns, "left_optical")
        roi = self.message(
            "sensor_msgs/msg/RegionOfInterest",
            x_offset=0, y_offset=0, height=0, width=0, do_rectify=False,
        )  # fmt: skip
        offset = -51.2 * 0.15 if eye == "right" else 0.0
        p = np.array([51.2, 0, 31.5, offset, 0, 51.2, 23.5, 0, 0, 0, 1, 0])
        self.send(
            f"/cam/{eye}/info", "sensor_msgs/msg/CameraInfo", t_ns, header=head, height=48,
            width=64, distortion_model="plumb_bob", d=np.zeros(5), k=np.eye(3).ravel(),
            r=np.eye(3).ravel(), p=p, binning_x=0, binning_y=0, roi=roi,
        )  # fmt: skip
        padded = np.pad(pixels, ((0, 0), (0, 3)))
        self.send(
            f"/cam/{eye}", "sensor_msgs/msg/Image", t_ns, header=head, height=48, width=64,
            encoding="8UC1", is_bigendian=0, step=67, data=padded.ravel(),
        )  # fmt: skip

    def inertial(self, t_ns: int, gyro: Any, accel: Any) -> None:
        self.send(
            "/xsens", "sensor_msgs/msg/Imu", t_ns, header=self.header(t_ns, "imu"),
            orientation=self.message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0),
            orientation_covariance=np.zeros(9), angular_velocity=self.vector("Vector3", gyro),
            angular_velocity_covariance=np.zeros(9),
            linear_acceleration=self.vector("Vector3", accel),
            linear_acceleration_covariance=np.zeros(9),
        )  # fmt: skip

    def pose(self, t_ns: int, pose: Any) -> None:
        placed = self.message(
            "geometry_msgs/msg/Pose",
            position=self.vector("Point", pose.translation.tolist()),
            orientation=self.rotation(pose),
        )
        still = self.vector("Vector3", np.zeros(3))
        twist = self.message("geometry_msgs/msg/Twist", linear=still, angular=still)
        part = {"covariance": np.zeros(36)}
        self.send(
            "/mocap", "nav_msgs/msg/Odometry", t_ns, header=self.header(t_ns, "map"),
            child_frame_id="base_link",
            pose=self.message("geometry_msgs/msg/PoseWithCovariance", pose=placed, **part),
            twist=self.message("geometry_msgs/msg/TwistWithCovariance", twist=twist, **part),
        )  # fmt: skip


def _halves(pose: Any) -> tuple[Any, Any]:
    """Cut a pose into two whose product it is."""
    half = type(pose).exp(0.5 * pose.log())
    return half, half.inverse() @ pose


def test_a_bag_of_others_is_read_by_the_topics_that_are_named(tmp_path: Path) -> None:
    """Images to the bit, times to the nanosecond, calibration from projections and frames."""
    types = typestore()
    where = write_bag_of_others(tmp_path / "theirs", types)
    given, read = small(), import_mcap(tmp_path / "theirs", where)
    images, back = given.measurements.images, read.measurements.images
    assert images is not None
    assert back is not None
    assert back.t_ns.tolist() == images.t_ns.tolist()
    for k in (5, 2, 7):
        np.testing.assert_array_equal(back.pair(k)[0], images.pair(k)[0])
        np.testing.assert_array_equal(back.pair(k)[1], images.pair(k)[1])
    imu = read.measurements.imu
    assert imu is not None
    assert given.measurements.imu is not None
    assert imu.equals(given.measurements.imu)
    stereo, declared = read.measurements.calibration.stereo, given.measurements.calibration.stereo
    assert stereo is not None
    assert declared is not None
    assert stereo.baseline_m == pytest.approx(declared.baseline_m)
    apart = stereo.T_body_camera.se3().inverse() @ declared.T_body_camera.se3()
    np.testing.assert_allclose(apart.log(), 0.0, atol=1e-12)
    start = read.measurements.calibration.T_world_body_start.se3()
    assert given.truth is not None
    np.testing.assert_allclose(
        (start.inverse() @ given.truth.body.T_world_body[0]).log(), 0.0, atol=1e-12
    )
    assert read.measurements.wheels is None


def test_what_a_bag_does_not_say_can_be_declared(tmp_path: Path) -> None:
    """Noise of the inertial unit, and cameras whose frames are not there."""
    where = write_bag_of_others(tmp_path / "theirs", typestore())
    lost = where.model_copy(update={"body_frame": "nowhere"})
    with pytest.raises(RecordingError, match="does not lead from the frame 'left_optical' to"):
        import_mcap(tmp_path / "theirs", lost)
    known = small().measurements.calibration
    declared = Calibration(imu=known.imu, stereo=known.stereo)
    read = import_mcap(tmp_path / "theirs", lost, declared).measurements.calibration
    assert (read.imu, read.stereo) == (known.imu, known.stereo)


def test_a_bag_without_the_topics_lists_those_that_it_holds(bag: Path) -> None:
    """So that they can be named."""
    where = {name: f"/no/{name}" for name in ("left_image", "imu", "joints", "truth")}
    spec = TopicsSpec(**where)
    with pytest.raises(RecordingError, match="/no/imu") as refused:
        import_mcap(bag_without_sightings(bag), spec)
    assert "/stereo/left/image_rect" in str(refused.value)


def bag_without_sightings(bag: Path) -> Path:
    """Export the truth, encoders and images alone, beside another bag."""
    given = small()
    folder = bag.parent / "bare"
    measurements = type(given.measurements)(
        given.measurements.calibration, images=given.measurements.images
    )
    export_mcap(type(given)(given.manifest, measurements), folder)
    return folder


@pytest.mark.parametrize("damage", ["absent", "cut", "garbage", "empty folder"])
def test_a_file_that_is_no_bag_is_refused_in_one_sentence(
    damage: str, bag: Path, tmp_path: Path
) -> None:
    """It names the file and what is expected."""
    whole, path = (bag / "run_0.mcap").read_bytes(), tmp_path / "bad.mcap"
    if damage == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "garbage":
        path.write_bytes(b"no bag" * 1000)
    elif damage == "empty folder":
        path.mkdir()
    with pytest.raises(RecordingError, match=r"bad\.mcap") as refused:
        import_mcap(path)
    assert "\n" not in str(refused.value)


def test_a_message_of_another_type_is_named(bag: Path) -> None:
    """With its topic and its type."""
    with pytest.raises(RecordingError, match=r"/joint_states is a sensor_msgs/msg/JointState"):
        import_mcap(bag, TopicsSpec(imu="/joint_states", joints="/none"))


def test_messages_lie_in_order_of_time(bag: Path) -> None:
    """In the file as in the reader, so that no reader has to hold much of it."""
    read = Bag(bag)
    stamps = [stamp for _, stamp, _ in read.messages(read.topics)]
    assert stamps == sorted(stamps)
    assert stamps[0] == EPOCH_NS
