"""A drive past as many landmarks as are asked for, for filters of any size of state."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import (
    Calibration,
    ImuCalibration,
    PoseSpec,
    StereoCalibration,
)
from lpet_sim.recording.streams import Measurements, OdometryStream, SightingStream
from lpet_sim.rng import stream

STEP_M, PERIOD_S = 0.02, 0.72
"""Between images: 100 m/h."""
LIFE = 100
"""Images in which a landmark is in view."""
SIGMA = np.array([5e-4, 2e-4, 2e-4, 2e-5, 2e-5, 2e-5])
"""White noise of a step of odometry, each part of xi [m, rad]."""
SCALE_SIGMA = 0.03
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Drive:
    """Drive forward at 100 m/h in gentle curves, with landmarks 4 to 10 m ahead.

    Attributes:
        images: Number of image pairs.
        visible: Landmarks in view in each image.
        sightings: How many of them are sighted, drawn anew in each image.
        sigma_px: Noise of the sightings, as declared [px].
        noise: Factor on all noise, not on what is declared.
        rate_radps: Constant error of the rate of turn, which odometry does not see [rad/s].
        rate_sigma_radps: What is declared of it, along each axis [rad/s].
        scale: Error of the distance, in units of its declared sigma.
    """

    images: int
    visible: int = 50
    sightings: int = 40
    sigma_px: float = 0.5
    noise: float = 1.0
    rate_radps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rate_sigma_radps: float = 1e-5
    scale: float = 0.0

    def poses(self) -> SE3:
        """Give the true poses, Shape (n,)."""
        poses = [SE3.identity()]
        for twist in self.twists():
            poses.append(poses[-1] @ SE3.exp(twist))
        return SE3.stack(poses)

    def twists(self) -> Array:
        """Give the true steps, Shape (n - 1, 6)."""
        k = np.arange(self.images - 1)
        twist = np.zeros((len(k), 6))
        twist[:, 0] = STEP_M
        twist[:, 3:] = 2e-3 * np.sin(np.outer(k, [0.11, 0.07, 0.013]))
        return twist

    def measurements(self, seed: int) -> Measurements:
        """Give what cameras and odometry deliver."""
        cameras = stereo(self.sigma_px)
        imu = ImuCalibration(
            rate_hz=100.0,
            T_body_imu=PoseSpec(),
            gyro_random_walk_radps_rthz=SIGMA[3] / np.sqrt(PERIOD_S),
            gyro_bias_radps=self.rate_sigma_radps,
            accel_random_walk_mps2_rthz=0.0,
            accel_bias_mps2=0.0,
            accel_quantum_mps=0.0,
        )
        calibration = Calibration(stereo=cameras, imu=imu, T_world_body_start=PoseSpec())
        return Measurements(
            calibration, sightings=self.sighted(cameras, seed), odometry=self.odometry(seed)
        )

    def odometry(self, seed: int) -> OdometryStream:
        """Give the steps as odometry reads them."""
        read, variance = np.zeros((self.images, 6)), np.zeros((self.images, 6))
        white = self.noise * SIGMA * stream(seed, "odometry").standard_normal((self.images - 1, 6))
        true = (SE3.exp(self.twists()) @ SE3.exp(-white)).log()
        read[1:, :3] = true[:, :3] / (1.0 + SCALE_SIGMA * self.scale)
        read[1:, 3:] = true[:, 3:] - PERIOD_S * np.array(self.rate_radps)
        variance[1:] = SIGMA**2
        scale = np.tile(SCALE_SIGMA * np.array([1.0, 1, 1, 0, 0, 0]), (self.images, 1))
        return OdometryStream(self.times(), read, variance, scale)

    def times(self) -> Ints:
        """Give the times of the images [ns], Shape (n,)."""
        return np.arange(self.images, dtype=np.int64) * round(PERIOD_S * NS_PER_S)

    def sighted(self, cameras: StereoCalibration, seed: int) -> SightingStream:
        """Sight landmarks that come into view one after the other and stay for their life."""
        rng, eyes = stream(seed, "sightings"), self.poses() @ cameras.T_body_camera.se3()
        points = self.points(eyes, seed)
        count, ids, rows = min(self.sightings, self.visible), [], []
        for k in range(self.images):
            first = k * self.visible // LIFE
            seen = first + np.sort(rng.choice(self.visible, count, replace=False))
            white = self.noise * self.sigma_px * rng.standard_normal((count, 3))
            rows.append(cameras.project(eyes[k].inverse() @ points[seen]) + white)
            ids.append(seen)
        offsets = np.arange(self.images + 1, dtype=np.int64) * count
        stereo_px, sigma = np.concatenate(rows), np.full(self.images * count, self.sigma_px)
        return SightingStream(self.times(), offsets, np.concatenate(ids), stereo_px, sigma)

    def points(self, eyes: SE3, seed: int) -> Array:
        """Place landmarks ahead of the camera as it is in the middle of their life [m]."""
        count = (self.images * self.visible) // LIFE + self.visible + 1
        drawn = stream(seed, "points").uniform([-0.35, -0.35, 4.0], [0.35, 0.35, 10.0], (count, 3))
        in_eye = drawn * np.column_stack([drawn[:, 2], drawn[:, 2], np.ones(count)])
        middle = np.arange(count) * LIFE // self.visible - LIFE // 2
        hosts = eyes[np.clip(middle, 0, self.images - 1)]
        placed: Array = np.einsum("nij,nj->ni", hosts.rotation, in_eye) + hosts.translation
        return placed


def stereo(sigma_px: float) -> StereoCalibration:
    """Make a pair at the height of a mast that looks ahead."""
    return StereoCalibration(
        width_px=1024,
        height_px=1024,
        focal_px=804.0,
        cx_px=511.5,
        cy_px=511.5,
        baseline_m=0.15,
        T_body_camera=PoseSpec.from_se3(SE3(_OPTICAL, np.array([0.3, 0.075, 1.5]))),
        sigma_px=sigma_px,
    )
