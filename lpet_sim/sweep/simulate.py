"""Drive a traverse, sense it on the way, and record it: memory does not grow with the distance."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from lpet_sim.outputs import output_folder
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.truth import Event, Truth, in_order
from lpet_sim.recording.writer import RecordingWriter
from lpet_sim.rng import stream
from lpet_sim.rover.drive import drive, start_of
from lpet_sim.rover.frames import RoverFrames
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import DriveSpec
from lpet_sim.sensors.camera import StereoRenderer
from lpet_sim.sensors.imu import Imu
from lpet_sim.sensors.suite import declared_calibration
from lpet_sim.sensors.wheels import WheelEncoders
from lpet_sim.sweep.cameras import StereoPipeline, TakenPair, check_period
from lpet_sim.sweep.scenery import RoverArtist, draw_ground
from lpet_sim.sweep.traverse import TraverseSpec, manifest_of, planned_drive
from lpet_sim.terrain.terrain import Terrain, build_terrain


@dataclass(frozen=True)
class World:
    """A traverse with everything built, ready to be driven.

    Attributes:
        spec: The traverse.
        seed: The run's seed.
        terrain: The ground.
        drive: The drive along the planned path.
        scene: The rover on the ground, at the start.
    """

    spec: TraverseSpec
    seed: int
    terrain: Terrain
    drive: DriveSpec
    scene: Scene

    @property
    def frames(self) -> RoverFrames:
        """Where things are on the rover."""
        return self.scene.frames


@dataclass(frozen=True)
class SimulateResult:
    """A traverse that was driven and recorded.

    Attributes:
        path: The recording.
        events: What happened on the drive, in order of time; the one that `ends` says how.
    """

    path: Path
    events: tuple[Event, ...]


def build_world(spec: TraverseSpec, seed: int) -> World:
    """Build ground, path and rover.

    Args:
        spec: The traverse.
        seed: The run's seed.

    Raises:
        SpecError: Rates that do not fit together.
        PlanningError: A start or goal that cannot be reached.
    """
    if spec.images is not None and spec.sensors.stereo is not None:
        check_period(spec.images, spec.drive.imu_rate_hz)
    terrain = build_terrain(spec.terrain, seed)
    path = planned_drive(spec, terrain, seed)
    start, heading_rad = start_of(path)
    return World(spec, seed, terrain, path, build_scene(terrain, spec.rover, start, heading_rad))


def simulate(
    spec: TraverseSpec, seed: int, path: Path, progress: Progress = silent
) -> SimulateResult:
    """Drive a traverse and record it.

    A drive that fails on the way (tips, sinks in, hangs up, gets stuck) is a result like any other.

    Args:
        spec: The traverse.
        seed: The run's seed; the same spec and seed give the same arrays to the bit.
        path: The recording to write, ending in .rrd.
        progress: Called with the fraction of the path driven.

    Returns:
        The recording, and what happened on the drive.

    Raises:
        LpetError: The spec cannot be driven, or the file cannot be written.
    """
    output_folder(path.parent)
    world = build_world(spec, seed)
    pieces = drive(world.scene, world.drive)
    first = next(pieces)
    calibration = _calibration(world, first)
    manifest = manifest_of(spec, world.drive, seed)
    keep = spec.images.keep_every if spec.images else 0
    with RecordingWriter(path, manifest, calibration, keep) as writer, ExitStack() as stack:
        sensing = _Sensing(world, calibration, writer, stack)
        driven_m, length_m = 0.0, _length_m(world.drive)
        events: list[Event] = []
        for piece in chain([first], pieces):
            sensing.sense(piece)
            events += piece.events
            driven_m += _moved_m(piece)
            progress(min(1.0, driven_m / length_m))
        sensing.finish()
        draw_ground(writer, world.terrain, np.asarray(world.drive.waypoints_m))
    return SimulateResult(path, in_order(events))


def _calibration(world: World, first: Truth) -> Calibration:
    suite, frames = world.spec.sensors, world.frames
    start = first.body.T_world_body[0]
    rate_hz = world.drive.imu_rate_hz
    return declared_calibration(suite, frames, frames.gravity_mps2, start, rate_hz)


class _Sensing:
    """The sensors of one traverse, fed with the truth piece by piece."""

    def __init__(
        self, world: World, calibration: Calibration, writer: RecordingWriter, stack: ExitStack
    ) -> None:
        self._writer = writer
        self._artist = RoverArtist(writer, world.spec.rover)
        suite, frames, seed = world.spec.sensors, world.frames, world.seed
        self._imu = self._wheels = self._stereo = None
        if suite.imu is not None:
            rng = stream(seed, "traverse", "imu")
            self._imu = Imu(suite.imu, frames.T_body_imu, frames.gravity_mps2, rng)
        if suite.wheels is not None:
            rng = stream(seed, "traverse", "wheels")
            steers = tuple(bool(limit > 0) for limit in frames.steer_limit_rad)
            self._wheels = WheelEncoders(suite.wheels, len(steers), rng, steers)
        if suite.stereo is not None and world.spec.images is not None and calibration.stereo:
            renderer = StereoRenderer(world.terrain, suite.stereo, frames.T_body_camera)
            pipeline = StereoPipeline(
                world.spec.images, renderer, suite.stereo, calibration.stereo, seed
            )
            self._stereo = stack.enter_context(pipeline)

    def sense(self, truth: Truth) -> None:
        """Record a piece of truth and what the sensors make of it."""
        self._writer.log_truth(truth)
        self._artist.draw(truth)
        if self._imu is not None:
            self._writer.log_imu(self._imu.sense(truth.body))
        if self._wheels is not None and truth.wheels is not None:
            self._writer.log_wheels(self._wheels.sense(truth.wheels))
        if self._stereo is not None:
            self._log_pairs(self._stereo.take(truth.body))

    def finish(self) -> None:
        """Record the image pairs that are still under way."""
        if self._stereo is not None:
            self._log_pairs(self._stereo.rest())

    def _log_pairs(self, pairs: Iterable[TakenPair]) -> None:
        for pair in pairs:
            self._writer.log_images(pair.t_ns, pair.left, pair.right)
            if pair.sightings is not None:
                self._writer.log_sightings(pair.sightings)


def _moved_m(piece: Truth) -> float:
    p = piece.body.T_world_body.translation
    return float(np.linalg.norm(p[-1] - p[0]))


def _length_m(spec: DriveSpec) -> float:
    corners = np.asarray(spec.waypoints_m, dtype=float)
    return float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
