"""Calibration in the form of Kalibr: a chain of cameras, and an inertial unit.

The unit is the frame that all is given in; where there is none, the body is. Kalibr knows neither
wheels nor turn-on biases, and this package declares no wandering of biases: it is written as zero.

Reference:
    Furgale, Rehder, Siegwart, Unified temporal and spatial calibration for multi-sensor systems
    (2013); the form of its YAML files is that of the tool's documentation.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats.sensor_yaml import write_yaml
from lpet_sim.geometry import SE3
from lpet_sim.outputs import whole_folder
from lpet_sim.recording.calibration import Calibration, ImuCalibration, StereoCalibration

CAMERAS, IMU = "camchain-imucam.yaml", "imu.yaml"
TOPICS = ("/stereo/left/image_rect", "/stereo/right/image_rect")
IMU_TOPIC = "/imu/data"


def export_kalibr(calibration: Calibration, folder: Path) -> None:
    """Write a calibration as Kalibr's files.

    Args:
        calibration: What is declared.
        folder: A folder that is made.

    Raises:
        RecordingError: Neither cameras nor an inertial unit are declared.
        OutputError: The folder is there already, or cannot be written.
    """
    if calibration.stereo is None and calibration.imu is None:
        raise RecordingError(
            "the recording declares neither cameras nor an inertial unit, and Kalibr's files hold "
            "nothing else"
        )
    with whole_folder(folder) as out:
        write_kalibr(calibration, out)


def write_kalibr(calibration: Calibration, folder: Path) -> None:
    """Write what there is of cameras and inertial unit into a folder that exists."""
    imu, stereo = calibration.imu, calibration.stereo
    if stereo is not None:
        T_body_imu = SE3.identity() if imu is None else imu.T_body_imu.se3()
        write_yaml(folder / CAMERAS, camera_chain(stereo, T_body_imu))
    if imu is not None:
        write_yaml(folder / IMU, imu_noise(imu))


def camera_chain(stereo: StereoCalibration, T_body_imu: SE3) -> dict[str, Any]:
    """Give both cameras, each with its pose: ``T_cam_imu`` takes points of the unit into it."""
    T_left_imu = stereo.T_body_camera.se3().inverse() @ T_body_imu
    T_right_left = SE3(np.eye(3), np.array([-stereo.baseline_m, 0.0, 0.0]))
    right = _camera(stereo, T_right_left @ T_left_imu, TOPICS[1], 0)
    return {
        "cam0": _camera(stereo, T_left_imu, TOPICS[0], 1),
        "cam1": right | {"T_cn_cnm1": T_right_left.matrix().tolist()},
    }


def imu_noise(imu: ImuCalibration) -> dict[str, Any]:
    """Give the noise of the inertial unit."""
    return {
        "accelerometer_noise_density": imu.accel_random_walk_mps2_rthz,
        "accelerometer_random_walk": 0.0,
        "gyroscope_noise_density": imu.gyro_random_walk_radps_rthz,
        "gyroscope_random_walk": 0.0,
        "rostopic": IMU_TOPIC,
        "update_rate": imu.rate_hz,
    }


def _camera(stereo: StereoCalibration, T_eye_imu: SE3, topic: str, overlaps: int) -> dict[str, Any]:
    return {
        "cam_overlaps": [overlaps],
        "camera_model": "pinhole",
        "distortion_coeffs": [0.0, 0.0, 0.0, 0.0],
        "distortion_model": "radtan",
        "intrinsics": [stereo.focal_px, stereo.focal_px, stereo.cx_px, stereo.cy_px],
        "resolution": [stereo.width_px, stereo.height_px],
        "rostopic": topic,
        "timeshift_cam_imu": 0.0,
        "T_cam_imu": T_eye_imu.matrix().tolist(),
    }
