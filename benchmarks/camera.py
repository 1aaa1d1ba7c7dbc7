"""Rendered stereo pairs against `mujoco.Renderer`, on the same model and on an empty plane."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import Row, Samples, alone_ms, compare_ms, in_turn
from lpet_sim.geometry import SE3
from lpet_sim.rng import stream
from lpet_sim.sensors.camera import StereoRenderer, make_eyes, place_eyes
from lpet_sim.sensors.camera_spec import StereoCameraSpec
from lpet_sim.sensors.image_chain import expose
from lpet_sim.sensors.render_scene import FAR_M, NEAR_M
from lpet_sim.sweep.simulate import World

Image = NDArray[Any]
Pair = tuple[Image, Image]

MULTISAMPLES = 4  # MuJoCo's default
_OPTICAL_TO_GL = np.diag([1.0, -1.0, -1.0])
_SAME = (
    "mujoco.Renderer draws the same geoms, textures blank, in 8-bit colour at 4 samples a pixel; "
    "LPET draws 16-bit radiance at 2 x 2 a pixel and fills in the sky"
)
_PLANE = (
    "mujoco.Renderer, one plane and one light, no shadows, 4 samples a pixel; "
    "LPET: relief, pebbles and rocks to the skyline with the sun's shadows"
)


@dataclass(frozen=True)
class CameraResult:
    """What was measured of the cameras.

    Attributes:
        rows: For the table.
        pairs: Images along the drive, for the other benchmarks.
        bare: Times of a bare pair of the same model.
    """

    rows: list[Row]
    pairs: list[Pair]
    bare: Samples


def measure(world: World, poses: Sequence[SE3], small: StereoCameraSpec) -> CameraResult:
    """Time the pairs of both cameras along a drive, and the image chain.

    Args:
        world: Terrain and rover.
        poses: Poses of the body, 2 cm apart.
        small: The camera of 640 x 480 px.
    """
    radiance, ours, same, plane = _in_turn(world, poses, small)
    _, large, large_same, _ = _in_turn(world, poses[::3], StereoCameraSpec())
    chain, pairs = _expose_all(radiance, small)
    rows = [
        compare_ms("stereo pair 640 x 480, same model", ours, same, note=_SAME),
        _with_new_ground(ours, same),
        compare_ms("stereo pair 1024 x 1024, same model", large, large_same, note=_SAME),
        compare_ms("stereo pair 640 x 480, empty plane", ours, plane, aim="<= 2", note=_PLANE),
        alone_ms("image chain of a pair 640 x 480", chain, "blur, vignetting, noise, encoding"),
    ]
    return CameraResult(rows, pairs, same)


def _with_new_ground(ours: Samples, bare: Samples) -> Row:
    return Row(
        part="stereo pair 640 x 480, mean over the drive",
        ours=1e3 * ours.mean_s,
        bare=1e3 * bare.mean_s,
        unit="ms",
        cost=ours.mean_s / bare.mean_s,
        cpu_cost=sum(ours.cpu_s) / sum(bare.cpu_s),
        note="as above, with the new ground and shadows that are made as the rover moves",
    )


def _in_turn(
    world: World, poses: Sequence[SE3], spec: StereoCameraSpec
) -> tuple[list[Pair], Samples, Samples, Samples]:
    """Time, at each pose: LPET, the bare renderer on LPET's model, and on an empty plane."""
    radiance: list[Pair] = []
    with StereoRenderer(world.terrain, spec, world.frames.T_body_camera) as renderer:
        radiance.append(renderer.render(poses[0]))
        inner = renderer._view._scene
        plane = _Plane(spec, world.frames.T_body_camera)
        with _bare_renderer(inner._model, spec) as bare, _bare_renderer(plane.model, spec) as empty:
            bare.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
            times = in_turn(
                poses[1:],
                lambda pose: radiance.append(renderer.render(pose)),
                lambda _: _draw(bare, inner._data),  # the eyes are where LPET has just put them
                lambda pose: _draw(empty, plane.seen_from(pose)),
            )
    ours, same, empty_times = times
    return radiance, ours, same, empty_times


@contextmanager
def _bare_renderer(model: mujoco.MjModel, spec: StereoCameraSpec) -> Iterator[mujoco.Renderer]:
    before = model.vis.quality.offsamples
    model.vis.quality.offsamples = MULTISAMPLES
    try:
        with mujoco.Renderer(model, spec.height_px, spec.width_px, max_geom=2000) as bare:
            yield bare
    finally:
        model.vis.quality.offsamples = before


def _draw(renderer: mujoco.Renderer, data: mujoco.MjData) -> list[NDArray[np.uint8]]:
    pair = []
    for eye in (0, 1):
        renderer.update_scene(data, camera=eye)
        pair.append(renderer.render())
    return pair


class _Plane:
    """An empty plane, seen by the same eyes."""

    def __init__(self, spec: StereoCameraSpec, T_body_camera: SE3) -> None:
        self.model = _plane_model(spec)
        self._data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self._data)
        self._T_body_eyes = place_eyes(spec, T_body_camera)

    def seen_from(self, T_world_body: SE3) -> mujoco.MjData:
        for eye, T_body_eye in enumerate(self._T_body_eyes):
            T_world_eye = T_world_body @ T_body_eye
            self._data.cam_xpos[eye] = T_world_eye.translation
            self._data.cam_xmat[eye] = (T_world_eye.rotation @ _OPTICAL_TO_GL).ravel()
        return self._data


def _plane_model(spec: StereoCameraSpec) -> mujoco.MjModel:
    out = mujoco.MjSpec()
    out.visual.global_.offwidth, out.visual.global_.offheight = spec.width_px, spec.height_px
    out.stat.extent = 1.0
    out.visual.map.znear, out.visual.map.zfar = NEAR_M, FAR_M
    out.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], rgba=[0.6, 0.4, 0.3, 1]
    )
    out.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[-1, 0, -1], castshadow=False
    )
    for eye in make_eyes(spec):
        out.worldbody.add_camera(
            resolution=[eye.width_px, eye.height_px],
            sensor_size=[eye.width_px * 1e-5, eye.height_px * 1e-5],
            focal_pixel=[eye.focal_px, eye.focal_px],
        )
    return out.compile()


def _expose_all(radiance: Sequence[Pair], spec: StereoCameraSpec) -> tuple[Samples, list[Pair]]:
    times, pairs = Samples(), []
    for index, pair in enumerate(radiance):
        pairs.append(times.time(lambda index=index, pair=pair: _expose(pair, spec, index)))
    return times.after(1), pairs


def _expose(radiance: Pair, spec: StereoCameraSpec, index: int) -> Pair:
    rng = stream(index, "benchmark", "camera")
    left, right = (expose(eye, spec.chain, spec.focal_px, rng) for eye in radiance)
    return left, right
