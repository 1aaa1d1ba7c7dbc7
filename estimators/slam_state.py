"""The state of the SLAM filter and what can happen to it: move, see, let enter, let leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators import gaussian, gaussian_blocks, slam_kernels
from estimators.jacobians import hat, se3_exp
from estimators.observation import camera_vector, transfer
from estimators.slam_kernels import FIRST_ESTIMATES, RIGHT_INVARIANT, STANDARD
from estimators.slam_map import POSE, LandmarkMap
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration

FORMS = {
    "standard": STANDARD,
    "first_estimates": FIRST_ESTIMATES,
    "right_invariant": RIGHT_INVARIANT,
}
_START_VARIANCE = 1e-12
_GROWTH = 1.25


@dataclass
class Innovations:
    """Sightings of known landmarks against their prediction.

    Attributes:
        slots: Which landmarks, Shape (m,).
        r: Seen minus predicted [px], Shape (m, 3).
        H: Derivatives by the pose's error, Shape (m, 3, 6).
        G: Derivatives by the landmark's own, Shape (m, 3, 3).
        variance: Of each image coordinate [px^2], Shape (m,).
    """

    slots: Ints
    r: Array
    H: Array
    G: Array
    variance: Array

    def __len__(self) -> int:
        return len(self.slots)

    def take(self, which: NDArray[np.bool_]) -> Innovations:
        """Keep some of them."""
        if which.all():
            return self
        return Innovations(
            self.slots[which], self.r[which], self.H[which], self.G[which], self.variance[which]
        )


class SlamState:
    """Pose and landmarks with their joint covariance.

    Attributes:
        R: Rotation of the body in the world, Shape (3, 3).
        p: Position of the body, from where the run starts [m], Shape (3,).
        P: Covariance of (pose, landmarks), Shape (6 + 3 c, 6 + 3 c); see `slam_kernels`.
        landmarks: The map.
    """

    def __init__(self, T_world_body: SE3, calibration: StereoCalibration, formulation: str) -> None:
        self._calibration = calibration
        self._camera = camera_vector(calibration)
        T_body_camera = calibration.T_body_camera.se3()
        self._R_body_camera = np.array(T_body_camera.rotation)
        self._p_body_camera = np.array(T_body_camera.translation)
        self._origin = np.array(T_world_body.translation)
        self._form = FORMS[formulation]
        self.R, self.p = np.array(T_world_body.rotation), np.zeros(3)
        self._predicted = self.R, self.p
        self.landmarks = LandmarkMap()
        start = gaussian.independent(np.full(POSE, _START_VARIANCE))
        self.P = gaussian_blocks.enlarged(start, self.landmarks.rows)

    @property
    def pose(self) -> SE3:
        """The estimate ``T_world_body``."""
        return SE3(self.R.copy(), self.p + self._origin)

    def pose_covariance(self) -> Array:
        """Give the covariance of the right perturbation of the pose, Shape (6, 6).

        ``rho = R' dp`` and ``R' (rho - p x phi)`` in the right-invariant form; ``phi`` turns by R'.
        """
        M = np.zeros((POSE, POSE))
        M[:3, :3] = M[3:, 3:] = self.R.T
        if self._form == RIGHT_INVARIANT:
            M[:3, 3:] = -self.R.T @ hat(self.p)
        return gaussian.transport(self.P[:POSE, :POSE], M)

    def advance(self, twist: Array, noise: Array) -> None:
        """Move by an increment of odometry.

        Args:
            twist: ``log(T_prev_curr)``, Shape (6,).
            noise: What unit noises do to its right perturbation, Shape (k, 6).
        """
        R_step, p_step = se3_exp(np.ascontiguousarray(twist))
        before = self._predicted[1] if self._form == FIRST_ESTIMATES else self.p
        self.p = self.p + self.R @ p_step
        self.R = self.R @ R_step
        if self._form != RIGHT_INVARIANT:
            F = np.eye(POSE)
            F[:3, 3:] = -hat(self.p - before)
            gaussian_blocks.move_block(self.P, F, np.zeros((POSE, POSE)))
        self._predicted = self.R, self.p
        self.disturb(noise)

    def disturb(self, noise: Array) -> None:
        """Add noise to the right perturbation of the pose.

        Args:
            noise: What unit noises do to it, Shape (k, 6).
        """
        B_T = np.zeros((len(noise), self.landmarks.rows))
        turn = np.ascontiguousarray(noise[:, 3:] @ self.R.T)
        B_T[:, :3], B_T[:, 3:POSE] = noise[:, :3] @ self.R.T, turn
        if self._form == RIGHT_INVARIANT:
            B_T[:, :3] += np.cross(self.p, turn)
            m = self.landmarks
            slam_kernels.turning_noise(self._camera, m.hosts, m.x, m.alive, turn, B_T)
        gaussian_blocks.add_noise(self.P, B_T)

    def innovations(self, slots: Ints, stereo_px: Array, variance: Array) -> Innovations:
        """Predict the sightings of known landmarks and compare them with what was seen."""
        n, m = len(slots), self.landmarks
        predicted, H, G = np.empty((n, 3)), np.empty((n, 3, POSE)), np.empty((n, 3, 3))
        pose = self._camera_pose(self.R, self.p)
        arm = self.R @ self._p_body_camera
        slam_kernels.linearise(
            self._camera, pose, arm, m.hosts, m.x, m.x_first, slots, self._form, predicted, H, G
        )
        return Innovations(slots, stereo_px - predicted, H, G, variance)

    def squared_distances(self, seen: Innovations) -> Array:
        """Give the squared Mahalanobis distance of each sighting by itself, Shape (m,)."""
        out = np.empty(len(seen))
        slam_kernels.gate(self.P, seen.slots, seen.r, seen.H, seen.G, seen.variance, out)
        return out

    def joint(self, seen: Innovations) -> tuple[Array, Array]:
        """Give ``P H'``, Shape (n, 3 m), and the innovations' covariance, Shape (3 m, 3 m)."""
        PH_T = np.empty((len(self.P), 3 * len(seen)))
        S = np.empty((3 * len(seen), 3 * len(seen)))
        slam_kernels.project_covariance(self.P, seen.slots, seen.H, seen.G, PH_T)
        slam_kernels.innovation_covariance(PH_T, seen.slots, seen.H, seen.G, seen.variance, S)
        return PH_T, S

    def correct(self, seen: Innovations, PH_T: Array, S: Array) -> float:
        """Take sightings in and give their normalised innovation squared."""
        dx, nis = gaussian_blocks.update_in_place(self.P, PH_T, S, seen.r.ravel())
        turn, shift = se3_exp(np.ascontiguousarray(dx[:POSE]))
        m = self.landmarks
        m.x += dx[POSE:].reshape(-1, 3)
        self.R = turn @ self.R
        if self._form == RIGHT_INVARIANT:
            self.p = turn @ self.p + shift
            m.R_world_host = turn @ m.R_world_host
            m.p_world_host = m.p_world_host @ turn.T
        else:
            self.p = self.p + dx[:3]
        return nis

    def enter(self, landmark_id: Ints, stereo_px: Array, variance: Array) -> None:
        """Let landmarks that are seen now into the map."""
        m = self.landmarks
        free = m.free_slots(len(landmark_id))
        if len(free) < len(landmark_id):
            m.grow(max(int(_GROWTH * m.capacity), m.capacity + len(landmark_id)))
            self.P = gaussian_blocks.enlarged(self.P, m.rows)
            free = m.free_slots(len(landmark_id))
        held = self._predicted if self._form == FIRST_ESTIMATES else (self.R, self.p)
        host, arm = self._camera_pose(*held), held[0] @ self._p_body_camera
        placed = stereo_px if held[1] is self.p else self._seen_from(host, stereo_px)
        J = np.empty((3, POSE))
        turns = self._form != RIGHT_INVARIANT
        for i, slot in enumerate(free):
            m.enter(slot, int(landmark_id[i]), stereo_px[i], host)
            m.x[slot] = placed[i]
            slam_kernels.entry_jacobian(self._camera, stereo_px[i], host[0], arm, turns, J)
            gaussian_blocks.join_block(self.P, POSE + 3 * int(slot), J, float(variance[i]))

    def leave(self, slots: Ints) -> None:
        """Take landmarks out of the state."""
        for slot in slots:
            gaussian_blocks.free_block(self.P, POSE + 3 * int(slot))
            self.landmarks.leave(int(slot))

    def decouple(self, keep_pose: bool) -> None:
        """Drop the correlations between landmarks, and those with the pose unless they are kept."""
        gaussian_blocks.drop_correlations(self.P, POSE, keep_pose)

    def landmark_variance(self) -> Array:
        """Give the summed variance of the three numbers of each slot [px^2], Shape (c,)."""
        return np.diag(self.P)[POSE:].reshape(-1, 3).sum(axis=1)

    def _camera_pose(self, R: Array, p: Array) -> tuple[Array, Array]:
        return np.ascontiguousarray(R @ self._R_body_camera), p + R @ self._p_body_camera

    def _seen_from(self, host: tuple[Array, Array], stereo_px: Array) -> Array:
        """Give where a host camera would see what the camera sees now."""
        T_camera_host = SE3(*self._camera_pose(self.R, self.p)).inverse() @ SE3(*host)
        return transfer(self._calibration, T_camera_host, stereo_px)
