"""Straight drives of a scene without a path follower, for tests of the wheels on soil."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import mujoco
import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import RoverSpec
from tests.rover.grounds import Waves

RADIUS_M = 0.1425


def start(ground: Waves, spec: RoverSpec | None = None, rest_s: float = 2.0) -> Scene:
    """Set a rover down and let it rest."""
    scene = build_scene(ground, spec or RoverSpec())
    for _ in range(round(rest_s / scene.spec.physics_dt_s)):
        scene.step()
    return scene


def steps(scene: Scene, seconds: float, speed_mps: float) -> Iterator[int]:
    """Drive straight ahead, with a command ten times a second; give control after each step."""
    every = round(0.1 / scene.spec.physics_dt_s)
    for k in range(round(seconds / scene.spec.physics_dt_s)):
        if k % every == 0:
            scene.follow()
            scene.command(np.zeros(6), np.full(6, speed_mps / RADIUS_M))
        scene.step()
        yield k


def roll(scene: Scene, seconds: float, speed_mps: float) -> None:
    """Drive straight ahead."""
    for _ in steps(scene, seconds, speed_mps):
        pass


@dataclass
class Way:
    """How a rover moved for what its wheels turned.

    Attributes:
        ahead: Distance along x over the way that the rims turned.
        left: The same along y.
        forces: Forces and rates of the wheels at every step, Shape (n, 4, 6).
    """

    ahead: float
    left: float
    forces: Array


def measure(scene: Scene, seconds: float, speed_mps: float) -> Way:
    """Drive straight ahead from x = y = 0 on, and measure in the ground's own plane."""
    begin, turned = scene.body_row()[:3], scene.wheel_row()[:6].mean()
    forces = np.array([scene.contact.force.copy() for _ in steps(scene, seconds, speed_mps)])
    x, y, z = scene.body_row()[:3] - begin
    rim = RADIUS_M * (scene.wheel_row()[:6].mean() - turned)
    x, y = np.copysign(np.hypot(x, z), x) if abs(x) > abs(y) else x, y
    return Way(float(x / rim), float(y / rim), forces)


def mechanical_energy_j(scene: Scene) -> float:
    """Give kinetic and potential energy of the rover."""
    model, data = scene.model, mujoco.MjData(scene.model)
    data.qpos[:], data.qvel[:] = scene.data.qpos, scene.data.qvel
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_energyPos(model, data)
    mujoco.mj_energyVel(model, data)
    return float(data.energy.sum())


def motor_work_j(scene: Scene, seconds: float, speed_mps: float) -> float:
    """Drive straight ahead, and give the work of all motors."""
    work, before = 0.0, scene.data.qvel.copy()
    for _ in steps(scene, seconds, speed_mps):
        mean = (before + scene.data.qvel) / 2
        work += float(scene.data.qfrc_actuator @ mean) * scene.spec.physics_dt_s
        before = scene.data.qvel.copy()
    return work
