"""Export of a recording as a ROS 2 bag: one MCAP file, with the ``metadata.yaml`` of rosbag2."""

from __future__ import annotations

import heapq
import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import yaml

from lpet_sim.errors import RecordingError
from lpet_sim.formats import ros_messages as ros
from lpet_sim.formats import ros_types, topics
from lpet_sim.formats.clock import EPOCH_NS
from lpet_sim.formats.mcap_file import BagWriter, Span
from lpet_sim.formats.rows import Layout, each_row, pack
from lpet_sim.geometry import SE3
from lpet_sim.outputs import whole_folder
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import ArrayStruct
from lpet_sim.recording.calibration import Calibration, ImuCalibration, StereoCalibration
from lpet_sim.recording.motions import Thinner
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import ImuStream, SightingStream, StereoImages, WheelStream
from lpet_sim.recording.truth import BodyTruth, Event, in_order

NAMES = topics.TopicsSpec()
SIGHTING_COLUMNS = ("landmark_id", "u_left_px", "u_right_px", "v_px", "sigma_px")


class Message(NamedTuple):
    """A message at its time since the start [ns]."""

    t_ns: int
    topic: str
    kind: str
    fields: dict[str, Any]


def export_mcap(recording: Recording, folder: Path, progress: Progress = silent) -> None:
    """Write a recording as a bag, message by message in order of time.

    Args:
        recording: What to write.
        folder: A folder that is made, with one MCAP file and ``metadata.yaml``.
        progress: Called after each message.

    Raises:
        RecordingError: There are images or wheels of which nothing is declared.
        OutputError: The folder is there already, or cannot be written.
    """
    streams, layouts = _streams(recording)
    with whole_folder(folder) as out:
        file = out / f"{folder.name}_0.mcap"
        with BagWriter(file) as bag:
            bag.note(topics.NOTE, _note(recording, layouts))
            merged = heapq.merge(*(made for _, made in streams), key=lambda message: message.t_ns)
            for message in track(merged, max(sum(count for count, _ in streams), 1), progress):
                bag.write(message.topic, message.kind, message.t_ns + EPOCH_NS, message.fields)
        (out / "metadata.yaml").write_text(_metadata(bag.span, file.name))


def _streams(
    recording: Recording,
) -> tuple[list[tuple[int, Iterator[Message]]], dict[str, Layout]]:
    """Give every stream as messages with how many there are, and layouts of those of our own."""
    given, truth = recording.measurements, recording.truth
    declared = given.calibration
    made: list[tuple[int, Iterator[Message]]] = [(1, _places(declared))]
    own: dict[str, ArrayStruct] = {}
    if given.images is not None:
        made.append((4 * len(given.images), _image_messages(given.images, _stereo(declared))))
    if given.imu is not None:
        made.append((len(given.imu), _imu_messages(given.imu, declared.imu)))
    if given.wheels is not None:
        made.append((len(given.wheels), _joint_messages(given.wheels, _names(declared))))
    if given.odometry is not None:
        own[topics.OWN_ODOMETRY] = given.odometry
    if given.sightings is not None:
        made.append((len(given.sightings), _sighting_messages(given.sightings)))
    if truth is not None:
        made += [(len(truth.body), _body_messages(truth.body)), (0, _tf_messages(truth.body))]
        made.append((len(truth.events), _event_messages(truth.events)))
        if truth.wheels is not None:
            own[topics.OWN_WHEEL_TRUTH] = truth.wheels
    made += [(len(struct), _own_messages(topic, struct)) for topic, struct in own.items()]
    return made, {topic: pack(struct)[0] for topic, struct in own.items()}


def _note(recording: Recording, layouts: dict[str, Layout]) -> dict[str, str]:
    """Give what belongs to no message."""
    return {
        "start_stamp_ns": str(EPOCH_NS),
        "calibration": json.dumps(recording.measurements.calibration.to_mapping()),
        "manifest": json.dumps(asdict(recording.manifest)),
        "layouts": json.dumps({topic: layout.json() for topic, layout in layouts.items()}),
    }


def _head(t_ns: int, frame: str) -> dict[str, Any]:
    return ros.header(int(t_ns) + EPOCH_NS, frame)


def _stereo(declared: Calibration) -> StereoCalibration:
    if declared.stereo is None:
        raise RecordingError("the recording has images but declares no stereo camera")
    return declared.stereo


def _names(declared: Calibration) -> tuple[str, ...]:
    if declared.wheels is None:
        raise RecordingError("the recording has encoder readings but declares no wheels")
    return declared.wheels.names


def _places(declared: Calibration) -> Iterator[Message]:
    """Tell once where the sensors sit."""
    frames: dict[str, SE3] = {}
    if declared.stereo is not None:
        frames[topics.CAMERA] = declared.stereo.T_body_camera.se3()
        aside = SE3(np.eye(3), np.array([declared.stereo.baseline_m, 0.0, 0.0]))
        frames[topics.CAMERA_RIGHT] = frames[topics.CAMERA] @ aside
    if declared.imu is not None:
        frames[topics.IMU_FRAME] = declared.imu.T_body_imu.se3()
    head = _head(0, NAMES.body_frame)
    placed = [ros.transform(head, name, pose) for name, pose in frames.items()]
    yield Message(0, NAMES.tf_static, ros_types.TRANSFORMS, {"transforms": placed})


