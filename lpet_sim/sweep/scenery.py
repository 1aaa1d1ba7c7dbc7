"""What is drawn of a simulated traverse beside its streams: ground, rocks and the moving rover."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.outputs import output_folder
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.scene import DrawnLink, Mesh, join_meshes
from lpet_sim.recording.truth import Truth, WheelTruth
from lpet_sim.recording.writer import RecordingWriter
from lpet_sim.rover.drawing import Link, RoverDrawing, joint_angles, rover_drawing
from lpet_sim.rover.shapes import LinkMesh
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.figures import draw_map, draw_relief
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.mesh import ground_mesh, rocks_mesh
from lpet_sim.terrain.summary import TerrainSummary, describe_terrain
from lpet_sim.terrain.terrain import Terrain, build_terrain

_MARGIN_M = 8.0
_ROCKS_DRAWN = 4000
_ROCK_MIN_M = 0.06
_MOTION_PERIOD_NS = NS_PER_S // 2


class RoverArtist:
    """Draws the rover of a traverse: once its shapes, then its moving joints."""

    def __init__(self, writer: RecordingWriter, spec: RoverSpec) -> None:
        """Draw the shapes of a rover."""
        self._writer, self._spec = writer, spec
        self._drawing = rover_drawing(spec)
        writer.draw_rover(
            [_drawn(link) for link in self._drawing.links if link.parent or link.meshes]
        )

    def draw(self, truth: Truth) -> None:
        """Draw the moving joints of a piece of truth, twice a second."""
        if truth.wheels is None:
            return
        rows = np.flatnonzero(truth.wheels.t_ns % _MOTION_PERIOD_NS == 0)
        poses = _poses_in_parent(self._drawing, self._spec, truth.wheels)
        motions = {name: pose[rows] for name, pose in poses.items()}
        self._writer.draw_motion(truth.wheels.t_ns[rows], motions)


def _drawn(link: Link) -> DrawnLink:
    mesh = join_meshes([_mesh(shape) for shape in link.meshes]) if link.meshes else None
    return DrawnLink(link.name, mesh, _parent(link), link.T_parent_link)


def _parent(link: Link) -> str:
    return "" if link.parent in (None, "body") else str(link.parent)


def _mesh(shape: LinkMesh) -> Mesh:
    return Mesh(shape.vertices, shape.faces, np.round(255 * shape.rgba).astype(np.uint8), flat=True)


def _poses_in_parent(drawing: RoverDrawing, spec: RoverSpec, wheels: WheelTruth) -> dict[str, SE3]:
    angles = joint_angles(spec, wheels)
    return {
        link.name: link.T_parent_link_at(angles[link.joint])
        for link in drawing.links
        if link.joint is not None and link.joint in angles
    }


def draw_ground(writer: RecordingWriter, terrain: Terrain, path_xy: Array) -> None:
    """Draw the ground and the largest rocks around a path.

    Args:
        writer: The recording.
        terrain: The terrain.
        path_xy: Where the rover drives [m], Shape (n, 2).
    """
    low, high = path_xy.min(axis=0) - _MARGIN_M, path_xy.max(axis=0) + _MARGIN_M
    box = Box(*(float(x) for x in (*low, *high)))
    writer.draw_mesh("ground", ground_mesh(terrain, box))
    rocks = terrain.rocks(box, _ROCK_MIN_M * max(1.0, (box.area_m2 / 1000.0) ** 0.5))
    if len(rocks):
        largest = np.argsort(-rocks.diameter_m, kind="stable")[:_ROCKS_DRAWN]
        writer.draw_mesh("rocks", rocks_mesh(rocks.select(largest)))


def draw_terrain(
    name_or_path: str, seed: int, size_m: float, folder: Path
) -> tuple[TerrainSummary, tuple[Path, ...]]:
    """Draw the map and the relief of a terrain around the world's origin.

    Args:
        name_or_path: A preset's name, or a YAML file.
        seed: Seed of the terrain.
        size_m: Side of the square that is drawn [m].
        folder: Where the pictures go.

    Returns:
        Measured figures of the square, and the files written.

    Raises:
        LpetError: The spec is not valid, or the folder cannot be written.
    """
    spec = load_terrain_spec(name_or_path)
    terrain = build_terrain(spec, seed)
    box = Box.around(0.0, 0.0, size_m / 2)
    paths = tuple(output_folder(folder) / f"{spec.name}_{what}.png" for what in ("map", "relief"))
    draw_map(terrain, box, paths[0])
    draw_relief(terrain, box, paths[1])
    return describe_terrain(terrain, box), paths
