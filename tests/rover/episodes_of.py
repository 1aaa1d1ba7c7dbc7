"""Short drives over analytic grounds, and what happened on them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.truth import Event, Truth, in_order
from lpet_sim.rover.drive import drive, start_of
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import DriveSpec, RoverSpec
from lpet_sim.rover.wheel_soil import WheelSoilLaw
from tests.rover.grounds import Waves

THREE_METRES = ((0.0, 0.0), (3.0, 0.0))


@dataclass
class Outcome:
    """A drive that is over."""

    scene: Scene
    chunks: list[Truth]

    @property
    def events(self) -> tuple[Event, ...]:
        """Everything that happened, in order of time."""
        return in_order(event for chunk in self.chunks for event in chunk.events)

    def of(self, kind: str) -> list[Event]:
        """Give the events of a kind."""
        return [event for event in self.events if event.kind == kind]

    @property
    def ending(self) -> Event:
        """The one event that ended the drive."""
        (event,) = [event for event in self.events if event.ends]
        return event

    @property
    def t_s(self) -> np.ndarray:
        """Times of the body's samples [s]."""
        return np.concatenate([chunk.body.t_ns for chunk in self.chunks]) / NS_PER_S

    @property
    def position(self) -> np.ndarray:
        """Positions of the body [m], Shape (n, 3)."""
        return np.concatenate([chunk.body.T_world_body.translation for chunk in self.chunks])

    def wheels(self, name: str) -> np.ndarray:
        """Join an array of the wheels' truth."""
        return np.concatenate([getattr(chunk.wheels, name) for chunk in self.chunks])


def drive_over(
    ground: Waves, law: WheelSoilLaw | None = None, rover: RoverSpec | None = None, **spec: Any
) -> Outcome:
    """Drive at 10 cm/s, sampled at 10 Hz, three metres ahead unless told otherwise."""
    fields = {"waypoints_m": THREE_METRES, "speed_mps": 0.1, "settle_s": 1.0}
    rates = {"imu_rate_hz": 10.0, "wheel_rate_hz": 10.0}
    asked = DriveSpec(**{**fields, **rates, **spec})
    scene = build_scene(ground, rover or RoverSpec(), *start_of(asked), law=law)
    return Outcome(scene, list(drive(scene, asked)))
