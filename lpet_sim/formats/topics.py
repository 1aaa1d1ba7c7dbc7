"""The topics and frames of a bag."""

from __future__ import annotations

from lpet_sim.spec import Spec

OWN_ODOMETRY, OWN_SIGHTINGS = "/lpet/odometry", "/lpet/sightings"
OWN_WHEEL_TRUTH, OWN_EVENTS = "/lpet/wheel_truth", "/lpet/events"
TF = "/tf"
NOTE = "lpet"

WORLD, CAMERA, CAMERA_RIGHT, IMU_FRAME = "world", "camera", "camera_right", "imu"
DRIVE, STEER = "drive", "steer"


class TopicsSpec(Spec):
    """Where in a bag the streams are; a topic that the bag does not hold is left out.

    Attributes:
        left_image: Grey rectified images of the left eye.
        right_image: Likewise of the right eye, with the same stamps.
        left_info: What is declared of the left eye.
        right_info: Likewise of the right eye; its projection holds the baseline.
        imu: Inertial readings.
        joints: Encoder readings; a wheel's joints are ``NAME_drive`` and ``NAME_steer``.
        truth: True poses of the body.
        tf_static: Where the sensors sit.
        body_frame: The frame of the body.
    """

    left_image: str = "/stereo/left/image_rect"
    right_image: str = "/stereo/right/image_rect"
    left_info: str = "/stereo/left/camera_info"
    right_info: str = "/stereo/right/camera_info"
    imu: str = "/imu/data"
    joints: str = "/joint_states"
    truth: str = "/ground_truth/odometry"
    tf_static: str = "/tf_static"
    body_frame: str = "body"


def joint_names(wheels: tuple[str, ...]) -> list[str]:
    """Name the joints of the wheels: those that drive, then those that steer."""
    return [f"{wheel}_{part}" for part in (DRIVE, STEER) for wheel in wheels]
