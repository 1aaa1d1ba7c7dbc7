"""The rocks that the cameras see: which, as what mesh, with what look."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.sensors.ground_texture import SKY_SHARE
from lpet_sim.sensors.rock_kernels import paint_rock
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks
from lpet_sim.terrain.terrain import Terrain

Floats = NDArray[np.float32]

logger = logging.getLogger(__name__)

GROUPS = 16
"""Meshes that rocks are spread over, each a compact set, so that those out of view cost nothing."""

ATLAS = 2048
"""Edge of the texture that holds all rocks' images [texels]."""

_FILL = 0.7
_SMALLEST_IMAGE, _LARGEST_IMAGE = 8, 256
_GRAIN_M = 0.035
_ROUGH = 0.10
_UNDERSIDE = -0.5


@dataclass(frozen=True)
class RockMesh:
    """A rock ready to be drawn.

    Attributes:
        corners: Corners of its triangles in the world [m], Shape (f, 3, 3).
        places: The corners' places in its image, 0 to 1, Shape (f, 3, 2).
        image: Its radiance, Shape (n, n).
    """

    corners: Array
    places: Array
    image: Floats


class RockLook:
    """Keeps painted rocks as long as they are near."""

    def __init__(self, terrain: Terrain, key: int) -> None:
        """Prepare; nothing is painted yet.

        Args:
            terrain: Where the rocks lie.
            key: What their grain is hashed with.
        """
        self._terrain, self._key = terrain, key
        self._sun = np.array(terrain.spec.sun.direction)
        self._painted: dict[tuple[int, int], RockMesh] = {}
        self._coarser: float | None = None

    def choose(
        self, boxes: Sequence[Box], min_diameters_m: Sequence[float], texels_m: Sequence[float],
        most_faces: int,
    ) -> list[RockMesh]:  # fmt: skip
        """Give the rocks of nested boxes, the largest against their texel first.

        Args:
            boxes: From the innermost out.
            min_diameters_m: Smallest rock of each box [m].
            texels_m: Texel of each box, which sets the size of the rocks' images [m].
            most_faces: How many triangles there may be.
        """
        rings = self._rings(boxes, min_diameters_m)
        if self._coarser is None:
            self._coarser = _fit_images(rings, texels_m)
        kept: dict[tuple[int, int], RockMesh] = {}
        for rocks, texel_m in zip(rings, texels_m, strict=True):
            self._paint_all(rocks, self._coarser * texel_m, kept)
        self._painted = kept
        return _within(kept, most_faces)

    def _rings(self, boxes: Sequence[Box], min_diameters_m: Sequence[float]) -> list[Rocks]:
        """Give the rocks of each box that are not in the one within."""
        rings = []
        for index, box in enumerate(boxes):
            rocks = self._terrain.rocks(box, min_diameters_m[index])
            if index:
                rocks = rocks.select(~boxes[index - 1].contains(rocks.p_world_rock[:, :2]))
            rings.append(rocks)
        return rings

    def _paint_all(
        self, rocks: Rocks, texel_m: float, kept: dict[tuple[int, int], RockMesh]
    ) -> None:
        for rows, corners, faces in rocks.meshes():
            for row, own in zip(rows, corners, strict=True):
                edge = _image_edge(float(rocks.diameter_m[row]), texel_m)
                key = (int(rocks.id[row]), edge)
                kept[key] = self._painted.get(key) or self._paint(rocks, int(row), own, faces, edge)

    def _paint(self, rocks: Rocks, row: int, corners: Array, faces: Ints, edge: int) -> RockMesh:
        """Paint one rock; a function of the rock alone."""
        origin = rocks.p_world_rock[row]
        triangles = (corners - origin)[faces]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        places = dome_places(corners - origin)[faces]
        # Undersides fold over the dome's middle: they are left out, and tops are painted last.
        order = np.argsort(normals[:, 2], kind="stable")
        order = order[normals[order, 2] > _UNDERSIDE]
        diameter, height = float(rocks.diameter_m[row]), float(rocks.height_m[row])
        image = np.zeros((edge, edge))
        paint_rock(
            image, triangles[order], places[order], normals[order],
            float(rocks.albedo[row]), height,
            min(_GRAIN_M, 0.4 * diameter), _ROUGH, self._sun, SKY_SHARE,
            (self._key + int(rocks.id[row])) & 0x7FFFFFFF,
        )  # fmt: skip
        lit = image > 0
        image[~lit] = image[lit].mean() if lit.any() else 0.05
        return RockMesh(corners[faces], places, image.astype(np.float32))


