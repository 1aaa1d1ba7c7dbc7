"""What the peers are given: sightings, and motion from image to image by the best odometry."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimators import gaussian
from estimators.frame_to_frame import declared_sightings
from estimators.fused_odometry import odometry_track
from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import Measurements, OdometryStream, SightingStream

_FLOOR = np.full(6, 1e-12)
"""Variance added to every motion [m^2, rad^2]: a rover that stands has none, a graph needs some."""


@dataclass(frozen=True)
class PeerInputs:
    """What a factor graph is made of.

    Attributes:
        sightings: Landmark sightings of n images.
        stereo: The declared camera pair.
        T_world_body_start: The pose at the first image.
        T_prev_curr: Motion from image to image by odometry, Shape (n - 1,).
        cov_motion: Covariances of their right perturbations, Shape (n - 1, 6, 6).
    """

    sightings: SightingStream
    stereo: StereoCalibration
    T_world_body_start: SE3
    T_prev_curr: SE3
    cov_motion: Array

    def well_seen(self, sigmas: float) -> NDArray[np.bool_]:
        """Tell which sightings have a disparity of at least so many sigmas, Shape (m,)."""
        s = self.sightings
        disparity = s.stereo_px[:, 0] - s.stereo_px[:, 1]
        return np.asarray(disparity > sigmas * np.sqrt(2.0) * s.sigma_px)

    def points_in_body(self, rows: slice | Ints) -> Array:
        """Give the points of sightings with positive disparity in the body [m], Shape (n, 3)."""
        p_camera = self.stereo.triangulate(self.sightings.stereo_px[rows])
        return self.stereo.T_body_camera.se3() @ p_camera


def peer_inputs(measurements: Measurements) -> PeerInputs:
    """Gather what a factor graph is made of.

    Raises:
        RecordingError: There are no sightings, or no odometry of any kind.
    """
    sightings, stereo = declared_sightings(measurements)
    start = measurements.calibration.T_world_body_start.se3()
    steps, covariance = motions(measurements, sightings.t_ns)
    return PeerInputs(sightings, stereo, start, steps, covariance)


def motions(measurements: Measurements, t_ns: Ints) -> tuple[SE3, Array]:
    """Give the motion between the images by the odometry stream, or else by gyro and wheels.

    The scale error, which all motions share, stands in each one's covariance as if it were its own:
    a factor between two poses cannot say more.

    Args:
        measurements: With ``odometry`` or ``wheels``.
        t_ns: Times of the images [ns], Shape (n,).

    Returns:
        ``T_prev_curr``, Shape (n - 1,), and covariances of the right perturbation, (n - 1, 6, 6).
    """
    if measurements.odometry is not None:
        pairs = _from_stream(measurements.odometry, t_ns)
    elif measurements.wheels is not None:
        track = odometry_track(measurements)
        within = np.clip(t_ns, *track.trajectory.t_ns[[0, -1]])
        pairs = [track.between(int(a), int(b)) for a, b in pairwise(within)]
    else:
        raise RecordingError(
            "a factor graph needs motion between its poses: a recording with 'odometry' or 'wheels'"
        )
    covariance = [gaussian.with_noise(np.asarray(cov), _FLOOR) for _, cov in pairs]
    return SE3.stack(step for step, _ in pairs), np.array(covariance).reshape(-1, 6, 6)


def _from_stream(odometry: OdometryStream, t_ns: Ints) -> list[tuple[SE3, Array]]:
    """Chain the odometry's steps from image to image.

    Raises:
        RecordingError: An image lies between two times of the odometry.
    """
    at = np.searchsorted(odometry.t_ns, t_ns)
    if not np.array_equal(odometry.t_ns[np.minimum(at, len(odometry) - 1)], t_ns):
        raise RecordingError("every image must lie at a time of the odometry stream")
    return [_chained(odometry, slice(a + 1, b + 1)) for a, b in pairwise(at)]


def _chained(odometry: OdometryStream, rows: slice) -> tuple[SE3, Array]:
    pose, covariance = SE3.identity(), np.zeros((6, 6))
    for twist, variance in zip(odometry.twist[rows], odometry.variance[rows], strict=True):
        step = SE3.exp(twist)
        F = step.inverse().adjoint()
        covariance = gaussian.propagate(covariance, F, np.diag(variance))
        pose = pose @ step
    along = odometry.scale_sigma[0] * pose.log()
    return pose, covariance + np.outer(along, along)
