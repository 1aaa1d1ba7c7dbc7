"""A hundred metres of S-curve, as a stereo pair and an odometry of known noise measure them.

A set-up for comparing estimators with each other and with the bound: everything is ideal but what
is said here, so that what an estimator loses is its own. The path is always the same; landmarks
and noise are drawn anew for each seed.

The ground undulates with two waves, 0.3 m sin(x / 5 m) cos(y / 7 m) + 0.1 m sin(x / 1.7 m), up to
about 7 deg steep, and the body lies flat on it. Landmarks lie on it at random, equally dense, and
nothing hides them. Where the numbers have no source beside them they are this project's choice.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.streams import (
    Measurements,
    OdometryStream,
    SightingStream,
    concatenate_slices,
)
from lpet_sim.recording.truth import BodyTruth, Truth
from lpet_sim.rng import stream
from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]

_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_PERIOD_NS = 7_200_000_000
_MARGIN_M = 15.0
_PATCH_IMAGES = 25


class SCurveSpec(Spec):
    """The S-curve and what is sensed on it.

    Attributes:
        images: Number of image pairs.
        step_m: Way along the path, seen from above, between two of them; 0.2 m at 100 m/h is an
            image each 7.2 s.
        swing_rad: Amplitude of the heading, one sine over 100 m.
        mast_height_m: Height of the cameras above the body's origin, which is on the ground; 2 m is
            that of ExoMars' mast.
        mast_forward_m: How far the cameras are before the origin; ExoMars' mast foot.
        pitch_down_rad: How far the cameras look down.
        focal_px: Focal length [px]; with 1024 x 1024 pixels the field of view is 65 deg.
        size_px: Width and height of the images.
        baseline_m: Distance between the eyes, ExoMars' mast pair.
        range_min_m: Nearer landmarks are not seen [m].
        range_max_m: Farther landmarks are not seen [m].
        landmarks_per_m2: Density on the ground; 1.25 puts 100 into view on average.
        detection_probability: Share of the landmarks in view that is sighted, anew in each image.
        sigma_px: White noise of u_left, u_right and v, 1 sigma.
        scale_sigma: Relative error of the way forward by odometry, one draw for a run, 1 sigma.
        white_share: White noise of odometry, 1 sigma, as share of the mean step: each part of the
            translation by that of its length, each part of the rotation by that of its angle.
        slip_m: By how much odometry runs ahead of the rover, once in a run, at a step drawn at
            random: 5 s at 100 m/h. It is not in the declared noise.
    """

    images: Annotated[int, Field(ge=2)] = 501
    step_m: Positive = 0.2
    swing_rad: float = 0.6
    mast_height_m: Positive = 2.0
    mast_forward_m: float = 0.28
    pitch_down_rad: float = np.radians(18.0)
    focal_px: Positive = 804.0
    size_px: Annotated[int, Field(ge=1)] = 1024
    baseline_m: Positive = 0.15
    range_min_m: Positive = 1.0
    range_max_m: Positive = 12.0
    landmarks_per_m2: Positive = 1.25
    detection_probability: Annotated[float, Field(gt=0.0, le=1.0)] = 0.8
    sigma_px: Positive = 0.5
    scale_sigma: NotNegative = 0.03
    white_share: Positive = 0.05
    slip_m: NotNegative = 0.139

    @property
    def stereo(self) -> StereoCalibration:
        """The camera pair, as it is and as it is declared."""
        level = SE3.from_rpy([0.0, self.pitch_down_rad, 0.0], [0.0] * 3).rotation
        eye = [self.mast_forward_m, 0.5 * self.baseline_m, self.mast_height_m]
        centre = 0.5 * (self.size_px - 1)
        return StereoCalibration(
            width_px=self.size_px,
            height_px=self.size_px,
            focal_px=self.focal_px,
            cx_px=centre,
            cy_px=centre,
            baseline_m=self.baseline_m,
            T_body_camera=PoseSpec.from_se3(SE3(level @ _OPTICAL, np.array(eye))),
            sigma_px=self.sigma_px,
        )


@dataclass(frozen=True)
class SCurveRun:
    """One run: what was measured, and what is true.

    Attributes:
        measurements: Sightings, odometry, calibration and start.
        truth: The body's motion, at the times of the images.
        p_world_landmark: The landmarks' places in the order of their names [m], Shape (n, 3).
    """

    measurements: Measurements
    truth: Truth
    p_world_landmark: Array

    @property
    def poses(self) -> SE3:
        """The body's true poses at the images."""
        return self.truth.body.T_world_body

    @property
    def sightings(self) -> SightingStream:
        """The sightings, which there always are."""
        assert self.measurements.sightings is not None
        return self.measurements.sightings

    @property
    def odometry(self) -> OdometryStream:
        """The odometry, which there always is."""
        assert self.measurements.odometry is not None
        return self.measurements.odometry

    @property
    def p_world_of(self) -> dict[int, Array]:
        """The landmarks' places by their names [m]."""
        return dict(enumerate(self.p_world_landmark))


def ground_m(x: Array, y: Array) -> Array:
    """Give the height of the undulating ground [m]."""
    return np.asarray(0.3 * np.sin(x / 5) * np.cos(y / 7) + 0.1 * np.sin(x / 1.7))


