"""What can be drawn beside the measurements: meshes, and links that move."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints


@dataclass(frozen=True, eq=False)
class Mesh:
    """A coloured triangle mesh.

    Attributes:
        vertices_m: Corners in the mesh's own frame [m], Shape (n, 3).
        faces: Corner indices, counter-clockwise seen from outside, Shape (m, 3).
        rgba: One colour, Shape (4,), or one for each corner, Shape (n, 4), uint8.
    """

    vertices_m: Array
    faces: Ints
    rgba: NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class DrawnLink:
    """A rigid part of the rover.

    Attributes:
        name: The part's name; its motion is given under it.
        mesh: Its shape in its own frame.
        parent: The part it hangs on, "" for the body frame.
    """

    name: str
    mesh: Mesh
    parent: str = ""


def join_meshes(meshes: list[Mesh]) -> Mesh:
    """Put meshes that do not move against each other into one."""
    starts = np.cumsum([0, *(len(m.vertices_m) for m in meshes)])[:-1]
    return Mesh(
        np.concatenate([m.vertices_m for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=True)]),
        np.concatenate([np.broadcast_to(m.rgba, (len(m.vertices_m), 4)) for m in meshes]),
    )
