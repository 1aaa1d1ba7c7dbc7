"""The Cramer-Rao bound of the body's pose: how well any unbiased estimator can do on its sightings.

The Fisher information of all poses, all landmarks and the scale of the odometry is taken at the
truth. Poses and landmarks are eliminated in order of time: the state is the newest pose, the
odometry's scale and the landmarks that have been seen and will be seen again. This is exact, and
what is left at an image is the information of all that was measured up to it.

Reference:
    Van Trees, Detection, Estimation, and Modulation Theory I (1968), sec. 2.4 [recalled];
    Tichavsky, Muravchik, Nehorai (1998), eq. 21, for the recursion over time [recalled].
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cho_factor, cho_solve

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.odometry_model import OdometryStep, lasting_errors, odometry_steps
from lpet_sim.evaluation.sighting_model import (
    OUTLIER_CHI2,
    Landmarks,
    Rows,
    in_view,
    known_landmarks,
    place_landmarks,
    seen_at,
    triangulate,
)
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import OdometryStream, SightingStream

START_VARIANCE = 1e-12
"""Variance of the start pose, which is given: a micrometre and a microradian."""

_POSE = 6


@dataclass(frozen=True, eq=False)
class PoseBound:
    """The least covariance of a pose.

    Attributes:
        covariance: Of the right perturbation ``T_true = T_est @ exp(xi)``, ``xi = (translation,
            rotation)`` [m, rad], Shape (6, 6).
    """

    covariance: Array

    @property
    def position_rms_m(self) -> float:
        """Root of the mean squared length of the position error [m]."""
        return math.sqrt(float(np.trace(self.covariance[:3, :3])))

    @property
    def attitude_rms_rad(self) -> float:
        """Root of the mean squared angle of the attitude error [rad]."""
        return math.sqrt(float(np.trace(self.covariance[3:, 3:])))


def end_bound(
    truth_poses: SE3,
    sightings: SightingStream,
    calibration: StereoCalibration,
    odometry: OdometryStream | None = None,
    p_world_of: Mapping[int, ArrayLike] | None = None,
    rate_sigma_radps: float = 0.0,
) -> PoseBound:
    """Give the bound of the body's pose at the last image; see `pose_bounds`."""
    last, told = len(sightings) - 1, (sightings, calibration, odometry, p_world_of)
    return pose_bounds(truth_poses, *told, [last], rate_sigma_radps)[0]


def pose_bounds(
    truth_poses: SE3,
    sightings: SightingStream,
    calibration: StereoCalibration,
    odometry: OdometryStream | None = None,
    p_world_of: Mapping[int, ArrayLike] | None = None,
    at: Sequence[int] | Ints | None = None,
    rate_sigma_radps: float = 0.0,
) -> list[PoseBound]:
    """Give the bounds of the body's pose at some images, each from what is measured up to it.

    The first pose is known. Landmarks that are seen but once tell nothing and are left out, and so
    are outliers: sightings that do not fit their landmark as it truly is.

    Args:
        truth_poses: True ``T_world_body`` at the images, Shape (n,).
        sightings: What was sighted, with its declared noise.
        calibration: The camera pair.
        odometry: Motion increments at the times of the images; None: there is none, and a step can
            lead anywhere.
        p_world_of: True places of the landmarks by their names [m], each Shape (3,); None: they are
            triangulated at the true poses.
        at: The images, in increasing order; None: all but the first.
        rate_sigma_radps: Declared constant error of the odometry's rate of turn about each axis,
            1 sigma: the bias of the gyro that it was made with.

    Returns:
        A bound for each of the images.

    Raises:
        RecordingError: Poses, sightings and odometry are not at the same times, or the sightings
            declare tracks that slide, of which this bound knows nothing.
    """
    _check(truth_poses, sightings, odometry)
    wanted = np.arange(1, len(sightings)) if at is None else np.asarray(at, dtype=np.int64)
    T_world_camera = truth_poses @ calibration.T_body_camera.se3()
    rows, landmarks = _sound_rows(sightings, T_world_camera, calibration, p_world_of)
    _, by_landmark, by_camera = in_view(rows, T_world_camera, landmarks, calibration)
    by_body = by_camera @ calibration.T_body_camera.se3().inverse().adjoint()
    sigma = rows.sigma_px[:, None, None]
    lasting = lasting_errors(truth_poses, odometry, rate_sigma_radps)
    known = _Information(rows, by_landmark / sigma, by_body / sigma, lasting.shape[2])
    bounds = {}
    for image, state in enumerate(known.over_time(odometry_steps(truth_poses, odometry, lasting))):
        if image in wanted:
            bounds[image] = PoseBound(state.pose_covariance())
        if image == wanted[-1]:
            break
    return [bounds[int(image)] for image in wanted]


def _check(truth_poses: SE3, sightings: SightingStream, odometry: OdometryStream | None) -> None:
    if len(truth_poses) != len(sightings):
        raise RecordingError(
            f"{len(truth_poses)} true poses and {len(sightings)} images: give the pose of each"
        )
    if np.any(sightings.drift_px > 0):
        raise RecordingError(
            "there is no bound for tracks that slide: the sightings must declare a drift_px of 0"
        )
    if odometry is not None and not np.array_equal(odometry.t_ns, sightings.t_ns):
        raise RecordingError("a bound needs odometry at the times of the images")


def _sound_rows(
    sightings: SightingStream,
    T_world_camera: SE3,
    calibration: StereoCalibration,
    p_world_of: Mapping[int, ArrayLike] | None,
) -> tuple[Rows, Landmarks]:
    """Give the sightings that fit their landmarks at the truth, and these landmarks."""
    rows = Rows.of(sightings)
    landmarks, chi2 = _landmarks(rows, T_world_camera, calibration, p_world_of)
    if np.all(chi2 < OUTLIER_CHI2):
        return rows, landmarks
    rows = rows.kept(chi2 < OUTLIER_CHI2)
    return rows, _landmarks(rows, T_world_camera, calibration, p_world_of)[0]


