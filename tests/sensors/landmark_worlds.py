"""Grounds, drives and cameras that tests of the landmark sensor share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import PoseSpec, StereoCalibration
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.sensors.landmark_spec import (
    LandmarkFieldSpec,
    LandmarkSensorSpec,
    SightingNoiseSpec,
    VisibilitySpec,
)
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks

MAST = SE3.from_rpy([0.0, 0.31, 0.0], [0.4, 0.075, 1.1]) @ SE3(
    np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3)
)
CAMERA = StereoCalibration(
    width_px=1024,
    height_px=1024,
    focal_px=804.0,
    cx_px=511.5,
    cy_px=511.5,
    baseline_m=0.15,
    T_body_camera=PoseSpec.from_se3(MAST),
    sigma_px=0.7,
)
QUIET = SightingNoiseSpec(sigma_left_px=0.0, sigma_right_px=0.0, sigma_v_px=0.0)
GROUND_ONLY = LandmarkFieldSpec(per_rock=0.0, far_per_rad=0.0)
ALL_IN_RANGE = VisibilitySpec(range_exponent=0.0, sightings_max=None, occlusion=False)


@dataclass(frozen=True)
class MadeUpTerrain:
    """Ground of any height function, and rocks as rows (x, y, diameter) [m]."""

    z: Callable[[Array], Array] = lambda xy: np.zeros(len(xy))
    stones: tuple[tuple[float, float, float], ...] = ()
    spec: Any = field(default_factory=lambda: SimpleNamespace(far=None))

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Give heights, Shape (n, 2) -> (n,)."""
        return self.z(xy)

    def normal(self, xy: Array) -> Array:
        """Give unit normals by differences, Shape (n, 3)."""
        step = 1e-4
        slopes = [
            (self.z(xy + np.array(d)) - self.z(xy - np.array(d))) / (2 * step)
            for d in ((step, 0.0), (0.0, step))
        ]
        normal = np.column_stack([-slopes[0], -slopes[1], np.ones(len(xy))])
        return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))

    def patch(
        self,
        x0: int,
        y0: int,
        shape: tuple[int, int],
        cell_m: float,
        detail_m: float = 0.0,
    ) -> Array:
        """Give heights on a grid of nodes."""
        x, y = (x0 + np.arange(shape[1])) * cell_m, (y0 + np.arange(shape[0])) * cell_m
        return self.z(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(shape)

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> Rocks:
        """Give the rocks of a box, a third as high as wide, buried by half."""
        xyd = np.array(self.stones, dtype=float).reshape(-1, 3)
        n = len(xyd)
        rocks = Rocks(
            id=np.arange(n),
            p_world_rock=np.column_stack([xyd[:, :2], self.z(xyd[:, :2])]),
            diameter_m=xyd[:, 2],
            height_m=0.6 * xyd[:, 2],
            buried_fraction=np.full(n, 0.5),
            width_ratio=np.full(n, 0.9),
            yaw_rad=np.zeros(n),
            shape=np.arange(n) % 64,
            albedo=np.full(n, 0.2),
        )
        return rocks.select(box.contains(xyd[:, :2]) & (xyd[:, 2] >= min_diameter_m))


def straight_drive(
    length_m: float,
    terrain: Any = None,
    start: tuple[float, float] = (0.0, 0.0),
    heading: float = 0.0,
) -> BodyTruth:
    """Drive straight at 0.1 m/s, 0.35 m over the ground, with a little pitch and roll."""
    n = int(length_m * 100) + 1
    t_ns = np.arange(n, dtype=np.int64) * 100_000_000
    s = np.arange(n) * 0.01
    xy = np.array(start) + np.outer(s, [np.cos(heading), np.sin(heading)])
    z = 0.35 + (terrain.height(xy) if terrain is not None else np.zeros(n))
    rpy = np.column_stack([0.03 * np.sin(s), 0.02 * np.cos(2 * s), np.full(n, heading)])
    poses = SE3.from_rpy(rpy, np.column_stack([xy, z]))
    return BodyTruth(t_ns, poses, np.zeros((n, 3)), np.zeros((n, 3)))


def sensor(**changes: Any) -> LandmarkSensorSpec:
    """Make a sensor without noise that finds all, an image every 0.1 m."""
    quiet: dict[str, Any] = {"period_s": 1.0, "noise": QUIET, "detection_probability": 1.0}
    return LandmarkSensorSpec(**(quiet | changes))


def camera_poses(truth: BodyTruth, t_ns: Array) -> SE3:
    """Give the left eye's poses at some times of the truth."""
    rows = np.searchsorted(truth.t_ns, t_ns)
    poses: SE3 = truth.T_world_body[rows] @ CAMERA.T_body_camera.se3()
    return poses
