"""What a render scene is made of: eyes and the layout of meshes."""

from __future__ import annotations

from dataclasses import dataclass

from lpet_sim.recording.arrays import Ints


@dataclass(frozen=True)
class MeshLayout:
    """A mesh whose corners may move but whose triangles stay.

    Attributes:
        corners: How many corners it has.
        faces: Triangles, counter-clockwise from outside, Shape (f, 3).
        texture: Index of its texture.
    """

    corners: int
    faces: Ints
    texture: int


@dataclass(frozen=True)
class Eye:
    """One pinhole camera; pixel (0, 0) is the centre of the first pixel.

    Attributes:
        width_px: Image width.
        height_px: Image height.
        focal_px: Focal length [px].
        cx_px: Principal point along u [px].
        cy_px: Principal point along v [px].
    """

    width_px: int
    height_px: int
    focal_px: float
    cx_px: float
    cy_px: float
