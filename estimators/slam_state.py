"""The state of the SLAM filter and what can happen to it: move, see, let enter, let leave."""

from __future__ import annotations

import math

import numpy as np

from estimators import gaussian, gaussian_blocks, slam_gate, slam_hosts, slam_kernels
from estimators.jacobians import hat, se3_exp
from estimators.observation import camera_vector, transfer
from estimators.slam_kernels import FIRST_ESTIMATES, RELATIVE, RIGHT_INVARIANT, STANDARD
from estimators.slam_map import FREE, LASTING, POSE, VEHICLE, LandmarkMap
from estimators.slam_spec import SlamSpec
from estimators.slam_values import Innovations, Joint, Step
from lpet_sim.geometry import SE3
from lpet_sim.geometry.so3 import left_jacobian
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration

FORMS = {
    ("standard", "world"): STANDARD,
    ("first_estimates", "world"): FIRST_ESTIMATES,
    ("right_invariant", "world"): RIGHT_INVARIANT,
    ("right_invariant", "keyframe"): RELATIVE,
}
_START_VARIANCE = 1e-12
_GROWTH = 8
_POSE_ROWS = np.arange(POSE)


class SlamState:
    """Pose and landmarks with their joint covariance.

    Attributes:
        R: Rotation of the body in the world, Shape (3, 3).
        p: Position of the body, from where the run starts [m], Shape (3,).
        lasting: Lasting errors of odometry: rate of turn [rad/s] and scale [sigma], Shape (4,).
        P: Covariance of (pose, slots), Shape (6 + 3 c, 6 + 3 c); see `slam_kernels`.
        landmarks: The map.
    """

    def __init__(
        self,
        T_world_body: SE3,
        calibration: StereoCalibration,
        spec: SlamSpec,
        rate_sigma_radps: float = 0.0,
    ) -> None:
        self._calibration, self._spec = calibration, spec
        self._camera = camera_vector(calibration)
        T_body_camera = calibration.T_body_camera.se3()
        self._R_body_camera = np.array(T_body_camera.rotation)
        self._p_body_camera = np.array(T_body_camera.translation)
        self._origin = np.array(T_world_body.translation)
        self._form = FORMS[spec.formulation, spec.landmark_frame]
        self._reach = spec.keyframe_m, spec.keyframe_rad
        self.R, self.p = np.array(T_world_body.rotation), np.zeros(3)
        self._predicted = self.R, self.p
        self.landmarks = LandmarkMap()
        self.lasting = np.zeros(LASTING)
        rate = spec.noise_scale * max(rate_sigma_radps, 1e-12)
        sure = np.r_[np.full(POSE, _START_VARIANCE), np.full(3, rate**2), spec.noise_scale**2]
        start = gaussian.independent(sure)
        self.P = gaussian_blocks.enlarged(start, self.landmarks.rows)

    @property
    def _invariant(self) -> bool:
        return self._form in (RIGHT_INVARIANT, RELATIVE)

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
        if self._invariant:
            M[:3, 3:] = -self.R.T @ hat(self.p)
        return gaussian.transport(self.P[:POSE, :POSE], M)

    def advance(self, step: Step) -> None:
        """Move by an increment of odometry, less what is known of its lasting errors."""
        twist = step.twist + self.lasting @ step.lasting
        R_step, p_step = se3_exp(np.ascontiguousarray(twist))
        before = self._predicted[1] if self._form == FIRST_ESTIMATES else self.p
        self.p = self.p + self.R @ p_step
        self.R = self.R @ R_step
        if not self._invariant:
            F = np.eye(POSE)
            F[:3, 3:] = -hat(self.p - before)
            gaussian_blocks.move_block(self.P, F, np.zeros((POSE, POSE)))
        self._predicted = self.R, self.p
        gaussian_blocks.carry(self.P, self.directions(step.lasting), POSE)
        self.disturb(step.noise)
        if step.drift_px > 0.0:
            self._drift(step.drift_px * math.sqrt(float(np.linalg.norm(twist[:3]))))

    def _drift(self, sigma_px: float) -> None:
        """Let what stands for each landmark in its host's image walk, 1 sigma [px]."""
        m, by_z = self.landmarks, np.empty((self.landmarks.capacity, 3, 3))
        x = m.x_first if self._form == FIRST_ESTIMATES else m.x
        slam_hosts.by_sighting(self._camera, x, m.far, m.alive, by_z)
        gaussian_blocks.add_block_noise(self.P, POSE, sigma_px * by_z)

    def disturb(self, noise: Array) -> None:
        """Add noise to the right perturbation of the pose.

        Args:
            noise: What unit noises do to it, Shape (k, 6).
        """
        gaussian_blocks.add_noise(self.P, self.directions(noise))

    def directions(self, moves: Array) -> Array:
        """Give what right perturbations of the pose, Shape (k, 6), are in the state, (k, n)."""
        B_T = np.zeros((len(moves), self.landmarks.rows))
        turn = np.ascontiguousarray(moves[:, 3:] @ self.R.T)
        B_T[:, :3], B_T[:, 3:POSE] = moves[:, :3] @ self.R.T, turn
        if self._invariant:
            B_T[:, :3] -= turn @ hat(self.p)
        if self._form == RIGHT_INVARIANT:
            m = self.landmarks
            slam_kernels.turning_noise(self._camera, m.hosts[:2], m.numbers, m.alive, turn, B_T)
        return B_T

    def innovations(self, slots: Ints, stereo_px: Array, variance: Array) -> Innovations:
        """Predict the sightings of known landmarks and compare them with what was seen."""
        n, m = len(slots), self.landmarks
        predicted, H, G = np.empty((n, 3)), np.empty((n, 3, POSE)), np.empty((n, 3, 3))
        pose = self._camera_pose(self.R, self.p)
        arm = pose[1] if self._form == RELATIVE else self.R @ self._p_body_camera
        slam_kernels.linearise(
            self._camera, pose, arm, m.hosts, m.numbers, slots, self._form, predicted, H, G
        )
        r = stereo_px - predicted
        return Innovations(slots, self._rows(slots), stereo_px, r, H, G, variance)

    def _rows(self, slots: Ints) -> tuple[Ints, Ints]:
        hosts = self.landmarks.host[slots]
        inside = self._form == RELATIVE
        return POSE + 3 * slots, POSE + 3 * hosts if inside else np.full(len(slots), -1)

    def squared_distances(self, seen: Innovations) -> Array:
        """Give the squared Mahalanobis distance of each sighting by itself, Shape (m,)."""
        out = np.empty(len(seen))
        slam_gate.gate(self.P, seen.rows, seen.r, seen.H, seen.G, seen.variance, out)
        return out

    def joint(self, seen: Innovations) -> Joint:
        """Give the covariances of stacked innovations, with the state and among themselves."""
        HP = np.empty((3 * len(seen), len(self.P)))
        S = np.empty((3 * len(seen), 3 * len(seen)))
        slam_gate.project_covariance(self.P, seen.rows, seen.H, seen.G, HP)
        slam_gate.innovation_covariance(HP, seen.rows, seen.H, seen.G, seen.variance, S)
        return Joint(HP, S)

    def correct(self, r: Array, joint: Joint) -> float:
        """Take sightings in and give their normalised innovation squared.

        Args:
            r: Seen minus predicted [px], Shape (m, 3).
            joint: As `joint` gives it of them; spoiled.
        """
        dx, nis = gaussian_blocks.update_in_place(self.P, joint.HP, joint.L, r.ravel())
        self.retract(dx)
        return nis

    def retract(self, dx: Array) -> None:
        """Move the estimate by a correction, Shape (n,)."""
        turn, shift = se3_exp(np.ascontiguousarray(dx[:POSE]))
        m = self.landmarks
        self.lasting = self.lasting + dx[POSE : POSE + LASTING]
        m.x += self._moves(dx) * m.alive[:, None]
        self.R = turn @ self.R
        if not self._invariant:
            self.p = self.p + dx[:3]
            return
        self.p = turn @ self.p + shift
        if self._form == RIGHT_INVARIANT:
            m.R_world_host = turn @ m.R_world_host
            m.p_world_host = m.p_world_host @ turn.T
        else:
            self._move_keyframes(dx)

    def _moves(self, dx: Array) -> Array:
        """Give what a correction adds to the numbers of each slot, Shape (c, 3).

        A place near by moves by ``J(phi) rho`` of the group beside the turn of its host, which is
        ``R_h' J(-phi) R_h e`` in the turned host.
        """
        e, m = dx[POSE:].reshape(-1, 3), self.landmarks
        if self._form != RIGHT_INVARIANT:
            return e
        J = left_jacobian(-dx[3:POSE])
        moved = np.einsum("cki,kl,clj,cj->ci", m.R_world_host, J, m.R_world_host, e, optimize=True)
        return np.where(m.far[:, None] > 0, e, moved)

    def _move_keyframes(self, dx: Array) -> None:
        m = self.landmarks
        for slot in m.keyframes:
            first = POSE + 3 * slot
            turn, shift = se3_exp(np.ascontiguousarray(dx[first : first + POSE]))
            m.R_world_host[slot] = turn @ m.R_world_host[slot]
            m.p_world_host[slot] = turn @ m.p_world_host[slot] + shift

    def enter(self, landmark_id: Ints, stereo_px: Array, variance: Array) -> None:
        """Let landmarks that are seen now into the map."""
        if len(landmark_id) and self._form == RELATIVE:
            self._enter_keyframe(landmark_id, stereo_px, variance)
        elif len(landmark_id):
            self._enter_world(landmark_id, stereo_px, variance)

    def _room(self, count: int) -> Ints:
        """Give free slots, and make them if there are too few."""
        m = self.landmarks
        if len(m.free_slots(count)) < count:
            m.grow(m.capacity + max(count - len(m.free_slots(count)), _GROWTH))
            self.P = gaussian_blocks.enlarged(self.P, m.rows)
        return m.free_slots(count)

    def _enter_world(self, landmark_id: Ints, stereo_px: Array, variance: Array) -> None:
        m, free = self.landmarks, self._room(len(landmark_id))
        held = self._predicted if self._form == FIRST_ESTIMATES else (self.R, self.p)
        host, arm = self._camera_pose(*held), held[0] @ self._p_body_camera
        placed = stereo_px if held[1] is self.p else self._seen_from(host, stereo_px)
        disparity = stereo_px[:, 0] - stereo_px[:, 1]
        far = disparity < self._spec.far_disparity_sigmas * np.sqrt(2.0 * variance)
        J, by_z, turns = np.empty((3, POSE)), np.empty((3, 3)), not self._invariant
        for i, slot in enumerate(free):
            m.enter(int(slot), int(landmark_id[i]), far[i], host)
            slam_kernels.numbers_of(self._camera, m.far[slot], placed[i], m.x[slot], by_z)
            slam_kernels.numbers_of(self._camera, m.far[slot], stereo_px[i], m.x_first[slot], by_z)
            slam_kernels.entry_jacobian(
                self._camera, m.far[slot], m.x_first[slot], host[0], arm, turns, J
            )
            by_z *= math.sqrt(variance[i])
            gaussian_blocks.join_block(self.P, POSE + 3 * int(slot), _POSE_ROWS, J, by_z)

    def _enter_keyframe(self, landmark_id: Ints, stereo_px: Array, variance: Array) -> None:
        m, now = self.landmarks, self._camera_pose(self.R, self.p)
        keyframe = self._keyframe(now)
        host = m.R_world_host[keyframe].copy(), m.p_world_host[keyframe].copy()
        known = np.concatenate([_POSE_ROWS, POSE + 3 * keyframe + _POSE_ROWS])
        x, J, H, G = np.empty(3), np.empty((3, 2 * POSE)), np.empty((3, POSE)), np.empty((3, 3))
        for i, slot in enumerate(self._room(len(landmark_id))):
            slam_kernels.relative_entry(self._camera, now, host, stereo_px[i], x, H, G)
            m.enter(int(slot), int(landmark_id[i]), True, keyframe)
            m.x[slot] = m.x_first[slot] = x
            J[:, :POSE], J[:, POSE:] = -H, H
            G *= math.sqrt(variance[i])
            gaussian_blocks.join_block(self.P, POSE + 3 * int(slot), known, J, G)

    def _keyframe(self, now: tuple[Array, Array]) -> int:
        """Give the latest keyframe, or make one of the camera's pose if that is too far away."""
        m = self.landmarks
        if m.keyframes and m.is_near(m.keyframes[-1], now, self._reach):
            return m.keyframes[-1]
        if m.free_pair() < 0:
            self._room(m.capacity - int((m.id != FREE).sum()) + 2)
        slot = m.free_pair()
        m.add_keyframe(slot, now)
        gaussian_blocks.clone_block(self.P, POSE + 3 * slot, POSE)
        for idle in m.idle_keyframes():
            gaussian_blocks.free_block(self.P, POSE + 3 * idle, POSE)
            m.drop_keyframe(idle)
        return slot

    def leave(self, slots: Ints) -> None:
        """Take landmarks out of the state."""
        for slot in slots:
            gaussian_blocks.free_block(self.P, POSE + 3 * int(slot), 3)
            self.landmarks.leave(int(slot))

    def decouple(self, keep_pose: bool) -> None:
        """Drop the correlations between landmarks, and those with the pose unless they are kept.

        What odometry's lasting errors have in common with the pose always stays, and goes with the
        pose in what they have in common with landmarks.
        """
        gaussian_blocks.drop_correlations(self.P, VEHICLE, keep_pose)

    def in_hosts(self) -> tuple[Array, Array]:
        """Give disparity [px] and summed variance [px^2] of landmarks in their hosts, (c,)."""
        m = self.landmarks
        out = np.empty((2, m.capacity))
        slam_hosts.in_hosts(self._camera, m.numbers, m.alive, self.P, out)
        return out[0], out[1]

    def _camera_pose(self, R: Array, p: Array) -> tuple[Array, Array]:
        return np.ascontiguousarray(R @ self._R_body_camera), p + R @ self._p_body_camera

    def _seen_from(self, host: tuple[Array, Array], stereo_px: Array) -> Array:
        """Give where a host camera would see what the camera sees now."""
        T_camera_host = SE3(*self._camera_pose(self.R, self.p)).inverse() @ SE3(*host)
        return transfer(self._calibration, T_camera_host, stereo_px)
