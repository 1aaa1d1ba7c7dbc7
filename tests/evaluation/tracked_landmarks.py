"""A stereo pair on a winding path past landmarks, with every error of its sightings known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpet_sim.evaluation.sighting_tracks import CameraPath
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import PoseSpec, StereoCalibration
from lpet_sim.recording.streams import SightingStream, concatenate_slices
from lpet_sim.rng import stream

IMAGES = 120
STEP_M = 0.15
OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
STEREO = StereoCalibration(
    width_px=1024,
    height_px=1024,
    focal_px=804.0,
    cx_px=511.5,
    cy_px=511.5,
    baseline_m=0.15,
    T_body_camera=PoseSpec.from_se3(SE3(OPTICAL, np.zeros(3))),
)


@dataclass(frozen=True)
class Errors:
    """What is wrong with the sightings; see `lpet_sim.sensors.landmark_spec` for each."""

    sigma_px: tuple[float, float, float] = (0.3, 0.4, 0.5)
    fixed_px: float = 0.0
    disparity_px: float = 0.0
    focal_scale: float = 0.0
    baseline_scale: float = 0.0
    detection: float = 0.8
    wrong_share: float = 0.0


def true_path(images: int = IMAGES) -> SE3:
    """Give the body's poses on a winding, nodding path."""
    s = np.arange(images) * STEP_M
    yaw, pitch = 0.5 * np.sin(s / 3), 0.05 * np.sin(s / 1.1)
    x = np.concatenate([[0.0], np.cumsum(STEP_M * np.cos(yaw))[:-1]])
    y = np.concatenate([[0.0], np.cumsum(STEP_M * np.sin(yaw))[:-1]])
    R = SE3.from_rpy(np.column_stack([0.3 * pitch, pitch, yaw]), np.zeros((images, 3))).rotation
    return SE3(R, np.column_stack([x, y, 1.5 + 0.02 * np.sin(s)]))


def landmarks(seed: int, count: int = 9000) -> Array:
    """Strew landmarks [m], Shape (n, 3), in a slab about the path."""
    rng = stream(seed, "tracks", "landmarks")
    return rng.uniform([-2.0, -12.0, -0.5], [30.0, 12.0, 2.0], (count, 3))


def camera_path(T_world_body: SE3) -> CameraPath:
    """Give the camera's path."""
    return CameraPath.from_se3((T_world_body @ STEREO.T_body_camera.se3()).inverse())


def sighted(errors: Errors, seed: int = 1, images: int = IMAGES) -> SightingStream:
    """Sight the landmarks along the path; ids are their rows."""
    rng = stream(seed, "tracks", "sightings")
    points = landmarks(seed)
    fixed = rng.normal(0.0, errors.fixed_px, points.shape)
    true = STEREO.model_copy(
        update={
            "focal_px": STEREO.focal_px / (1 + errors.focal_scale),
            "baseline_m": STEREO.baseline_m / (1 + errors.baseline_scale),
        }
    )
    path, ids, px = camera_path(true_path(images)), [], []
    for k in range(images):
        seen, at = _in_view(path.seen_from(np.full(len(points), k), points), true)
        kept = rng.random(len(seen)) < errors.detection
        seen, at = seen[kept], at[kept]
        at += rng.normal(0.0, errors.sigma_px, at.shape) + fixed[seen]
        at[:, 1] -= errors.disparity_px
        ids.append(seen)
        px.append(_swapped(at, errors.wrong_share, rng))
    count = sum(map(len, ids))
    t_ns = np.arange(images) * NS_PER_S
    sigma_px = np.full(count, 0.4)
    return SightingStream(
        t_ns, concatenate_slices(ids), np.concatenate(ids), np.concatenate(px), sigma_px
    )


def _in_view(p_camera: Array, stereo: StereoCalibration) -> tuple[Ints, Array]:
    ids = np.flatnonzero((p_camera[:, 2] > 1.0) & (p_camera[:, 2] < 12.0))
    px = stereo.project(p_camera[ids])
    inside = np.all((px > 8) & (px < 1015), axis=1)
    ids, px = ids[inside], px[inside]
    nearest = ids % 12 == 0
    return ids[nearest].astype(np.int64), px[nearest]


def _swapped(px: Array, share: float, rng: np.random.Generator) -> Array:
    """Give some sightings the coordinates of another landmark of the image."""
    wrong = np.flatnonzero(rng.random(len(px)) < share)
    other = (wrong + rng.integers(1, len(px), len(wrong))) % len(px)
    out = px.copy()
    out[wrong] = px[other]
    return out
