"""Import of ROS 2 bags in MCAP: our own to the nanosecond, and those of others by their topics."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats import ros_messages as ros
from lpet_sim.formats import topics as names
from lpet_sim.formats.bag_calibration import stated_calibration
from lpet_sim.formats.bag_images import BagImages, paired_stamps
from lpet_sim.formats.bag_rows import Gathered, gather
from lpet_sim.formats.beginning import counted_from, first_stamp, pose_at
from lpet_sim.formats.mcap_file import Bag
from lpet_sim.formats.overrides import overridden
from lpet_sim.formats.rows import Layout, Struct, poses_of, unpack
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.arrays import Ints
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import (
    ImuStream,
    Measurements,
    OdometryStream,
    SightingStream,
    WheelStream,
)
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth


def import_mcap(
    path: Path,
    topics: names.TopicsSpec | None = None,
    declared: Calibration | None = None,
    progress: Progress = silent,
) -> Recording:
    """Read a bag; images stay in it until they are asked for.

    Args:
        path: An MCAP file of ROS 2 messages, or the folder of a bag that holds one.
        topics: Where the streams are; as we export them where None.
        declared: A calibration; what it sets stands in place of what the bag says.
        progress: Called after each message that is read.

    Raises:
        RecordingError: The file cannot be read, or holds none of the topics.
    """
    where, bag = topics or names.TopicsSpec(), Bag(path)
    _check(bag, where)
    note = bag.notes(names.NOTE)
    stated = _noted(bag.path, note) or stated_calibration(bag, where, declared)
    calibration = overridden(stated, declared)
    rows = gather(bag, _readers(where, calibration), progress)
    held = _Held(
        paired_stamps(bag, where.left_image, where.right_image),
        _imu(rows.get(where.imu)),
        _wheels(rows.get(where.joints)),
        _body(rows.get(where.truth)),
    )
    start = int(note["start_stamp_ns"]) if note else held.start(bag.path)
    if not note and (declared is None or "T_world_body_start" not in declared.model_fields_set):
        placed = {"T_world_body_start": pose_at(held.body, start)}
        calibration = calibration.model_copy(update=placed)
    own = _Own(rows, json.loads(note.get("layouts", "{}")), start)
    measurements = Measurements(
        calibration,
        imu=None if held.imu is None else counted_from(held.imu, start),
        wheels=None if held.wheels is None else counted_from(held.wheels, start),
        sightings=_sightings(rows.get(names.OWN_SIGHTINGS), start),
        images=None if held.images is None else BagImages(bag, where, held.images, start),
        odometry=own.stream(OdometryStream, names.OWN_ODOMETRY),
    )
    wheel_truth = own.stream(WheelTruth, names.OWN_WHEEL_TRUTH)
    truth = None
    if held.body is not None:
        truth = Truth(counted_from(held.body, start), wheel_truth, _events(bag))
    return Recording(_manifest(bag.path, note), measurements, truth)


@dataclass(frozen=True)
class _Stamps:
    """Stamps alone, as a stream."""

    t_ns: Ints


@dataclass(frozen=True)
class _Held:
    """What a bag holds that others write too, with its own stamps."""

    images: Ints | None
    imu: ImuStream | None
    wheels: WheelStream | None
    body: BodyTruth | None

    def start(self, path: Path) -> int:
        """Find where a bag of others begins."""
        images = None if self.images is None else _Stamps(self.images)
        return first_stamp(path, (images, self.imu, self.wheels), self.body)


@dataclass(frozen=True)
class _Own:
    """The rows of our own topics."""

    rows: dict[str, Gathered]
    layouts: dict[str, Any]
    start_ns: int

    def stream(self, kind: type[Struct], topic: str) -> Struct | None:
        """Make a stream of a topic, None where there is none."""
        if topic not in self.rows or topic not in self.layouts:
            return None
        found, layout = self.rows[topic], Layout.from_json(self.layouts[topic])
        return unpack(kind, found.t_ns() - self.start_ns, layout, found.table())


def _check(bag: Bag, where: names.TopicsSpec) -> None:
    streams = (where.left_image, where.imu, where.joints, where.truth)
    if not any(topic in bag.topics for topic in (*streams, names.OWN_SIGHTINGS)):
        raise RecordingError(
            f"{bag.path} has none of the topics {', '.join(streams)}; name yours in a YAML file "
            f"given by --topics; it holds {', '.join(sorted(bag.topics)) or 'none'}"
        )


def _noted(path: Path, note: dict[str, str]) -> Calibration | None:
    if not note:
        return None
    return Calibration.from_mapping(json.loads(note["calibration"]), f"{path}, its calibration")


def _manifest(path: Path, note: dict[str, str]) -> Manifest:
    return Manifest(**json.loads(note["manifest"])) if note else Manifest(f"mcap {path.stem}")


def _readers(
    where: names.TopicsSpec, calibration: Calibration
) -> dict[str, Callable[[Any, int], tuple[int, list[float]]]]:
    """Tell how a message of each topic becomes a stamp and a row of numbers."""
    readers: dict[str, Callable[[Any, int], tuple[int, list[float]]]] = {
        where.imu: _imu_row,
        where.truth: _body_row,
        names.OWN_SIGHTINGS: _sighting_row,
        names.OWN_ODOMETRY: _number_row,
        names.OWN_WHEEL_TRUTH: _number_row,
    }
    if calibration.wheels is not None:
        wanted = names.joint_names(calibration.wheels.names)
        readers[where.joints] = partial(_joint_row, wanted)
    return readers


def _imu_row(message: Any, stamp: int) -> tuple[int, list[float]]:
    del stamp
    parts = (message.angular_velocity, message.linear_acceleration)
    return ros.stamp_of(message), [x for part in parts for x in ros.vector_of(part)]


def _joint_row(wanted: list[str], message: Any, stamp: int) -> tuple[int, list[float]]:
    del stamp
    held = dict(zip(message.name, message.position, strict=True))
    missing = [name for name in wanted if name.endswith(names.DRIVE) and name not in held]
    if missing:
        raise RecordingError(
            f"the joints lack {', '.join(missing)}; they are {', '.join(held) or 'none'}"
        )
    return ros.stamp_of(message), [held.get(name, 0.0) for name in wanted]


def _body_row(message: Any, stamp: int) -> tuple[int, list[float]]:
    del stamp
    pose, twist = message.pose.pose, message.twist.twist
    values = (
        *ros.vector_of(pose.position),
        *ros.quaternion_of(pose.orientation),
        *ros.vector_of(twist.linear),
        *ros.vector_of(twist.angular),
    )
    return ros.stamp_of(message), list(values)


def _sighting_row(message: Any, stamp: int) -> tuple[int, list[float]]:
    before, rows = ros.numbers_of(message)
    return stamp, [*before.tolist(), *rows.ravel().tolist()]


def _number_row(message: Any, stamp: int) -> tuple[int, list[float]]:
    return stamp, list(message.data)


def _imu(rows: Gathered | None) -> ImuStream | None:
    if rows is None:
        return None
    values = rows.table()
    return ImuStream(rows.t_ns(), values[:, :3].copy(), values[:, 3:].copy())


def _wheels(rows: Gathered | None) -> WheelStream | None:
    if rows is None:
        return None
    drive, steer = np.split(rows.table(), 2, axis=1)
    return WheelStream(rows.t_ns(), drive.copy(), steer.copy())


def _body(rows: Gathered | None) -> BodyTruth | None:
    if rows is None:
        return None
    values = rows.table()
    poses = poses_of("the bag's odometry of the truth", values[:, 3:7], values[:, :3])
    v_world = np.einsum("nij,nj->ni", poses.rotation, values[:, 7:10])
    return BodyTruth(rows.t_ns(), poses, v_world, values[:, 10:].copy())


def _sightings(rows: Gathered | None, start: int) -> SightingStream | None:
    if rows is None:
        return None
    images = rows.ragged()
    table = np.concatenate([image[1:].reshape(-1, 5) for image in images])
    counts = [len(image) // 5 for image in images]
    return SightingStream(
        rows.t_ns() - start,
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        table[:, 0].astype(np.int64),
        table[:, 1:4].copy(),
        table[:, 4].copy(),
        np.array([image[0] for image in images]),
    )


def _events(bag: Bag) -> tuple[Event, ...]:
    held = [topic for topic in (names.OWN_EVENTS,) if topic in bag.topics]
    return tuple(Event(**json.loads(message.data)) for _, _, message in bag.messages(held))
