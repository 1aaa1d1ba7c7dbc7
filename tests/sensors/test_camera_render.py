"""The rendered pair: exact intrinsics, no cracks, no swimming, no bias."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lpet_sim.geometry import SE3
from lpet_sim.sensors.camera import StereoRenderer, make_eyes, place_eyes
from lpet_sim.sensors.camera_spec import GroundDetailSpec, StereoCameraSpec
from lpet_sim.sensors.render_layout import MeshLayout
from lpet_sim.sensors.render_scene import RenderScene
from lpet_sim.sensors.sky import sky_coefficients, sky_radiance
from lpet_sim.terrain.spec import ReliefSpec, RockAbundanceSpec, SunSpec, TerrainSpec
from lpet_sim.terrain.terrain import Terrain, build_terrain

COARSE = GroundDetailSpec(texel_m=0.0125, tile_texels=128, levels=5, rock_faces=4000)
SMALL = StereoCameraSpec(width_px=160, height_px=120, focal_px=125.0, ground=COARSE)
MOUNT = SE3(
    # Forward and 25 deg down.
    np.array(
        [
            [0.0, -math.sin(0.44), math.cos(0.44)],
            [-1.0, 0.0, 0.0],
            [0.0, -math.cos(0.44), -math.sin(0.44)],
        ]
    ),
    np.array([0.3, 0.07, 1.5]),
)


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    """Rough ground with rocks."""
    relief = ReliefSpec(rms_slope_rad=0.1)
    return build_terrain(TerrainSpec(relief=relief, rocks=RockAbundanceSpec(k=0.07)), seed=4)


def on_ground(terrain: Terrain, x: float, y: float = 0.0, yaw: float = 0.0) -> SE3:
    """Set the body level on the ground."""
    z = terrain.height(np.array([[x, y]]))[0]
    return SE3.from_rpy([0.0, 0.0, yaw], [x, y, z])


def discs(
    centres: np.ndarray, R_draw_camera: np.ndarray, radii: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Make discs that face the camera: corners and triangles."""
    angle = np.linspace(0, 2 * np.pi, 33)[:-1]
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(32)], axis=1)
    ring = np.vstack([np.zeros(3), ring])
    corners = centres[:, None] + radii[:, None, None] * (ring @ R_draw_camera.T)
    k = np.arange(32)
    fan = np.stack([np.zeros(32, int), 1 + (k + 1) % 32, 1 + k], axis=1)
    faces = (33 * np.arange(len(centres))[:, None, None] + fan).reshape(-1, 3)
    return corners.reshape(-1, 3), faces


@pytest.mark.parametrize("offset", [0.0, 0.37])
def test_points_are_drawn_where_the_calibration_projects_them(offset: float) -> None:
    """Centroids of discs over the whole field, both eyes, lie within 0.1 px of the projection."""
    spec = StereoCameraSpec(
        width_px=640, height_px=480, focal_px=502.5, cx_px=311.3 + offset, cy_px=247.1
    )
    T_world_body = SE3.from_rpy([0.1, -0.2, 2.0], [3.2, -1.7, 0.4])
    left, right = (T_world_body @ pose for pose in place_eyes(spec, MOUNT))
    calibration = spec.declared_calibration(MOUNT)
    u, v = np.meshgrid(np.linspace(8, 680, 13), np.linspace(8, 471, 9))
    z = np.repeat(np.random.default_rng(0).uniform(1.8, 30.0, 9), 13)
    x = (u.ravel() - calibration.cx_px) / calibration.focal_px * z
    y = (v.ravel() - calibration.cy_px) / calibration.focal_px * z
    points = np.stack([x, y, z], axis=1)
    corners, faces = discs(left @ points, left.rotation, 5.0 * z / calibration.focal_px)
    scene = RenderScene(make_eyes(spec), [MeshLayout(len(corners), faces, 0)], [2], 2)
    scene.upload_tile(0, 0, 0, [np.full((n, n), 50_000, np.uint16) for n in (2, 1)])
    scene.upload_mesh(0, corners, np.full((len(corners), 2), 0.5))
    expected = calibration.project(points)
    for eye, (pose, column) in enumerate(((left, 0), (right, 1))):
        samples = scene.draw(eye, pose, np.array([True]))
        image = samples[::-1].astype(float).reshape(480, 2, 640, 2).mean(axis=(1, 3))
        places = expected[:, [column, 2]]
        places = places[(places[:, 0] > 7) & (places[:, 0] < 632)]
        assert places[:, 0].min() < 60
        assert places[:, 0].max() > 580
        error = np.array([centroid(image, *place) for place in places]) - places
        assert np.abs(error).max() < 0.1, eye
        assert np.abs(error.mean(axis=0)).max() < 0.01, eye
    scene.close()


def centroid(image: np.ndarray, u: float, v: float) -> tuple[float, float]:
    """Give the centre of light within 7 px of a place, which must hold a whole disc."""
    i, j = np.mgrid[round(v) - 7 : round(v) + 8, round(u) - 7 : round(u) + 8]
    inside = (i >= 0) & (i < image.shape[0]) & (j >= 0) & (j < image.shape[1])
    weight = np.where(inside, image[np.clip(i, 0, 479), np.clip(j, 0, 639)], 0.0)
    assert weight.sum() > 0
    return float((weight * j).sum() / weight.sum()), float((weight * i).sum() / weight.sum())


