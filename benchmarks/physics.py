"""Steps of a drive against bare MuJoCo steps of the same model from the same state."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import mujoco

from benchmarks.timing import Row, Samples, compare_steps
from lpet_sim.recording.truth import Truth
from lpet_sim.rover.drive import drive
from lpet_sim.rover.scene import Scene
from lpet_sim.sweep.simulate import World

CHUNK_S = 5.0
NOTE = (
    "drive(): slip law at every step, follower and soil at 10 Hz, truth logged at 100 and 20 Hz; "
    "bare: a Python loop of mj_step from each chunk's first state"
)


@dataclass(frozen=True)
class PhysicsResult:
    """What was measured of the physics.

    Attributes:
        row: For the table.
        pieces: The truth of the drive, for the other benchmarks.
        bare: Times of a bare step.
    """

    row: Row
    pieces: list[Truth]
    bare: Samples


def measure(world: World) -> PhysicsResult:
    """Time the drive chunk by chunk, and bare steps from the state that each chunk began with."""
    scene = world.scene
    chunks = drive(scene, world.drive, CHUNK_S)
    pieces, ours, bare = [next(chunks)], Samples(), Samples()
    while True:
        model, data = copy.copy(scene.model), copy.copy(scene.data)
        before = scene.step_count
        chunk = ours.time(lambda: next(chunks, None))
        if chunk is None:
            break
        pieces.append(chunk)
        steps = scene.step_count - before
        bare.time(lambda model=model, data=data, steps=steps: _step(model, data, steps))
    return _result(scene, pieces, ours, bare)


def _step(model: mujoco.MjModel, data: mujoco.MjData, steps: int) -> None:
    for _ in range(steps):
        mujoco.mj_step(model, data)


def _result(scene: Scene, pieces: list[Truth], ours: Samples, bare: Samples) -> PhysicsResult:
    full = len(pieces) - 2  # neither the first chunk nor the last, which is shorter
    ours = Samples(ours.wall_s[:full], ours.cpu_s[:full])
    bare = Samples(bare.wall_s[:full], bare.cpu_s[:full])
    steps = CHUNK_S / scene.spec.physics_dt_s
    row = compare_steps("physics, drive loop", ours, bare, steps, note=NOTE)
    return PhysicsResult(row, pieces, bare.shared_by(steps))
