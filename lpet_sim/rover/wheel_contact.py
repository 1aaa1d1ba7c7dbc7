"""The wheels where they meet the ground: what lies under them, and the law's part in every step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.ground import Ground
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.wheel_forces import follow_forces, move_wheels, read_wheels
from lpet_sim.rover.wheel_soil import (
    DEEPEST,
    WheelResponse,
    WheelSoilLaw,
    WheelSoilSpec,
    WheelState,
    tabulated_law,
)
from lpet_sim.soil.spec import WheelSpec

_LOOK_S = 0.1  # soil and normals are looked up again after this: 3 mm at 100 m/h
_CROSS = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])


@dataclass(frozen=True)
class WheelIndex:
    """Where a model keeps its wheels.

    Attributes:
        at: Geoms, bodies and joint rates, Shape (3, w).
        contacts: Where the contact sensors begin in `sensordata`.
    """

    at: Ints
    contacts: int


class WheelContact:
    """The wheels on the ground, whatever model of it is loaded.

    Attributes:
        law: The wheel-soil law.
        force: Forces of the ground on the wheels, forward, to the left and normal [N], and their
            rates [rad/s], Shape (4, w).
        wheels: What the law was told last.
        response: What it answered.
        motion: Slip, side creep and depth [m] of the wheels as they are, Shape (3, w).
        normal: Normal of the ground under each wheel, Shape (w, 3).
    """

    def __init__(
        self,
        law: WheelSoilLaw,
        spec: WheelSoilSpec,
        count: int,
        radius_m: float,
        share_kg: float,
        dt_s: float,
    ) -> None:
        """Start with wheels that stand on the surface; `bind` gives them a model."""
        self.law = law
        self.wheels = WheelState.of(count)
        self.response = WheelResponse.of(count)
        self.motion = np.zeros((3, count))
        self.normal = np.tile([0.0, 0.0, 1.0], (count, 1))
        self.force = np.zeros((4, count))
        self._mean = np.zeros((4, count))
        self._arm = np.full(count, radius_m)
        self._radius_m = radius_m
        self._looked = 0
        self._looks_every = max(1, round(_LOOK_S / dt_s))
        gains = [-math.expm1(-dt_s / tau) for tau in (spec.filter_s, spec.side_filter_s)]
        length = spec.sinking_length * radius_m
        self._pace = np.array([dt_s, *gains, length, radius_m, spec.sinks, share_kg, 0.0])

    def stand(self, ground: Ground, load_n: float) -> float:
        """Let wheels without motion stand as deep as a load presses them; give the mean depth [m].

        Args:
            ground: What they stand on; the model must know where they are.
            load_n: Load of each wheel [N].
        """
        self.look_under(ground)
        for array in (self.motion, self.force, self._mean):
            array[:] = 0.0
        told = self.wheels
        told.on_rock[:] = False
        for zero in (told.traction_n, told.side_n, told.omega_radps):
            zero[:] = 0.0
        told.load_n[:] = self._mean[2] = load_n
        self.law.respond(self.wheels, self.response)
        self.motion[2] = np.minimum(self.response.sinkage_m, DEEPEST * self._radius_m)
        return float(self._pace[5] * self.motion[2].mean())

    def bind(self, model: Any, data: Any, index: WheelIndex) -> None:
        """Keep views of a model's arrays: looking them up at every step would cost more."""
        self._pace[7] = margin = model.geom_margin[index.at[0, 0]]
        stand = self._radius_m - self._pace[5] * self.motion[2]
        model.geom_size[index.at[0], 0], self._arm[:] = stand - margin, stand - margin / 2
        at, wheels, answer = index.at, self.wheels, self.response
        contacts = data.sensordata[index.contacts : index.contacts + 5 * at.shape[1]].reshape(-1, 5)
        self._position = data.geom_xpos
        self._geom = at[0]
        self._read = (
            *(contacts, data.geom_xmat, data.qfrc_constraint, data.qvel, at),
            *(self.normal, self._arm, self.force, wheels.on_rock),
        )
        self._followed = (
            *(self.force, self._pace, answer.slip_steepness, answer.side_steepness, self._mean),
            *(wheels.traction_n, wheels.side_n, wheels.load_n, wheels.omega_radps),
        )
        self._moved = (
            *(at, data.geom_xmat, model.geom_surfacevel, model.geom_size, model.geom_friction),
            *(data.xfrc_applied, self._pace),
        )
        self._told = (
            *(self.force, self._mean, answer.slip, answer.side_creep, answer.sinkage_m),
            *(answer.torque_nm, answer.friction, self.motion, self._arm),
        )

    def read(self) -> Array:
        """Read the forces of the last step, Shape (4, w)."""
        read_wheels(*self._read)
        return self.force

    def step(self, ground: Ground, held: bool) -> None:
        """Read the forces of the last step, ask the law, and set up the next.

        Args:
            ground: What the wheels stand on.
            held: Whether their surfaces are to stand still.
        """
        self._looked += 1
        if self._looked >= self._looks_every:
            self.look_under(ground)
        read_wheels(*self._read)
        follow_forces(*self._followed)
        self.law.respond(self.wheels, self.response)
        move_wheels(*self._moved, held, *self._told)

    def look_under(self, ground: Ground) -> None:
        """Look up which soil is under each wheel, and how the ground leans there."""
        self._looked = 0
        xy = self._position[self._geom, :2]
        self.wheels.soil[:] = ground.soil(xy)
        reach = self._radius_m / 2  # about the footprint
        around = (xy[:, None] + reach * _CROSS).reshape(-1, 2)
        east, west, north, south = ground.height(around).reshape(-1, 4).T
        lean = np.stack([west - east, south - north, np.full(len(xy), 2 * reach)], axis=1)
        self.normal[:] = lean / np.linalg.norm(lean, axis=1, keepdims=True)


def law_on(ground: Ground, spec: RoverSpec) -> WheelSoilLaw:
    """Make the law of a rover's wheels on the soils of a terrain, as its spec says."""
    frames = rover_frames(spec)
    wheel = WheelSpec(radius_m=frames.wheel_radius_m, width_m=frames.wheel_width_m)
    soils = [soil_class.soil for soil_class in ground.spec.soils]
    return tabulated_law(spec.wheel_soil, soils, wheel, frames.wheel_share_n, frames.gravity_mps2)
