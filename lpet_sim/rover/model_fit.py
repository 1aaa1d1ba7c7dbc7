"""A user's rover made ready to drive: what our own model has and theirs lacks, put into it.

The result has the names that the drive goes by, whatever the user's are: ``body`` with the free
joint at its top, geoms ``wheel_<name>`` that touch the ground, motors ``drive_<name>`` and
``steer_<name>``, sites ``imu``, ``camera``, ``camera_right`` and the geom ``belly``. All that is
the user's has ``own/`` before its name. One of the files of the room that import MuJoCo.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.rover.model_parts import Parts, Wheel
from lpet_sim.rover.model_source import compiled, read_source, take_globals
from lpet_sim.rover.model_spec import CameraMountSpec, MotorSpec, MountSpec, RoverModelSpec

OWN = "own/"
"""Stands before every name of the user's model."""

_COLLIDING: Final = {
    "mass": 0.0,
    "contype": 2,
    "conaffinity": 1,
    "condim": 3,
    "priority": 1,
    "group": 3,
}
_R_FLU_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_TINY = 1e-9  # a surface velocity that is not zero makes MuJoCo heed it


@dataclass(frozen=True)
class _Share:
    """What one wheel carries: weight times radius [N m], mass times radius squared [kg m2]."""

    torque_nm: float
    inertia_kgm2: float


def fitted(spec: RoverModelSpec) -> mujoco.MjSpec:
    """Read a user's model and put into it what the drive needs.

    Raises:
        SpecError: The model cannot be read, or is not what a rover needs.
        UnknownNameError: The description names what the model does not have.
    """
    model = compiled(read_source(spec), spec.path)
    parts = Parts(model, spec)
    source = read_source(spec)
    _hold_still(source, parts.moving)
    _turn_round(source, parts, spec)
    _damp(source, spec, _share(model, parts, spec))
    canvas = _canvas(spec)
    body = canvas.worldbody.add_body(name="body")
    body.add_freejoint(name="body")
    # Where the root stands in the user's own world says nothing.
    T_world_root = SE3.from_quat_wxyz(model.body_quat[1], model.body_pos[1])
    frame = body.add_frame(**_place(parts.T_body_root @ T_world_root.inverse()))
    take_globals(source, canvas)
    canvas.attach(source, prefix=OWN, frame=frame)
    _add_wheels(canvas, parts, spec, _share(model, parts, spec))
    _add_sites(canvas, parts, spec)
    _add_belly(body, spec)
    _tie(canvas, parts, spec)
    compiled(canvas, spec.path)
    return canvas


def _canvas(spec: RoverModelSpec) -> mujoco.MjSpec:
    """Make an empty model with the solver settings that were measured on our own rover."""
    canvas = mujoco.MjSpec()
    canvas.compiler.fusestatic = False
    canvas.compiler.degree = False
    option = canvas.option
    option.gravity = [0.0, 0.0, -spec.gravity_mps2]
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 2.0
    option.iterations = 50
    option.noslip_iterations, option.noslip_tolerance = 6, 1e-9
    option.ccd_iterations, option.ccd_tolerance = 200, 1e-9
    return canvas


def _place(pose: SE3) -> dict[str, Array]:
    return {"pos": np.array(pose.translation), "quat": pose.quat_wxyz()}


def _share(model: Any, parts: Parts, spec: RoverModelSpec) -> _Share:
    mass = float(model.body_subtreemass[1]) / len(parts.wheels)
    torque = mass * spec.gravity_mps2 * parts.radius_m
    return _Share(torque, mass * parts.radius_m**2)


def _hold_still(source: mujoco.MjSpec, moving: frozenset[str]) -> None:
    """Take out every other joint, with the equalities that need it."""
    for tie in list(source.equalities):
        if tie.type == mujoco.mjtEq.mjEQ_JOINT and not {tie.name1, tie.name2} - {""} <= moving:
            source.delete(tie)
    for joint in list(source.joints):
        if joint.name not in moving:
            source.delete(joint)


def _turn_round(source: mujoco.MjSpec, parts: Parts, spec: RoverModelSpec) -> None:
    """Let every drive roll forward and every steering joint turn left where it is positive."""
    for wheel in parts.wheels:
        drive = source.joint(wheel.drive.name)
        _clear(drive)
        drive.limited = False
        _flip(drive, wheel.drive.backward)
        if wheel.steer is None:
            continue
        steer = source.joint(wheel.steer.name)
        _clear(steer)
        _flip(steer, wheel.steer.backward)
        limit = spec.steer_limit_rad or wheel.steer.limit_rad
        unit = math.degrees(1.0) if source.compiler.degree else 1.0
        steer.limited, steer.range = True, [-limit * unit, limit * unit]


def _clear(joint: Any) -> None:
    joint.stiffness[:] = 0.0
    joint.springref = joint.ref = joint.frictionloss = 0.0


def _flip(joint: Any, backward: bool) -> None:
    if backward:
        joint.axis = -np.asarray(joint.axis)


def _damp(source: mujoco.MjSpec, spec: RoverModelSpec, share: _Share) -> None:
    """Damp the suspension joints that have no damping of their own."""
    damping = spec.suspension_damping_nms_rad
    for joint in source.joints:
        if joint.name in spec.suspension and not joint.damping[0]:
            joint.damping[0] = 2.2 * share.torque_nm if damping is None else damping


