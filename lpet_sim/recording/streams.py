"""Measurement streams: what the sensors of a rover deliver, and nothing else."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Final, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import RecordingError
from lpet_sim.recording.arrays import Array, ArrayStruct, Ints
from lpet_sim.recording.calibration import Calibration


@dataclass(frozen=True, eq=False)
class ImuStream(ArrayStruct):
    """Inertial measurements in the ``imu`` frame, each the mean over the interval up to its time.

    Attributes:
        t_ns: End of each interval since the start [ns], Shape (n,).
        gyro_radps: Body rate [rad/s], Shape (n, 3).
        accel_mps2: Specific force [m/s^2], Shape (n, 3).
    """

    t_ns: Ints
    gyro_radps: Array
    accel_mps2: Array


@dataclass(frozen=True, eq=False)
class WheelStream(ArrayStruct):
    """Encoder readings.

    Attributes:
        t_ns: Times since the start [ns], Shape (n,).
        drive_angle_rad: Accumulated angle of each wheel, forward positive [rad], Shape (n, w).
        steer_angle_rad: Steering angle, left positive, 0 where fixed [rad], Shape (n, w).
    """

    t_ns: Ints
    drive_angle_rad: Array
    steer_angle_rad: Array


@dataclass(frozen=True, eq=False)
class OdometryStream(ArrayStruct):
    """Motion of the body from one time to the next, as some odometry of its own delivers it.

    Step i leads from ``t_ns[i - 1]`` to ``t_ns[i]``; the first row's step is zero.

    Attributes:
        t_ns: Times since the start [ns], Shape (n,).
        twist: ``log(T_prev_curr)``, ``(translation, rotation)`` in the body [m, rad], Shape (n, 6).
        variance: Declared variance of each part of the right perturbation of ``T_prev_curr``
            [m^2, rad^2], white from step to step, Shape (n, 6).
        scale_sigma: Declared relative error of each part, 1 sigma, shared by all steps; the same in
            every row, Shape (n, 6).
    """

    t_ns: Ints
    twist: Array
    variance: Array
    scale_sigma: Array


_SIGHTED = ("landmark_id", "stereo_px", "sigma_px")


@dataclass(frozen=True, eq=False)
class SightingStream(ArrayStruct):
    """Landmark sightings, ragged: those of image i are rows ``offsets[i]:offsets[i + 1]``.

    Attributes:
        t_ns: Times of the image pairs since the start [ns], Shape (n,).
        offsets: Row offsets, Shape (n + 1,), int64.
        landmark_id: Which landmark is seen, Shape (m,), int64; unique within an image.
        stereo_px: (u_left, u_right, v) [px], Shape (m, 3).
        sigma_px: Declared noise of each image coordinate, 1 sigma [px], Shape (m,).
        drift_px: Declared random walk of what stands for a landmark in the images, with the
            distance driven, 1 sigma [px/sqrt(m)], Shape (n,); zeros if it is not given.
    """

    t_ns: Ints
    offsets: Ints
    landmark_id: Ints
    stereo_px: Array
    sigma_px: Array
    drift_px: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def ragged_fields(cls) -> frozenset[str]:
        """Name the arrays whose length is not that of ``t_ns``."""
        return frozenset({"offsets", *_SIGHTED})

    def __post_init__(self) -> None:
        """Check the offsets against the rows, and the rows themselves.

        Raises:
            RecordingError: Offsets and rows do not fit together, a number is not finite, a noise
                is not above zero, or a landmark is twice in an image.
        """
        if len(self.drift_px) == 0:
            object.__setattr__(self, "drift_px", np.zeros(len(self.t_ns)))
        super().__post_init__()
        rows = len(self.landmark_id)
        counts = np.diff(self.offsets)
        fits = len(self.offsets) == len(self.t_ns) + 1 and self.offsets[0] == 0
        fits = fits and self.offsets[-1] == rows and bool(np.all(counts >= 0))
        if not fits or len(self.stereo_px) != rows or len(self.sigma_px) != rows:
            raise RecordingError("SightingStream: offsets must run from 0 to the number of rows")
        self._check_rows(counts)

    def _check_rows(self, counts: Ints) -> None:
        sound = np.isfinite(self.stereo_px).all(axis=1) & np.isfinite(self.sigma_px)
        if not np.all(sound & (self.sigma_px > 0)):
            raise RecordingError(
                "SightingStream: image coordinates must be finite, and sigma_px above zero"
            )
        image = np.repeat(np.arange(len(self.t_ns)), counts)
        order = np.lexsort((self.landmark_id, image))
        ids, image = self.landmark_id[order], image[order]
        twice = np.flatnonzero((np.diff(ids) == 0) & (np.diff(image) == 0))
        if twice.size:
            raise RecordingError(
                f"SightingStream: landmark {ids[twice[0]]} is seen twice in the image at "
                f"{self.t_ns[image[twice[0]]]} ns; each may be there once"
            )

    def rows(self, image: int) -> slice:
        """Give the rows of one image."""
        return slice(int(self.offsets[image]), int(self.offsets[image + 1]))

    def images(self, first: int, last: int) -> Self:
        """Give the images from one to before another."""
        rows = slice(int(self.offsets[first]), int(self.offsets[last]))
        return replace(
            self,
            t_ns=self.t_ns[first:last].copy(),
            offsets=self.offsets[first : last + 1] - self.offsets[first],
            drift_px=self.drift_px[first:last].copy(),
            **{name: getattr(self, name)[rows].copy() for name in _SIGHTED},
        )

    def chosen(self, keep: NDArray[np.bool_]) -> Self:
        """Give the sightings chosen, Shape (m,); every image stays."""
        before = np.concatenate([[0], np.cumsum(keep)]).astype(np.int64)
        rows = {name: getattr(self, name)[keep] for name in _SIGHTED}
        return replace(self, offsets=before[self.offsets], **rows)


class StereoImages(Protocol):
    """Image pairs read one at a time, so that a long recording never has to fit in memory."""

    @property
    def t_ns(self) -> Ints:
        """Times of the pairs since the start [ns], Shape (n,)."""
        ...

    def __len__(self) -> int: ...

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Give the left and right grey image of a pair, Shape (h, w), uint8 or uint16."""
        ...


