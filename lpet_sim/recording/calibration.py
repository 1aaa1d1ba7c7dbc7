"""The declared calibration: what a real rover would believe of its own sensors.

The true values live in the sensor specs; the two may differ, and that is how calibration error is
studied.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from lpet_sim.geometry import SE3
from lpet_sim.spec import Spec

Array = NDArray[np.float64]
Triple = tuple[float, float, float]


class PoseSpec(Spec):
    """A pose ``T_a_b`` as YAML-ready numbers.

    Attributes:
        translation_m: Origin of b in a [m].
        q_wxyz: Unit quaternion of the rotation, scalar first.
    """

    translation_m: Triple = (0.0, 0.0, 0.0)
    q_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    @classmethod
    def from_se3(cls, pose: SE3) -> PoseSpec:
        """Make the spec from a single pose."""
        x, y, z = map(float, pose.translation)
        w, i, j, k = map(float, pose.quat_wxyz())
        return cls(translation_m=(x, y, z), q_wxyz=(w, i, j, k))

    def se3(self) -> SE3:
        """Give the pose."""
        return SE3.from_quat_wxyz(self.q_wxyz, self.translation_m)


class StereoCalibration(Spec):
    """A rectified stereo pair: two equal pinhole cameras, the right one at +x of the left.

    A point ``(x, y, z)`` in ``camera`` projects to ``u_left = f x/z + cx``,
    ``u_right = f (x - b)/z + cx``, ``v = f y/z + cy``; pixel (0, 0) is the centre of the first one.

    Attributes:
        width_px: Image width.
        height_px: Image height.
        focal_px: Focal length f [px].
        cx_px: Principal point, along u [px].
        cy_px: Principal point, along v [px].
        baseline_m: Distance b between the eyes [m].
        T_body_camera: Pose of the left camera (optical frame) in the body.
        sigma_px: White noise of one image coordinate of a sighting, 1 sigma [px].
    """

    width_px: int = Field(gt=0)
    height_px: int = Field(gt=0)
    focal_px: float = Field(gt=0)
    cx_px: float
    cy_px: float
    baseline_m: float = Field(gt=0)
    T_body_camera: PoseSpec
    sigma_px: float = Field(default=0.5, gt=0)

    def project(self, p_camera: ArrayLike) -> Array:
        """Project points to (u_left, u_right, v).

        Args:
            p_camera: Points in the left camera [m], Shape (..., 3), with z > 0.

        Returns:
            Image coordinates [px], Shape (..., 3).
        """
        p = np.asarray(p_camera, dtype=float)
        x, y, z = p[..., 0], p[..., 1], p[..., 2]
        f = self.focal_px
        u_left = f * x / z + self.cx_px
        return np.stack([u_left, u_left - f * self.baseline_m / z, f * y / z + self.cy_px], axis=-1)

    def triangulate(self, stereo_px: ArrayLike) -> Array:
        """Intersect the rays of sightings with positive disparity, the inverse of `project`.

        Args:
            stereo_px: (u_left, u_right, v) [px], Shape (..., 3).

        Returns:
            Points in the left camera [m], Shape (..., 3).
        """
        s = np.asarray(stereo_px, dtype=float)
        z_over_f = self.baseline_m / (s[..., 0] - s[..., 1])
        x = (s[..., 0] - self.cx_px) * z_over_f
        y = (s[..., 2] - self.cy_px) * z_over_f
        return np.stack([x, y, z_over_f * self.focal_px], axis=-1)

    def projection_jacobian(self, p_camera: ArrayLike) -> Array:
        """Give d(u_left, u_right, v)/d(x, y, z) at points in the camera, Shape (..., 3, 3)."""
        p = np.asarray(p_camera, dtype=float)
        x, y, z = p[..., 0], p[..., 1], p[..., 2]
        out = np.zeros((*p.shape, 3))
        f = self.focal_px
        out[..., 0, 0] = out[..., 1, 0] = out[..., 2, 1] = f / z
        out[..., 0, 2] = -f * x / z**2
        out[..., 1, 2] = -f * (x - self.baseline_m) / z**2
        out[..., 2, 2] = -f * y / z**2
        return out


class ImuCalibration(Spec):
    """What is declared of the inertial unit.

    Attributes:
        rate_hz: Sample rate.
        T_body_imu: Pose of the unit in the body.
        gyro_random_walk_radps_rthz: Angle random walk [rad/s/sqrt(Hz)].
        gyro_bias_radps: Turn-on bias, 1 sigma [rad/s].
        accel_random_walk_mps2_rthz: Velocity random walk [m/s^2/sqrt(Hz)].
        accel_bias_mps2: Turn-on bias, 1 sigma [m/s^2].
        accel_quantum_mps: Quantum of a velocity increment [m/s].
    """

    rate_hz: float = Field(gt=0)
    T_body_imu: PoseSpec
    gyro_random_walk_radps_rthz: float = Field(ge=0)
    gyro_bias_radps: float = Field(ge=0)
    accel_random_walk_mps2_rthz: float = Field(ge=0)
    accel_bias_mps2: float = Field(ge=0)
    accel_quantum_mps: float = Field(ge=0)


class WheelCalibration(Spec):
    """What is declared of the wheels, in the order of `names`.

    Attributes:
        names: Names of the wheels.
        position_body_m: Contact points of the wheels in the body at rest [m].
        radius_m: Effective rolling radius [m].
        steerable: Which wheels steer.
        scale_sigma: Relative error of the distance per wheel turn, 1 sigma.
        white_sigma_m_rtm: Noise that grows with the root of the distance [m/sqrt(m)].
        lateral_sigma_m_rtm: Sideways slip noise [m/sqrt(m)].
        heading_sigma_rad_rtm: Heading noise [rad/sqrt(m)].
    """

    names: tuple[str, ...]
    position_body_m: tuple[Triple, ...]
    radius_m: float = Field(gt=0)
    steerable: tuple[bool, ...]
    scale_sigma: float = Field(default=0.03, ge=0)
    white_sigma_m_rtm: float = Field(default=0.05, ge=0)
    lateral_sigma_m_rtm: float = Field(default=0.02, ge=0)
    heading_sigma_rad_rtm: float = Field(default=0.01, ge=0)


class Calibration(Spec):
    """The declared calibration of a whole suite; a sensor that is absent is None.

    Attributes:
        stereo: The camera pair.
        imu: The inertial unit.
        wheels: Wheel and steering encoders.
        T_world_body_start: The pose at the first time stamp, which is given.
        gravity_mps2: Magnitude of gravity, along -z of the world [m/s^2].
    """

    stereo: StereoCalibration | None = None
    imu: ImuCalibration | None = None
    wheels: WheelCalibration | None = None
    T_world_body_start: PoseSpec = PoseSpec()
    gravity_mps2: float = Field(default=3.721, gt=0)