def _add_wheels(canvas: mujoco.MjSpec, parts: Parts, spec: RoverModelSpec, share: _Share) -> None:
    motors = spec.motors
    for wheel in parts.wheels:
        _add_tread(canvas.body(OWN + wheel.drive.link), wheel, parts)
        _add_drive(canvas, wheel, motors, share)
        if wheel.steer is not None:
            _add_steering(canvas, wheel, motors, share)


def _add_tread(link: Any, wheel: Wheel, parts: Parts) -> None:
    """Add the cylinder that touches the ground; its z is the axle, to the left."""
    link.add_geom(
        name=f"wheel_{wheel.name}",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[parts.radius_m, parts.width_m / 2, 0.0],
        pos=wheel.centre,
        quat=_to_axle(wheel.axle),
        **_COLLIDING,
        friction=[0.9, 0.005, 0.0001],
        solref=[0.015, 1.0],
        solimp=[0.75, 0.75, 0.001, 0.5, 2.0],
        margin=0.005,
        surfacevel=[0.0, 0.0, 0.0, 0.0, 0.0, _TINY],
        rgba=[0.5, 0.5, 0.5, 0.3],
    )


def _to_axle(axle: Array) -> Array:
    """Give the shortest turn that takes z to the axle, scalar first."""
    z = np.array([0.0, 0.0, 1.0])
    turn = np.array([1.0 + z @ axle, *np.cross(z, axle)])
    length = float(np.linalg.norm(turn))
    return turn / length if length > 1e-6 else np.array([0.0, 1.0, 0.0, 0.0])


def _add_drive(canvas: mujoco.MjSpec, wheel: Wheel, motors: MotorSpec, share: _Share) -> None:
    stiffness = motors.drive_stiffness_nm_rad or 73.0 * share.torque_nm
    torque = motors.drive_torque_nm or 2.2 * share.torque_nm
    motor = canvas.add_actuator(
        name=f"drive_{wheel.name}",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=OWN + wheel.drive.name,
        actlimited=True,
        actrange=[-1e9, 1e9],
        forcelimited=True,
        forcerange=[-torque, torque],
    )
    damping = motors.drive_damping_nms_rad or 0.02 * stiffness
    motor.set_to_intvelocity(kp=stiffness, kv=damping)
    joint = canvas.joint(OWN + wheel.drive.name)
    joint.damping[:] = [0.05 / 27.4 * share.torque_nm, 0.0, 0.0]
    joint.armature = motors.drive_armature_kgm2 or 0.66 * share.inertia_kgm2


def _add_steering(canvas: mujoco.MjSpec, wheel: Wheel, motors: MotorSpec, share: _Share) -> None:
    assert wheel.steer is not None
    torque = motors.steer_torque_nm or 5.5 * share.torque_nm
    name = OWN + wheel.steer.name
    motor = canvas.add_actuator(
        name=f"steer_{wheel.name}",
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        target=name,
        forcelimited=True,
        forcerange=[-torque, torque],
    )
    motor.set_to_position(
        kp=motors.steer_stiffness_nm_rad or 146.0 * share.torque_nm, dampratio=1.0
    )
    joint = canvas.joint(name)
    joint.damping[:] = [2.0 / 27.4 * share.torque_nm, 0.0, 0.0]
    joint.armature = motors.steer_armature_kgm2 or 0.48 * share.inertia_kgm2


def _add_sites(canvas: mujoco.MjSpec, parts: Parts, spec: RoverModelSpec) -> None:
    eyes = {"camera": spec.camera, "camera_right": spec.camera_right}
    for name, mount in {"imu": spec.imu, **eyes}.items():
        if mount is not None:
            link, pose = parts.mount(mount, name)
            owner = canvas.body("body" if link is None else OWN + link)
            owner.add_site(name=name, **_place(pose @ _looking(mount)))


def _looking(mount: MountSpec) -> SE3:
    """Give the turn from the mount's axes to an eye's; none for what is no camera."""
    if not isinstance(mount, CameraMountSpec) or mount.optical:
        return SE3.identity()
    turn = SE3.from_rpy([0.0, mount.pitch_down_rad, mount.yaw_left_rad], np.zeros(3))
    return turn @ SE3(_R_FLU_OPTICAL, np.zeros(3))


def _add_belly(body: Any, spec: RoverModelSpec) -> None:
    if spec.belly is None:
        return
    body.add_geom(
        name="belly",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=list(spec.belly.half_size_m),
        pos=list(spec.belly.centre_m),
        **_COLLIDING,
        friction=[0.5, 0.005, 0.0001],
        solref=[0.02, 1.0],
    )


def _tie(canvas: mujoco.MjSpec, parts: Parts, spec: RoverModelSpec) -> None:
    """Let pairs of suspension joints turn against each other, about the body's y."""
    left = np.array([0.0, 1.0, 0.0])
    for one, other in spec.differentials:
        pair = [parts.joint(name, "differentials", left) for name in (one, other)]
        same_way = pair[0].backward == pair[1].backward
        tie = canvas.add_equality(
            name=f"differential_{one}",
            type=mujoco.mjtEq.mjEQ_JOINT,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            name1=OWN + pair[0].name,
            name2=OWN + pair[1].name,
        )
        tie.data[:5] = [0.0, -1.0 if same_way else 1.0, 0.0, 0.0, 0.0]
