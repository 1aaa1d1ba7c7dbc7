"""Frame-to-frame visual motion estimation: each image pair against the one before it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from pydantic import Field

from estimators import gaussian
from estimators.fused_odometry import odometry_track
from estimators.motion import OdometryTrack
from estimators.odometry_steps import motion_between
from estimators.view_pair import CameraStep, TwoViewSpec, ViewPair, estimate_step
from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements, SightingStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream
from lpet_sim.spec import Spec

_START_VARIANCE = 1e-12


class FrameToFrameSpec(Spec):
    """Parameters of frame-to-frame visual motion estimation.

    Attributes:
        two_view: How the motion between two images is estimated.
        hold_sigma: Where vision fails and there is no odometry the last motion is held; its
            relative error, 1 sigma (this project's choice).
        hold_sigma_m: Least such error of the position [m].
        hold_sigma_rad: Least such error of the attitude [rad].
    """

    two_view: TwoViewSpec = TwoViewSpec()
    hold_sigma: float = Field(default=1.0, ge=0)
    hold_sigma_m: float = Field(default=0.01, gt=0)
    hold_sigma_rad: float = Field(default=0.01, gt=0)


@dataclass(frozen=True)
class BodyStep:
    """The motion of the body between two images, seen or bridged.

    Attributes:
        T_prev_curr: Pose of the body at the later image in that at the earlier one.
        covariance: Of its right perturbation, Shape (6, 6).
        seen: What vision says, None where the step is bridged.
    """

    T_prev_curr: SE3
    covariance: Array
    seen: CameraStep | None


@dataclass(frozen=True)
class FrameToFrame:
    """Visual motion estimation without memory: the baseline of every filter that remembers.

    Attributes:
        spec: Parameters.
        ransac_seed: Seed of the samples that RANSAC draws.
        name: The name under which results are reported.
        needs: The streams without which it cannot run.
    """

    spec: FrameToFrameSpec = field(default_factory=FrameToFrameSpec)
    ransac_seed: int = 0
    name: str = "frame_to_frame"
    needs: ClassVar[tuple[str, ...]] = ("sightings",)

    def estimate(self, measurements: Measurements) -> Estimate:
        """Chain the motions between images; see `Estimator`.

        Where too few landmarks agree on a motion the step is bridged with odometry, or the last
        motion is held where there is none; ``bridged`` among the diagnostics says so.
        """
        sightings, calibration = declared_sightings(measurements)
        moved = measurements.odometry is not None or measurements.wheels is not None
        odometry = odometry_track(measurements) if moved else None
        steps = self._steps(sightings, calibration, odometry)
        poses, covariance = chain(
            *_start_pose(measurements, odometry, int(sightings.t_ns[0])), steps
        )
        return Estimate(
            self.name,
            Trajectory(sightings.t_ns.copy(), poses),
            covariance,
            diagnostics(steps, sightings),
        )

    def _steps(
        self,
        sightings: SightingStream,
        calibration: StereoCalibration,
        odometry: OdometryTrack | None,
    ) -> list[BodyStep]:
        T_body_camera = calibration.T_body_camera.se3()
        rng = stream(self.ransac_seed, "frame_to_frame", "ransac")
        steps: list[BodyStep] = []
        T_start = SE3.identity()
        for k in range(len(sightings) - 1):
            pair = ViewPair.of(sightings, k, k + 1)
            seen = estimate_step(pair, calibration, self.spec.two_view, rng, T_start)
            if seen is None:
                t_ns = int(sightings.t_ns[k]), int(sightings.t_ns[k + 1])
                last = steps[-1].T_prev_curr if steps else SE3.identity()
                steps.append(self._bridge(odometry, t_ns, last))
            else:
                steps.append(_in_body(seen, T_body_camera))
            T_start = T_body_camera.inverse() @ steps[-1].T_prev_curr @ T_body_camera
        return steps

    def _bridge(self, odometry: OdometryTrack | None, t_ns: tuple[int, int], last: SE3) -> BodyStep:
        """Step by the best odometry there is, or hold the last motion."""
        if odometry is not None:
            return BodyStep(*motion_between(odometry, *t_ns), None)
        size = self.spec.hold_sigma * last.log()
        sigma_m = max(float(np.linalg.norm(size[:3])), self.spec.hold_sigma_m)
        sigma_rad = max(float(np.linalg.norm(size[3:])), self.spec.hold_sigma_rad)
        return BodyStep(last, np.diag(np.repeat([sigma_m**2, sigma_rad**2], 3)), None)


def declared_sightings(measurements: Measurements) -> tuple[SightingStream, StereoCalibration]:
    """Give the sightings and the declared camera pair.

    Raises:
        RecordingError: One of them is absent, or there is no image.
    """
    measurements.require("sightings")
    sightings, calibration = measurements.sightings, measurements.calibration.stereo
    if sightings is None or calibration is None:
        raise RecordingError("the recording declares no cameras: its calibration must hold stereo")
    if len(sightings) == 0:
        raise RecordingError("the recording has no images: visual motion needs at least 1")
    return sightings, calibration


def chain(start: SE3, unsure: Array, steps: list[BodyStep]) -> tuple[SE3, Array]:
    """Chain steps onto the start, with the covariance of every pose.

    ``xi_k+1 = Ad(T_prev_curr^-1) xi_k + d_k``. Neighbouring steps share an image, and its noise
    enters the first as ``B e`` and the second as ``A e``, nearly ``-B e`` where the rover moves
    little: what one step gains the next loses. The cross-covariance ``Ad B cov(e) A'`` counts this.

    Args:
        start: Pose of the body at the first image.
        unsure: Covariance of its right perturbation, Shape (6, 6).
        steps: Motion between the images, n.

    Returns:
        Poses, Shape (n + 1,), and covariances of their right perturbations, Shape (n + 1, 6, 6).
    """
    poses, covariance = [start], [unsure]
    before: CameraStep | None = None
    for step in steps:
        F = step.T_prev_curr.inverse().adjoint()
        cross = F @ shared_noise(before, step.seen)
        added = step.covariance + cross + cross.T
        covariance.append(gaussian.propagate(covariance[-1], F, added))
        poses.append(poses[-1] @ step.T_prev_curr)
        before = step.seen
    return SE3.stack(poses), np.array(covariance)


def shared_noise(before: CameraStep | None, after: CameraStep | None) -> Array:
    """Give ``B cov(e) A'``, the covariance of neighbouring steps by their shared image, (6, 6)."""
    if before is None or after is None:
        return np.zeros((6, 6))
    _, i, j = np.intersect1d(
        before.landmark_id, after.landmark_id, assume_unique=True, return_indices=True
    )
    variance = after.var_prev[j, None, None]
    return np.asarray(np.einsum("nij,nkj->ik", variance * before.by_curr[i], after.by_prev[j]))


def diagnostics(steps: list[BodyStep], sightings: SightingStream) -> dict[str, Array]:
    """Tell of each image how its motion was found.

    Besides sightings, inliers, reduced_chi2 and bridged this is ``step_sigma_m``: the error of the
    step's translation along its worst direction, 1 sigma [m].
    """
    seen = [step.seen for step in steps]
    return {
        "sightings": np.diff(sightings.offsets).astype(float),
        "inliers": np.array([0.0] + [float(s.inliers) if s else 0.0 for s in seen]),
        "reduced_chi2": np.array([0.0] + [s.reduced_chi2 if s else 0.0 for s in seen]),
        "bridged": np.array([0.0] + [float(s is None) for s in seen]),
        "step_sigma_m": np.array([0.0] + [_translation_sigma(step) for step in steps]),
    }


def _translation_sigma(step: BodyStep) -> float:
    return float(np.sqrt(np.linalg.eigvalsh(step.covariance[:3, :3])[-1]))


def _in_body(seen: CameraStep, T_body_camera: SE3) -> BodyStep:
    """Carry the camera's motion and its error to the body: ``xi_body = Ad(T_body_camera) xi``."""
    moved = seen.in_frame(T_body_camera)
    return BodyStep(moved.T_prev_curr, moved.covariance(), moved)


def _start_pose(
    measurements: Measurements, odometry: OdometryTrack | None, t_ns: int
) -> tuple[SE3, Array]:
    """Give the pose at the first image by the known start and odometry, and its covariance."""
    start = measurements.calibration.T_world_body_start.se3()
    given = np.full(6, _START_VARIANCE)
    if odometry is None:
        return start, gaussian.independent(given)
    T_start_first, covariance = motion_between(odometry, int(odometry.trajectory.t_ns[0]), t_ns)
    return start @ T_start_first, gaussian.with_noise(covariance, given)
