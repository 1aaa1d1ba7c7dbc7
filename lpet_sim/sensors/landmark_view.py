"""Which landmarks a pair of images shows, and where: field of view, range, incidence, occlusion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.sensors.landmark_far import FarField, pick_highest
from lpet_sim.sensors.landmark_field import FAR, LandmarkField, Landmarks
from lpet_sim.sensors.landmark_occluders import Occluders, OccluderSource
from lpet_sim.sensors.landmark_sight_line import hidden_by_ground, hidden_by_rocks
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec, VisibilitySpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.terrain import Terrain

BLOCK_M = 40.0
"""Size of the box of places whose landmarks and occluders are gathered at once [m]: memory stays
flat over a long drive."""

_EDGE_M = 0.5


@dataclass(frozen=True)
class ShownImage:
    """The landmarks that one pair of images shows, as they truly project.

    Attributes:
        landmarks: All landmarks gathered around.
        rows: Those that are shown, the strongest first, Shape (m,).
        stereo_px: Their true (u_left, u_right, v) [px], Shape (m, 3).
    """

    landmarks: Landmarks
    rows: Ints
    stereo_px: Array


class LandmarkView:
    """A stereo pair that looks at the landmarks of a terrain."""

    def __init__(
        self, terrain: Terrain, camera: StereoCalibration, spec: LandmarkSensorSpec, seed: int
    ) -> None:
        """Prepare the view; nothing is gathered yet.

        Args:
            terrain: What carries the landmarks, and hides them.
            camera: The pair as it truly is.
            spec: Where landmarks are, and what is seen of them.
            seed: The run's seed.
        """
        self._spec, self._camera = spec.visibility, camera
        self._field = LandmarkField(terrain, spec.field, seed)
        self._far = FarField(terrain, spec.field, seed)
        rock_min_m, near_m = spec.field.rock_min_diameter_m, spec.visibility.range_max_m
        self._occluders = OccluderSource(terrain, near_m, self._far.reach_m, rock_min_m)

    def look(self, T_world_camera: SE3) -> Iterator[ShownImage]:
        """Look from each of some places, and yield what is shown.

        Args:
            T_world_camera: Poses of the left eye, Shape (n,).
        """
        xy = T_world_camera.translation[:, :2]
        for begin, end in blocks(xy):
            block = self._gathered(xy[begin:end])
            for n in range(begin, end):
                yield block.show(T_world_camera.rotation[n], T_world_camera.translation[n])

    def _gathered(self, xy: Array) -> _Block:
        """Gather all that can be seen, or can hide, from some places."""
        box = _box_around(xy)
        far = self._far.near(box)
        near = self._field.near(box.grown(self._spec.range_max_m))
        distance, _ = cKDTree(xy).query(near.p_world[:, :2])
        near = near.select(distance <= _reach_m(near, self._spec))
        both = near.joined(far.landmarks)
        # By strength: an image that shows enough need not look at the rest.
        order = np.lexsort((both.id, -both.strength))
        place = np.empty(len(order), np.int64)
        place[order] = np.arange(len(order))
        landmarks, rows = both.select(order), place[len(near) :]
        stations = (rows, far.station, far.lattice, far.first_cell_m)
        occluders = self._occluders.around(box)
        return _Block(landmarks, stations, occluders, self._spec, self._camera)


class _Block:
    """The landmarks and occluders around some places, as the kernel takes them."""

    def __init__(
        self,
        landmarks: Landmarks,
        stations: tuple[Ints, Ints, Array, float],
        occluders: Occluders,
        spec: VisibilitySpec,
        camera: StereoCalibration,
    ) -> None:
        n = len(landmarks)
        far = landmarks.kind == FAR
        self._landmarks, self._stations, self._occlusion = landmarks, stations, spec.occlusion
        self._points = (landmarks.p_world, landmarks.normal, far, _reach_m(landmarks, spec))
        self._allowed = np.ones(n, np.bool_)
        self._camera = _camera_row(camera)
        limits = (spec.border_px, spec.range_min_m, math.cos(spec.incidence_max_rad))
        self._limits = np.array(limits)
        self._ground = (occluders.levels, occluders.z)
        self._rocks = (
            occluders.rocks,
            occluders.plane_start,
            occluders.planes,
            occluders.grid,
            occluders.cell_start,
            occluders.cell_rocks,
        )
        most = n if spec.sightings_max is None else min(spec.sightings_max, n)
        self._rows, self._px = np.empty(most, np.int64), np.empty((most, 3))

    def show(self, R_world_camera: Array, p_world_camera: Array) -> ShownImage:
        """Look from one place in the block."""
        R, eye = np.ascontiguousarray(R_world_camera), np.ascontiguousarray(p_world_camera)
        pick_highest(self._points[0], *self._stations, eye, self._allowed)
        count = _show(
            R,
            eye,
            self._camera,
            self._limits,
            self._points,
            self._allowed,
            self._ground,
            self._rocks,
            self._occlusion,
            self._rows,
            self._px,
        )
        return ShownImage(self._landmarks, self._rows[:count].copy(), self._px[:count].copy())


@njit(cache=True, nogil=True)
def _project(p, R, eye, camera, border, out):  # type: ignore[no-untyped-def]
    """Project a landmark into both eyes, and tell whether both images hold it."""
    dx, dy, dz = p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]
    z = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
    if z <= 1e-6:
        return False
    x = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
    y = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
    out[0] = camera[0] * x / z + camera[1]
    out[1] = out[0] - camera[0] * camera[3] / z
    out[2] = camera[0] * y / z + camera[2]
    right, bottom = camera[4] - 1.0 - border, camera[5] - 1.0 - border
    return border <= out[1] and out[0] <= right and border <= out[2] <= bottom


@njit(cache=True, nogil=True)
def _faces(p, normal, eye, reach, limits):  # type: ignore[no-untyped-def]
    """Tell whether a near landmark is in range and its surface is not seen too flatly."""
    dx, dy, dz = eye[0] - p[0], eye[1] - p[1], eye[2] - p[2]
    distance = math.sqrt(dx * dx + dy * dy + dz * dz)
    if distance < limits[1] or distance > reach:
        return False
    return normal[0] * dx + normal[1] * dy + normal[2] * dz >= limits[2] * distance


@njit(cache=True, nogil=True)
def _is_free(p, eye, far, ground, rocks):  # type: ignore[no-untyped-def]
    """Tell whether neither ground nor rocks hide a landmark from an eye."""
    if hidden_by_ground(ground[0], ground[1], eye, p, far):
        return False
    table, plane_start, planes, grid, cell_start, cell_rocks = rocks
    return not hidden_by_rocks(table, plane_start, planes, grid, cell_start, cell_rocks, eye, p)


@njit(cache=True, nogil=True)
def _show(  # type: ignore[no-untyped-def]
    R, eye, camera, limits, points, allowed, ground, rocks, occlusion, rows, px
):
    """Find the first landmarks that both eyes see, as many as `rows` holds; give their number."""
    p_world, normal, far, reach = points
    right_eye = eye + camera[3] * R[:, 0]
    here = np.empty(3)
    count = 0
    for i in range(len(p_world)):
        if count == len(rows):
            break
        p = p_world[i]
        if not allowed[i] or not (far[i] or _faces(p, normal[i], eye, reach[i], limits)):
            continue
        if not _project(p, R, eye, camera, limits[0], here):
            continue
        if occlusion and not (
            _is_free(p, eye, far[i], ground, rocks)
            and _is_free(p, right_eye, far[i], ground, rocks)
        ):
            continue
        rows[count] = i
        px[count] = here
        count += 1
    return count


def _camera_row(camera: StereoCalibration) -> Array:
    """Give (f, cx, cy, baseline, width, height), Shape (6,)."""
    pinhole = (camera.focal_px, camera.cx_px, camera.cy_px, camera.baseline_m)
    return np.array([*pinhole, camera.width_px, camera.height_px], dtype=np.float64)


def _box_around(xy: Array) -> Box:
    low, high = xy.min(axis=0) - _EDGE_M, xy.max(axis=0) + _EDGE_M
    return Box(*(float(value) for value in (*low, *high)))


def _reach_m(landmarks: Landmarks, spec: VisibilitySpec) -> Array:
    """Give how far each landmark is seen [m], Shape (n,); far ones without limit."""
    near = np.full(len(landmarks), spec.range_max_m)
    if spec.range_exponent > 0:
        own = spec.range_full_m * (1.0 - landmarks.fading) ** (-1.0 / spec.range_exponent)
        near = np.minimum(near, own)
    return np.where(landmarks.kind == FAR, np.inf, near)


def blocks(xy: Array) -> Iterator[tuple[int, int]]:
    """Cut places into runs that each fit into a box of `BLOCK_M`.

    Args:
        xy: Places in order [m], Shape (n, 2).

    Yields:
        First place of a run, and the one after its last.
    """
    begin = 0
    low = high = xy[0] if len(xy) else np.zeros(2)
    for n in range(len(xy)):
        low, high = np.minimum(low, xy[n]), np.maximum(high, xy[n])
        if np.any(high - low > BLOCK_M):
            yield begin, n
            begin, low, high = n, xy[n], xy[n]
    if len(xy):
        yield begin, len(xy)
