"""Convex, faceted, irregular stones: a fixed library of shapes that rocks are scaled from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, HalfspaceIntersection

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rng import stream

_A = TypeVar("_A", bound=NDArray[Any])

SHAPE_COUNT = 64
_FEWEST_CUTS = 9
_MOST_CUTS = 18
_MERGE = 0.12


@dataclass(frozen=True)
class RockShape:
    """A convex polyhedron of unit size.

    Seen from above it covers pi/4, the area of a disc of diameter 1, and has equal second moments
    about both axes, so that stretching it by ``w`` and ``1/w`` gives exactly that axis ratio.

    Attributes:
        vertices: Corners; the centroid of the outline is at x = y = 0 and z spans [0, 1],
            Shape (v, 3).
        faces: Corners of each triangle, counter-clockwise from outside, Shape (f, 3).
        outline: Corners of the outline seen from above, counter-clockwise, Shape (o,).
        reach: Largest horizontal distance of a corner from the origin.
    """

    vertices: Array
    faces: Ints
    outline: Ints
    reach: float


@cache
def rock_shapes() -> tuple[RockShape, ...]:
    """Give the library: angular to subrounded stones of 12 to 32 corners, always the same."""
    return tuple(_cut_stone(index) for index in range(SHAPE_COUNT))


@cache
def shape_reaches() -> Array:
    """Reach of each shape in the library, Shape (SHAPE_COUNT,)."""
    return np.array([shape.reach for shape in rock_shapes()])


def _cut_stone(index: int) -> RockShape:
    """Cut a stone out of an ellipsoid by planes; more cuts make it rounder."""
    rng = stream(0, "rock shape library", index)
    cuts = int(rng.integers(_FEWEST_CUTS, _MOST_CUTS + 1))
    normals = _spread_normals(rng, cuts)
    axes = np.array([1.0, rng.uniform(0.75, 1.0), rng.uniform(0.55, 0.85)])
    ellipsoid = np.linalg.qr(rng.normal(size=(3, 3)))[0] * axes
    distances = np.linalg.norm(normals @ ellipsoid, axis=1) * rng.uniform(0.72, 1.0, cuts)
    planes = np.column_stack([normals, -distances])
    corners = HalfspaceIntersection(planes, np.zeros(3)).intersections
    return _unit_shape(_merged(corners))


def _spread_normals(rng: np.random.Generator, count: int) -> Array:
    """Draw directions that keep apart, so that the cuts close the stone on every side."""
    best, apart = rng.normal(size=(1, 3)), 0.0
    best /= np.linalg.norm(best)
    while len(best) < count:
        trial = rng.normal(size=(12, 3))
        trial /= np.linalg.norm(trial, axis=1, keepdims=True)
        closeness = (trial @ best.T).max(axis=1) + apart
        best = np.vstack([best, trial[np.argmin(closeness)]])
    return best


def _merged(corners: Array) -> Array:
    """Drop corners that nearly coincide: slivers serve neither contact nor light."""
    kept: list[Array] = []
    for corner in corners:
        if all(np.linalg.norm(corner - other) > _MERGE for other in kept):
            kept.append(corner)
    return np.array(kept)


def _unit_shape(corners: Array) -> RockShape:
    """Scale corners to unit outline area, round second moments and unit height."""
    hull = trimesh.convex.convex_hull(corners)
    vertices = np.array(hull.vertices, dtype=np.float64)
    plan = ConvexHull(vertices[:, :2])
    outline = plan.vertices.astype(np.int64)
    centre, moments = _area_moments(vertices[outline, :2])
    values, vectors = np.linalg.eigh(moments)
    flat = (vertices[:, :2] - centre) @ (vectors / np.sqrt(values)) @ vectors.T
    flat *= math.sqrt(math.pi / 4.0 / _area(flat[outline]))
    z = vertices[:, 2] - vertices[:, 2].min()
    unit = np.column_stack([flat, z / z.max()])
    reach = float(np.linalg.norm(flat, axis=1).max())
    return RockShape(_frozen(unit), _frozen(_outward(unit, hull.faces)), _frozen(outline), reach)


def _outward(vertices: Array, faces: NDArray[np.integer]) -> Ints:
    """Turn triangles so that they run counter-clockwise from outside."""
    out = np.array(faces, dtype=np.int64)
    a, b, c = (vertices[out[:, i]] for i in range(3))
    inward = np.sum(np.cross(b - a, c - a) * (a - vertices.mean(axis=0)), axis=1) < 0.0
    out[inward] = out[inward][:, ::-1]
    return out


def _area(polygon: Array) -> float:
    x, y = polygon.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def _area_moments(polygon: Array) -> tuple[Array, Array]:
    """Centroid and central second moments of a polygon's area, by the shoelace sums."""
    here, after = polygon, np.roll(polygon, -1, axis=0)
    cross = here[:, 0] * after[:, 1] - after[:, 0] * here[:, 1]
    area = 0.5 * cross.sum()
    centre = ((here + after) * cross[:, None]).sum(axis=0) / (6.0 * area)
    both = here + after
    second = np.einsum("n,ni,nj->ij", cross, both, both)
    second += np.einsum("n,ni,nj->ij", cross, here, here)
    second += np.einsum("n,ni,nj->ij", cross, after, after)
    return centre, second / (24.0 * area) - np.outer(centre, centre)


def _frozen(array: _A) -> _A:
    array.flags.writeable = False
    return array