@dataclass(frozen=True, eq=False)
class ImagesInMemory:
    """Image pairs held as two arrays.

    Attributes:
        t_ns: Times since the start [ns], Shape (n,).
        left: Grey images, Shape (n, h, w), uint8 or uint16.
        right: Likewise.
    """

    t_ns: Ints
    left: NDArray[Any]
    right: NDArray[Any]

    def __len__(self) -> int:
        return len(self.t_ns)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Give the left and right image of a pair."""
        return self.left[index], self.right[index]


STREAMS: Final = ("imu", "wheels", "odometry", "sightings", "images")
"""The streams that an estimator may need."""


@dataclass(frozen=True)
class Measurements:
    """All that an estimator may know.

    Attributes:
        calibration: The declared calibration, with the start pose.
        imu: Inertial measurements, None where there is no unit.
        wheels: Encoder readings, None where there are none.
        sightings: Landmark sightings, None until a front end has made them.
        images: The image pairs, None where they were not kept.
        odometry: Motion increments of a unit of its own, None where there is none.
    """

    calibration: Calibration
    imu: ImuStream | None = None
    wheels: WheelStream | None = None
    sightings: SightingStream | None = None
    images: StereoImages | None = None
    odometry: OdometryStream | None = None

    def require(self, *names: str) -> None:
        """Hold the measurements to have the named streams.

        Raises:
            RecordingError: A stream is absent.
        """
        present = [name for name in STREAMS if getattr(self, name) is not None]
        for name in names:
            if name not in present:
                hint = ""
                if name == "sightings":
                    how = "sight" if "images" in present else "sense"
                    hint = f"; run 'lpet {how}' first"
                held = ", ".join(present) or "none"
                raise RecordingError(f"the recording has no stream '{name}' (it has: {held}){hint}")


def concatenate_slices(parts: list[NDArray[np.int64]]) -> Ints:
    """Make row offsets, Shape (n + 1,), from the landmark ids of n images."""
    return np.concatenate([[0], np.cumsum([len(part) for part in parts])]).astype(np.int64)
