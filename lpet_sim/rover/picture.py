"""A picture of a rover on its ground, as MuJoCo renders it: to see whether a model is right.

One of the files of the room that import MuJoCo.
"""

from __future__ import annotations

import importlib
import os
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import UnknownNameError
from lpet_sim.geometry import SE3
from lpet_sim.rover.frames import RoverFrames
from lpet_sim.rover.ground import cut_patch
from lpet_sim.rover.mjcf import spec_on
from lpet_sim.rover.scene import Scene

_CONTEXTS = ("egl", "glfw", "osmesa")
_GROUND_RGBA, _ROCK_RGBA = [0.62, 0.46, 0.34, 1.0], [0.48, 0.37, 0.30, 1.0]
_HIDDEN_GROUPS = slice(2, None)
_SUN = np.array([-0.55, 0.45, -0.70])


@dataclass(frozen=True)
class PictureView:
    """From where a picture is taken.

    Attributes:
        azimuth_rad: Direction in which the camera looks, from the body's x to its left; the
            default looks from ahead on the left.
        elevation_rad: How far it looks down.
        width_px: Width of the picture.
        height_px: Height of the picture.
        patch_m: Side of the ground that is shown.
    """

    azimuth_rad: float = np.radians(-140.0)
    elevation_rad: float = np.radians(18.0)
    width_px: int = 1280
    height_px: int = 800
    patch_m: float = 16.0


def offscreen_context(width_px: int, height_px: int) -> Any:
    """Make an offscreen context by the way that MUJOCO_GL names; egl where it is not set.

    Raises:
        UnknownNameError: MUJOCO_GL names no offscreen OpenGL.
    """
    way = os.environ.get("MUJOCO_GL", "egl").lower()
    if way not in _CONTEXTS:
        raise UnknownNameError("value of MUJOCO_GL", way, _CONTEXTS)
    return importlib.import_module(f"mujoco.{way}").GLContext(width_px, height_px)


def rover_picture(scene: Scene, view: PictureView | None = None) -> NDArray[np.uint8]:
    """Take a picture of a rover where it stands.

    Args:
        scene: The rover on its ground.
        view: From where; None for the default.

    Returns:
        Shape (h, w, 3).
    """
    view = view or PictureView()
    model = _lit_model(scene, view)
    data = mujoco.MjData(model)
    data.qpos[:] = scene.data.qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_camlight(model, data)
    return _render(model, data, _camera(scene, view), view)


def _lit_model(scene: Scene, view: PictureView) -> Any:
    """Compile the rover with more ground than it drives on, and a sun."""
    patch = cut_patch(scene.ground, scene.xy, view.patch_m)
    rocks = scene.ground.rocks(patch.box(), scene.spec.rock_min_diameter_m)
    spec = spec_on(scene.spec.model, scene.spec.physics_dt_s, patch, rocks)
    spec.visual.global_.offwidth, spec.visual.global_.offheight = view.width_px, view.height_px
    spec.visual.quality.shadowsize = 4096
    spec.visual.headlight.active = 1
    spec.visual.headlight.ambient = [0.35, 0.35, 0.38]
    spec.visual.headlight.diffuse = [0.15, 0.15, 0.15]
    spec.visual.headlight.specular = [0.0, 0.0, 0.0]
    spec.stat.extent = view.patch_m / 2
    spec.stat.center = [*scene.xy, 0.0]
    # Shadows are cast in a tube along the light, through where it stands.
    from_m = scene.body_row()[:3] - 10.0 * _SUN
    sun = spec.worldbody.add_light(pos=from_m, dir=_SUN, castshadow=True)
    sun.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    sun.diffuse = [0.8, 0.77, 0.7]
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.80, 0.68, 0.56],
        rgb2=[0.55, 0.45, 0.38],
        width=64,
        height=64,
    )
    _paint(spec)
    model = spec.compile()
    model.hfield_data[:] = patch.data.ravel()
    return model


def _paint(spec: Any) -> None:
    for geom in spec.worldbody.geoms:
        geom.rgba = _GROUND_RGBA if geom.name == "ground" else _ROCK_RGBA


def _camera(scene: Scene, view: PictureView) -> Any:
    camera = mujoco.MjvCamera()
    camera.type = mujoco.mjtCamera.mjCAMERA_FREE
    size = _size_m(scene.frames)
    middle = scene.frames.wheel_position_body_m.mean(axis=0) * [1.0, 1.0, 0.0]
    body = SE3.from_quat_wxyz(scene.body_row()[3:7], scene.body_row()[:3])
    camera.lookat[:] = body @ middle + [0.0, 0.0, 0.15 * size]
    camera.distance = 2.1 * size
    camera.azimuth = np.degrees(view.azimuth_rad + scene.yaw_rad)
    camera.elevation = -np.degrees(view.elevation_rad)
    return camera


def _size_m(frames: RoverFrames) -> float:
    """Give about how large the rover is: its wheels' spread, or its mast's height [m]."""
    spread = float(np.ptp(frames.wheel_position_body_m, axis=0).max()) + 2 * frames.wheel_radius_m
    return max(spread, float(frames.T_body_camera.translation[2]) + frames.ride_height_m)


def _render(model: Any, data: Any, camera: Any, view: PictureView) -> NDArray[np.uint8]:
    gl = offscreen_context(view.width_px, view.height_px)
    gl.make_current()
    try:
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, context)
        option, scene = mujoco.MjvOption(), mujoco.MjvScene(model, maxgeom=4000)
        option.geomgroup[_HIDDEN_GROUPS] = 0
        option.sitegroup[:] = 0
        everything = mujoco.mjtCatBit.mjCAT_ALL.value
        perturb = mujoco.MjvPerturb()
        mujoco.mjv_updateScene(model, data, option, perturb, camera, everything, scene)
        rect = mujoco.MjrRect(0, 0, view.width_px, view.height_px)
        image = np.empty((view.height_px, view.width_px, 3), dtype=np.uint8)
        mujoco.mjr_render(rect, scene, context)
        mujoco.mjr_readPixels(image, None, rect, context)
        context.free()
        return np.ascontiguousarray(image[::-1])
    finally:
        gl.free()
