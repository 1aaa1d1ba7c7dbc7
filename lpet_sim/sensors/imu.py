"""Inertial unit: increments of angle and velocity, with the errors of a tactical-grade unit.

Each output is the mean over one interval between truth samples, so increments are what is
measured, kept whole: nothing is lost between two samples, and quantisation carries its remainder
over to the next increment as a counter of pulses does.
"""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import ImuCalibration, PoseSpec, Triple
from lpet_sim.recording.streams import ImuStream
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.sensors.increments import TriadErrors, true_increments
from lpet_sim.spec import Spec

STANDARD_GRAVITY_MPS2 = 9.80665
_RADPS_PER_DEG_PER_H = math.radians(1.0) / 3600.0
_CHUNK = 200_000
_ZERO = (0.0, 0.0, 0.0)


class ImuSpec(Spec):
    """An inertial unit of the LN-200 class, per axis x, y, z of the unit.

    The random walks, bias walks and the quantum are derived from the Allan deviations of 6 h of
    real LN-200 data at rest at 1.28, 10.24, 81.9 and 1311 s (and 0.045 deg/h at 5000 s for the
    gyro) through ``sigma^2 = 3 Q^2/tau^2 + N^2/tau + K^2 tau/3`` (IEEE Std 952 annex C
    [recalled]): the coefficients whose largest relative misfit of sigma^2 is smallest, for the
    accelerometer with the value at 1311 s, which K alone sets, met exactly. The accelerometer's x
    axis does not follow this law (its slope from 1.28 to 10.24 s is -0.73 where quantisation has
    -1): the best there is misses by 16 %.

    Turn-on biases, scale and misalignment are constant over a traverse and drawn once for it.

    Attributes:
        gyro_random_walk_radps_rthz: Angle random walk N [rad/s/sqrt(Hz)]; 0.036-0.041 deg/sqrt(h).
        gyro_bias_walk_radps_rts: Rate random walk K [rad/s/sqrt(s)].
        gyro_bias_radps: Turn-on bias, 1 sigma; 2 deg/h, amid the 1-3 deg/h [recalled].
        gyro_scale_sigma: Scale error, 1 sigma; 100 ppm [recalled].
        gyro_quantum_rad: Quantum of an angle increment; the data show none.
        accel_random_walk_mps2_rthz: Velocity random walk N [m/s^2/sqrt(Hz)]; 9-23 ug/sqrt(Hz).
        accel_bias_walk_mps2_rts: Acceleration random walk K [m/s^2/sqrt(s)].
        accel_bias_mps2: Turn-on bias, 1 sigma; 300 ug [recalled].
        accel_scale_sigma: Scale error, 1 sigma; 300 ppm [recalled].
        accel_quantum_mps: Quantum q of a velocity increment. The data give the coefficient Q of
            the whole velocity error that does not accumulate (4.6-6.2e-4 m/s); with half of its
            variance from the quantum, ``q^2 / 12 = Q^2 / 2``.
        accel_jitter_mps: The other half: white noise of the velocity before it is quantised,
            ``Q / sqrt(2)``, 1 sigma. It keeps the quantisation error white when the unit is at
            rest. The split is an assumption; the data show the sum only.
        misalignment_sigma_rad: Each axis against each of the other two, 1 sigma; 0.1 mrad
            [recalled].
    """

    gyro_random_walk_radps_rthz: Triple = (1.039e-5, 1.151e-5, 1.179e-5)
    gyro_bias_walk_radps_rts: Triple = (2.81e-9, 4.01e-9, 3.95e-9)
    gyro_bias_radps: float = Field(default=2.0 * _RADPS_PER_DEG_PER_H, ge=0)
    gyro_scale_sigma: float = Field(default=100e-6, ge=0)
    gyro_quantum_rad: Triple = _ZERO
    accel_random_walk_mps2_rthz: Triple = (2.303e-4, 1.130e-4, 9.164e-5)
    accel_bias_walk_mps2_rts: Triple = (5.416e-7, 8.473e-7, 8.033e-7)
    accel_bias_mps2: float = Field(default=300e-6 * STANDARD_GRAVITY_MPS2, ge=0)
    accel_scale_sigma: float = Field(default=300e-6, ge=0)
    accel_quantum_mps: Triple = (1.117e-3, 1.425e-3, 1.525e-3)
    accel_jitter_mps: Triple = (3.224e-4, 4.113e-4, 4.403e-4)
    misalignment_sigma_rad: float = Field(default=1e-4, ge=0)

    @classmethod
    def perfect(cls) -> ImuSpec:
        """Make a unit without any error."""
        triples = ("gyro_random_walk_radps_rthz", "gyro_bias_walk_radps_rts", "accel_quantum_mps")
        more = ("accel_random_walk_mps2_rthz", "accel_bias_walk_mps2_rts", "accel_jitter_mps")
        scalars = ("gyro_bias_radps", "gyro_scale_sigma", "accel_bias_mps2", "accel_scale_sigma")
        zeros = dict.fromkeys(triples + more, _ZERO)
        return cls.model_validate(zeros | dict.fromkeys((*scalars, "misalignment_sigma_rad"), 0.0))

    @property
    def accel_velocity_noise_mps(self) -> Array:
        """Quantisation coefficient ``Q = sqrt(q^2 / 12 + jitter^2)`` [m/s], Shape (3,)."""
        return np.sqrt(np.square(self.accel_quantum_mps) / 12 + np.square(self.accel_jitter_mps))

    def declared(self, T_body_imu: SE3, rate_hz: float) -> ImuCalibration:
        """Declare the unit: the RMS over the axes of each of its noises.

        The declared quantum is the one that would make the whole velocity noise,
        ``sqrt(12) Q``. Misalignment and scale are not declared: they are errors.
        """
        return ImuCalibration(
            rate_hz=rate_hz,
            T_body_imu=PoseSpec.from_se3(T_body_imu),
            gyro_random_walk_radps_rthz=_rms(self.gyro_random_walk_radps_rthz),
            gyro_bias_radps=self.gyro_bias_radps,
            accel_random_walk_mps2_rthz=_rms(self.accel_random_walk_mps2_rthz),
            accel_bias_mps2=self.accel_bias_mps2,
            accel_quantum_mps=math.sqrt(12) * _rms(self.accel_velocity_noise_mps),
        )


