"""What cameras without any error would see of landmarks that lie on the ground and on the rocks."""

from __future__ import annotations

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream, concatenate_slices
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.terrain import Terrain

_REACH_M = 8.0
_SPACING_M = 0.4
_NEAREST_M = 0.5


def landmarks_around(terrain: Terrain, path_m: Array) -> Array:
    """Place landmarks [m], Shape (n, 3): a grid on the ground, and the rocks' corners."""
    low, high = path_m[:, :2].min(axis=0) - _REACH_M, path_m[:, :2].max(axis=0) + _REACH_M
    axes = [np.arange(a, b, _SPACING_M) for a, b in zip(low, high, strict=True)]
    xy = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    ground = np.column_stack([xy, terrain.height(xy)])
    rocks = terrain.rocks(Box(*map(float, (*low, *high))), 0.15)
    corners = [rocks.p_world_rock[k] + rocks.mesh(k)[0] for k in range(len(rocks))]
    return np.concatenate([ground, *corners])


def exact_sightings(
    landmarks_m: Array, body: BodyTruth, stereo: StereoCalibration, every: int
) -> SightingStream:
    """Project landmarks, Shape (n, 3), through a pair at every n-th true pose.

    Nothing hides a landmark: the sightings are exact, not likely.
    """
    rows = np.arange(0, len(body), every)
    T_world_camera = body.T_world_body[rows] @ stereo.T_body_camera.se3()
    seen = [_seen(landmarks_m, T_world_camera[i], stereo) for i in range(len(rows))]
    ids, px = [ids for ids, _ in seen], np.concatenate([px for _, px in seen])
    sigma_px = np.full(len(px), stereo.sigma_px)
    offsets = concatenate_slices(ids)
    return SightingStream(body.t_ns[rows].copy(), offsets, np.concatenate(ids), px, sigma_px)


def _seen(landmarks_m: Array, T_world_camera: SE3, stereo: StereoCalibration) -> tuple[Ints, Array]:
    p_camera = T_world_camera.inverse() @ landmarks_m
    ids = np.flatnonzero(p_camera[:, 2] > _NEAREST_M)
    px = stereo.project(p_camera[ids])
    size = np.array([stereo.width_px, stereo.width_px, stereo.height_px])
    inside = np.all((px >= 0) & (px <= size - 1), axis=1)
    return ids[inside].astype(np.int64), px[inside]
