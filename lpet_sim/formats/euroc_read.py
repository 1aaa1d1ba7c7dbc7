"""Import of ASL folders: our own to the bit, those of others from where their truth begins."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from lpet_sim.errors import RecordingError, SpecError
from lpet_sim.formats import asl
from lpet_sim.formats.asl_cameras import from_stamp, read_cameras
from lpet_sim.formats.beginning import counted_from, first_stamp, pose_at
from lpet_sim.formats.csv_files import read_csv, read_stream
from lpet_sim.formats.overrides import overridden
from lpet_sim.formats.rows import poses_of
from lpet_sim.formats.sensor_yaml import imu_of, own_part, read_mapping
from lpet_sim.recording.arrays import ArrayStruct, Ints
from lpet_sim.recording.calibration import (
    Calibration,
    StereoCalibration,
    WheelCalibration,
)
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import (
    ImuStream,
    Measurements,
    OdometryStream,
    SightingStream,
    StereoImages,
    WheelStream,
)
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth

GRAVITY_MPS2 = 9.81
_POSE_AND_VELOCITY = 10

Struct = TypeVar("Struct", bound=ArrayStruct)


@dataclass(frozen=True)
class _Held:
    """What a folder holds that others write too, with its own stamps."""

    stereo: StereoCalibration | None
    images: StereoImages | None
    imu: ImuStream | None
    body: BodyTruth | None


def import_euroc(folder: Path, declared: Calibration | None = None) -> Recording:
    """Read an ASL folder; images stay on disk until they are asked for.

    Args:
        folder: The folder that ``mav0`` lies in, or ``mav0`` itself.
        declared: A calibration; what it sets stands in place of what the folder declares.

    Raises:
        RecordingError: The folder lacks a file, or a file is not valid.
    """
    root = _root(folder)
    stereo, images = read_cameras(root)
    held = _Held(stereo, images, _imu(root), _body(root))
    if (root / asl.ABOUT).exists():
        return _own(root, held, declared)
    return _foreign(root, held, declared)


def _root(folder: Path) -> Path:
    for root in (folder / asl.ROOT, folder):
        if any((root / name).is_dir() for name in (*asl.EYES, asl.IMU, asl.BODY_TRUTH)):
            return root
        if (root / asl.ABOUT).exists():
            return root
    raise RecordingError(
        f"{folder} is no ASL folder; expected is {asl.ROOT}/ with some of {', '.join(asl.EYES)}, "
        f"{asl.IMU} and {asl.BODY_TRUTH}"
    )


def _own(root: Path, held: _Held, declared: Calibration | None) -> Recording:
    try:
        about = asl.AboutSpec.from_yaml(root / asl.ABOUT)
    except SpecError as error:
        raise RecordingError(str(error)) from None
    start, sensor = about.start_stamp_ns, root / asl.IMU / asl.SENSOR
    stated = Calibration(
        stereo=held.stereo,
        imu=imu_of(sensor) if sensor.exists() else None,
        wheels=_wheels(root),
        T_world_body_start=about.T_world_body_start,
        gravity_mps2=about.gravity_mps2,
    )
    measurements = Measurements(
        overridden(stated, declared),
        imu=None if held.imu is None else counted_from(held.imu, start),
        wheels=_stream(root / asl.WHEELS, start, WheelStream),
        sightings=_sightings(root / asl.SIGHTINGS, start),
        images=None if held.images is None else from_stamp(held.images, start),
        odometry=_stream(root / asl.ODOMETRY, start, OdometryStream),
    )
    return Recording(_manifest(root), measurements, _own_truth(root, held.body, start))


def _foreign(root: Path, held: _Held, declared: Calibration | None) -> Recording:
    """Begin with the first image, or reading, of which the truth tells the pose."""
    if held.imu is None and (root / asl.IMU).is_dir():
        raise RecordingError(
            f"{root / asl.IMU} has no {asl.DATA}; leave the folder out where there is no unit"
        )
    start = first_stamp(root, (held.images, held.imu), held.body)
    stated = Calibration(
        stereo=held.stereo,
        imu=None if held.imu is None else imu_of(root / asl.IMU / asl.SENSOR),
        T_world_body_start=pose_at(held.body, start),
        gravity_mps2=GRAVITY_MPS2,
    )
    measurements = Measurements(
        overridden(stated, declared),
        imu=None if held.imu is None else counted_from(held.imu, start),
        images=None if held.images is None else from_stamp(held.images, start),
    )
    truth = None if held.body is None else Truth(counted_from(held.body, start))
    name = root.parent.name if root.name == asl.ROOT else root.name
    return Recording(Manifest(f"euroc {name}"), measurements, truth)


def _imu(root: Path) -> ImuStream | None:
    table = root / asl.IMU / asl.DATA
    if not table.exists():
        return None
    stamps, values = read_csv(table, 6)
    if not table.stat().st_size:
        raise RecordingError(f"{table} is empty; leave the folder out where there is no unit")
    return ImuStream(stamps, values[:, :3].copy(), values[:, 3:].copy())


def _body(root: Path) -> BodyTruth | None:
    table = root / asl.BODY_TRUTH / asl.DATA
    if not table.exists():
        return None
    stamps, values = read_csv(table, _POSE_AND_VELOCITY)
    if not len(stamps):
        raise RecordingError(f"{table} holds no pose; leave the folder out where there is no truth")
    poses = poses_of(table, values[:, 3:7], values[:, :3])
    return replace(BodyTruth.from_poses(stamps, poses), v_world_body_mps=values[:, 7:].copy())


def _wheels(root: Path) -> WheelCalibration | None:
    path = root / asl.WHEELS / asl.SENSOR
    if not path.exists():
        return None
    return own_part(path, read_mapping(path), WheelCalibration)


def _stream(folder: Path, start: int, kind: type[Struct]) -> Struct | None:
    table = folder / asl.DATA
    return read_stream(table, start, kind) if table.exists() else None


def _sightings(folder: Path, start: int) -> SightingStream | None:
    if not (folder / asl.DATA).exists():
        return None
    stamps, drift = read_csv(folder / asl.SIGHTED_IMAGES, 1)
    each, values = read_csv(folder / asl.DATA, 5, repeats=True)
    counts = _counts(folder, stamps, each)
    return SightingStream(
        stamps - start,
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        values[:, 0].astype(np.int64),
        values[:, 1:4].copy(),
        values[:, 4].copy(),
        drift[:, 0].copy(),
    )


def _counts(folder: Path, stamps: Ints, each: Ints) -> Ints:
    """Count the sightings of each image, whose rows must follow the order of the images."""
    counts = np.searchsorted(each, stamps, "right") - np.searchsorted(each, stamps, "left")
    if np.any(np.diff(each) < 0) or counts.sum() != len(each):
        raise RecordingError(
            f"{folder / asl.DATA}: each stamp must be one of {asl.SIGHTED_IMAGES}, in order of time"
        )
    return counts


def _own_truth(root: Path, body: BodyTruth | None, start: int) -> Truth | None:
    if body is None:
        return None
    folder = root / asl.OWN_TRUTH
    counted = counted_from(body, start)
    if (folder / asl.BODY_RATE).exists():
        _, rate = read_csv(folder / asl.BODY_RATE, 3)
        counted = replace(counted, omega_body_radps=rate)
    table = folder / asl.WHEEL_TRUTH
    wheels = read_stream(table, start, WheelTruth) if table.exists() else None
    return Truth(counted, wheels, _events(folder / asl.EVENTS))


def _events(path: Path) -> tuple[Event, ...]:
    try:
        return tuple(Event(**event) for event in _json(path, []))
    except TypeError as error:
        raise RecordingError(f"{path} is no list of events: {error}") from None


def _manifest(root: Path) -> Manifest:
    return Manifest(**_json(root / asl.OWN_TRUTH / asl.MANIFEST, {"source": "euroc"}))


def _json(path: Path, absent: Any) -> Any:
    try:
        return json.loads(path.read_text()) if path.exists() else absent
    except ValueError as error:
        raise RecordingError(f"{path} is not valid JSON: {error}") from None
