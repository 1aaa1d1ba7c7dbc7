"""The scene: a rover on the ground around it, stepped by MuJoCo, for as far as it drives.

The ground and the rocks follow the rover: when it nears the edge of its patch the model is compiled
anew around it and the whole state is carried over, so that nothing is felt and memory stays flat.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.truth import CONTACT_NONE, CONTACT_ROCK, CONTACT_SOIL
from lpet_sim.rover.drivable import check_drivable, reach_of
from lpet_sim.rover.frames import RoverFrames, rover_frames
from lpet_sim.rover.ground import Ground, cut_patch
from lpet_sim.rover.mjcf import compile_on
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.wheel_contact import WheelContact, WheelIndex, law_on
from lpet_sim.rover.wheel_parts import WheelParts, parts_of
from lpet_sim.rover.wheel_soil import WheelSoilLaw, WheelState

_ROCK_MARGIN_M = 1.0  # rocks are found by their centre; the largest reach this far
_LIFT_STEP_M = 0.01
# Sweeps that take creep out of contacts: to hold slip to half a point, and to park for hours.
_SWEEPS_DRIVING, _SWEEPS_PARKED = 1, 6


class Scene:
    """A rover that stands on a terrain.

    Attributes:
        ground: The terrain.
        spec: The rover.
        frames: Its frames.
        contact: The wheels on the ground, with the law that is asked at every step.
        patch_changes: How often the ground has been cut anew.
    """

    def __init__(self, ground: Ground, spec: RoverSpec, law: WheelSoilLaw) -> None:
        """Prepare a scene; `build_scene` makes it ready to use."""
        self.ground = ground
        self.spec = spec
        self.frames: RoverFrames = rover_frames(spec)
        self._count = len(self.frames.wheel_names)
        share_kg = self.frames.mass_kg / self._count
        sizes = (self._count, self.frames.wheel_radius_m, share_kg)
        self.contact = WheelContact(law, spec.wheel_soil, *sizes, spec.physics_dt_s)
        self._reach_m = reach_of(self.frames)
        self.patch_changes = 0
        self.step_count = 0
        self._held = False

    @property
    def xy(self) -> Array:
        """Position of the body in the world's plane [m], Shape (2,)."""
        return self._qpos[:2].copy()

    @property
    def yaw_rad(self) -> float:
        """Heading of the body in the world [rad]."""
        w, x, y, z = self._qpos[3:7]
        return float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))

    @property
    def up(self) -> float:
        """Cosine of the body's tilt: 1 upright, 0 on its side."""
        _, x, y, _ = self._qpos[3:7]
        return float(1 - 2 * (x * x + y * y))

    @property
    def sinkage_m(self) -> Array:
        """How deep each wheel stands in the soil [m], Shape (w,)."""
        return self.contact.motion[2].copy()

    @property
    def belly_load_n(self) -> float:
        """Sum of the normal forces of ground and rocks on the belly in the last step [N].

        Of each contact the first row of the constraint force is the normal one. Just after the
        ground was cut anew there are no contacts yet: ask before `follow`.
        """
        if self._belly_geom is None:
            return 0.0
        contact = self.data.contact
        rows = contact.efc_address[(contact.geom == self._belly_geom).any(axis=1)]
        return float(self.data.efc_force[rows[rows >= 0]].sum())

    def place(self, xy: Array, yaw_rad: float) -> None:
        """Set the rover down at rest, upright on the plane through the ground under its wheels."""
        self._load_patch(np.asarray(xy, dtype=float), carry=False)
        R_flat = SE3.from_rpy([0.0, 0.0, yaw_rad], [*xy, 0.0])
        wheel = R_flat @ self.frames.contact_body_m
        height = self.ground.height(wheel[:, :2])
        plane = np.c_[wheel[:, :2] - xy, np.ones(self._count)]
        slope_x, slope_y, level = np.linalg.lstsq(plane, height, rcond=None)[0]
        pose = SE3(_facing(slope_x, slope_y, yaw_rad), np.zeros(3))
        centre = np.array([*xy, level])
        up = pose.rotation[:, 2]
        self._qpos[:3] = centre + self.frames.ride_height_m * up
        self._qpos[3:7] = pose.quat_wxyz()
        mujoco.mj_kinematics(self.model, self.data)
        depth = self.contact.stand(self.ground, self.frames.wheel_share_n * up[2])
        self._bind()
        self._qpos[:3] -= depth * up
        self._lift_clear()

    def _lift_clear(self) -> None:
        """Raise the rover until nothing touches, since it may have been put inside a rock."""
        mujoco.mj_forward(self.model, self.data)
        while self.data.ncon:
            self._qpos[2] += _LIFT_STEP_M
            mujoco.mj_forward(self.model, self.data)

    def command(self, steer_rad: Array, rate_radps: Array) -> None:
        """Set the steering angles [rad] and wheel rates [rad/s], Shape (w,) each.

        The drives integrate their rate to an angle, which lets them brake without creep. A wheel
        that stalls must not save up a turn for later: the angle is kept within the motor's reach.
        """
        lag = self._drive_lag_s * self._qvel[self._drive_dof]
        angle = self._qpos[self._drive_qpos] + lag
        self._act[:] = np.clip(self._act, angle - self._drive_reach, angle + self._drive_reach)
        self._ctrl[self._parts.steer_act] = steer_rad[self._steered]
        self._ctrl[self._drive_act] = rate_radps
        driving = np.any(rate_radps)
        self.model.opt.noslip_iterations = _SWEEPS_DRIVING if driving else _SWEEPS_PARKED

    def hold(self, held: bool) -> None:
        """Begin or end a forced slip: the wheels' surfaces stand still while the wheels turn."""
        self._held = held

    def step(self) -> None:
        """Advance by one physics step, and set the slip of the next from the traction of this."""
        mujoco.mj_step(self.model, self.data)
        self.step_count += 1
        self.contact.step(self.ground, self._held)

    def wheel_state(self) -> WheelState:
        """Give the forces of the last step on the wheels, as the wheel-soil law is told of them.

        The law itself is told of their means over a short time.
        """
        ahead, side, load, rate = self.contact.read().copy()
        told = self.contact.wheels
        along = np.copysign(1.0, rate) * ahead
        return WheelState(along, side, load, rate, told.soil.copy(), told.on_rock.copy())

    def refresh_soil(self) -> None:
        """Look up now what lies under the wheels; `step` does so ten times a second by itself."""
        self.contact.look_under(self.ground)

    def follow(self) -> None:
        """Cut the ground anew around the rover when it nears the edge of its patch."""
        away = np.abs(self.xy - self.model.geom("ground").pos[:2]).max()
        if away > self.spec.patch_m / 2 - self._reach_m:
            self.recentre()

    def recentre(self) -> None:
        """Cut the ground anew around the rover, and carry its state over."""
        self._load_patch(self.xy, carry=True)
        self.patch_changes += 1

    def _load_patch(self, xy: Array, carry: bool) -> None:
        patch = cut_patch(self.ground, xy, self.spec.patch_m)
        box = patch.box(_ROCK_MARGIN_M)
        rocks = self.ground.rocks(box, self.spec.rock_min_diameter_m)
        model = compile_on(self.spec.model, self.spec.physics_dt_s, patch, rocks)
        data = mujoco.MjData(model)
        if carry:
            self._carry_over(model, data)
        self.model, self.data = model, data
        self._bind()

    def _carry_over(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Copy the state, with what the solver starts from and what the law has just read."""
        kind = mujoco.mjtState.mjSTATE_INTEGRATION
        state = np.empty(mujoco.mj_stateSize(self.model, kind))
        mujoco.mj_getState(self.model, self.data, state, kind)
        mujoco.mj_setState(model, data, state, kind)
        model.opt.noslip_iterations = self.model.opt.noslip_iterations
        for name in ("sensordata", "xpos", "xquat", "qfrc_constraint"):
            getattr(data, name)[:] = getattr(self.data, name)
        mine, theirs = self._parts.geom, parts_of(model, self.frames.wheel_names).geom
        for name in ("geom_surfacevel", "geom_friction"):
            getattr(model, name)[theirs] = getattr(self.model, name)[mine]
        for name in ("geom_xmat", "geom_xpos"):
            getattr(data, name)[theirs] = getattr(self.data, name)[mine]

    def _bind(self) -> None:
        """Keep views of MuJoCo's arrays: looking them up at every step would cost more."""
        model, data = self.model, self.data
        self._parts: WheelParts = parts_of(model, self.frames.wheel_names)
        self._qpos, self._qvel, self._ctrl, self._act = data.qpos, data.qvel, data.ctrl, data.act
        belly = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_GEOM, "belly")
        self._belly_geom = belly if belly >= 0 else None
        self._drive_act = self._parts.drive_act
        limit = model.actuator_forcerange[self._drive_act, 1]
        self._drive_reach = limit / model.actuator_gainprm[self._drive_act, 0]
        damping = model.actuator_biasprm[self._drive_act]
        self._drive_lag_s = damping[:, 2] / damping[:, 1]
        self._steered = self._parts.steered
        self._drive_dof = model.jnt_dofadr[self._parts.drive].astype(np.int64)
        self._drive_qpos = model.jnt_qposadr[self._parts.drive].astype(np.int64)
        self._steer_qpos = model.jnt_qposadr[self._parts.steer[self._steered]].astype(np.int64)
        joints = [model.joint(name).id for name in self._parts.suspension]
        self._suspension_qpos = model.jnt_qposadr[np.array(joints, dtype=np.int64)]
        start = int(model.sensor(f"load_{self.frames.wheel_names[0]}").adr[0])
        width = 5 * self._count
        self._contacts = data.sensordata[start : start + width].reshape(-1, 5)
        at = np.stack([self._parts.geom, self._parts.body, self._drive_dof])
        self.contact.bind(model, data, WheelIndex(at, start))

    def body_row(self) -> Array:
        """Give position, quaternion, velocity in the world and body rate, Shape (13,)."""
        return np.concatenate([self._qpos[:7], self._qvel[:6]])

    def wheel_row(self) -> Array:
        """Give the wheels' and joints' state as one row, for `truth_log`, Shape (13 w + j,)."""
        return np.concatenate(
            [
                self._qpos[self._drive_qpos],
                self._steer_angle(),
                self.contact.read()[2],
                self._contact_kinds(),
                self.data.geom_xpos[self._parts.geom].ravel(),
                self._leg_quat().ravel(),
                self.contact.force[0],
                self.sinkage_m,
                self._qpos[self._suspension_qpos],
            ]
        )

    def _steer_angle(self) -> Array:
        angle = np.zeros(self._count)
        angle[self._steered] = self._qpos[self._steer_qpos]
        return angle

    def _leg_quat(self) -> Array:
        """Give how the legs stand, with the body's axes where they have others, Shape (w, 4)."""
        quat = self.data.xquat[self._parts.leg]
        ahead = self._parts.R_leg_ahead
        return quat if ahead is None else so3.to_quat_wxyz(so3.from_quat_wxyz(quat) @ ahead)

    def _contact_kinds(self) -> NDArray[np.uint8]:
        found, soil = self._contacts[:, 0], self._contacts[:, 4]
        kind = np.where(found > 0, CONTACT_SOIL, CONTACT_NONE)
        return np.where(found > soil, CONTACT_ROCK, kind).astype(np.uint8)