def _landmarks(
    rows: Rows,
    T_world_camera: SE3,
    calibration: StereoCalibration,
    p_world_of: Mapping[int, ArrayLike] | None,
) -> tuple[Landmarks, Array]:
    if p_world_of is None:
        return triangulate(rows, T_world_camera, calibration)
    known = known_landmarks(rows, p_world_of)
    landmarks = place_landmarks(rows, T_world_camera, calibration, known)
    point, _, _ = in_view(rows, T_world_camera, landmarks, calibration)
    residual = (rows.stereo_px - seen_at(calibration, point)) / rows.sigma_px[:, None]
    return landmarks, (residual**2).sum(axis=1)


class _Information:
    """The information of the newest pose, odometry's lasting errors and landmarks still in use.

    The matrix is kept dense with room for landmarks to come; a landmark has a slot of three rows
    from its first sighting to its last.
    """

    def __init__(self, rows: Rows, G: Array, J: Array, lasting: int) -> None:
        """Start with the known pose and no landmark.

        Args:
            rows: Sightings in order of the images, m.
            G: Their derivatives by the landmark over their noise, Shape (m, 3, 3).
            J: Their derivatives by the pose of the body over their noise, Shape (m, 3, 6).
            lasting: Number of the odometry's lasting errors.
        """
        self._rows, self._G, self._J = rows, G, J
        self._head = _POSE + lasting
        self._matrix = np.diag(np.repeat([1.0 / START_VARIANCE, 1.0], [_POSE, lasting]))
        self._slot = np.full(len(rows.landmark_id), -1)
        last = np.zeros(len(rows.landmark_id), dtype=np.int64)
        np.maximum.at(last, rows.landmark, rows.image)
        self._last = last
        self._held = np.zeros(0, dtype=np.int64)

    def over_time(self, steps: Iterator[OdometryStep]) -> Iterator[_Information]:
        """Yield itself after each image's sightings."""
        self._sight(0)
        yield self
        for image, step in enumerate(steps, start=1):
            self._move(step)
            self._sight(image)
            yield self
            self._let_go(image)

    def pose_covariance(self) -> Array:
        """Invert the information and give the block of the pose, Shape (6, 6)."""
        factor = cho_factor(self._matrix, lower=True)
        block = cho_solve(factor, np.eye(len(self._matrix), _POSE))[:_POSE]
        return np.asarray(0.5 * (block + block.T))

    def _move(self, step: OdometryStep) -> None:
        """Replace the pose by the next one.

        With the transition A and noise Q of the pose alone: ``M = A^-T Y A^-1``, ``D = I + Q
        M_pp``; ``Y_pp = M_pp D^-1``, ``Y_rp = M_rp D^-1``, ``Y_rr = M_rr - M_rp D^-1 Q M_pr``,
        which holds for no noise as well as for much.
        """
        Y, p, h = self._matrix, _POSE, self._head
        Y[:, :h] = Y[:, :h] @ step.back
        Y[:h, :] = step.back.T @ Y[:h, :]
        column = Y[:, :p].copy()
        noisy = step.variance[:, None] * column[:p]
        shrunk = np.linalg.solve((np.eye(p) + noisy).T, column.T).T
        Y[p:, p:] -= (shrunk[p:] * step.variance) @ column[p:].T
        Y[:, :p] = shrunk
        Y[:p, :] = shrunk.T
        Y[:p, :p] = 0.5 * (shrunk[:p] + shrunk[:p].T)

    def _sight(self, image: int) -> None:
        """Add the information of an image's sightings."""
        ends = np.searchsorted(self._rows.image, [image, image + 1])
        seen = slice(int(ends[0]), int(ends[1]))
        landmark, G, J = self._rows.landmark[seen], self._G[seen], self._J[seen]
        self._make_room(landmark)
        Y, p = self._matrix, _POSE
        at = self._slot[landmark][:, None] + np.arange(3)
        Y[:p, :p] += np.einsum("nij,nik->jk", J, J)
        cross = np.einsum("nij,nik->njk", G, J)
        Y[at, :p] += cross
        Y[:p, at] += np.moveaxis(cross, 2, 0)
        Y[at[:, :, None], at[:, None, :]] += np.einsum("nij,nik->njk", G, G)

    def _make_room(self, landmark: Ints) -> None:
        fresh = landmark[self._slot[landmark] < 0]
        before, self._held = len(self._matrix), np.concatenate([self._held, fresh])
        self._slot[fresh] = before + 3 * np.arange(len(fresh))
        grown = np.zeros((before + 3 * len(fresh),) * 2)
        grown[:before, :before] = self._matrix
        self._matrix = grown

    def _let_go(self, image: int) -> None:
        """Eliminate the landmarks that will not be seen again: ``Y_kk - Y_kd Y_dd^-1 Y_dk``."""
        leaves = self._last[self._held] <= image
        if not leaves.any():
            return
        going = np.concatenate([np.zeros(self._head, dtype=bool), np.repeat(leaves, 3)])
        gone, kept = np.flatnonzero(going), np.flatnonzero(~going)
        Y = self._matrix
        cross = Y[np.ix_(gone, kept)]
        factor = cho_factor(Y[np.ix_(gone, gone)], lower=True)
        self._matrix = Y[np.ix_(kept, kept)] - cross.T @ cho_solve(factor, cross)
        self._held = self._held[~leaves]
        self._slot[self._held] = self._head + 3 * np.arange(len(self._held))
