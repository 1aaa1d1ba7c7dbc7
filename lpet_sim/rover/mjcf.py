"""Rover models: find them, read them, and compile them together with a piece of ground.

One of the files of the room that import MuJoCo.
"""

from __future__ import annotations

from functools import lru_cache

import mujoco
import numpy as np

from lpet_sim.errors import UnknownNameError
from lpet_sim.rover.ground import CELL_M, RANGE_M, GroundPatch, RocksLike
from lpet_sim.rover.model_fit import fitted
from lpet_sim.rover.model_source import DRAWN_GROUP
from lpet_sim.rover.model_spec import load_rover_model, wheel_names

_FLOOR_M = 1.0
_NET_FORCE = 3  # the contact sensor's reduction of that name


@lru_cache(maxsize=8)
def rover_source(name: str) -> mujoco.MjSpec:
    """Give a rover ready to be put on ground; not to be written to.

    Args:
        name: The name of a rover, or the path of its description.

    Raises:
        UnknownNameError: There is no such rover, or its description names what its model lacks.
        SpecError: Its description or its model cannot be read, or is not what a rover needs.
    """
    spec = load_rover_model(name)
    return mujoco.MjSpec.from_file(str(spec.path)) if spec.complete else fitted(spec)


@lru_cache(maxsize=8)
def bare_model(name: str) -> mujoco.MjModel:
    """Compile a rover by itself, without any ground; not to be written to.

    Raises:
        UnknownNameError: As `rover_source`.
        SpecError: As `rover_source`.
    """
    return rover_source(name).copy().compile()


def compile_on(name: str, dt_s: float, patch: GroundPatch, rocks: RocksLike) -> mujoco.MjModel:
    """Compile a rover with the ground under it and the rocks near it.

    The joints, actuators and sensors do not depend on the ground, so a state carries over from one
    compiled model to the next. The heights are written after compiling, because the compiler
    would stretch them to 0..1.

    Args:
        name: The rover model.
        dt_s: Physics step [s].
        patch: The ground.
        rocks: Convex rocks, each a geom of its own.
    """
    model = spec_on(name, dt_s, patch, rocks).compile()
    model.hfield_data[:] = patch.data.ravel()
    return model


def spec_on(name: str, dt_s: float, patch: GroundPatch, rocks: RocksLike) -> mujoco.MjSpec:
    """Put a rover and ground together as `compile_on` does, not yet compiled, without heights."""
    spec = rover_source(name).copy()
    spec.option.timestep = dt_s
    _add_ground(spec, patch)
    for k in range(len(rocks.id)):
        _add_rock(spec, rocks, k)
    for wheel in wheel_names(name):
        _add_contact_sensor(spec, f"load_{wheel}", wheel, None)
        _add_contact_sensor(spec, f"soil_{wheel}", wheel, "ground")
    return spec


def _add_contact_sensor(spec: mujoco.MjSpec, name: str, wheel: str, ground: str | None) -> None:
    """Count a wheel's contacts: all of them, with their net force, or those with one geom."""
    fields = [mujoco.mjtConDataField.mjCONDATA_FOUND]
    if ground is None:
        fields.append(mujoco.mjtConDataField.mjCONDATA_FORCE)
    sensor = spec.add_sensor(
        name=name,
        type=mujoco.mjtSensor.mjSENS_CONTACT,
        objtype=mujoco.mjtObj.mjOBJ_GEOM,
        objname=f"wheel_{wheel}",
        intprm=[sum(1 << int(field) for field in fields), _NET_FORCE if ground is None else 0, 1],
    )
    if ground is not None:
        sensor.reftype = mujoco.mjtObj.mjOBJ_GEOM
        sensor.refname = ground


def _add_ground(spec: mujoco.MjSpec, patch: GroundPatch) -> None:
    nodes = len(patch.data)
    spec.add_hfield(
        name="ground",
        nrow=nodes,
        ncol=nodes,
        size=[patch.half_m, patch.half_m, RANGE_M, _FLOOR_M],
        userdata=np.zeros(nodes * nodes, dtype=np.float32),
    )
    assert patch.half_m * 2 == (nodes - 1) * CELL_M
    spec.worldbody.add_geom(
        name="ground",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="ground",
        pos=[*patch.centre_xy, patch.base_m],
        contype=1,
        conaffinity=2,
        group=0,
    )


def _add_rock(spec: mujoco.MjSpec, rocks: RocksLike, k: int) -> None:
    vertices, faces = rocks.mesh(k)
    name = f"rock_{int(rocks.id[k])}"
    spec.add_mesh(
        name=name,
        uservert=np.asarray(vertices, dtype=float).ravel(),
        userface=np.asarray(faces, dtype=np.int32).ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX,
    )
    spec.worldbody.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        pos=rocks.p_world_rock[k],
        contype=1,
        conaffinity=2,
        group=0,
    )


VISUAL_GROUP = DRAWN_GROUP
"""Group of the geoms that are drawn; those that collide are in group 3."""

_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}


def geom_kind(model: mujoco.MjModel, geom: int) -> str:
    """Give the kind of a drawn geom: box, cylinder, capsule, sphere, ellipsoid or mesh.

    Raises:
        UnknownNameError: It is of another kind.
    """
    kind = int(model.geom_type[geom])
    if kind not in _KINDS:
        raise UnknownNameError("kind of drawn geom", str(kind), _KINDS.values())
    return _KINDS[kind]


def is_hinge(model: mujoco.MjModel, joint: int) -> bool:
    """Tell whether a joint turns about one axis."""
    return int(model.jnt_type[joint]) == int(mujoco.mjtJoint.mjJNT_HINGE)