class Imu:
    """The unit on one traverse: fed with truth chunk by chunk, equal to the bit however cut."""

    def __init__(
        self, spec: ImuSpec, T_body_imu: SE3, gravity_mps2: float, rng: np.random.Generator
    ) -> None:
        """Turn the unit on, which draws its biases, scales and misalignments.

        Args:
            spec: The unit.
            T_body_imu: Where it is mounted.
            gravity_mps2: Magnitude of gravity, along -z of the world [m/s^2].
            rng: Its own random stream.
        """
        self._T_body_imu = T_body_imu
        self._gravity_mps2 = gravity_mps2
        self._rng = rng
        self._last: tuple[Array, ...] | None = None
        self._gyro = TriadErrors(
            axes=_drawn_axes(rng, spec.gyro_scale_sigma, spec.misalignment_sigma_rad),
            bias=spec.gyro_bias_radps * rng.standard_normal(3),
            random_walk=np.array(spec.gyro_random_walk_radps_rthz),
            bias_walk=np.array(spec.gyro_bias_walk_radps_rts),
            quantum=np.array(spec.gyro_quantum_rad),
            jitter=np.zeros(3),
        )
        self._accel = TriadErrors(
            axes=_drawn_axes(rng, spec.accel_scale_sigma, spec.misalignment_sigma_rad),
            bias=spec.accel_bias_mps2 * rng.standard_normal(3),
            random_walk=np.array(spec.accel_random_walk_mps2_rthz),
            bias_walk=np.array(spec.accel_bias_walk_mps2_rts),
            quantum=np.array(spec.accel_quantum_mps),
            jitter=np.array(spec.accel_jitter_mps),
        )

    def sense(self, body: BodyTruth) -> ImuStream:
        """Measure one chunk of the motion.

        Args:
            body: Truth that continues the chunk before; the very first sample only starts the
                first interval.

        Returns:
            One row for each interval that ends in this chunk.
        """
        T = body.T_world_body
        new = (body.t_ns, T.rotation, body.v_world_body_mps, body.omega_body_radps)
        old = self._last if self._last is not None else tuple(part[:0] for part in new)
        t_ns, rotation, velocity, omega = (
            np.concatenate([before, part]) for before, part in zip(old, new, strict=True)
        )
        self._last = tuple(part[-1:].copy() for part in (t_ns, rotation, velocity, omega))
        mount = np.array(self._T_body_imu.rotation), np.array(self._T_body_imu.translation)
        dt = np.diff(t_ns) / NS_PER_S
        angle, speed = true_increments(dt, rotation, velocity, omega, *mount, self._gravity_mps2)
        return self.corrupt(t_ns[1:].copy(), dt, angle, speed)

    def corrupt(self, t_ns: Ints, dt: Array, delta_theta: Array, delta_v: Array) -> ImuStream:
        """Put the unit's errors on true increments in its own frame.

        Args:
            t_ns: End of each interval [ns], Shape (n,).
            dt: Length of each interval [s], Shape (n,).
            delta_theta: Rotation over each interval [rad], Shape (n, 3).
            delta_v: Specific force integrated over each interval [m/s], Shape (n, 3).
        """
        # One row of numbers per sample: how the samples are cut into chunks makes no difference.
        normals = self._rng.standard_normal((len(dt), 18))
        gyro = self._gyro.rates(delta_theta, dt, normals[:, :9])
        return ImuStream(t_ns, gyro, self._accel.rates(delta_v, dt, normals[:, 9:]))


