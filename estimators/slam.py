"""EKF-SLAM with a stereo camera: one filter, the paper's algorithms as values of its spec.

For each image pair: odometry moves the pose; landmarks in the map that are seen again correct pose
and map together; who is new enters and who has served leaves, as the policy says. While an
observable filter stands at the start every landmark stays, and those seen best become anchors.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimators import slam_gate, slam_slips
from estimators.frame_to_frame import declared_sightings
from estimators.gaussian import chi_square_threshold
from estimators.odometry_steps import image_odometry
from estimators.retention import build_policy, choose_anchors, expired_anchors
from estimators.slam_iterate import relinearised
from estimators.slam_map import LASTING, POSE, LandmarkMap
from estimators.slam_spec import AnchorSpec, BoundedQueue, SlamSpec
from estimators.slam_state import SlamState
from estimators.slam_values import Innovations, Joint, Step
from estimators.thinning import spread_over_image
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements, OdometryStream
from lpet_sim.recording.trajectory import Trajectory

Bools = NDArray[np.bool_]
LOGGED = (
    "sightings",
    "accepted",
    "rejected",
    "matched",
    "new",
    "dropped",
    "landmarks",
    "anchors_seen",
    "nis",
    "nis_dof",
    "slipped",
    "bridged",
)
"""The diagnostics, one value for each image.