def _facing(slope_x: float, slope_y: float, yaw_rad: float) -> Array:
    """Give the rotation with z normal to a plane and x along the heading, Shape (3, 3)."""
    up = np.array([-slope_x, -slope_y, 1.0])
    up /= np.linalg.norm(up)
    ahead = np.array([np.cos(yaw_rad), np.sin(yaw_rad), 0.0])
    left = np.cross(up, ahead)
    left /= np.linalg.norm(left)
    return np.stack([np.cross(left, up), left, up], axis=1)


def build_scene(
    ground: Ground,
    spec: RoverSpec,
    start_xy_m: Sequence[float] = (0.0, 0.0),
    start_yaw_rad: float = 0.0,
    law: WheelSoilLaw | None = None,
) -> Scene:
    """Set a rover down on a terrain.

    Args:
        ground: The terrain.
        spec: The rover.
        start_xy_m: Where, in the world [m].
        start_yaw_rad: Its heading [rad].
        law: The wheel-soil law; None for that of the terrain's soils as the spec says.

    Raises:
        UnknownNameError: There is no such rover model.
        PlanningError: The start lies outside the drivable ground.
    """
    xy = np.array([start_xy_m], dtype=float)
    check_drivable(ground, xy, reach_of(rover_frames(spec)))
    scene = Scene(ground, spec, law or law_on(ground, spec))
    scene.place(np.asarray(start_xy_m, dtype=float), start_yaw_rad)
    return scene