def dome_places(p: Array) -> Array:
    """Map directions from a rock's origin to the unit square: the zenith to its middle.

    ``r = sin(theta / 2) / 2`` for the angle theta from the zenith, which keeps areas; the nadir,
    always buried, is the rim.

    Args:
        p: Points relative to the origin [m], Shape (n, 3).

    Returns:
        Shape (n, 2).
    """
    length = np.maximum(np.linalg.norm(p, axis=1), 1e-12)
    r = 0.49 * np.sqrt(np.clip((1.0 - p[:, 2] / length) / 2.0, 0.0, 1.0))
    flat = np.maximum(np.hypot(p[:, 0], p[:, 1]), 1e-12)
    return 0.5 + p[:, :2] * (r / flat)[:, None]


def _image_edge(diameter_m: float, texel_m: float) -> int:
    """Choose a power of two so that a texel on the rock is about one on the ground."""
    wish = 2.0 * diameter_m / texel_m
    edge = 2 ** int(np.ceil(np.log2(max(wish, 1.0)) - 0.3))
    return int(min(max(edge, _SMALLEST_IMAGE), _LARGEST_IMAGE))


def _fit_images(rings: Sequence[Rocks], texels_m: Sequence[float]) -> float:
    """Choose how much coarser than the ground's the rocks' texels are, for all to find a place.

    It is chosen where a traverse begins and kept, so that no rock ever changes its image.
    """
    coarser = 1.0
    while coarser < 64:
        edges = [
            _image_edge(float(diameter), coarser * texel)
            for rocks, texel in zip(rings, texels_m, strict=True)
            for diameter in rocks.diameter_m
        ]
        if sum(edge**2 for edge in edges) < _FILL * ATLAS**2:
            break
        coarser *= math.sqrt(2)
    return coarser


def _within(kept: dict[tuple[int, int], RockMesh], most_faces: int) -> list[RockMesh]:
    """Give the rocks by falling size of their image, as many as there are triangles for."""
    meshes = sorted(kept.values(), key=lambda mesh: -len(mesh.image))
    total = np.cumsum([len(mesh.corners) for mesh in meshes])
    count = int(np.searchsorted(total, most_faces, side="right"))
    if count < len(meshes):
        logger.warning("%d small rocks are not drawn: raise rock_faces", len(meshes) - count)
    return meshes[:count]


def pack(sizes: Sequence[int], atlas: int) -> list[tuple[int, int] | None]:
    """Place squares of falling power-of-two sizes in a square atlas, along a Z-shaped curve.

    Args:
        sizes: Edges, not rising [texels].
        atlas: Edge of the atlas, a power of two [texels].

    Returns:
        Column and row of each; None where the atlas is full.
    """
    unit, at = _SMALLEST_IMAGE, 0
    out: list[tuple[int, int] | None] = []
    for size in sizes:
        step = (size // unit) ** 2
        if at + step > (atlas // unit) ** 2:
            out.append(None)
            continue
        out.append((unit * _even_bits(at), unit * _even_bits(at >> 1)))
        at += step
    return out


def _even_bits(code: int) -> int:
    """Gather the bits 0, 2, 4, ... of a number."""
    return sum(((code >> (2 * k)) & 1) << k for k in range(16))


def split_groups(centres: Array, weights: Ints) -> list[Ints]:
    """Split rocks into `GROUPS` compact groups of even weight, by halving along the longer side.

    Args:
        centres: Shape (n, 2) [m].
        weights: Triangles of each, Shape (n,).

    Returns:
        Row numbers of each group.
    """
    groups = [np.arange(len(centres))]
    while len(groups) < GROUPS:
        groups = [half for group in groups for half in _halved(centres, weights, group)]
    return groups


def _halved(centres: Array, weights: Ints, group: Ints) -> tuple[Ints, Ints]:
    if len(group) == 0:
        return group, group
    axis = int(np.argmax(np.ptp(centres[group], axis=0)))
    order = group[np.argsort(centres[group, axis], kind="stable")]
    load = np.cumsum(weights[order])
    cut = int(np.searchsorted(load, load[-1] / 2))
    return order[:cut], order[cut:]
