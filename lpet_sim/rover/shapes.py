"""Triangles of the shapes that a rover's model draws."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rover.mjcf import geom_kind

_SIDES, _RINGS = 24, 6
_GREY = np.array([0.5, 0.5, 0.5, 1.0], dtype=np.float32)


@dataclass(frozen=True)
class LinkMesh:
    """A shape on a link.

    Attributes:
        vertices: In the link [m], Shape (v, 3).
        faces: Triangles, outward, Shape (f, 3).
        rgba: Colour, 0..1, Shape (4,).
    """

    vertices: Array
    faces: Ints
    rgba: NDArray[np.float32]


def drawn_shape(model: Any, geom: int) -> LinkMesh:
    """Make the mesh of a geom of a compiled model, in its link.

    Raises:
        UnknownNameError: It is of a kind that is not drawn.
    """
    vertices, faces = _shape(model, geom)
    T_link_geom = SE3.from_quat_wxyz(model.geom_quat[geom], model.geom_pos[geom])
    return LinkMesh(T_link_geom @ vertices, faces, _colour(model, geom))


def _colour(model: Any, geom: int) -> NDArray[np.float32]:
    """Give the geom's colour or, where it leaves it at MuJoCo's grey, that of its material."""
    material, rgba = int(model.geom_matid[geom]), model.geom_rgba[geom]
    if material >= 0 and np.array_equal(rgba, _GREY):
        rgba = model.mat_rgba[material]
    return np.array(rgba, dtype=np.float32)


def _shape(model: Any, geom: int) -> tuple[Array, Ints]:
    size, kind = model.geom_size[geom], geom_kind(model, geom)
    if kind == "mesh":
        return _mesh(model, int(model.geom_dataid[geom]))
    if kind == "box":
        return _box(size)
    if kind == "cylinder":
        return _cylinder(size[0], size[1])
    if kind == "capsule":
        return _round(np.array([size[0]] * 3), size[1])
    return _round(np.array([size[0]] * 3) if kind == "sphere" else np.array(size), 0.0)


def _mesh(model: Any, mesh: int) -> tuple[Array, Ints]:
    """Give a mesh as compiled: moved to its centre of mass, as the geom's pose takes account of."""
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    vertices = np.array(model.mesh_vert[first : first + count], dtype=float)
    return vertices, np.array(model.mesh_face[face : face + faces], dtype=np.int64)


def _box(half: Array) -> tuple[Array, Ints]:
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def _cylinder(radius: float, half_length: float) -> tuple[Array, Ints]:
    """Give a closed cylinder about z: two rings, then the centres of bottom and top."""
    angle = np.arange(_SIDES) * 2 * np.pi / _SIDES
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    low = np.column_stack([ring, np.full(_SIDES, -half_length)])
    high = np.column_stack([ring, np.full(_SIDES, half_length)])
    i, j = np.arange(_SIDES), (np.arange(_SIDES) + 1) % _SIDES
    bottom, top = np.full(_SIDES, 2 * _SIDES), np.full(_SIDES, 2 * _SIDES + 1)
    parts = [
        (i, j, j + _SIDES),
        (i, j + _SIDES, i + _SIDES),
        (bottom, j, i),
        (top, i + _SIDES, j + _SIDES),
    ]
    faces = np.concatenate([np.stack(part, axis=1) for part in parts])
    caps = np.array([[0.0, 0.0, -half_length], [0.0, 0.0, half_length]])
    return np.concatenate([low, high, caps]), faces


def _round(radii: Array, half_length: float) -> tuple[Array, Ints]:
    """Give an ellipsoid, its halves drawn apart along z by a half length each: a capsule's caps."""
    latitude = np.linspace(-np.pi / 2, np.pi / 2, 2 * _RINGS)
    angle = np.arange(_SIDES) * 2 * np.pi / _SIDES
    x, y = np.outer(np.cos(latitude), np.cos(angle)), np.outer(np.cos(latitude), np.sin(angle))
    z = np.repeat(np.sin(latitude)[:, None], _SIDES, axis=1)
    vertices = np.stack([x, y, z], axis=-1) * radii
    vertices[..., 2] += np.sign(latitude)[:, None] * half_length
    row, i = np.meshgrid(np.arange(2 * _RINGS - 1), np.arange(_SIDES), indexing="ij")
    a, b = row * _SIDES + i, row * _SIDES + (i + 1) % _SIDES
    faces = [np.stack([a, b, b + _SIDES], -1), np.stack([a, b + _SIDES, a + _SIDES], -1)]
    return vertices.reshape(-1, 3), np.concatenate([part.reshape(-1, 3) for part in faces])
