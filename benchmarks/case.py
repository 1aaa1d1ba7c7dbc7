"""What all benchmarks work on: a straight traverse over ExoMars-like ground."""

from __future__ import annotations

from dataclasses import dataclass

from lpet_sim.geometry import SE3
from lpet_sim.recording.truth import Truth
from lpet_sim.rover.spec import DriveSpec
from lpet_sim.sensors.camera_spec import StereoCameraSpec
from lpet_sim.sensors.suite import SensorSuiteSpec
from lpet_sim.sweep.simulate import World, build_world
from lpet_sim.sweep.traverse import ImagesSpec, TraverseSpec

SEED = 7
PERIOD_S = 0.72
"""Between image pairs: 2 cm at 100 m/h."""


@dataclass(frozen=True)
class Case:
    """A traverse at a size.

    Attributes:
        length_m: How far the rover drives.
        pairs: Image pairs that the camera and vision benchmarks use.
        repetitions: How often the short things are done.
        sensed_m: How far the landmark sensor goes.
        images: Length of the SLAM filter's drives.
    """

    length_m: float
    pairs: int
    repetitions: int
    sensed_m: float
    images: int

    @classmethod
    def full(cls) -> Case:
        """Make the case whose numbers count."""
        return cls(length_m=2.5, pairs=60, repetitions=5, sensed_m=34.0, images=1000)

    @classmethod
    def quick(cls) -> Case:
        """Make a case that only shows that everything runs."""
        return cls(length_m=0.6, pairs=12, repetitions=2, sensed_m=1.0, images=240)

    def traverse(self) -> TraverseSpec:
        """Give the traverse: 100 m/h, a pair of 640 x 480 px every 2 cm, all sensors."""
        return TraverseSpec(
            name="benchmark",
            terrain="exomars",  # type: ignore[arg-type]
            drive=DriveSpec(waypoints_m=((0.0, 0.0), (self.length_m, 0.0))),
            route=None,
            sensors=SensorSuiteSpec(stereo=StereoCameraSpec.small()),
            images=ImagesSpec(period_s=PERIOD_S),
        )

    def build(self) -> World:
        """Build the traverse's ground and rover."""
        return build_world(self.traverse(), SEED)

    def poses(self, pieces: list[Truth]) -> list[SE3]:
        """Give the body's poses 2 cm apart, at most as many as there are `pairs`."""
        period_ns = round(PERIOD_S * 1e9)
        rows = [
            piece.body.T_world_body[row]
            for piece in pieces
            for row in range(len(piece.body))
            if piece.body.t_ns[row] % period_ns == 0
        ]
        return rows[-self.pairs :]
