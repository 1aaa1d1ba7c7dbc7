"""What can be drawn beside the measurements: meshes, and links that move."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints


@dataclass(frozen=True, eq=False)
class Mesh:
    """A coloured triangle mesh.

    Attributes:
        vertices_m: Corners in the mesh's own frame [m], Shape (n, 3).
        faces: Corner indices, counter-clockwise seen from outside, Shape (m, 3).
        rgba: One colour, Shape (4,), or one for each corner, Shape (n, 4), uint8.
        flat: Whether its faces are seen as planes with edges (rocks, parts of the rover), not as
            one smooth surface.
    """

    vertices_m: Array
    faces: Ints
    rgba: NDArray[np.uint8]
    flat: bool = False

    def faceted(self) -> Mesh:
        """Give each face corners of its own, so that no normal is shared across an edge."""
        corners = self.faces.reshape(-1)
        rgba = np.broadcast_to(self.rgba, (len(self.vertices_m), 4))[corners]
        faces = np.arange(len(corners)).reshape(-1, 3)
        return Mesh(self.vertices_m[corners], faces, rgba)


@dataclass(frozen=True, eq=False)
class DrawnLink:
    """A rigid part of the rover.

    Attributes:
        name: The part's name; its motion is given under it.
        mesh: Its shape in its own frame; None for a part that only carries others.
        parent: The part it hangs on, "" for the body.
        T_parent_link: Its pose until it is moved.
    """

    name: str
    mesh: Mesh | None
    parent: str = ""
    T_parent_link: SE3 = field(default_factory=SE3.identity)


def join_meshes(meshes: list[Mesh]) -> Mesh:
    """Put meshes that do not move against each other into one, with the first one's shading."""
    starts = np.cumsum([0, *(len(m.vertices_m) for m in meshes)])[:-1]
    return Mesh(
        np.concatenate([m.vertices_m for m in meshes]),
        np.concatenate([m.faces + start for m, start in zip(meshes, starts, strict=True)]),
        np.concatenate([np.broadcast_to(m.rgba, (len(m.vertices_m), 4)) for m in meshes]),
        meshes[0].flat,
    )
