"""What the rover looks like: coloured meshes on links that move with the joints.

For drawing only, by viewers that know no simulator. `WheelTruth` holds all the joint angles:
``drive_<wheel>`` and ``steer_<wheel>`` in the order of the wheels, and the suspension's
``bogie_*`` in the order of `RoverFrames.suspension_joints`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.truth import WheelTruth
from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.mjcf import VISUAL_GROUP, WHEELS, bare_model, geom_kind
from lpet_sim.rover.spec import RoverSpec

_SIDES = 24


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


@dataclass(frozen=True)
class Link:
    """A rigid part of the rover.

    Attributes:
        name: Its name in the MJCF.
        parent: Name of the link it hangs on; None for ``body``.
        T_parent_link: Its pose in the parent with the joint at zero.
        joint: Name of the hinge between parent and link, None where it is fixed.
        axis: Axis of the hinge in the link, through its origin, Shape (3,).
        meshes: Its shapes.
    """

    name: str
    parent: str | None
    T_parent_link: SE3
    joint: str | None
    axis: Array
    meshes: tuple[LinkMesh, ...]

    def T_parent_link_at(self, angle_rad: Array) -> SE3:
        """Give the poses in the parent for joint angles [rad], Shape (n,)."""
        turn = so3.exp(np.asarray(angle_rad)[..., None] * self.axis)
        return self.T_parent_link @ SE3(turn, np.zeros((*turn.shape[:-2], 3)))


@dataclass(frozen=True)
class RoverDrawing:
    """A rover as links, parents before children; the first one is ``body``."""

    links: tuple[Link, ...]


def rover_drawing(spec: RoverSpec) -> RoverDrawing:
    """Read the visual shapes of a rover from its MJCF.

    Raises:
        UnknownNameError: There is no such rover model.
    """
    model = bare_model(spec.model)
    return RoverDrawing(tuple(_link(spec, index) for index in range(1, model.nbody)))


def _link(spec: RoverSpec, index: int) -> Link:
    model = bare_model(spec.model)
    body = model.body(index)
    is_root = body.name == "body"
    joint = model.joint(int(body.jntadr[0])) if body.jntnum[0] and not is_root else None
    geoms = range(int(body.geomadr[0]), int(body.geomadr[0] + body.geomnum[0]))
    shown = [k for k in geoms if model.geom_group[k] == VISUAL_GROUP]
    return Link(
        name=body.name,
        parent=None if is_root else model.body(int(body.parentid[0])).name,
        T_parent_link=SE3.from_quat_wxyz(body.quat, body.pos),
        joint=None if joint is None else joint.name,
        axis=np.zeros(3) if joint is None else np.array(joint.axis),
        meshes=tuple(_mesh(spec, k) for k in shown),
    )


def _mesh(spec: RoverSpec, geom: int) -> LinkMesh:
    model = bare_model(spec.model)
    size = model.geom_size[geom]
    shape = _box(size) if geom_kind(model, geom) == "box" else _cylinder(size[0], size[1])
    vertices, faces = shape
    T_link_geom = SE3.from_quat_wxyz(model.geom_quat[geom], model.geom_pos[geom])
    return LinkMesh(T_link_geom @ vertices, faces, model.geom_rgba[geom].copy())


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


def joint_angles(spec: RoverSpec, wheels: WheelTruth) -> dict[str, Array]:
    """Name the joint angles of a wheel truth [rad], Shape (n,) each."""
    names = rover_frames(spec).suspension_joints
    angles = {name: wheels.joint_angle_rad[:, k] for k, name in enumerate(names)}
    for k, wheel in enumerate(WHEELS):
        angles[f"drive_{wheel}"] = wheels.drive_angle_rad[:, k]
        angles[f"steer_{wheel}"] = wheels.steer_angle_rad[:, k]
    return angles


def link_poses(
    drawing: RoverDrawing, T_world_body: SE3, angles_rad: Mapping[str, Array]
) -> dict[str, SE3]:
    """Give the poses of all links in the world.

    Args:
        drawing: The rover.
        T_world_body: Poses of the body, Shape (n,).
        angles_rad: Joint angles by name [rad], Shape (n,) each; absent ones are zero.

    Returns:
        ``T_world_link`` by the link's name, Shape (n,) each.
    """
    poses: dict[str, SE3] = {}
    still = np.zeros(len(T_world_body))
    for link in drawing.links:
        if link.parent is None:
            poses[link.name] = T_world_body
            continue
        angle = still if link.joint is None else angles_rad.get(link.joint, still)
        poses[link.name] = poses[link.parent] @ link.T_parent_link_at(angle)
    return poses