def imu_at_rest(
    spec: ImuSpec,
    duration_s: float,
    rng: np.random.Generator,
    rate_hz: float = 100.0,
    gravity_mps2: float = STANDARD_GRAVITY_MPS2,
) -> ImuStream:
    """Measure standstill, level, as on a bench.

    Args:
        spec: The unit.
        duration_s: How long [s].
        rng: The unit's random stream.
        rate_hz: Sample rate.
        gravity_mps2: On a bench on Earth by default [m/s^2].
    """
    imu = Imu(spec, SE3.identity(), gravity_mps2, rng)
    count, step_ns = round(duration_s * rate_hz), round(NS_PER_S / rate_hz)
    t_ns = np.arange(1, count + 1, dtype=np.int64) * step_ns
    parts = [_rest_chunk(imu, t, step_ns / NS_PER_S, gravity_mps2) for t in _chunks(t_ns)]
    gyro = np.concatenate([part.gyro_radps for part in parts])
    return ImuStream(t_ns, gyro, np.concatenate([part.accel_mps2 for part in parts]))


def _chunks(t_ns: Ints) -> list[Ints]:
    return [t_ns[i : i + _CHUNK].copy() for i in range(0, len(t_ns), _CHUNK)]


def _rest_chunk(imu: Imu, t_ns: Ints, dt_s: float, gravity_mps2: float) -> ImuStream:
    still = np.zeros((len(t_ns), 3))
    falling = still + np.array([0.0, 0.0, gravity_mps2 * dt_s])
    return imu.corrupt(t_ns, np.full(len(t_ns), dt_s), still, falling)


def _drawn_axes(rng: np.random.Generator, scale_sigma: float, misalignment_rad: float) -> Array:
    """Draw ``I + scale + misalignment``, Shape (3, 3): what the sensitive axes pick up."""
    off = misalignment_rad * rng.standard_normal((3, 3))
    scale = 1.0 + scale_sigma * rng.standard_normal(3)
    return np.asarray(np.where(np.eye(3, dtype=bool), scale, off))


def _rms(values: Triple | Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
