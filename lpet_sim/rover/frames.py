"""Frames, wheels and joints of a rover, read from its MJCF: the model is their only source."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.rover.mjcf import bare_model
from lpet_sim.rover.model_parts import link_pose
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.wheel_parts import wheel_parts


@dataclass(frozen=True)
class RoverFrames:
    """Where things are on the rover, with its suspension and steering at zero.

    Attributes:
        T_body_imu: Pose of the inertial unit.
        T_body_camera: Pose of the left eye (optical: x right, y down, z forward).
        T_body_camera_right: Pose of the right eye; None where the model does not say it.
        wheel_names: Names of the wheels; their order everywhere.
        wheel_position_body_m: Centres of the wheels in the body [m], Shape (w, 3).
        wheel_radius_m: Radius of the wheels [m].
        wheel_width_m: Width of the wheels [m].
        steer_limit_rad: Largest steering angle of each wheel, 0 where it does not steer [rad],
            Shape (w,).
        suspension_joints: Names of the joints of `WheelTruth.joint_angle_rad`, in its order.
        mass_kg: Mass of the whole rover [kg].
        gravity_mps2: Magnitude of gravity in the model [m/s^2].
    """

    T_body_imu: SE3
    T_body_camera: SE3
    T_body_camera_right: SE3 | None
    wheel_names: tuple[str, ...]
    wheel_position_body_m: Array
    wheel_radius_m: float
    wheel_width_m: float
    steer_limit_rad: Array
    suspension_joints: tuple[str, ...]
    mass_kg: float
    gravity_mps2: float

    @property
    def contact_body_m(self) -> Array:
        """Lowest points of the wheels in the body, on flat ground at rest [m], Shape (w, 3)."""
        return self.wheel_position_body_m - [0.0, 0.0, self.wheel_radius_m]

    @property
    def wheel_share_n(self) -> float:
        """An equal share of the weight for each wheel [N]."""
        return self.mass_kg * self.gravity_mps2 / len(self.wheel_names)

    @property
    def ride_height_m(self) -> float:
        """Height of the body's origin above flat ground at rest [m]."""
        return float(-self.contact_body_m[:, 2].mean())


def rover_frames(spec: RoverSpec) -> RoverFrames:
    """Read the frames of a rover from its MJCF.

    Raises:
        UnknownNameError: There is no such rover model, or it lacks what its description names.
        SpecError: It cannot be read, or is not what a rover needs.
    """
    model = bare_model(spec.model)
    wheels = wheel_parts(spec.model)
    tread = model.geom_size[wheels.geom[0]]
    right = has_site(spec, "camera_right")
    return RoverFrames(
        T_body_imu=site_pose(spec, "imu"),
        T_body_camera=site_pose(spec, "camera"),
        T_body_camera_right=site_pose(spec, "camera_right") if right else None,
        wheel_names=wheels.names,
        wheel_position_body_m=np.array([_geom_place(spec, geom) for geom in wheels.geom]),
        wheel_radius_m=float(tread[0]),
        wheel_width_m=float(2 * tread[1]),
        steer_limit_rad=np.array([0.0 if j < 0 else model.jnt_range[j, 1] for j in wheels.steer]),
        suspension_joints=wheels.suspension,
        mass_kg=float(model.body("body").subtreemass[0]),
        gravity_mps2=float(-model.opt.gravity[2]),
    )


def _geom_place(spec: RoverSpec, geom: int) -> Array:
    """Give the middle of a geom in the body [m], Shape (3,)."""
    model = bare_model(spec.model)
    owner = model.body(int(model.geom_bodyid[geom])).name
    return body_pose(spec, owner) @ np.array(model.geom_pos[geom])


def body_pose(spec: RoverSpec, name: str) -> SE3:
    """Give ``T_body_link`` of a link of the rover, with every joint at zero."""
    model = bare_model(spec.model)
    return link_pose(model, model.body(name).id, model.body("body").id)


def has_site(spec: RoverSpec, name: str) -> bool:
    """Tell whether the rover has a site of that name."""
    model = bare_model(spec.model)
    return name in [model.site(k).name for k in range(model.nsite)]


def site_pose(spec: RoverSpec, name: str) -> SE3:
    """Give ``T_body_site`` of a site of the rover, with every joint at zero."""
    model = bare_model(spec.model)
    site = model.site(name)
    owner = model.body(int(site.bodyid[0])).name
    return body_pose(spec, owner) @ SE3.from_quat_wxyz(site.quat, site.pos)
