"""A user's MJCF or URDF as MuJoCo reads it, stripped to the rover itself.

One of the files of the room that import MuJoCo.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from enum import Enum
from pathlib import Path
from typing import Any

import mujoco

from lpet_sim.errors import SpecError, UnknownNameError
from lpet_sim.rover.model_spec import RoverModelSpec

DRAWN_GROUP, HIDDEN_GROUP = 1, 4
_PACKAGE = "package://"


def compiled(spec: mujoco.MjSpec, path: Path) -> mujoco.MjModel:
    """Compile a model; what MuJoCo does not like about it becomes one sentence.

    Raises:
        SpecError: It does not compile.
    """
    return _told(path, spec.compile)


def read_source(spec: RoverModelSpec) -> mujoco.MjSpec:
    """Read the model's file, and take out all that is not the rover: world, motors, sensors.

    Raises:
        SpecError: The file cannot be read, is not MJCF or URDF, or does not have one rover.
        UnknownNameError: It has no link of the body's name.
    """
    source = _told(spec.path, lambda: _read(spec.path))
    _strip(source)
    root = _root(source, spec)
    for body in list(source.worldbody.bodies):
        if body.name != root.name:
            source.delete(body)
    _free(source, source.body(root.name), spec.path)
    source.compiler.fusestatic = False
    return source


def take_globals(source: mujoco.MjSpec, canvas: mujoco.MjSpec) -> None:
    """Put solver, sizes and looks of one model in place of another's, so that they agree."""
    for section in ("option", "visual", "stat"):
        _copy(getattr(canvas, section), getattr(source, section))
    for size in (name for name in dir(canvas) if name.startswith("nuser")):
        setattr(source, size, getattr(canvas, size))
    for size in ("memory", "njmax", "nconmax", "nstack", "nkey"):
        setattr(source, size, getattr(canvas, size))


def _copy(from_: Any, to: Any) -> None:
    for name in (name for name in dir(from_) if not name.startswith("_")):
        value = getattr(from_, name)
        if type(value).__module__.startswith("mujoco.") and not isinstance(value, Enum):
            _copy(value, getattr(to, name))
        elif not callable(value):
            setattr(to, name, value)


def _told(path: Path, work: Callable[[], Any]) -> Any:
    try:
        return work()
    except OSError as error:
        raise SpecError(f"cannot read {path}: {error.strerror or error}") from None
    except (ValueError, ElementTree.ParseError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())
        raise SpecError(f"{path} is no model that MuJoCo reads: {said}") from None


def _read(path: Path) -> mujoco.MjSpec:
    if ElementTree.fromstring(path.read_text()).tag != "robot":
        return mujoco.MjSpec.from_file(str(path))
    return mujoco.MjSpec.from_string(_urdf_with_shapes(path))


def _urdf_with_shapes(path: Path) -> str:
    """Tell MuJoCo's reader of URDF to keep the visual shapes, and where the mesh files are."""
    robot = ElementTree.fromstring(path.read_text())
    for mesh in robot.iter("mesh"):
        mesh.set("filename", str(_mesh_file(mesh.get("filename", ""), path.resolve().parent)))
    for extra in robot.findall("mujoco"):
        robot.remove(extra)
    own = ElementTree.SubElement(robot, "mujoco")
    keep = {"discardvisual": "false", "fusestatic": "false", "strippath": "false"}
    ElementTree.SubElement(own, "compiler", keep)
    return ElementTree.tostring(robot, encoding="unicode")


def _mesh_file(name: str, folder: Path) -> Path:
    """Find a mesh beside the URDF or above it; a ``package://`` name begins with its package."""
    inside = name.removeprefix("file://").removeprefix(_PACKAGE)
    places = [inside, inside.partition("/")[2]] if name.startswith(_PACKAGE) else [inside]
    for above in (folder, *list(folder.parents)[:3]):
        for place in places:
            if place and (above / place).is_file():
                return above / place
    return folder / inside


def _strip(source: mujoco.MjSpec) -> None:
    """Take out motors, sensors and the like, and let nothing collide; see `_show`."""
    kinds = ("actuators", "sensors", "keys", "pairs", "excludes", "cameras", "lights")
    for kind in kinds:
        for element in list(getattr(source, kind)):
            source.delete(element)
    for element in (*source.worldbody.geoms, *source.worldbody.sites):
        source.delete(element)
    for number, body in enumerate(source.bodies):
        body.name = body.name or f"link_{number}"
        _show(list(body.geoms))


def _show(geoms: list[Any]) -> None:
    """Draw the shapes of a link that do not collide or, where all of them do, all."""
    looks = [geom for geom in geoms if not (geom.contype or geom.conaffinity)]
    for geom in geoms:
        drawn = not looks or not (geom.contype or geom.conaffinity)
        geom.group = DRAWN_GROUP if drawn else HIDDEN_GROUP
    for geom in geoms:
        geom.contype = geom.conaffinity = 0


def _root(source: mujoco.MjSpec, spec: RoverModelSpec) -> Any:
    """Find the link that all others hang on."""
    tops = list(source.worldbody.bodies)
    if spec.body.link is None:
        if len(tops) != 1:
            named = ", ".join(body.name for body in tops) or "none"
            raise SpecError(
                f"{spec.path.name} has {len(tops)} links at its top ({named}): name the rover's "
                "own as body.link"
            )
        return tops[0]
    links = {body.name: body for body in source.bodies if body.name != source.worldbody.name}
    if spec.body.link not in links:
        raise UnknownNameError("link of body", spec.body.link, links)
    found = links[spec.body.link]
    while found.parent.name != source.worldbody.name:
        found = found.parent
    return found


def _free(source: mujoco.MjSpec, root: Any, path: Path) -> None:
    """Take the link off the world; the joint that lets it move is added later."""
    for joint in list(root.joints):
        if joint.type != mujoco.mjtJoint.mjJNT_FREE:
            raise SpecError(
                f"{path.name}: joint '{joint.name}' ties '{root.name}' to the world; a rover hangs "
                "on the world by a free joint or by none"
            )
        source.delete(joint)
