"""The parts of a user's model that a description names, found and held to what a rover needs.

One of the files of the room that import MuJoCo.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np

from lpet_sim.errors import SpecError, UnknownNameError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.rover.model_spec import BodyPart, RoverModelSpec, WheelPart, limit_of

_LEFT, _UP = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
_TILTED = math.cos(math.radians(5.0))
_SAME_M = 1e-3
_AXLE_M = 0.05


@dataclass(frozen=True)
class Joint:
    """A hinge that has been looked up.

    Attributes:
        name: In the model.
        link: The link that it moves.
        backward: Whether its axis points right or down, so that it has to be turned round.
        limit_rad: How far it turns both ways.
    """

    name: str
    link: str
    backward: bool
    limit_rad: float


@dataclass(frozen=True)
class Wheel:
    """A wheel that has been looked up.

    Attributes:
        name: What it is called.
        drive: The joint that it rolls about.
        steer: The joint that steers it, if any.
        axle: Direction of the axle in the wheel's link, to the left, Shape (3,).
        centre: Middle of the tread in the wheel's link [m], Shape (3,).
        centre_body: The same in the body [m], Shape (3,).
        size: Radius and width of the link's cylinder [m]; None where it has none.
    """

    name: str
    drive: Joint
    steer: Joint | None
    axle: Array
    centre: Array
    centre_body: Array
    size: tuple[float, float] | None


class Parts:
    """The parts of a model.

    Attributes:
        T_body_root: Pose of the link that all others hang on in the body, which is fixed to it.
        wheels: The wheels, in their order.
        radius_m: Radius of the wheels.
        width_m: Their width.
    """

    def __init__(self, model: Any, spec: RoverModelSpec) -> None:
        """Look up everything that the description names.

        Args:
            model: The stripped model, compiled, without what LPET adds.
            spec: The description.

        Raises:
            UnknownNameError: It has no part of a name.
            SpecError: A part is not what a rover needs.
        """
        self._model, self._spec = model, spec
        self.T_body_root = self._root()
        self.wheels = tuple(self._wheel(part) for part in spec.wheels)
        self.radius_m, self.width_m = self._size("radius", 0), self._size("width", 1)
        _check_axles(self.wheels)
        for name in spec.suspension:
            self._hinge(name, "suspension")

    def link_in_body(self, name: str) -> SE3:
        """Give ``T_body_link`` with every joint at zero."""
        return self.T_body_root @ link_pose(self._model, self._model.body(name).id, 1)

    def mount(self, part: BodyPart, what: str) -> tuple[str | None, SE3]:
        """Find where a sensor sits: the link (None for the body), and ``T_link_sensor``."""
        pose = part.pose().se3()
        site = getattr(part, "site", None)
        if site is not None:
            found = self._model.site(self._known("site", what, site))
            owner = self._model.body(int(found.bodyid[0])).name
            return owner, SE3.from_quat_wxyz(found.quat, found.pos)
        if part.link is None:
            return None, pose
        return self._known("body", what, part.link), pose

    def _known(self, kind: str, what: str, name: str) -> str:
        """Hold a name to be one of the model's."""
        words = {"body": "link", "jnt": "joint", "site": "site"}
        count = getattr(self._model, f"n{kind}")
        look_up = getattr(self._model, "joint" if kind == "jnt" else kind)
        valid = [look_up(i).name for i in range(1 if kind == "body" else 0, count)]
        named = [each for each in valid if each]
        if name not in named:
            kind_of = f"{words[kind]} of {what}"
            if not named:
                raise SpecError(
                    f"{self._spec.path.name} has no {words[kind]} '{name}' for {what}, nor any "
                    f"other {words[kind]} with a name"
                )
            raise UnknownNameError(kind_of, name, named)
        return name

    def _root(self) -> SE3:
        part = self._spec.body
        if part.link is None:
            return part.pose().se3().inverse()
        body = self._model.body(self._known("body", "body", part.link))
        between = body.id
        while between > 1:
            if self._model.body_jntnum[between]:
                raise SpecError(
                    f"body.link '{part.link}' moves against '{self._model.body(1).name}': the "
                    "body's frame is fixed to the link that all others hang on"
                )
            between = self._model.body_parentid[between]
        return (link_pose(self._model, body.id, 1) @ part.pose().se3()).inverse()

    def joint(self, name: str, what: str, along: Array) -> Joint:
        """Find a hinge about an axis of the body.

        Raises:
            UnknownNameError: There is no such joint.
            SpecError: It is no hinge, or leans from the axis by more than 5 deg.
        """
        joint = self._hinge(name, what)
        link = self._model.body(int(joint.bodyid[0])).name
        axis = self.link_in_body(link).rotation @ joint.axis
        if abs(axis @ along) < _TILTED:
            x, y, z = (round(float(part), 3) + 0.0 for part in axis)
            want = "y (left)" if along is _LEFT else "z (up)"
            raise SpecError(
                f"joint '{name}' ({what}) turns about ({x:g}, {y:g}, {z:g}) of the body; it must "
                f"be {want}: if the body's axes are not x forward, y left, z up give body.q_wxyz"
            )
        limit = limit_of(*map(float, joint.range)) if self._limited(joint) else limit_of(0.0, 0.0)
        return Joint(name, link, bool(axis @ along < 0), limit)

    def _hinge(self, name: str, what: str) -> Any:
        joint = self._model.joint(self._known("jnt", what, name))
        if int(joint.type[0]) != int(mujoco.mjtJoint.mjJNT_HINGE):
            raise SpecError(f"joint '{name}' ({what}) is no hinge; it must turn about one axis")
        return joint

    @property
    def moving(self) -> frozenset[str]:
        """Names of the joints that move: those of wheels, and the suspension's."""
        pairs = [(wheel.drive, wheel.steer) for wheel in self.wheels]
        named = {joint.name for pair in pairs for joint in pair if joint is not None}
        return frozenset(named | set(self._spec.suspension))

    def _limited(self, joint: Any) -> bool:
        return bool(self._model.jnt_limited[joint.id])

    def _wheel(self, part: WheelPart) -> Wheel:
        what = f"wheel {part.name}"
        drive = self.joint(str(part.drive), f"drive of {what}", _LEFT)
        steer = None
        if part.steer is not None:
            steer = self.joint(part.steer, f"steer of {what}", _UP)
            self._check_carries(steer, drive, what)
        body = self._model.body(drive.link)
        self._check_own_link(drive, body, what)
        axle = np.array(self._model.joint(drive.name).axis) * (-1.0 if drive.backward else 1.0)
        centre, size = self._tread(body, axle)
        if part.offset_m is not None:
            centre = part.offset_m * axle
        return Wheel(
            part.name, drive, steer, axle, centre, self.link_in_body(drive.link) @ centre, size
        )

    def _check_own_link(self, drive: Joint, body: Any, what: str) -> None:
        if int(body.jntnum[0]) != 1:
            raise SpecError(
                f"link '{body.name}' of {what} has {int(body.jntnum[0])} joints; '{drive.name}' "
                "must be its only one, and steering that of a link before it"
            )
        if np.linalg.norm(self._model.joint(drive.name).pos) > _SAME_M:
            raise SpecError(
                f"joint '{drive.name}' of {what} lies beside the origin of link '{body.name}'; "
                "the axle must pass through it"
            )

    def _check_carries(self, steer: Joint, drive: Joint, what: str) -> None:
        index = self._model.body(drive.link).id
        index = self._model.body_parentid[index]
        chain = []
        while index > 0:
            chain.append(self._model.body(int(index)).name)
            index = self._model.body_parentid[index]
        if steer.link not in chain:
            raise SpecError(
                f"joint '{steer.name}' does not steer {what}: it moves link '{steer.link}', but "
                f"the wheel hangs on {', '.join(repr(link) for link in chain)}"
            )

    def _tread(self, body: Any, axle: Array) -> tuple[Array, tuple[float, float] | None]:
        """Find the link's widest cylinder about the axle: its middle along it, and its size."""
        best: tuple[Array, tuple[float, float] | None] = np.zeros(3), None
        for k in range(int(body.geomadr[0]), int(body.geomadr[0]) + int(body.geomnum[0])):
            if int(self._model.geom_type[k]) != int(mujoco.mjtGeom.mjGEOM_CYLINDER):
                continue
            pose = SE3.from_quat_wxyz(self._model.geom_quat[k], self._model.geom_pos[k])
            radius, half = self._model.geom_size[k][:2]
            about = abs(pose.rotation[:, 2] @ axle) > _TILTED
            if about and (best[1] is None or radius > best[1][0]):
                best = axle * (axle @ pose.translation), (float(radius), float(2 * half))
        return best

    def _size(self, what: str, k: int) -> float:
        """Give the wheels' radius or width: the description's, else that of all cylinders."""
        given: float | None = getattr(self._spec, f"wheel_{what}_m")
        if given is not None:
            return given
        found = {wheel.name: wheel.size[k] for wheel in self.wheels if wheel.size is not None}
        if len(found) < len(self.wheels):
            lacks = next(wheel for wheel in self.wheels if wheel.size is None)
            raise SpecError(
                f"link '{lacks.drive.link}' of wheel {lacks.name} has no cylinder about its axle: "
                f"give wheel_{what}_m"
            )
        if np.ptp(list(found.values())) > _SAME_M:
            sizes = ", ".join(f"{name} {size:g} m" for name, size in found.items())
            raise SpecError(
                f"the wheels differ in {what} ({sizes}); all must be equal: give wheel_{what}_m"
            )
        return next(iter(found.values()))


