"""Sightings sorted by landmark, and the true path of the camera that made them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Tracks:
    """All sightings of a stream, those of one landmark beside each other and in order of time.

    Attributes:
        starts: Rows of track j are ``starts[j]:starts[j + 1]``, Shape (k + 1,).
        landmark_id: Whose track it is, Shape (k,).
        image: Image of each row, Shape (m,).
        stereo_px: (u_left, u_right, v) [px], Shape (m, 3).
        sigma_px: Declared noise, 1 sigma [px], Shape (m,).
        images: Number of images.
    """

    starts: Ints
    landmark_id: Ints
    image: Ints
    stereo_px: Array
    sigma_px: Array
    images: int

    @classmethod
    def of(cls, sightings: SightingStream) -> Self:
        """Sort a stream by landmark.

        Raises:
            RecordingError: It has no sightings.
        """
        if len(sightings.landmark_id) == 0:
            raise RecordingError("the recording has no sightings: a sensor is measured on them")
        image = np.repeat(np.arange(len(sightings)), np.diff(sightings.offsets))
        order = np.lexsort((image, sightings.landmark_id))
        landmark_id, first = np.unique(sightings.landmark_id[order], return_index=True)
        return cls(
            np.append(first, len(order)).astype(np.int64),
            landmark_id,
            image[order],
            sightings.stereo_px[order],
            sightings.sigma_px[order],
            len(sightings),
        )

    def __len__(self) -> int:
        return len(self.landmark_id)

    @property
    def lengths(self) -> Ints:
        """Number of sightings of each track, Shape (k,)."""
        return np.diff(self.starts)

    @property
    def track(self) -> Ints:
        """Track of each row, Shape (m,)."""
        return np.repeat(np.arange(len(self)), self.lengths)

    def total(self, rows: NDArray[np.generic]) -> NDArray[np.float64]:
        """Sum values of rows, Shape (m, ...), over each track, Shape (k, ...)."""
        return np.add.reduceat(np.asarray(rows, dtype=float), self.starts[:-1], axis=0)


@dataclass(frozen=True, eq=False)
class CameraPath:
    """Where the left camera was in each image.

    Attributes:
        R_camera_world: Shape (n, 3, 3).
        t_camera_world_m: Origin of the world in the camera [m], Shape (n, 3).
    """

    R_camera_world: Array
    t_camera_world_m: Array

    @classmethod
    def of(cls, truth: Trajectory, t_ns: Ints, calibration: StereoCalibration) -> Self:
        """Take a camera on a body's true path.

        Raises:
            RecordingError: An image's time lies outside the trajectory.
        """
        T_world_camera = truth.at(t_ns) @ calibration.T_body_camera.se3()
        return cls.from_se3(T_world_camera.inverse())

    @classmethod
    def from_se3(cls, T_camera_world: SE3) -> Self:
        """Take poses of the world in the camera, Shape (n,)."""
        R, t = T_camera_world.rotation, T_camera_world.translation
        return cls(np.ascontiguousarray(R), np.ascontiguousarray(t))

    @property
    def T_camera_world(self) -> SE3:
        """Poses of the world in the camera, Shape (n,)."""
        return SE3(self.R_camera_world, self.t_camera_world_m)

    def seen_from(self, image: Ints, p_world: Array) -> Array:
        """Give points in the cameras of images, Shape (m, 3) [m]."""
        turned = np.einsum("mij,mj->mi", self.R_camera_world[image], p_world)
        return np.asarray(turned + self.t_camera_world_m[image])


def since(sightings: SightingStream, image: int) -> SightingStream:
    """Leave out the images before one.

    Raises:
        RecordingError: There is no such image.
    """
    if not 0 <= image < len(sightings):
        raise RecordingError(
            f"image {image} is not there: the recording has {len(sightings)} images; "
            f"give one from 0 to {len(sightings) - 1}"
        )
    return sightings.images(image, len(sightings))
