"""What the peers are given: sightings, and motion from image to image by the best odometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimators import gaussian
from estimators.frame_to_frame import declared_sightings
from estimators.odometry_steps import image_odometry
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
        odometry: Increments at the images' times.
        T_world_body_start: The pose at the first image.
    """

    sightings: SightingStream
    stereo: StereoCalibration
    odometry: OdometryStream
    T_world_body_start: SE3

    @property
    def first_sigma(self) -> Array:
        """Error of the pose at the first image by the odometry until then, 1 sigma, Shape (6,)."""
        along = self.odometry.scale_sigma[0] * self.odometry.twist[0]
        return np.asarray(np.sqrt(self.odometry.variance[0] + along**2))

    def motion(self, image: int) -> tuple[SE3, Array]:
        """Give the motion to an image from the one before it.

        The scale error, which all motions share, stands in each one's covariance as if it were its
        own: a factor between two poses cannot say more.

        Returns:
            ``T_prev_curr``, and the covariance of its right perturbation, Shape (6, 6).
        """
        twist = self.odometry.twist[image]
        along = self.odometry.scale_sigma[image] * twist
        covariance = gaussian.independent(self.odometry.variance[image] + _FLOOR)
        return SE3.exp(twist), covariance + np.outer(along, along)

    def well_seen(self, sigmas: float) -> NDArray[np.bool_]:
        """Tell which sightings have a disparity of more than so many sigmas, Shape (m,)."""
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
    if measurements.odometry is None and measurements.wheels is None:
        raise RecordingError(
            "a factor graph needs motion between its poses: a recording with 'odometry' or 'wheels'"
        )
    odometry = image_odometry(measurements, sightings.t_ns)
    start = measurements.calibration.T_world_body_start.se3() @ SE3.exp(odometry.twist[0])
    return PeerInputs(sightings, stereo, odometry, start)