def test_depth_leads_back_to_the_ground(terrain: Terrain) -> None:
    """Pixel and depth, through mount and pose, give points on the terrain: a few mm off it."""
    flat = build_terrain(TerrainSpec(relief=ReliefSpec(rms_slope_rad=0.1)), seed=4)
    T_world_body = on_ground(flat, 812.3, -431.2, 0.7)
    with StereoRenderer(flat, SMALL, MOUNT) as renderer:
        depth = renderer.depth(T_world_body)
    calibration = SMALL.true_calibration(MOUNT)
    v, u = np.mgrid[:120, :160].astype(float)
    z = depth.astype(float)
    disparity = calibration.focal_px * calibration.baseline_m / z
    near = z < 4.0
    stereo = np.stack([u, u - disparity, v], axis=-1)[near]
    points = (T_world_body @ MOUNT) @ calibration.triangulate(stereo)
    off = points[:, 2] - flat.height(points[:, :2])
    assert near.sum() > 4000
    assert np.median(np.abs(off)) < 0.002
    assert np.abs(off).max() < 0.04


def test_there_are_no_cracks_between_the_levels(terrain: Terrain) -> None:
    """Looking down at the ground no sample shows the sky, at several places."""
    down = SE3(np.array([[0.0, -1.0, 0], [-1.0, 0, 0], [0, 0, -1.0]]), np.array([0, 0, 30.0]))
    spec = SMALL.model_copy(update={"focal_px": 60.0})
    with StereoRenderer(terrain, spec, down) as renderer:
        for x in (0.0, 2.9):
            pose = on_ground(terrain, x) @ down
            assert renderer._view.draw(0, pose).min() > 0


def test_the_same_drive_gives_the_same_pairs_to_the_bit(terrain: Terrain) -> None:
    """Two renderers agree; another place differs."""
    pairs = []
    for _ in range(2):
        with StereoRenderer(terrain, SMALL, MOUNT) as renderer:
            pairs.append([renderer.render(on_ground(terrain, x)) for x in (0.0, 0.5)])
    np.testing.assert_array_equal(pairs[0], pairs[1])
    assert np.any(pairs[0][0][0] != pairs[0][1][0])


def test_near_ground_does_not_change_when_the_levels_move(terrain: Terrain) -> None:
    """The same view with windows centred elsewhere: near pixels are the same."""
    here, before = on_ground(terrain, 11.13), on_ground(terrain, 10.7)
    with StereoRenderer(terrain, SMALL, MOUNT) as renderer:
        direct = renderer.render(here)[0]
        first = renderer._view._window(0).first
    with StereoRenderer(terrain, SMALL, MOUNT) as renderer:
        renderer.render(before)
        renderer._view._windows[0].first
        came = renderer.render(here)[0]
        second = renderer._view._window(0).first
        depth = renderer.depth(here)
    assert first != second
    near = depth < 3.0
    assert near.sum() > 2000
    assert np.abs(direct - came)[near].max() < 2e-4


def test_left_and_right_see_one_world(terrain: Terrain) -> None:
    """The right image, read at u - f b / z, is the left one but for what filtering leaves."""
    with StereoRenderer(terrain, SMALL, MOUNT) as renderer:
        left, right = renderer.render(on_ground(terrain, 0.0))
        depth = renderer.depth(on_ground(terrain, 0.0))
    calibration = SMALL.true_calibration(MOUNT)
    v, u = np.mgrid[30:115, 40:150]
    disparity = calibration.focal_px * calibration.baseline_m / depth[v, u]
    at = u - disparity
    k = np.floor(at).astype(int)
    part = at - k

    def mismatch(shift_px: float) -> float:
        a = part + shift_px
        read = (1 - a) * right[v, k] + a * right[v, k + 1]
        return float(np.median(np.abs(read - left[v, u])))

    errors = {shift: mismatch(shift) for shift in (-0.3, 0.0, 0.3)}
    assert errors[0.0] < 0.8 * min(errors[-0.3], errors[0.3])


def test_the_sky_is_brightest_around_the_sun() -> None:
    """Towards the sun more than away from it, at the horizon more than above."""
    sky = sky_coefficients(SunSpec(azimuth_rad=0.0, elevation_rad=0.5))

    def at(azimuth: float, elevation: float) -> float:
        level = SE3.from_rpy([0.0, 0.0, azimuth], [0.0, 0.0, 0.0]).rotation
        camera = level @ np.array([[0.0, 0, 1], [-1.0, 0, 0], [0, -1.0, 0]])
        return float(sky_radiance(camera, 0.0, -math.tan(elevation), sky))

    assert at(0.0, 0.5) > at(1.0, 0.5) > at(3.1, 0.5)
    assert at(3.1, 0.0) > at(3.1, 0.5)
