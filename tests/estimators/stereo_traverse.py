"""A traverse of 100 m on undulating ground, and what an ideal stereo front end would sight on it.

Images every 0.2 m, f = 804 px, baseline 0.15 m, 1024 x 1024 px, pitched down by 18 deg, landmarks
at 1 to 12 m, about 80 sightings an image, each landmark detected with probability 0.8, white noise
of 0.5 px: the set-up of the reference figures.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.streams import Measurements, SightingStream, concatenate_slices
from lpet_sim.rng import stream

IMAGES = 501
STEP_M = 0.2
SIGMA_PX = 0.5
_LANDMARKS = 60_000
_CANDIDATES = 100
_DETECTION = 0.8
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Scene:
    """A path with landmarks along it.

    Attributes:
        T_world_body: True poses, Shape (n,).
        visible: For each image the landmarks that can be seen.
        stereo_px: Their exact image coordinates [px].
    """

    T_world_body: SE3
    visible: list[Ints]
    stereo_px: list[Array]

    @property
    def length_m(self) -> float:
        """Distance along the path [m]."""
        steps = np.diff(self.T_world_body.translation, axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())


def stereo() -> StereoCalibration:
    """Make the mast's camera pair."""
    mount = SE3(
        SE3.from_rpy([0.0, np.radians(18.0), 0.0], [0.0] * 3).rotation @ _OPTICAL, [0.3, 0.075, 1.5]
    )
    return StereoCalibration(
        width_px=1024,
        height_px=1024,
        focal_px=804.0,
        cx_px=511.5,
        cy_px=511.5,
        baseline_m=0.15,
        T_body_camera=PoseSpec.from_se3(mount),
        sigma_px=SIGMA_PX,
    )


def ground_m(x: Array, y: Array) -> Array:
    """Give the height of the undulating ground [m]."""
    return np.asarray(0.3 * np.sin(x / 5) * np.cos(y / 7) + 0.1 * np.sin(x / 1.7))


@cache
def scene(images: int = IMAGES) -> Scene:
    """Lay out the S-curve and its landmarks; always the same."""
    s = np.arange(images) * STEP_M
    yaw = 0.6 * np.sin(2 * np.pi * s / 100)
    x = np.concatenate([[0.0], np.cumsum(STEP_M * np.cos(yaw))[:-1]])
    y = np.concatenate([[0.0], np.cumsum(STEP_M * np.sin(yaw))[:-1]])
    slope_x = (ground_m(x + 0.05, y) - ground_m(x - 0.05, y)) / 0.1
    slope_y = (ground_m(x, y + 0.05) - ground_m(x, y - 0.05)) / 0.1
    pitch = -np.arctan(slope_x * np.cos(yaw) + slope_y * np.sin(yaw))
    roll = np.arctan(slope_y * np.cos(yaw) - slope_x * np.sin(yaw))
    rpy, position = np.stack([roll, pitch, yaw], 1), np.stack([x, y, ground_m(x, y)], 1)
    poses = SE3.from_rpy(rpy, position)
    seen = [_visible(_landmarks(), poses[k]) for k in range(images)]
    return Scene(poses, [ids for ids, _ in seen], [px for _, px in seen])


@cache
def _landmarks() -> Array:
    rng = stream(0, "landmarks")
    xy = rng.uniform([-15.0, -40.0], [115.0, 60.0], (_LANDMARKS, 2))
    return np.column_stack([xy, ground_m(*xy.T) + rng.uniform(0.0, 0.2, _LANDMARKS)])


def _visible(p_world: Array, T_world_body: SE3) -> tuple[Ints, Array]:
    camera = stereo()
    p = (T_world_body @ camera.T_body_camera.se3()).inverse() @ p_world
    distance = np.linalg.norm(p, axis=1)
    ids = np.flatnonzero((p[:, 2] > 0.3) & (distance > 1.0) & (distance < 12.0))
    px = camera.project(p[ids])
    inside = np.all((px >= 0) & (px <= 1023), axis=1)
    ids, px = ids[inside], px[inside]
    # The same landmarks are preferred in every image, so that they are followed over time.
    first = np.argsort((ids * 7919) % 60013)[:_CANDIDATES]
    return ids[first], px[first]


def sightings(seed: int, images: int = IMAGES, noise_px: float = SIGMA_PX) -> SightingStream:
    """Sight the scene with white noise, declared to be 0.5 px whatever it is."""
    rng, world = stream(seed, "sightings"), scene(images)
    ids, px = [], []
    for visible, exact in zip(world.visible, world.stereo_px, strict=True):
        seen = rng.random(len(visible)) < _DETECTION
        ids.append(visible[seen].astype(np.int64))
        px.append(exact[seen] + noise_px * rng.standard_normal((int(seen.sum()), 3)))
    rows = np.concatenate(px)
    t_ns = np.arange(images, dtype=np.int64) * NS_PER_S
    declared = np.full(len(rows), SIGMA_PX)
    return SightingStream(t_ns, concatenate_slices(ids), np.concatenate(ids), rows, declared)


def measurements(stream_of_sightings: SightingStream) -> Measurements:
    """Give an estimator the sightings, the declared cameras and the start."""
    start = PoseSpec.from_se3(scene().T_world_body[0])
    calibration = Calibration(stereo=stereo(), T_world_body_start=start)
    return Measurements(calibration, sightings=stream_of_sightings)
