"""Factors and values of GTSAM, from our own types and conventions.

GTSAM's tangent of a pose is (rotation, translation), with its error on the right as ours: only the
order differs. Its stereo point is (u_left, u_right, v), the same as ours.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from estimators.peers.inputs import PeerInputs
from estimators.peers.library import load_gtsam
from estimators.peers.peer_spec import PeerSpec
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array

_SWAP = np.array([3, 4, 5, 0, 1, 2])


def swapped(P: Array) -> Array:
    """Exchange rotation and translation in a covariance, Shape (6, 6), either way."""
    return np.ascontiguousarray(P[np.ix_(_SWAP, _SWAP)])


def to_pose3(pose: SE3) -> Any:
    """Give a pose as GTSAM's."""
    return load_gtsam().Pose3(pose.matrix())


def from_pose3(pose: Any) -> SE3:
    """Give GTSAM's pose as ours."""
    return SE3.from_matrix(pose.matrix())


class GraphMaker:
    """Makes the factors of a recording.

    Attributes:
        gtsam: The library.
        inputs: Sightings and motions.
        spec: Noise models.
    """

    def __init__(self, inputs: PeerInputs, spec: PeerSpec) -> None:
        """Translate the camera once."""
        self.gtsam, self.inputs, self.spec = load_gtsam(), inputs, spec
        c = inputs.stereo
        self._camera = self.gtsam.Cal3_S2Stereo(
            c.focal_px, c.focal_px, 0.0, c.cx_px, c.cy_px, c.baseline_m
        )
        self._mount = to_pose3(c.T_body_camera.se3())
        self._entry_noise = self.gtsam.noiseModel.Isotropic.Sigma(3, spec.landmark_sigma_m)
        self._noise: dict[tuple[float, str], Any] = {}

    def pose_key(self, image: int) -> int:
        """Name the pose at an image."""
        return int(self.gtsam.symbol("x", image))

    def landmark_key(self, number: int) -> int:
        """Name a landmark."""
        return int(self.gtsam.symbol("l", number))

    def prior(self) -> Any:
        """Tie the first pose to the given start, less sure by the odometry from there."""
        given = np.repeat([self.spec.prior_sigma_rad, self.spec.prior_sigma_m], 3)
        sigmas = np.hypot(given, self.inputs.first_sigma[[3, 4, 5, 0, 1, 2]])
        noise = self.gtsam.noiseModel.Diagonal.Sigmas(sigmas)
        start = to_pose3(self.inputs.T_world_body_start)
        return self.gtsam.PriorFactorPose3(self.pose_key(0), start, noise)

    def entry(self, landmark_key: int, p_world: Array) -> Any:
        """Hold a landmark weakly to the point where it enters."""
        return self.gtsam.PriorFactorPoint3(landmark_key, p_world, self._entry_noise)

    def motion(self, image: int) -> Any:
        """Tie the pose at an image to the one before it by odometry."""
        step, covariance = self.inputs.motion(image)
        noise = self.gtsam.noiseModel.Gaussian.Covariance(swapped(covariance))
        keys = self.pose_key(image - 1), self.pose_key(image)
        return self.gtsam.BetweenFactorPose3(*keys, to_pose3(step), noise)

    def sighting(self, image: int, landmark_key: int, row: int, robust: str) -> Any:
        """Tie a landmark to the pose that sees it.

        A landmark behind the camera is left without pull: GTSAM then gives a constant residual.
        """
        s = self.inputs.sightings
        measured = self.gtsam.StereoPoint2(*s.stereo_px[row].tolist())
        noise = self._sighting_noise(float(s.sigma_px[row]), robust)
        pose_key = self.pose_key(image)
        return self.gtsam.GenericStereoFactor3D(
            measured, noise, pose_key, landmark_key, self._camera, self._mount
        )

    def _sighting_noise(self, sigma_px: float, robust: str) -> Any:
        if (sigma_px, robust) not in self._noise:
            noise = self.gtsam.noiseModel.Isotropic.Sigma(3, sigma_px)
            if robust != "none":
                kernels = self.gtsam.noiseModel.mEstimator
                kind = {"huber": kernels.Huber, "geman_mcclure": kernels.GemanMcClure}[robust]
                kernel = kind.Create(self.spec.robust_width)
                noise = self.gtsam.noiseModel.Robust.Create(kernel, noise)
            self._noise[sigma_px, robust] = noise
        return self._noise[sigma_px, robust]
