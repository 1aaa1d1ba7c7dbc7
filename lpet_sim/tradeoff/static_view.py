"""One candidate on the nominal path: what it sees from where, and what that tells of its poses."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky

from estimators.fused_odometry import FusedOdometrySpec
from estimators.motion import MotionSpec
from estimators.slam_spec import SlamSpec
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.sensors.landmark_spec import VisibilitySpec
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.grades import imu_grade
from lpet_sim.tradeoff.proxies import ProxySpec
from lpet_sim.tradeoff.spec import SiteSpec, StaticSpec
from lpet_sim.tradeoff.static_kernels import add_landmarks, look
from lpet_sim.tradeoff.static_world import StaticWorld

_POSE = 6
_TILT_WAVES = ((2.9, 0.4, 1.1), (6.7, 2.3, 3.9), (17.0, 5.2, 0.2))
"""Wavelength [m], phase of pitch and of roll: the nominal path's tilt, the same for all."""
_ODOMETRY_VARIANCE_MIN = 1e-14


@dataclass(frozen=True, eq=False)
class Setting:
    """What all candidates have in common.

    Attributes:
        site: Where and how the sensor is used.
        static: How closely to look.
        proxies: What sensors cost.
        world: The landmarks along the path.
        path_m: Length of the path that is analysed.
    """

    site: SiteSpec
    static: StaticSpec
    proxies: ProxySpec
    world: StaticWorld
    path_m: float

    @property
    def stretches(self) -> int:
        """How many such paths make up the distance."""
        return round(self.site.distance_m / self.path_m)


class View:
    """One candidate on the nominal path: what it sees, and what that tells."""

    def __init__(
        self,
        candidate: Candidate,
        setting: Setting,
        T_world_body: SE3,
        calibration: StereoCalibration,
        world: StaticWorld,
        shown: NDArray[np.bool_],
    ) -> None:
        """Hold what was seen; `View.of` looks.

        Args:
            candidate: The sensor.
            setting: What all candidates have in common.
            T_world_body: Poses of the stations, Shape (k,).
            calibration: The camera pair.
            world: The landmarks that the path comes near enough to.
            shown: Who is seen from where, Shape (k, n).
        """
        self._candidate, self._setting, self.T_world_body = candidate, setting, T_world_body
        self.calibration, self.world, self.shown = calibration, world, shown

    @classmethod
    def of(cls, candidate: Candidate, setting: Setting) -> View:
        """Look along the path."""
        site, static = setting.site, setting.static
        x_m = stations_of(candidate, setting.path_m, static.lump_m)
        tilt = static.tilt_share * site.terrain.relief.rms_slope_rad
        T_world_body = nominal_poses(x_m, tilt, site.ride_height_m)
        calibration = candidate.calibration(site.ride_height_m)
        seen = candidate.landmark_sensor(site.landmarks, site.speed_mps).visibility
        world, reach = _within_reach(setting.world, seen, candidate.mast_height_m)
        T_world_camera = T_world_body @ calibration.T_body_camera.se3()
        shown = np.empty((len(x_m), len(world)), np.bool_)
        points = (world.p_world, world.normal, reach, world.slope_min, world.is_far)
        eyes = np.array(T_world_camera.rotation), np.array(T_world_camera.translation)
        look(*eyes, camera_row(calibration), _limits(seen), points, shown)
        return cls(candidate, setting, T_world_body, calibration, world, shown)

    def sighted(self) -> tuple[float, float, float]:
        """Give the mean number of landmarks shown, of far ones, and the median range of others."""
        near = self.shown & ~self.world.is_far
        station, i = np.nonzero(near)
        eyes = (self.T_world_body @ self.calibration.T_body_camera.se3()).translation
        apart = self.world.p_world[i] - eyes[station]
        ranges = np.linalg.norm(apart, axis=1)
        far = self.shown.sum() - near.sum()
        count = len(self.T_world_body)
        median = float(np.median(ranges)) if len(ranges) else math.nan
        return float(self.shown.sum() / count), float(far / count), median

    def end_covariance(self) -> Array:
        """Give the covariance of the last pose when all else is eliminated, Shape (6, 6)."""
        count, lasting = len(self.T_world_body), 4
        info = np.zeros((_POSE * count,) * 2)
        poses = np.array(self.T_world_body.rotation), np.array(self.T_world_body.translation)
        T_body_camera = self.calibration.T_body_camera.se3()
        mount = np.array(T_body_camera.rotation), np.array(T_body_camera.translation)
        told = (camera_row(self.calibration), self._weights(), self.world.p_world, self.shown)
        add_landmarks(poses, mount, *told, self._memory(), info)
        # Lasting errors come first and the end last; the start is given.
        whole = np.eye(lasting + _POSE * (count - 1))
        whole[lasting:, lasting:] = info[_POSE:, _POSE:]
        _add_odometry(whole, lasting, self.T_world_body, *self._odometry())
        root = cholesky(whole, lower=True)[-_POSE:, -_POSE:]
        inverse = np.linalg.inv(root)
        return np.asarray(inverse.T @ inverse)

    def _step_m(self) -> float:
        return self._setting.path_m / (len(self.T_world_body) - 1)

    def _weights(self) -> Array:
        """Give the sightings of each landmark at a station over the variance of one."""
        lumped = self._step_m() / self._candidate.image_interval_m
        images = np.full(len(self.T_world_body), max(1.0, lumped))
        site = self._setting.site
        images[0] = 1.0 + site.standstill_s / self._candidate.period_s(site.speed_mps)
        images[-1] = max(1.0, 0.5 * lumped)
        sigma = self._candidate.matching_sigma_px
        return images * site.landmarks.detection_probability / sigma**2

    def _memory(self) -> int:
        """Give the memory in stations, at least one."""
        reach_m = self._setting.static.memory_images * self._candidate.image_interval_m
        return max(1, round(reach_m / self._step_m()))

    def _odometry(self) -> tuple[Array, Array]:
        """Give the variances of the steps, Shape (k - 1, 6), and lasting errors, Shape (6, 4)."""
        site, imu = self._setting.site, imu_grade(self._candidate.imu).spec
        step_m, wheels = self._step_m(), site.wheels
        step_s = step_m / site.speed_mps
        walk = math.sqrt(float(np.mean(np.square(imu.gyro_random_walk_radps_rthz))))
        vertical = MotionSpec().vertical_sigma_m_rtm
        moved = [wheels.declared_white_m_rtm, wheels.declared_lateral_m_rtm, vertical]
        variance = np.array([*(s**2 * step_m for s in moved), *(3 * [walk**2 * step_s])])
        lasting = np.zeros((_POSE, 4))
        lasting[0, 0] = wheels.declared_scale_sigma * step_m
        lasting[3:, 1:] = np.eye(3) * step_s * _bias_left(imu.gyro_bias_radps, walk, site)
        return np.maximum(variance, _ODOMETRY_VARIANCE_MIN) + self._slipped(), lasting

    def _slipped(self) -> Array:
        """Give what slips, evenly along the path, add to the variances, Shape (k - 1, 6)."""
        so_far = self.T_world_body.translation[:, 0] * self._setting.site.slips_per_m
        slips = np.diff(np.floor(so_far + 0.5))
        least = SlamSpec()
        moved_m = max(self._candidate.image_interval_m, least.slip_sigma_m)
        sigma = np.repeat([moved_m, least.slip_sigma_rad], 3)
        return slips[:, None] * sigma**2


