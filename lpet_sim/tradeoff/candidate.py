"""One candidate sensor: eight numbers and what the rest of LPET makes of them."""

from __future__ import annotations

import math
from typing import Annotated, Final

import numpy as np
from pydantic import AfterValidator, Field

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import PoseSpec, StereoCalibration
from lpet_sim.sensors.camera_spec import LOCCAM_FOCAL_PX, StereoCameraSpec
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.spec import Spec
from lpet_sim.tradeoff.grades import IMU_GRADES

PARAMETERS: Final = (
    "field_of_view_rad",
    "resolution_px",
    "baseline_m",
    "mast_height_m",
    "depression_rad",
    "image_interval_m",
    "matching_sigma_px",
    "imu",
)
"""What a candidate is made of, in the order of tables."""

_FORWARD_M: Final = 0.37
_SAMPLE_S: Final = 0.01


def _known_grade(name: str) -> str:
    if name not in IMU_GRADES:
        raise ValueError(f"unknown IMU grade '{name}': choose one of {', '.join(IMU_GRADES)}")
    return name


Grade = Annotated[str, AfterValidator(_known_grade)]


class Candidate(Spec):
    """One sensor of the space.

    Attributes:
        field_of_view_rad: Horizontal field of view, from edge to edge.
        resolution_px: Width of an image; its height follows from the aspect.
        baseline_m: Distance between the eyes.
        mast_height_m: Height of the eyes above flat ground.
        depression_rad: Angle by which the optical axes point below the horizon.
        image_interval_m: Distance driven between two image pairs.
        matching_sigma_px: White noise of each image coordinate of a sighting, 1 sigma.
        imu: Grade of the inertial unit, one of `IMU_GRADES`.
        aspect: Height of an image over its width.
    """

    field_of_view_rad: Annotated[float, Field(ge=0.1, le=2.6)] = math.radians(65.0)
    resolution_px: Annotated[int, Field(ge=64, le=4096)] = 1024
    baseline_m: Annotated[float, Field(gt=0.0, le=5.0)] = 0.15
    mast_height_m: Annotated[float, Field(ge=0.2, le=5.0)] = 1.75
    depression_rad: Annotated[float, Field(ge=-0.5, le=1.57)] = math.radians(18.0)
    image_interval_m: Annotated[float, Field(gt=0.0, le=20.0)] = 0.02
    matching_sigma_px: Annotated[float, Field(gt=0.0, le=20.0)] = 0.5
    imu: Grade = "ln200"
    aspect: Annotated[float, Field(gt=0.1, le=4.0)] = 1.0

    @property
    def focal_px(self) -> float:
        """Focal length ``W / (2 tan(fov / 2))`` [px]."""
        return 0.5 * self.resolution_px / math.tan(0.5 * self.field_of_view_rad)

    @property
    def height_px(self) -> int:
        """Height of an image [px]."""
        return max(16, round(self.aspect * self.resolution_px))

    @property
    def lowest_ray_rad(self) -> float:
        """Angle of the image's lower edge below the horizon, at most straight down [rad]."""
        half = math.atan(0.5 * self.height_px / self.focal_px)
        return min(self.depression_rad + half, 0.5 * math.pi)

    def period_s(self, speed_mps: float) -> float:
        """Time between image pairs at a speed, in whole hundredths of a second [s]."""
        return max(1, round(self.image_interval_m / speed_mps / _SAMPLE_S)) * _SAMPLE_S

    def mount(self, ride_height_m: float) -> PoseSpec:
        """Give ``T_body_camera``: at the front of the body, the pair's middle in its plane.

        Args:
            ride_height_m: Height of the body's origin above flat ground.
        """
        s, c = math.sin(self.depression_rad), math.cos(self.depression_rad)
        # Columns: the camera's x (right), y (down) and z (forward) in the body.
        R_body_camera = np.array([[0.0, -s, c], [-1.0, 0.0, 0.0], [0.0, -c, -s]])
        place = [_FORWARD_M, 0.5 * self.baseline_m, self.mast_height_m - ride_height_m]
        return PoseSpec.from_se3(SE3(R_body_camera, np.array(place)))

    def camera(self, ride_height_m: float) -> StereoCameraSpec:
        """Give the pair as a traverse takes it (``sensors.stereo``)."""
        return StereoCameraSpec(
            width_px=self.resolution_px,
            height_px=self.height_px,
            focal_px=self.focal_px,
            baseline_m=self.baseline_m,
            mount=self.mount(ride_height_m),
            sigma_px=self.matching_sigma_px,
        )

    def calibration(self, ride_height_m: float) -> StereoCalibration:
        """Give the pair's calibration, true and declared alike."""
        return self.camera(ride_height_m).true_calibration(SE3.identity())

    def landmark_sensor(self, base: LandmarkSensorSpec, speed_mps: float) -> LandmarkSensorSpec:
        """Give the landmark-level sensor that stands for the pair and its front end.

        A landmark is seen while it covers enough pixels, so the range up to which all are seen
        grows with the focal length; that of the base holds for the default camera's
        (`LOCCAM_FOCAL_PX`).

        Args:
            base: Field, visibility and detection of the default camera.
            speed_mps: Speed of the rover.
        """
        sigma, seen = self.matching_sigma_px, base.visibility
        full_m = seen.range_full_m * self.focal_px / LOCCAM_FOCAL_PX
        white = {f"sigma_{name}_px": sigma for name in ("left", "right", "v")}
        return base.model_copy(
            update={
                "period_s": self.period_s(speed_mps),
                "visibility": seen.model_copy(update={"range_full_m": full_m}),
                "noise": base.noise.model_copy(update=white),
            }
        )
