"""Steps with the wheel-soil law and the brakes against bare MuJoCo steps from the same states."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from benchmarks.timing import Row, Samples, compare_steps
from lpet_sim.rig.bed import TiltBed
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.sweep.simulate import World
from lpet_sim.terrain.spec import TerrainSpec

STEPS = 1000
WARM_UP = 100
AIM = "1.4"
NOTES = {
    "law": "Scene.step() against mj_step of the same model with wheels that roll without a law",
    "law and brakes": (
        "the same, against mj_step without what makes brakes hold either (noslip_iterations)"
    ),
}


def measure(world: World, repetitions: int) -> list[Row]:
    """Time pieces of two straight drives three ways: law and brakes, brakes alone, bare.

    Args:
        world: A rover that stands at the start of its drive among rocks; it is driven on.
        repetitions: Pieces of `STEPS` steps; one more is driven first and not counted.
    """
    bed = TiltBed(TerrainSpec(soils=world.scene.ground.spec.soils), slope_rad=0.0)
    flat = build_scene(bed, world.scene.spec)
    on_rocks = _rows(world.scene, world.drive.speed_mps, repetitions, "exomars")
    return [*on_rocks, *_rows(flat, world.drive.speed_mps, repetitions, "flat")]


def _rows(scene: Scene, speed_mps: float, repetitions: int, where: str) -> list[Row]:
    ours, braked, bare = Samples(), Samples(), Samples()
    for _ in range(1 + 2 * repetitions):
        scene.follow()
        scene.command(np.zeros(6), np.full(6, speed_mps / scene.frames.wheel_radius_m))
        _drive(scene, WARM_UP)
        _time_bare(scene, braked, brakes=True)
        _time_bare(scene, bare, brakes=False)
        ours.time(lambda: _drive(scene, STEPS))
    return [
        _row("law", where, ours, braked),
        _row("law and brakes", where, ours, bare),
    ]


def _drive(scene: Scene, steps: int) -> None:
    for _ in range(steps):
        scene.step()


def _time_bare(scene: Scene, samples: Samples, brakes: bool) -> None:
    """Time MuJoCo alone; surfaces that kept still to a slip of the past would cost it more."""
    model, data = copy.copy(scene.model), copy.copy(scene.data)
    model.geom_surfacevel[:] = 0.0
    data.xfrc_applied[:] = 0.0
    if not brakes:
        model.opt.noslip_iterations = 0
    _step(model, data, WARM_UP)
    samples.time(lambda: _step(model, data, STEPS))


def _step(model: mujoco.MjModel, data: mujoco.MjData, steps: int) -> None:
    for _ in range(steps):
        mujoco.mj_step(model, data)


def _row(part: str, where: str, ours: Samples, bare: Samples) -> Row:
    name = f"wheel-soil {part}, {where}"
    return compare_steps(name, ours.after(1), bare.after(1), STEPS, AIM, NOTES[part])