def _image_messages(images: StereoImages, stereo: StereoCalibration) -> Iterator[Message]:
    eyes = (
        (topics.CAMERA, NAMES.left_image, NAMES.left_info),
        (topics.CAMERA_RIGHT, NAMES.right_image, NAMES.right_info),
    )
    for index, t_ns in enumerate(images.t_ns.tolist()):
        for eye, pixels in enumerate(images.pair(index)):
            frame, image_topic, info_topic = eyes[eye]
            head = _head(t_ns, frame)
            info = ros.camera_info(head, stereo, eye)
            yield Message(t_ns, info_topic, ros_types.CAMERA_INFO, info)
            yield Message(t_ns, image_topic, ros_types.IMAGE, ros.image(head, pixels))


def _imu_messages(imu: ImuStream, declared: ImuCalibration | None) -> Iterator[Message]:
    variances = (0.0, 0.0)
    if declared is not None:
        walks = (declared.gyro_random_walk_radps_rthz, declared.accel_random_walk_mps2_rthz)
        variances = (walks[0] ** 2 * declared.rate_hz, walks[1] ** 2 * declared.rate_hz)
    for t_ns, gyro, accel in each_row(imu.t_ns, imu.gyro_radps, imu.accel_mps2):
        fields = ros.inertial(_head(t_ns, topics.IMU_FRAME), gyro, accel, variances)
        yield Message(t_ns, NAMES.imu, ros_types.IMU, fields)


def _joint_messages(wheels: WheelStream, names: tuple[str, ...]) -> Iterator[Message]:
    joints = topics.joint_names(names)
    angles = np.concatenate([wheels.drive_angle_rad, wheels.steer_angle_rad], axis=1)
    for t_ns, row in each_row(wheels.t_ns, angles):
        fields = ros.joints(_head(t_ns, NAMES.body_frame), joints, row)
        yield Message(t_ns, NAMES.joints, ros_types.JOINT_STATE, fields)


def _sighting_messages(sightings: SightingStream) -> Iterator[Message]:
    for image, t_ns in enumerate(sightings.t_ns.tolist()):
        rows = sightings.rows(image)
        values = np.column_stack(
            [sightings.landmark_id[rows], sightings.stereo_px[rows], sightings.sigma_px[rows]]
        )
        before = [float(sightings.drift_px[image])]
        fields = ros.numbers(values, SIGHTING_COLUMNS, before)
        yield Message(t_ns, topics.OWN_SIGHTINGS, ros_types.NUMBERS, fields)


def _own_messages(topic: str, struct: ArrayStruct) -> Iterator[Message]:
    layout, rows = pack(struct)
    labels = layout.labels()
    for t_ns, row in zip(struct.t_ns.tolist(), rows, strict=True):
        yield Message(t_ns, topic, ros_types.NUMBERS, ros.numbers(row[None], labels))


def _body_messages(body: BodyTruth) -> Iterator[Message]:
    poses = body.T_world_body
    v_body = np.einsum("nji,nj->ni", poses.rotation, body.v_world_body_mps)
    twists = np.concatenate([v_body, body.omega_body_radps], axis=1)
    parts = (body.t_ns, poses.translation, poses.quat_wxyz(), twists)
    for t_ns, position, q_wxyz, twist in each_row(*parts):
        head = _head(t_ns, topics.WORLD)
        fields = ros.body_motion(head, NAMES.body_frame, (position, q_wxyz), twist)
        yield Message(t_ns, NAMES.truth, ros_types.ODOMETRY, fields)


def _tf_messages(body: BodyTruth) -> Iterator[Message]:
    """Move the body's frame, five times a second, for those who draw."""
    for row in Thinner().keep(body.t_ns).tolist():
        t_ns = int(body.t_ns[row])
        head = _head(t_ns, topics.WORLD)
        placed = ros.transform(head, NAMES.body_frame, body.T_world_body[row])
        yield Message(t_ns, topics.TF, ros_types.TRANSFORMS, {"transforms": [placed]})


def _event_messages(events: tuple[Event, ...]) -> Iterator[Message]:
    for event in in_order(events):
        fields = {"data": json.dumps(asdict(event))}
        yield Message(event.t_ns, topics.OWN_EVENTS, ros_types.TEXT, fields)


def _metadata(span: Span, file: str) -> str:
    """Write what rosbag2 wants to know of a bag, in its format 5."""
    length, start = max(span.last_ns - span.first_ns, 0), min(span.first_ns, span.last_ns)
    held = [
        {"topic_metadata": _offered(name, topic.kind), "message_count": topic.messages}
        for name, topic in span.topics.items()
    ]
    times = {
        "duration": {"nanoseconds": length},
        "starting_time": {"nanoseconds_since_epoch": start},
        "message_count": span.messages,
    }
    about = {
        "version": 5,
        "storage_identifier": "mcap",
        **times,
        "topics_with_message_count": held,
        "compression_format": "",
        "compression_mode": "",
        "relative_file_paths": [file],
        "files": [{"path": file, **times}],
    }
    return yaml.safe_dump({"rosbag2_bagfile_information": about}, sort_keys=False)


def _offered(topic: str, kind: str) -> dict[str, str]:
    # Readers hold this to what the MCAP's channels say, and the library writes no profiles there.
    profiles = {"serialization_format": "cdr", "offered_qos_profiles": ""}
    return {"name": topic, "type": kind, **profiles}
