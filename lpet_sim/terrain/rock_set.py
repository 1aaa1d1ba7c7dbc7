"""The rocks of a box as arrays, and their meshes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.rock_shapes import rock_shapes, shape_reaches


@dataclass(frozen=True)
class Rocks:
    """Rocks of a box, as read-only arrays; `mesh` gives the polyhedron of one.

    Attributes:
        id: Identity, the same whichever box asks, Shape (n,).
        p_world_rock: Where the rock's axis meets the ground; the mesh's origin [m], Shape (n, 3).
        diameter_m: Diameter of the disc of equal area seen from above [m], Shape (n,).
        height_m: Height above the ground at `p_world_rock` [m], Shape (n,).
        buried_fraction: Share of the rock's full height that is below ground, Shape (n,).
        width_ratio: Width over length seen from above, Shape (n,).
        yaw_rad: Direction of the longer axis, from x towards y [rad], Shape (n,).
        shape: Index into `rock_shapes.rock_shapes()`, Shape (n,).
        albedo: Albedo of the rock's surface in 0..1, Shape (n,).
    """

    id: Ints
    p_world_rock: Array
    diameter_m: Array
    height_m: Array
    buried_fraction: Array
    width_ratio: Array
    yaw_rad: Array
    shape: Ints
    albedo: Array

    def __post_init__(self) -> None:
        """Make every array read-only."""
        for array in self.arrays().values():
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.id)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Give the arrays by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def select(self, which: NDArray[Any]) -> Rocks:
        """Give the rocks that a mask or an index array picks."""
        return Rocks(**{name: array[which] for name, array in self.arrays().items()})

    @property
    def depth_m(self) -> Array:
        """How far the lowest corner lies below `p_world_rock` [m], Shape (n,)."""
        return self.height_m * self.buried_fraction / (1.0 - self.buried_fraction)

    @property
    def reach_m(self) -> Array:
        """Radius of a disc about the rock that no corner leaves, seen from above [m], (n,)."""
        return shape_reaches()[self.shape] * self.diameter_m / np.sqrt(self.width_ratio)

    @property
    def A_world_shape(self) -> Array:
        """Linear map of a unit shape's corners to world axes [m], Shape (n, 3, 3).

        ``A = R_z(yaw) diag(D / sqrt(w), D sqrt(w), height + depth)``: outline area pi D^2 / 4.
        """
        cos, sin = np.cos(self.yaw_rad), np.sin(self.yaw_rad)
        length = self.diameter_m / np.sqrt(self.width_ratio)
        width = self.diameter_m * np.sqrt(self.width_ratio)
        A = np.zeros((len(self), 3, 3))
        A[:, 0, 0], A[:, 0, 1] = cos * length, -sin * width
        A[:, 1, 0], A[:, 1, 1] = sin * length, cos * width
        A[:, 2, 2] = self.height_m + self.depth_m
        return A

    def mesh(self, k: int) -> tuple[Array, Ints]:
        """Give the convex polyhedron of one rock.

        Args:
            k: Row of the rock.

        Returns:
            Corners relative to ``p_world_rock[k]`` in world axes [m], Shape (v, 3), and triangles
            as rows of corners, counter-clockwise from outside, Shape (f, 3).
        """
        shape = rock_shapes()[int(self.shape[k])]
        one = self.select(np.array([k]))
        corners = shape.vertices @ one.A_world_shape[0].T
        return corners - [0.0, 0.0, one.depth_m[0]], shape.faces

    def meshes(self) -> Iterator[tuple[Ints, Array, Ints]]:
        """Give all polyhedra, the rocks of one shape at a time.

        Yields:
            Rows of the rocks, Shape (m,); their corners in the world [m], Shape (m, v, 3); and
            the triangles that they share, Shape (f, 3).
        """
        A, origin = self.A_world_shape, self.p_world_rock - np.outer(self.depth_m, [0.0, 0.0, 1.0])
        for index in np.unique(self.shape):
            rows = np.flatnonzero(self.shape == index)
            shape = rock_shapes()[int(index)]
            corners = np.einsum("nij,vj->nvi", A[rows], shape.vertices)
            yield rows, corners + origin[rows, None, :], shape.faces

    def outlines(self) -> list[Array]:
        """Give each rock's outline seen from above, counter-clockwise [m], each Shape (o, 2)."""
        out: list[Array] = [np.empty((0, 2))] * len(self)
        for rows, corners, _ in self.meshes():
            outline = rock_shapes()[int(self.shape[rows[0]])].outline
            for row, polygon in zip(rows, corners[:, outline, :2], strict=True):
                out[row] = polygon
        return out
