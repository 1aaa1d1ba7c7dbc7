"""Wheel and steering encoders: the turned angles, with the errors of odometry."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import Triple, WheelCalibration
from lpet_sim.recording.streams import WheelStream
from lpet_sim.recording.truth import WheelTruth
from lpet_sim.spec import Spec


class WheelOdometrySpec(Spec):
    """Encoders of driven and steered wheels, and what is declared of them.

    Scale errors and biases are drawn once for a traverse. Values without a source are this
    project's choice.

    Attributes:
        drive_resolution_rad: Quantum of the wheel angle; 12 bit on the wheel's own axis.
        drive_noise_rad: White noise of a reading, before it is quantised.
        distance_noise_rad_rtrad: Noise that grows with the root of the angle turned, as uneven
            rolling does [rad/sqrt(rad)]; at a radius of 0.14 m, 7.5 mm per root metre.
        scale_common_sigma: Scale error that all wheels share, 1 sigma: the effective radius in
            the soil; 3 %, as in published studies of stereo odometry for rovers [recalled].
        scale_wheel_sigma: Scale error of each wheel on its own, 1 sigma: wear, load.
        steer_resolution_rad: Quantum of the steering angle; 12 bit.
        steer_noise_rad: White noise of a steering reading, before it is quantised.
        steer_bias_rad: Misalignment of each steering axis, 1 sigma.
        declared_radius_error: Relative error of the declared rolling radius.
        declared_track_error: Relative error of the declared track width.
        declared_scale_sigma: What an estimator is told of the scale error, 1 sigma.
        declared_white_m_rtm: What it is told of the noise along [m/sqrt(m)]; most of it is slip.
        declared_lateral_m_rtm: The same across [m/sqrt(m)].
        declared_heading_rad_rtm: The same of the heading [rad/sqrt(m)].
    """

    drive_resolution_rad: float = Field(default=2 * math.pi / 4096, ge=0)
    drive_noise_rad: float = Field(default=5e-4, ge=0)
    distance_noise_rad_rtrad: float = Field(default=0.02, ge=0)
    scale_common_sigma: float = Field(default=0.03, ge=0)
    scale_wheel_sigma: float = Field(default=0.003, ge=0)
    steer_resolution_rad: float = Field(default=2 * math.pi / 4096, ge=0)
    steer_noise_rad: float = Field(default=1e-3, ge=0)
    steer_bias_rad: float = Field(default=3e-3, ge=0)
    declared_radius_error: float = Field(default=0.0, gt=-0.5, lt=0.5)
    declared_track_error: float = Field(default=0.0, gt=-0.5, lt=0.5)
    declared_scale_sigma: float = Field(default=0.03, ge=0)
    declared_white_m_rtm: float = Field(default=0.05, ge=0)
    declared_lateral_m_rtm: float = Field(default=0.02, ge=0)
    declared_heading_rad_rtm: float = Field(default=0.01, ge=0)

    @classmethod
    def perfect(cls) -> WheelOdometrySpec:
        """Make encoders without any error; what is declared of the noise stays."""
        errors = [name for name in cls.model_fields if not name.startswith("declared")]
        return cls.model_validate(dict.fromkeys(errors, 0.0))

    def declared(
        self,
        names: tuple[str, ...],
        position_body_m: Array,
        radius_m: float,
        steerable: tuple[bool, ...],
    ) -> WheelCalibration:
        """Declare wheels of the given true geometry, with the declared errors put on it.

        Args:
            names: Of the wheels.
            position_body_m: True contact points in the body, Shape (w, 3).
            radius_m: True rolling radius.
            steerable: Which wheels steer.
        """
        stretched = np.asarray(position_body_m) * np.array([1, 1 + self.declared_track_error, 1])
        rows: list[Triple] = [(float(x), float(y), float(z)) for x, y, z in stretched]
        return WheelCalibration(
            names=names,
            position_body_m=tuple(rows),
            radius_m=radius_m * (1 + self.declared_radius_error),
            steerable=steerable,
            scale_sigma=self.declared_scale_sigma,
            white_sigma_m_rtm=self.declared_white_m_rtm,
            lateral_sigma_m_rtm=self.declared_lateral_m_rtm,
            heading_sigma_rad_rtm=self.declared_heading_rad_rtm,
        )


class WheelEncoders:
    """The encoders on one traverse: fed chunk by chunk, equal to the bit however cut."""

    def __init__(
        self,
        spec: WheelOdometrySpec,
        wheels: int,
        rng: np.random.Generator,
        steerable: tuple[bool, ...] | None = None,
    ) -> None:
        """Draw the errors that stay for the traverse.

        Args:
            spec: The encoders.
            wheels: Number of wheels.
            rng: Their own random stream.
            steerable: Which wheels steer, and so have an encoder there; None for all of them.
        """
        self._spec = spec
        self._steers = np.array((True,) * wheels if steerable is None else steerable)
        self._rng = rng
        common = spec.scale_common_sigma * rng.standard_normal()
        self._scale = 1.0 + common + spec.scale_wheel_sigma * rng.standard_normal(wheels)
        self._steer_bias = spec.steer_bias_rad * rng.standard_normal(wheels)
        self._last_angle: Array | None = None
        self._wander = np.zeros(wheels)

    @property
    def scale(self) -> Array:
        """What one true radian reads as on each wheel, Shape (w,); for splitting errors."""
        return self._scale.copy()

    def sense(self, truth: WheelTruth) -> WheelStream:
        """Read the encoders at every time of one chunk of the truth.

        ``drive = scale theta + wander + white`` and ``steer = delta + bias + white``, each rounded
        to its resolution, and 0 where there is no steering; the wander's variance grows with the
        angle turned.
        """
        spec = self._spec
        # One row of numbers per reading: chunks make no difference.
        normals = self._rng.standard_normal((len(truth), 3, len(self._wander)))
        drive = truth.drive_angle_rad * self._scale + self._wandered(truth, normals[:, 0])
        drive = drive + spec.drive_noise_rad * normals[:, 1]
        steer = truth.steer_angle_rad + self._steer_bias + spec.steer_noise_rad * normals[:, 2]
        return WheelStream(
            np.array(truth.t_ns),
            _quantised(drive, spec.drive_resolution_rad),
            np.where(self._steers, _quantised(steer, spec.steer_resolution_rad), 0.0),
        )

    def _wandered(self, truth: WheelTruth, normals: Array) -> Array:
        angle = truth.drive_angle_rad
        before = angle[:1] if self._last_angle is None else self._last_angle
        turned = np.abs(np.diff(np.concatenate([before, angle]), axis=0))
        steps = self._spec.distance_noise_rad_rtrad * np.sqrt(turned) * normals
        wander = np.cumsum(np.concatenate([self._wander[None], steps]), axis=0)
        self._last_angle, self._wander = angle[-1:].copy(), wander[-1].copy()
        return wander[1:]


def _quantised(angle: Array, resolution: float) -> Array:
    if resolution == 0.0:
        return angle
    return np.asarray(resolution * np.floor(angle / resolution + 0.5))
