"""Rows of a recording as fields of ROS 2 messages, and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.calibration import StereoCalibration

Fields = dict[str, Any]
_AXES = ("x", "y", "z")
_UNKNOWN = -1.0
_NO_COVARIANCE = (0.0,) * 36
_GREY: dict[str, str] = {"mono8": "u1", "8UC1": "u1", "mono16": "u2", "16UC1": "u2"}


def header(stamp_ns: int, frame: str) -> Fields:
    """Give the header of a message."""
    seconds, rest = divmod(stamp_ns, NS_PER_S)
    return {"stamp": {"sec": seconds, "nanosec": rest}, "frame_id": frame}


def stamp_of(message: Any) -> int:
    """Read the stamp of a message's header [ns]."""
    return int(message.header.stamp.sec) * NS_PER_S + int(message.header.stamp.nanosec)


def vector(values: Sequence[float]) -> Fields:
    """Give a point or a vector."""
    return dict(zip(_AXES, values, strict=True))


def vector_of(fields: Any) -> tuple[float, float, float]:
    """Read a point or a vector."""
    return fields.x, fields.y, fields.z


def quaternion(q_wxyz: Sequence[float]) -> Fields:
    """Give a rotation."""
    w, *xyz = q_wxyz
    return {**vector(xyz), "w": w}


def quaternion_of(fields: Any) -> tuple[float, float, float, float]:
    """Read a rotation, scalar first."""
    return fields.w, fields.x, fields.y, fields.z


def image(head: Fields, pixels: NDArray[Any]) -> Fields:
    """Give a grey image, Shape (h, w), uint8 or uint16, with the values that it has."""
    rows = np.ascontiguousarray(pixels, dtype=pixels.dtype.newbyteorder("<"))
    return {
        "header": head,
        "height": rows.shape[0],
        "width": rows.shape[1],
        "encoding": "mono8" if rows.dtype.itemsize == 1 else "mono16",
        "is_bigendian": 0,
        "step": rows.shape[1] * rows.dtype.itemsize,
        "data": rows.tobytes(),
    }


def pixels_of(message: Any) -> NDArray[Any]:
    """Read a grey image, Shape (h, w), uint8 or uint16.

    Raises:
        RecordingError: It is not grey.
    """
    if message.encoding not in _GREY:
        raise RecordingError(
            f"an image has the encoding '{message.encoding}': valid are {', '.join(_GREY)}"
        )
    kind = np.dtype((">" if message.is_bigendian else "<") + _GREY[message.encoding])
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)
    used = np.ascontiguousarray(rows[:, : message.width * kind.itemsize]).view(kind)
    return used.astype(kind.newbyteorder("="))


def camera_info(head: Fields, stereo: StereoCalibration, eye: int) -> Fields:
    """Give what is declared of an eye, 0 left or 1 right: a rectified pinhole."""
    f, cx, cy = stereo.focal_px, stereo.cx_px, stereo.cy_px
    offset = -f * stereo.baseline_m * eye
    return {
        "header": head,
        "height": stereo.height_px,
        "width": stereo.width_px,
        "distortion_model": "plumb_bob",
        "d": [0.0] * 5,
        "k": [f, 0.0, cx, 0.0, f, cy, 0.0, 0.0, 1.0],
        "r": np.eye(3).ravel().tolist(),
        "p": [f, 0.0, cx, offset, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
        "binning_x": 0,
        "binning_y": 0,
        "roi": {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False},
    }


def inertial(
    head: Fields, gyro: Sequence[float], accel: Sequence[float], variances: tuple[float, float]
) -> Fields:
    """Give a reading of rate and specific force; there is no orientation, as -1 says.

    Args:
        head: Its header.
        gyro: Body rate [rad/s].
        accel: Specific force [m/s^2].
        variances: Of both, for each axis [rad^2/s^2, m^2/s^4]; 0 where they are not known.
    """
    return {
        "header": head,
        "orientation": quaternion((1.0, 0.0, 0.0, 0.0)),
        "orientation_covariance": [_UNKNOWN] + [0.0] * 8,
        "angular_velocity": vector(gyro),
        "angular_velocity_covariance": _diagonal(variances[0]),
        "linear_acceleration": vector(accel),
        "linear_acceleration_covariance": _diagonal(variances[1]),
    }


def joints(head: Fields, names: Sequence[str], positions: Sequence[float]) -> Fields:
    """Give the positions of joints."""
    state: Fields = {"name": list(names), "position": list(positions)}
    return {"header": head, **state, "velocity": [], "effort": []}


def body_motion(
    head: Fields, child: str, pose: tuple[Sequence[float], Sequence[float]], twist: Sequence[float]
) -> Fields:
    """Give pose and twist, the twist in the moving frame as ROS has it.

    Args:
        head: Its header, whose frame the pose is in.
        child: The moving frame.
        pose: Position [m] and quaternion, scalar first.
        twist: Velocity and rate in the moving frame [m/s, rad/s].
    """
    position, q_wxyz = pose
    placed = {"position": vector(position), "orientation": quaternion(q_wxyz)}
    moving = {"linear": vector(twist[:3]), "angular": vector(twist[3:])}
    return {
        "header": head,
        "child_frame_id": child,
        "pose": {"pose": placed, "covariance": _NO_COVARIANCE},
        "twist": {"twist": moving, "covariance": _NO_COVARIANCE},
    }


def transform(head: Fields, child: str, T_parent_child: SE3) -> Fields:
    """Give the pose of a frame in that of the header."""
    placed = {
        "translation": vector(T_parent_child.translation.tolist()),
        "rotation": quaternion(T_parent_child.quat_wxyz().tolist()),
    }
    return {"header": head, "child_frame_id": child, "transform": placed}


def transform_of(fields: Any) -> SE3:
    """Read a pose, the inverse of `transform`."""
    moved = fields.transform
    return SE3.from_quat_wxyz(quaternion_of(moved.rotation), vector_of(moved.translation))


def numbers(values: Array, labels: Sequence[str], before: Sequence[float] = ()) -> Fields:
    """Give rows of numbers, Shape (n, k).

    Args:
        values: The rows.
        labels: Names of the columns, written with commas as the label of their axis.
        before: Numbers that stand before the rows.
    """
    rows, columns = values.shape
    axes = [
        {"label": "rows", "size": rows, "stride": rows * columns},
        {"label": ",".join(labels), "size": columns, "stride": columns},
    ]
    data = [*before, *values.ravel().tolist()]
    return {"layout": {"dim": axes, "data_offset": len(before)}, "data": data}


def numbers_of(message: Any) -> tuple[Array, Array]:
    """Read what stands before the rows, and the rows, Shape (n, k)."""
    data = np.array(message.data, dtype=float)
    before = int(message.layout.data_offset)
    rows, columns = (int(axis.size) for axis in message.layout.dim)
    return data[:before], data[before:].reshape(rows, columns)


def _diagonal(variance: float) -> list[float]:
    return [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]
