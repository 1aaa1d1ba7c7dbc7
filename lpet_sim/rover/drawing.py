"""What the rover looks like: coloured meshes on links that move with the joints.

For drawing only, by viewers that know no simulator. `WheelTruth` holds all the joint angles:
those of drives and steering in the order of the wheels, and the suspension's in the order of
`RoverFrames.suspension_joints`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.truth import WheelTruth
from lpet_sim.rover.mjcf import VISUAL_GROUP, bare_model
from lpet_sim.rover.shapes import LinkMesh, drawn_shape
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.wheel_parts import wheel_parts


@dataclass(frozen=True)
class Link:
    """A rigid part of the rover.

    Attributes:
        name: Its name in the MJCF.
        parent: Name of the link it hangs on; None for ``body``.
        T_parent_link: Its pose in the parent with the joint at zero.
        joint: Name of the hinge between parent and link, None where it is fixed.
        axis: Axis of the hinge in the link, Shape (3,).
        meshes: Its shapes.
        anchor_m: A point of the hinge's axis in the link, Shape (3,); its origin for most.
    """

    name: str
    parent: str | None
    T_parent_link: SE3
    joint: str | None
    axis: Array
    meshes: tuple[LinkMesh, ...]
    anchor_m: Array = field(default_factory=lambda: np.zeros(3))

    def T_parent_link_at(self, angle_rad: Array) -> SE3:
        """Give the poses in the parent for joint angles [rad], Shape (n,)."""
        turn = so3.exp(np.asarray(angle_rad)[..., None] * self.axis)
        shift = self.anchor_m - turn @ self.anchor_m
        return self.T_parent_link @ SE3(turn, shift)


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
        anchor_m=np.zeros(3) if joint is None else np.array(joint.pos),
        meshes=tuple(drawn_shape(model, k) for k in shown),
    )


def joint_angles(spec: RoverSpec, wheels: WheelTruth) -> dict[str, Array]:
    """Name the joint angles of a wheel truth [rad], Shape (n,) each."""
    parts, model = wheel_parts(spec.model), bare_model(spec.model)
    angles = {name: wheels.joint_angle_rad[:, k] for k, name in enumerate(parts.suspension)}
    for k, (drive, steer) in enumerate(zip(parts.drive, parts.steer, strict=True)):
        angles[model.joint(int(drive)).name] = wheels.drive_angle_rad[:, k]
        if steer >= 0:
            angles[model.joint(int(steer)).name] = wheels.steer_angle_rad[:, k]
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
