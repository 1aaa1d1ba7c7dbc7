from __future__ import annotations

import numpy as np
import pytest
import trimesh

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rock_shapes import RockShape, rock_shapes, shape_reaches
from lpet_sim.terrain.rock_spec import RockAbundanceSpec
from lpet_sim.terrain.rocks import BURIED_FRACTION, HEIGHT_RATIO, WIDTH_RATIO, RockField, Rocks


def slope(xy: Array) -> Array:
    """Ground that rises to the north-east."""
    return 0.1 * xy[:, 0] + 0.05 * xy[:, 1]


@pytest.fixture(scope="module")
def rocks() -> Rocks:
    """Some hundred rocks of all sizes."""
    return RockField(RockAbundanceSpec(k=0.19), 3, slope).query(Box(0, 0, 8, 8))


def shoelace(polygon: Array) -> float:
    """Signed area of a polygon."""
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def assert_convex_and_closed(vertices: Array, faces: Array) -> None:
    """Hold every corner behind every face, and the surface to being watertight."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    size = np.ptp(vertices, axis=0).max()
    above = np.einsum("fi,vfi->vf", normals, vertices[:, None, :] - a[None])
    assert above.max() < 1e-9 * size
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0.0


@pytest.mark.parametrize("shape", rock_shapes())
def test_every_shape_is_a_closed_convex_faceted_stone(shape: RockShape) -> None:
    """12 to 40 corners, 20 to 60 outward triangles, all on the hull."""
    assert_convex_and_closed(shape.vertices, shape.faces)
    assert 12 <= len(shape.vertices) <= 40 and 20 <= len(shape.faces) <= 60
    assert shoelace(shape.vertices[shape.outline, :2]) == pytest.approx(np.pi / 4, rel=1e-9)
    assert np.ptp(shape.vertices[:, 2]) == pytest.approx(1.0)


def test_no_two_shapes_are_alike() -> None:
    """Their volumes differ, and spread by more than rounding."""
    volumes = [trimesh.Trimesh(s.vertices, s.faces, process=False).volume for s in rock_shapes()]
    assert len(np.unique(np.round(volumes, 6))) == len(volumes)
    assert np.std(volumes) > 0.02


def test_reach_bounds_every_corner(rocks: Rocks) -> None:
    """No corner of a mesh leaves the disc that placement kept clear, which is under 0.85 D."""
    for rows, corners, _ in rocks.meshes():
        offsets = corners[:, :, :2] - rocks.p_world_rock[rows, None, :2]
        radius = np.linalg.norm(offsets, axis=2).max(axis=1)
        assert np.all(radius <= rocks.reach_m[rows] * (1 + 1e-12))
    assert shape_reaches().max() / np.sqrt(WIDTH_RATIO[0]) < 0.85


def test_rock_meshes_are_convex_with_outward_faces(rocks: Rocks) -> None:
    """Stretch, yaw and burial keep the polyhedra convex, closed and right side out."""
    for k in range(0, len(rocks), 5):
        assert_convex_and_closed(*rocks.mesh(k))


def test_rocks_are_as_wide_and_as_high_as_declared(rocks: Rocks) -> None:
    """The outline covers pi D^2 / 4; the top stands height_m above the ground."""
    outlines = rocks.outlines()
    for k in range(0, len(rocks), 5):
        vertices, _ = rocks.mesh(k)
        assert shoelace(outlines[k]) == pytest.approx(np.pi / 4 * rocks.diameter_m[k] ** 2)
        assert vertices[:, 2].max() == pytest.approx(rocks.height_m[k])
        assert -vertices[:, 2].min() / np.ptp(vertices[:, 2]) == pytest.approx(
            rocks.buried_fraction[k]
        )


def test_proportions_are_those_of_the_field(rocks: Rocks) -> None:
    """Height near D / 2, half buried, and each inside its range."""
    ratio = rocks.height_m / rocks.diameter_m
    for value, limits in (
        (ratio, HEIGHT_RATIO),
        (rocks.buried_fraction, BURIED_FRACTION),
        (rocks.width_ratio, WIDTH_RATIO),
    ):
        assert value.min() >= limits[0] and value.max() <= limits[1]
        assert value.mean() == pytest.approx(np.mean(limits), abs=0.02)


def test_width_ratio_and_yaw_are_those_of_the_outline(rocks: Rocks) -> None:
    """Principal axes of the outline's area, by triangulating it, give back ratio and yaw."""
    k = int(np.argmin(rocks.width_ratio))
    polygon = rocks.outlines()[k] - rocks.p_world_rock[k, :2]
    after = np.roll(polygon, -1, axis=0)
    weight = polygon[:, 0] * after[:, 1] - after[:, 0] * polygon[:, 1]
    pairs = [(polygon, polygon), (after, after), (polygon + after, polygon + after)]
    moments = sum(np.einsum("n,ni,nj->ij", weight, a, b) for a, b in pairs)
    values, vectors = np.linalg.eigh(moments)
    assert np.sqrt(values[0] / values[1]) == pytest.approx(rocks.width_ratio[k], rel=1e-9)
    along = vectors[:, 1] @ [np.cos(rocks.yaw_rad[k]), np.sin(rocks.yaw_rad[k])]
    assert abs(along) == pytest.approx(1.0, rel=1e-9)


def test_rocks_stand_on_the_ground(rocks: Rocks) -> None:
    """The mesh's origin is at the ground's height."""
    np.testing.assert_array_equal(rocks.p_world_rock[:, 2], slope(rocks.p_world_rock[:, :2]))


def test_batched_meshes_equal_single_ones(rocks: Rocks) -> None:
    """All polyhedra at once are those given one by one."""
    for rows, corners, faces in rocks.meshes():
        vertices, one = rocks.mesh(int(rows[0]))
        np.testing.assert_allclose(corners[0] - rocks.p_world_rock[rows[0]], vertices, atol=1e-12)
        np.testing.assert_array_equal(faces, one)