def link_pose(model: Any, index: int, root: int) -> SE3:
    """Give ``T_root_link`` of a link of a compiled model, with every joint at zero."""
    pose = SE3.identity()
    while index != root:
        pose = SE3.from_quat_wxyz(model.body_quat[index], model.body_pos[index]) @ pose
        index = model.body_parentid[index]
    return pose


def _check_axles(wheels: Iterable[Wheel]) -> None:
    """Hold wheels that do not steer, beside some that do, to one axle under the body's origin.

    The rover turns about a point of that axle's line, and its path is that of the body's origin.

    Raises:
        SpecError: They stand on several axles, or the origin is elsewhere.
    """
    fixed = [wheel for wheel in wheels if wheel.steer is None]
    if not fixed or len(fixed) == len(list(wheels)):
        return
    x = np.array([wheel.centre_body[0] for wheel in fixed])
    if np.ptp(x) > _AXLE_M:
        names = ", ".join(wheel.name for wheel in fixed)
        raise SpecError(
            f"wheels {names} do not steer but stand on several axles (x from {x.min():.2f} to "
            f"{x.max():.2f} m) while others steer: steer all but one axle, or none"
        )
    if abs(x.mean()) > _AXLE_M:
        raise SpecError(
            f"the axle that does not steer is {x.mean():+.2f} m ahead of the body's origin, which "
            f"is what follows the path: move the origin there, by {x.mean():.3f} m more in x of "
            "body.translation_m"
        )