def s_curve_poses(spec: SCurveSpec) -> SE3:
    """Give the body's poses ``T_world_body`` at the images, on the ground and along its slope."""
    s = np.arange(spec.images) * spec.step_m
    yaw = spec.swing_rad * np.sin(2 * np.pi * s / 100.0)
    steps = spec.step_m * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
    x, y = np.concatenate([[[0.0, 0.0]], np.cumsum(steps, axis=0)[:-1]]).T
    slope_x = (ground_m(x + 0.05, y) - ground_m(x - 0.05, y)) / 0.1
    slope_y = (ground_m(x, y + 0.05) - ground_m(x, y - 0.05)) / 0.1
    along = slope_x * np.cos(yaw) + slope_y * np.sin(yaw)
    across = slope_y * np.cos(yaw) - slope_x * np.sin(yaw)
    rpy = np.stack([np.arctan(across * np.cos(np.arctan(along))), -np.arctan(along), yaw], axis=1)
    return SE3.from_rpy(rpy, np.stack([x, y, ground_m(x, y)], axis=1))


def s_curve_run(spec: SCurveSpec, seed: int) -> SCurveRun:
    """Make the run of a seed.

    Args:
        spec: The set-up.
        seed: Landmarks, noise and slip are drawn from ``stream(seed, "s_curve", ...)``.
    """
    poses = s_curve_poses(spec)
    t_ns = np.arange(spec.images, dtype=np.int64) * _PERIOD_NS
    landmarks = _landmarks(spec, poses, stream(seed, "s_curve", "landmarks"))
    measurements = Measurements(
        Calibration(stereo=spec.stereo, T_world_body_start=PoseSpec.from_se3(poses[0])),
        sightings=_sight(spec, t_ns, poses, landmarks, stream(seed, "s_curve", "sightings")),
        odometry=_measure_odometry(spec, t_ns, poses, stream(seed, "s_curve", "odometry")),
    )
    return SCurveRun(measurements, Truth(_motion(t_ns, poses)), landmarks)


def _motion(t_ns: Ints, poses: SE3) -> BodyTruth:
    """Give the motion through the poses, with the mean velocity around each."""
    t_s = t_ns / NS_PER_S
    velocity = np.gradient(poses.translation, t_s, axis=0)
    rate = (poses[:-1].inverse() @ poses[1:]).log()[:, 3:] / np.diff(t_s)[:, None]
    return BodyTruth(t_ns, poses, velocity, np.concatenate([rate, rate[-1:]]))


def _landmarks(spec: SCurveSpec, poses: SE3, rng: np.random.Generator) -> Array:
    """Strew landmarks on the ground around the path."""
    low = poses.translation[:, :2].min(axis=0) - _MARGIN_M
    high = poses.translation[:, :2].max(axis=0) + _MARGIN_M
    count = rng.poisson(spec.landmarks_per_m2 * float(np.prod(high - low)))
    x, y = rng.uniform(low, high, (count, 2)).T
    return np.stack([x, y, ground_m(x, y)], axis=1)


def _sight(
    spec: SCurveSpec, t_ns: Ints, poses: SE3, landmarks: Array, rng: np.random.Generator
) -> SightingStream:
    ids, pixels = [], []
    for seen, exact in _in_view(spec, poses, landmarks):
        found = rng.random(len(seen)) < spec.detection_probability
        ids.append(seen[found])
        noise = rng.standard_normal((int(found.sum()), 3))
        pixels.append(exact[found] + spec.sigma_px * noise)
    rows = np.concatenate(ids)
    declared = np.full(len(rows), spec.sigma_px)
    return SightingStream(t_ns, concatenate_slices(ids), rows, np.concatenate(pixels), declared)


def _in_view(spec: SCurveSpec, poses: SE3, landmarks: Array) -> Iterator[tuple[Ints, Array]]:
    """Yield for each image the landmarks in view, and where exactly they appear [px]."""
    camera, near = spec.stereo, np.arange(len(landmarks))
    T_camera_world = (poses @ camera.T_body_camera.se3()).inverse()
    for k in range(len(poses)):
        if k % _PATCH_IMAGES == 0:
            reach = spec.range_max_m + spec.mast_height_m + _PATCH_IMAGES * spec.step_m
            away = landmarks - poses[k].translation
            near = np.flatnonzero(np.linalg.norm(away, axis=1) < reach)
        p = T_camera_world[k] @ landmarks[near]
        distance = np.linalg.norm(p, axis=1)
        fits = (p[:, 2] > 0) & (distance > spec.range_min_m) & (distance < spec.range_max_m)
        px = camera.project(p[fits])
        inside = np.all((px >= 0) & (px <= spec.size_px - 1), axis=1)
        yield near[fits][inside].astype(np.int64), px[inside]


def _measure_odometry(
    spec: SCurveSpec, t_ns: Ints, poses: SE3, rng: np.random.Generator
) -> OdometryStream:
    """Measure the steps: scale, white noise and a slip; ``T_prev_curr_meas = exp(u) exp(d)``."""
    true = (poses[:-1].inverse() @ poses[1:]).log()
    length = np.linalg.norm(true[:, :3], axis=1).mean()
    angle = np.linalg.norm(true[:, 3:], axis=1).mean()
    sigma = spec.white_share * np.repeat([length, angle], 3)
    scaled = true.copy()
    scaled[:, 0] *= 1.0 + spec.scale_sigma * rng.standard_normal()
    scaled[rng.integers(len(true)), 0] += spec.slip_m
    noise = sigma * rng.standard_normal(true.shape)
    twist = np.concatenate([np.zeros((1, 6)), (SE3.exp(scaled) @ SE3.exp(noise)).log()])
    variance = np.concatenate([np.zeros((1, 6)), np.broadcast_to(sigma**2, true.shape)])
    declared = np.zeros((len(twist), 6))
    declared[:, 0] = spec.scale_sigma
    return OdometryStream(t_ns, twist, variance, declared)
