"""Ground and rocks as coloured meshes, for drawing in a recording."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.scene import Mesh
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks
from lpet_sim.terrain.terrain import Terrain

_DUST = np.array([206.0, 148.0, 104.0])
_STONE = np.array([138.0, 104.0, 84.0])
_SKY_SHARE = 0.35  # of the light, so that shaded ground is not black


def ground_mesh(terrain: Terrain, box: Box, nodes_max: int = 500) -> Mesh:
    """Make a mesh of the ground, coloured by albedo and shaded by the sun.

    Args:
        terrain: The terrain.
        box: What to cover [m].
        nodes_max: Most nodes along the longer side; they set the mesh's resolution.

    Returns:
        The mesh in the world.
    """
    cell_m = max(box.x_max - box.x_min, box.y_max - box.y_min) / (nodes_max - 1)
    x0, y0 = math.floor(box.x_min / cell_m), math.floor(box.y_min / cell_m)
    columns = math.ceil(box.x_max / cell_m) - x0 + 1
    rows = math.ceil(box.y_max / cell_m) - y0 + 1
    z = terrain.patch(x0, y0, (rows, columns), cell_m)
    x, y = np.meshgrid((x0 + np.arange(columns)) * cell_m, (y0 + np.arange(rows)) * cell_m)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return Mesh(vertices, _grid_faces(rows, columns), _ground_colours(terrain, vertices, cell_m))


def rocks_mesh(rocks: Rocks) -> Mesh:
    """Make one mesh of many rocks, in the world.

    Args:
        rocks: At least one rock.
    """
    vertices: list[Array] = []
    faces: list[Ints] = []
    tones: list[Array] = []
    start = 0
    for rows, corners, shape_faces in rocks.meshes():
        count, corner_count = corners.shape[:2]
        vertices.append(corners.reshape(-1, 3))
        first = start + corner_count * np.arange(count)
        faces.append((first[:, None, None] + shape_faces).reshape(-1, 3))
        tones.append(np.repeat(rocks.albedo[rows], corner_count))
        start += count * corner_count
    tone = np.concatenate(tones) / float(np.mean(rocks.albedo))
    return Mesh(np.concatenate(vertices), np.concatenate(faces), _tinted(_STONE, tone), flat=True)


def _grid_faces(rows: int, columns: int) -> Ints:
    """Split each cell into two triangles, counter-clockwise from above."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    lower = np.stack([corner, corner + 1, corner + columns + 1], axis=1)
    upper = np.stack([corner, corner + columns + 1, corner + columns], axis=1)
    return np.concatenate([lower, upper])


def _ground_colours(terrain: Terrain, vertices: Array, cell_m: float) -> NDArray[np.uint8]:
    xy = vertices[:, :2]
    light = np.maximum(terrain.normal(xy) @ np.array(terrain.spec.sun.direction), 0.0)
    flat = terrain.spec.sun.direction[2]
    shade = _SKY_SHARE + (1.0 - _SKY_SHARE) * light / flat
    return _tinted(_DUST, shade * terrain.albedo(xy, cell_m) / terrain.spec.albedo.mean)


def _tinted(rgb: Array, tone: Array) -> NDArray[np.uint8]:
    colours = np.clip(rgb * tone[:, None], 0.0, 255.0)
    return np.column_stack([colours, np.full(len(tone), 255.0)]).astype(np.uint8)
