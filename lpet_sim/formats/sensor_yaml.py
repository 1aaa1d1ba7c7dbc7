"""What is declared of camera and inertial unit, as the ``sensor.yaml`` of an ASL folder says it.

What such a file has no key for stands under a key of our own, ``lpet``, with the same numbers once
more as they were declared; a file whose two parts contradict each other is refused.

Reference:
    Burri et al., The EuRoC micro aerial vehicle datasets (2016), section 4.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from lpet_sim.errors import RecordingError, SpecError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import ImuCalibration, PoseSpec, StereoCalibration
from lpet_sim.spec import Spec, read_yaml

OWN_KEY = "lpet"
_AGREEMENT = 1e-9

Kind = TypeVar("Kind", bound=Spec)


def pose_mapping(T_a_b: SE3) -> dict[str, Any]:
    """Give a pose as the 16 numbers of its matrix, row by row."""
    return {"cols": 4, "rows": 4, "data": T_a_b.matrix().ravel().tolist()}


def camera_mappings(stereo: StereoCalibration, rate_hz: float) -> tuple[dict[str, Any], ...]:
    """Give the files of the left and the right camera; the pair is rectified.

    Args:
        stereo: What is declared of the pair.
        rate_hz: Image pairs a second.
    """
    T_body_left = stereo.T_body_camera.se3()
    to_right = SE3(np.eye(3), np.array([stereo.baseline_m, 0.0, 0.0]))
    left = _camera(stereo, T_body_left, rate_hz, "left eye, rectified")
    right = _camera(stereo, T_body_left @ to_right, rate_hz, "right eye, rectified")
    return left | {OWN_KEY: stereo.to_mapping()}, right


def imu_mapping(imu: ImuCalibration) -> dict[str, Any]:
    """Give the file of the inertial unit; how fast its biases wander is not declared here."""
    return {
        "sensor_type": "imu",
        "comment": "inertial unit; each row is the mean over the interval up to its stamp",
        "T_BS": pose_mapping(imu.T_body_imu.se3()),
        "rate_hz": imu.rate_hz,
        "gyroscope_noise_density": imu.gyro_random_walk_radps_rthz,
        "gyroscope_random_walk": 0.0,
        "accelerometer_noise_density": imu.accel_random_walk_mps2_rthz,
        "accelerometer_random_walk": 0.0,
        OWN_KEY: imu.to_mapping(),
    }


def write_yaml(path: Path, mapping: Mapping[str, Any]) -> None:
    """Write a mapping, its lists of numbers on one line each."""
    path.write_text(yaml.safe_dump(dict(mapping), sort_keys=False, default_flow_style=None))


def read_mapping(path: Path) -> dict[str, Any]:
    """Read a mapping.

    Raises:
        RecordingError: The file is missing, is not YAML, or holds no mapping.
    """
    try:
        mapping = read_yaml(path)
    except SpecError as error:
        raise RecordingError(str(error)) from None
    if not isinstance(mapping, dict):
        raise RecordingError(f"{path} holds no mapping of keys to values; a sensor.yaml does")
    return mapping


def own_part(path: Path, mapping: Mapping[str, Any], kind: type[Kind]) -> Kind | None:
    """Read what stands under our own key, None where there is nothing.

    Raises:
        RecordingError: It is not valid.
    """
    if OWN_KEY not in mapping:
        return None
    try:
        return kind.from_mapping(mapping[OWN_KEY], f"{path}, key '{OWN_KEY}'")
    except SpecError as error:
        raise RecordingError(str(error)) from None


def hold_to(path: Path, mapping: Mapping[str, Any], declared: Mapping[str, Any]) -> None:
    """Hold the keys of a file to say the same as its own part.

    Args:
        path: The file.
        mapping: What the file says.
        declared: The same keys as they follow from its own part.

    Raises:
        RecordingError: A number differs.
    """
    for key, value in declared.items():
        if key not in mapping or key in (OWN_KEY, "comment", "rate_hz"):
            continue
        mine, theirs = numbers_in(value), numbers_in(mapping[key])
        if mine.shape != theirs.shape or not np.allclose(mine, theirs, _AGREEMENT, _AGREEMENT):
            raise RecordingError(
                f"{path}: '{key}' and the part under '{OWN_KEY}' contradict each other; change "
                f"both, or remove '{OWN_KEY}'"
            )


def pose_of(path: Path, mapping: Mapping[str, Any]) -> SE3:
    """Read ``T_BS``, the pose of a sensor in the body.

    Raises:
        RecordingError: It is missing, or not 16 numbers.
    """
    data = {"T_BS": numbers_in(mapping.get("T_BS", [])).ravel()}
    matrix = numbers_of(path, data, "T_BS", 16).reshape(4, 4)
    return SE3(_nearest_rotation(matrix[:3, :3]), matrix[:3, 3])


def numbers_of(path: Path, mapping: Mapping[str, Any], key: str, count: int) -> Array:
    """Read a list of numbers.

    Raises:
        RecordingError: It is missing, or of another length.
    """
    found = numbers_in(mapping.get(key, []))
    if found.shape != (count,) or not np.all(np.isfinite(found)):
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise RecordingError(f"{path}: '{key}' must be {wanted}")
    return found


def imu_of(path: Path) -> ImuCalibration:
    """Read what is declared of an inertial unit; what the file does not say is zero.

    Raises:
        RecordingError: The file is missing or not valid.
    """
    mapping = read_mapping(path)
    own = own_part(path, mapping, ImuCalibration)
    if own is not None:
        hold_to(path, mapping, imu_mapping(own))
        return own
    keys = ("rate_hz", "gyroscope_noise_density", "accelerometer_noise_density")
    rate, gyro, accel = (float(numbers_of(path, {k: [mapping.get(k)]}, k, 1)[0]) for k in keys)
    return ImuCalibration(
        rate_hz=rate,
        T_body_imu=PoseSpec.from_se3(pose_of(path, mapping)),
        gyro_random_walk_radps_rthz=gyro,
        gyro_bias_radps=0.0,
        accel_random_walk_mps2_rthz=accel,
        accel_bias_mps2=0.0,
        accel_quantum_mps=0.0,
    )


def _camera(
    stereo: StereoCalibration, T_body_eye: SE3, rate_hz: float, comment: str
) -> dict[str, Any]:
    return {
        "sensor_type": "camera",
        "comment": comment,
        "T_BS": pose_mapping(T_body_eye),
        "rate_hz": rate_hz,
        "resolution": [stereo.width_px, stereo.height_px],
        "camera_model": "pinhole",
        "intrinsics": [stereo.focal_px, stereo.focal_px, stereo.cx_px, stereo.cy_px],
        "distortion_model": "radial-tangential",
        "distortion_coefficients": [0.0, 0.0, 0.0, 0.0],
    }


def numbers_in(value: Any) -> Array:
    """Give the numbers of a value; of a word, none."""
    data = value.get("data", []) if isinstance(value, dict) else value
    try:
        return np.asarray(data, dtype=float)
    except (TypeError, ValueError):
        return np.zeros(0)


def _nearest_rotation(matrix: Array) -> Array:
    u, _, vt = np.linalg.svd(matrix)
    return np.asarray(u @ vt)
