"""Steps with the wheel-soil law and the brakes against bare MuJoCo steps from the same states."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from benchmarks.timing import Row, Samples
from lpet_sim.rover.scene import Scene
from lpet_sim.sweep.simulate import World

STEPS = 400
AIM = "1.4"
LAW_NOTE = "Scene.step() against mj_step of the same model: traction, table, slip, sinkage, torque"
BRAKES_NOTE = (
    "Scene.step() against mj_step of the model without what makes brakes hold (noslip_iterations)"
)


def measure(world: World, repetitions: int) -> list[Row]:
    """Time pieces of a straight drive three ways: with law and brakes, with brakes only, bare.

    Args:
        world: A rover that stands at the start of its drive; it is driven on.
        repetitions: Pieces of `STEPS` steps; one more is driven first and not counted.
    """
    scene = world.scene
    rate = world.drive.speed_mps / scene.frames.wheel_radius_m
    ours, braked, bare = Samples(), Samples(), Samples()
    for _ in range(1 + 4 * repetitions):
        scene.follow()
        scene.command(np.zeros(6), np.full(6, rate))
        _time_bare(scene, braked, brakes=True)
        _time_bare(scene, bare, brakes=False)
        ours.time(lambda: _drive(scene))
    return [
        _row("wheel-soil law", ours, braked, LAW_NOTE),
        _row("wheel-soil law and brakes", ours, bare, BRAKES_NOTE),
    ]


def _drive(scene: Scene) -> None:
    for _ in range(STEPS):
        scene.step()


def _time_bare(scene: Scene, samples: Samples, brakes: bool) -> None:
    model, data = copy.copy(scene.model), copy.copy(scene.data)
    if not brakes:
        model.opt.noslip_iterations = 0
    samples.time(lambda: _step(model, data))


def _step(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    for _ in range(STEPS):
        mujoco.mj_step(model, data)


def _row(part: str, ours: Samples, bare: Samples, note: str) -> Row:
    ours, bare = ours.after(1), bare.after(1)
    return Row(
        part=part,
        ours=STEPS / ours.median_s,
        bare=STEPS / bare.median_s,
        unit="steps/s",
        cost=ours.median_s / bare.median_s,
        cpu_cost=ours.median_cpu_s / bare.median_cpu_s,
        aim=AIM,
        note=note,
    )