def _bias_left(bias_radps: float, walk: float, site: SiteSpec) -> float:
    """Give the error of the gyro's bias after the standstill, 1 sigma [rad/s].

    The standstill is taken in as the odometry takes it: in blocks, in each of which the parked
    rover turns a little.
    """
    odometry = FusedOdometrySpec()
    block_s = odometry.rest_block_s
    turned = odometry.rest_turn_sigma_radps**2 + walk**2 / block_s
    learnt = site.standstill_s / block_s / turned
    return 1.0 / math.sqrt(1.0 / max(bias_radps, 1e-12) ** 2 + learnt)


def _within_reach(
    world: StaticWorld, seen: VisibilitySpec, height_m: float
) -> tuple[StaticWorld, Array]:
    """Keep the landmarks that the path comes near enough to, and say how far each is seen [m]."""
    reach = np.full(len(world), seen.range_max_m)
    if seen.range_exponent > 0:
        own = seen.range_full_m * (1.0 - world.fading) ** (-1.0 / seen.range_exponent)
        reach = np.minimum(reach, own)
    aside = np.abs(world.p_world[:, 1])
    above = np.maximum(height_m - world.p_world[:, 2], 0.0) * 0.5
    kept = world.is_far | (reach > np.maximum(np.hypot(aside, above), seen.range_min_m))
    return world.select(kept), reach[kept]


def _limits(seen: VisibilitySpec) -> Array:
    most = np.inf if seen.sightings_max is None else float(seen.sightings_max)
    return np.array([seen.border_px, seen.range_min_m, math.cos(seen.incidence_max_rad), most])


def camera_row(camera: StereoCalibration) -> Array:
    """Give (f, cx, cy, baseline, width, height) as the kernels take it, Shape (6,)."""
    pinhole = (camera.focal_px, camera.cx_px, camera.cy_px, camera.baseline_m)
    return np.array([*pinhole, camera.width_px, camera.height_px], dtype=np.float64)


def _add_odometry(whole: Array, lasting: int, poses: SE3, variance: Array, by: Array) -> None:
    """Add the steps' information: ``xi_next - Ad(T_prev_curr^-1) xi_prev - U s`` of a variance."""
    back = (poses[:-1].inverse() @ poses[1:]).inverse().adjoint()
    for k in range(len(back)):
        row = np.zeros((_POSE, len(whole)))
        at = lasting + _POSE * k
        row[:, at : at + _POSE] = np.eye(_POSE)
        if k > 0:
            row[:, at - _POSE : at] = -back[k]
        row[:, :lasting] = -by
        used = np.r_[0:lasting, max(lasting, at - _POSE) : at + _POSE]
        row = row[:, used] / np.sqrt(variance[k])[:, None]
        whole[np.ix_(used, used)] += row.T @ row


def stations_of(candidate: Candidate, path_m: float, lump_m: float) -> Array:
    """Give where along the path the analysis looks [m], Shape (k,), k at least 2."""
    step_m = candidate.image_interval_m * max(1, math.floor(lump_m / candidate.image_interval_m))
    return np.linspace(0.0, path_m, max(1, round(path_m / step_m)) + 1)


def nominal_poses(x_m: Array, tilt_rad: float, ride_height_m: float) -> SE3:
    """Give ``T_world_body`` along x, level but for a tilt in waves of a given RMS [rad]."""
    size = tilt_rad * math.sqrt(2.0 / len(_TILT_WAVES))
    rpy = np.zeros((len(x_m), 3))
    for wavelength_m, pitch, roll in _TILT_WAVES:
        phase = 2.0 * math.pi * x_m / wavelength_m
        rpy[:, 0] += size * np.sin(phase + roll)
        rpy[:, 1] += size * np.sin(phase + pitch)
    place = np.column_stack([x_m, np.zeros(len(x_m)), np.full(len(x_m), ride_height_m)])
    return SE3.from_rpy(rpy, place)