``sightings`` were looked at; ``matched`` ones are of landmarks in the map, ``accepted`` and
``rejected`` ones of them passed or failed the checks; ``new`` and ``dropped`` landmarks entered and
left; ``landmarks`` is the size of the state; ``nis`` the normalised innovation squared of
``nis_dof`` numbers; ``slipped`` is 1 where odometry was not believed, ``bridged`` where too few
sightings were accepted.
"""


@dataclass(frozen=True)
class Slam:
    """The filter.

    Attributes:
        spec: The variant.
        name: The name under which results are reported.
        needs: The streams without which it cannot run.

    Reference:
        Bakambu, Langley, Mukherji, sections 3.4 and 4; the right-invariant form after Barrau and
        Bonnabel (2015), An EKF-SLAM algorithm with consistency properties [recalled].
    """

    spec: SlamSpec = field(default_factory=SlamSpec)
    name: str = "slam"
    needs: ClassVar[tuple[str, ...]] = ("sightings",)

    def estimate(self, measurements: Measurements) -> Estimate:
        """Run the filter over the images; see `Estimator`.

        Without odometry a step is held to be like the one before it.

        Raises:
            BrokenFilterError: The covariance is no longer positive definite.
        """
        sightings, calibration = declared_sightings(measurements)
        known = measurements.odometry is not None or measurements.wheels is not None
        odometry = image_odometry(measurements, sightings.t_ns) if known else None
        start = measurements.calibration.T_world_body_start.se3()
        imu = measurements.calibration.imu
        rate_sigma_radps = 0.0 if imu is None else imu.gyro_bias_radps
        run = SlamRun(self.spec, start, calibration, rate_sigma_radps)
        poses, covariance = list[SE3](), list[Array]()
        for k in range(len(sightings)):
            step = _step(odometry, k, poses, self.spec)
            run.advance(replace(step, drift_px=float(sightings.drift_px[k])))
            rows = sightings.rows(k)
            stereo_px, sigma_px = sightings.stereo_px[rows], sightings.sigma_px[rows]
            run.see(sightings.landmark_id[rows], stereo_px, sigma_px)
            poses.append(run.state.pose)
            covariance.append(run.state.pose_covariance())
        trajectory = Trajectory(sightings.t_ns.copy(), SE3.stack(poses))
        return Estimate(self.name, trajectory, np.array(covariance), run.diagnostics())


class SlamRun:
    """The filter on its way.

    Attributes:
        state: Pose, map and covariance.
    """

    def __init__(
        self,
        spec: SlamSpec,
        start: SE3,
        calibration: StereoCalibration,
        rate_sigma_radps: float = 0.0,
    ) -> None:
        self._spec = spec
        self._size_px = calibration.width_px, calibration.height_px
        self.state = SlamState(start, calibration, spec, rate_sigma_radps)
        self._policy = build_policy(spec.retention)
        self._threshold = chi_square_threshold(3, spec.gate_probability)
        self._slip_threshold = chi_square_threshold(POSE, 1.0 - spec.slip_probability)
        self._standing = spec.anchors is not None
        self._rested = self._moved = 0
        self._unfixed, self._held = np.zeros(6), False
        self._log: dict[str, list[float]] = {name: [] for name in LOGGED}

    def advance(self, step: Step) -> None:
        """Move by odometry; when an observable filter sets off it chooses its anchors."""
        scale = self._spec.noise_scale
        step = replace(step, noise=scale * step.noise, drift_px=scale * step.drift_px)
        self.state.advance(step)
        self._unfixed, self._held = self._unfixed + np.abs(step.twist), step.held
        if self._standing and self._spec.anchors is not None:
            self._watch_standstill(step.twist, self._spec.anchors)

    def _watch_standstill(self, twist: Array, anchors: AnchorSpec) -> None:
        """Choose the anchors when the rover sets off after it has stood for long enough."""
        size = np.linalg.norm(twist.reshape(2, 3), axis=1)
        if size[0] <= anchors.standstill_m and size[1] <= anchors.standstill_rad:
            self._rested += 1
        elif self._rested >= anchors.looks_min:
            self._standing = False
            chosen = choose_anchors(self.landmarks, self.state.in_hosts()[0], anchors)
            self.landmarks.pinned[chosen] = True
        else:
            self._rested, self._moved = 0, self._moved + 1
            self._standing = self._moved <= anchors.settling_images

    def see(self, landmark_id: Ints, stereo_px: Array, sigma_px: Array) -> None:
        """Take in the sightings of one image pair."""
        known = self.landmarks.slots(landmark_id) >= 0
        rows = spread_over_image(stereo_px, known, self._size_px, self._spec.sightings_max)
        landmark_id, stereo_px, known = landmark_id[rows], stereo_px[rows], known[rows]
        slots = self.landmarks.slots(landmark_id)
        variance = (self._spec.noise_scale * sigma_px[rows]) ** 2
        seen = self.state.innovations(slots[known], stereo_px[known], variance[known])
        slipped, seen, fits, joint = self._gated(seen)
        accepted, nis = self._taken_in(seen, fits, joint)
        count = int(accepted.sum())
        # Where most do not fit it is the pose that is wrong, not the landmarks.
        blamed = seen.slots[~accepted] if 2 * count > len(seen) else seen.slots[:0]
        self.landmarks.count_image(seen.slots[accepted], blamed)
        if count >= self._spec.sightings_min:
            self._unfixed = np.zeros(6)
        new, dropped = self._renew(landmark_id[~known], stereo_px[~known], variance[~known])
        self._note(
            sightings=len(slots),
            accepted=count,
            rejected=len(seen) - count,
            matched=len(seen),
            new=new,
            dropped=dropped,
            landmarks=len(self.landmarks),
            anchors_seen=int(self.landmarks.pinned[seen.slots[accepted]].sum()),
            nis=nis,
            nis_dof=3 * count,
            slipped=slipped,
            bridged=float(bool(self._log["sightings"]) and count < self._spec.sightings_min),
        )

    @property
    def landmarks(self) -> LandmarkMap:
        """The map."""
        return self.state.landmarks

    def diagnostics(self) -> dict[str, Array]:
        """Give what was logged of each image."""
        return {name: np.array(values) for name, values in self._log.items()}

    def _gated(self, seen: Innovations) -> tuple[bool, Innovations, Bools, Joint]:
        """Tell whether odometry slipped, and which sightings fit by themselves."""
        fits, joint = self._fits(seen), self.state.joint(seen)
        asked = self._spec.slip_probability > 0.0 and len(seen) >= self._spec.sightings_min
        # A step that was only held is no odometry to be contradicted, but may be far off.
        if not asked or (self._held and 2 * fits.sum() >= len(seen)):
            return False, seen, fits, joint
        moves, sizes, agree = slam_slips.moves(self.state, seen), self._slip_sizes(), fits
        if not fits.all():
            agree = slam_slips.agreeing(seen, moves, joint.S, sizes, self._threshold)
        square = slam_slips.contradiction(seen, moves, joint, agree)
        if square <= self._slip_threshold or agree.sum() < self._spec.sightings_min:
            return False, seen, fits, joint
        self.state.disturb(np.diag(sizes))
        seen = relinearised(self.state, seen, seen.take(agree), self._spec.slip_rounds)
        return True, seen, self._fits(seen), self.state.joint(seen)

    def _fits(self, seen: Innovations) -> Bools:
        return np.asarray(self.state.squared_distances(seen) <= self._threshold)

    def _taken_in(self, seen: Innovations, fits: Bools, joint: Joint) -> tuple[Bools, float]:
        """Correct the state by the sightings that fit together; gives which, and their NIS."""
        accepted = fits
        if self._spec.association_check != "none" and fits.any():
            together = np.empty(int(fits.sum()))
            slam_gate.consensus(joint.take(fits).S, seen.r[fits], self._threshold, together)
            accepted = fits.copy()
            accepted[fits] = together > 0
        if not accepted.any():
            return accepted, 0.0
        nis = self.state.correct(seen.r[accepted], joint.take(accepted))
        if self._spec.coupling != "coupled":
            self.state.decouple(self._spec.coupling == "decoupled_pose_kept")
        return accepted, nis

    def _slip_sizes(self) -> Array:
        """Give the error of the steps since the last fix, believed to within their length only."""
        spec, sizes = self._spec, np.linalg.norm(self._unfixed.reshape(2, 3), axis=1)
        least = spec.slip_sigma_m, spec.slip_sigma_rad
        return np.asarray(np.repeat(np.maximum(sizes, least), 3))

    def _renew(self, landmark_id: Ints, stereo_px: Array, variance: Array) -> tuple[int, int]:
        """Let landmarks leave and enter; gives how many entered and left."""
        misfit = np.flatnonzero(self.landmarks.misfits >= self._spec.misfits_max)
        self.state.leave(misfit)
        admitted = self._policy.admit(landmark_id)
        if self._standing:
            self.state.enter(landmark_id, stereo_px, variance)
            return len(landmark_id), len(misfit)
        entering = np.flatnonzero(admitted)
        if isinstance(self._spec.retention, BoundedQueue):
            entering = entering[: self._spec.retention.size]
        gone = self._leaving(len(entering))
        self.state.leave(gone)
        self.state.enter(landmark_id[entering], stereo_px[entering], variance[entering])
        return len(entering), len(gone) + len(misfit)

    def _leaving(self, entering: int) -> Ints:
        retention, variance = self._spec.retention, None
        if isinstance(retention, BoundedQueue) and retention.leave == "least_confidence":
            variance = self.state.in_hosts()[1]
        gone = self._policy.leaving(self.landmarks, entering, variance)
        if self._spec.anchors is None:
            return gone
        return np.concatenate([expired_anchors(self.landmarks, self._spec.anchors), gone])

    def _note(self, **values: float) -> None:
        for name, value in values.items():
            self._log[name].append(float(value))


def odometry_step(odometry: OdometryStream, k: int) -> Step:
    """Give the motion to an image by odometry and what is unsure of it."""
    lasting, twist = np.zeros((LASTING, 6)), odometry.twist[k]
    seconds = (odometry.t_ns[k] - (odometry.t_ns[k - 1] if k else 0)) / NS_PER_S
    lasting[:3, 3:] = seconds * np.eye(3)
    lasting[3] = odometry.scale_sigma[k] * twist
    return Step(twist, np.diag(np.sqrt(odometry.variance[k])), lasting)


def _step(odometry: OdometryStream | None, k: int, poses: list[SE3], spec: SlamSpec) -> Step:
    """Give the motion to an image, held to be the last one where there is no odometry."""
    if odometry is not None:
        return odometry_step(odometry, k)
    lasting = np.zeros((LASTING, 6))
    if k == 0:
        return Step(np.zeros(6), np.zeros((0, 6)), lasting)
    held = (poses[-2].inverse() @ poses[-1]).log() if k > 1 else np.zeros(6)
    noise = np.diag(np.repeat([spec.free_sigma_m, spec.free_sigma_rad], 3))
    return Step(held, noise, lasting, held=True)
