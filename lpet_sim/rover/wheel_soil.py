"""The wheel-soil law in the drive loop: what wheels do for the forces they have to supply.

The scene asks the law at every physics step, for all wheels at once, and moves each wheel's surface
by the answer, so that slip, side creep and sinkage emerge from slope, rocks and load transfer.
Another law needs only a class with the method of `WheelSoilLaw`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.soil.load import NamedSoil, load_soil
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    LOAD_SPAN,
    RATIO_MAX,
    RATIO_NODES,
    SIDE_CREEP,
    SIDE_NODES,
    SINKAGE,
    TORQUE,
    SlipTable,
)
from lpet_sim.soil.spec import NotNegative, Positive, SoilSpec, WheelSpec
from lpet_sim.soil.tabulate import tabulate
from lpet_sim.soil.wheel_law import rolling_radius
from lpet_sim.spec import Spec

STANDING_RADPS = 1e-3
"""A wheel that turns slower than this stands: its soil bears its load and nothing is sheared."""

DEEPEST = 0.8
"""Deepest that a wheel stands, over its radius: then its axle nearly drags. An assumption."""

_MIN_LOAD_N = 1.0
_NODES_PER_LOG = (LOAD_NODES - 1) / (2 * math.log(LOAD_SPAN))


@dataclass
class WheelState:
    """What the law is told of the wheels, in their usual order; every array has Shape (w,).

    Attributes:
        traction_n: Force of the ground along the wheel's rolling, positive where it drives the
            rover the way the wheel turns [N].
        side_n: Force of the ground along the axle in the ground's plane, positive to the left [N].
        load_n: Normal force [N].
        omega_radps: Turning rate of the wheel about its axle, positive forward [rad/s].
        soil: Index of the soil class under the wheel.
        on_rock: Whether the wheel touches a rock.
    """

    traction_n: Array
    side_n: Array
    load_n: Array
    omega_radps: Array
    soil: Ints
    on_rock: NDArray[np.bool_]

    @classmethod
    def of(cls, wheels: int) -> WheelState:
        """Make the state of so many wheels without load or motion, on the first soil."""
        traction, side, load, omega = np.zeros((4, wheels))
        soil, on_rock = np.zeros(wheels, dtype=np.int64), np.zeros(wheels, dtype=np.bool_)
        return cls(traction, side, load, omega, soil, on_rock)


@dataclass
class WheelResponse:
    """What the law answers; it writes into these arrays, every one of Shape (w,).

    The scene lets the motion follow `slip` and `side_creep` in time, and the depth follow
    `sinkage_m` with the distance rolled.

    Attributes:
        slip: ``1 - v / (r omega)``, below 0 where it skids, above 1 where it slides back.
        side_creep: Sideways speed over ``r |omega|``, positive to the left: against `side_n`.
        sinkage_m: Depth of the wheel's lowest point once the wheel has rolled there; for a wheel
            that stands (`STANDING_RADPS`) the depth under its load alone.
        torque_nm: What the motor must supply against the soil, positive along the rolling.
        friction: Most tangential force over load, whether the wheel turns or not.
        slip_steepness: How fast slip rises with traction over load, near enough; only the pace at
            which the motion follows depends on it. A law may leave it alone.
        side_steepness: The same of the creep with side force over load.
    """

    slip: Array
    side_creep: Array
    sinkage_m: Array
    torque_nm: Array
    friction: Array
    slip_steepness: Array
    side_steepness: Array

    @classmethod
    def of(cls, wheels: int) -> WheelResponse:
        """Make room for the answer for so many wheels."""
        values = (0.0, 0.0, 0.0, 0.0, 0.9, 5.0, 5.0)
        return cls(*(np.full(wheels, value) for value in values))


class WheelSoilLaw(Protocol):
    """A law of wheels on soil."""

    def respond(self, wheels: WheelState, response: WheelResponse) -> None:
        """Write what each wheel does into the response, in place."""
        ...


class WheelSoilSpec(Spec):
    """How wheels follow the law of the soil under them; the soils are the terrain's.

    Attributes:
        filter_s: Time constant with which slip follows the law (0.1 s is stable: measured).
        side_filter_s: The same across the wheel (0.3 s is stable: measured).
        wheel: The wheel whose law is taken; None for the model's own, by its radius and width. The
            law of another wheel gives slip and torque at the same forces over load, and sinkage in
            proportion to the radius.
        law_load_n: Load of that wheel at which the law is computed, standing for an equal share of
            the rover's weight; None for that share itself.
        law_gravity_mps2: Gravity for which the law is computed; None for the model's.
        rock: The soil that stands for a rock; in a file also the name of a soil of the library, or
            the path of a soil's YAML file.
        sinks: Whether wheels stand as deep as they sink; if not the depth is recorded only.
        sinking_length: Distance rolled over the wheel's radius in which the depth follows the law.
            An assumption: about half of a wheel's contact has then been renewed.
    """

    filter_s: Annotated[float, Field(ge=0.02, le=2.0)] = 0.1
    side_filter_s: Annotated[float, Field(ge=0.02, le=2.0)] = 0.3
    wheel: WheelSpec | None = None
    law_load_n: Positive | None = None
    law_gravity_mps2: NotNegative | None = None
    rock: NamedSoil = Field(default_factory=partial(load_soil, "rock"))
    sinks: bool = True
    sinking_length: Annotated[float, Field(ge=0.05, le=5.0)] = 0.5


class TabulatedLaw:
    """The slip tables of a terrain's soils and of its rocks, looked up for all wheels in one call.

    Linear in traction ratio, side ratio and the logarithm of load, each held to the table's ends.
    A wheel that stands is looked up without force, so that its depth is that of its load.
    """

    def __init__(self, soils: Sequence[SlipTable], rock: SlipTable, radius_m: float) -> None:
        """Stack the tables.

        Args:
            soils: One for each soil class of the terrain, in the order of their index.
            rock: For a wheel that touches a rock.
            radius_m: Radius of the rover's wheels.

        Raises:
            SpecError: The tables do not share one nominal load.
        """
        tables = [*soils, rock]
        loads = {table.nominal_load_n for table in tables}
        if len(loads) > 1:
            raise SpecError(f"slip tables for nominal loads of {loads} N: all must have one")
        self._value = np.stack([table.value for table in tables]).astype(np.float32)
        self._friction = np.stack([table.friction for table in tables])
        self._nominal_n = loads.pop()
        self._radius_m = radius_m

    def respond(self, wheels: WheelState, response: WheelResponse) -> None:
        """Write what each wheel does into the response, in place."""
        _look_up(
            wheels.traction_n,
            wheels.side_n,
            wheels.load_n,
            wheels.omega_radps,
            wheels.soil,
            wheels.on_rock,
            self._value,
            self._friction,
            self._nominal_n,
            self._radius_m,
            response.slip,
            response.side_creep,
            response.sinkage_m,
            response.torque_nm,
            response.friction,
            response.slip_steepness,
            response.side_steepness,
        )


def tabulated_law(
    spec: WheelSoilSpec,
    soils: Sequence[SoilSpec],
    wheel: WheelSpec,
    load_n: float,
    gravity_mps2: float,
) -> TabulatedLaw:
    """Make the law of a rover's wheels on the soils of a terrain.

    Args:
        spec: Whose wheel and test to take instead of the rover's.
        soils: The terrain's soils, in the order of their index.
        wheel: The rover's wheel.
        load_n: An equal share of the rover's weight [N].
        gravity_mps2: The model's gravity.
    """
    of = spec.wheel or wheel
    law_load_n = spec.law_load_n or load_n
    law_gravity = gravity_mps2 if spec.law_gravity_mps2 is None else spec.law_gravity_mps2
    size = wheel.radius_m / rolling_radius(of)
    tables = [
        _scaled(tabulate(soil, of, law_load_n, law_gravity), load_n, size)
        for soil in [*soils, spec.rock]
    ]
    return TabulatedLaw(tables[:-1], tables[-1], wheel.radius_m)


def _scaled(table: SlipTable, nominal_load_n: float, size: float) -> SlipTable:
    """Read a table at another nominal load, its sinkage in proportion to the wheel's size."""
    value = table.value.copy()
    value[..., SINKAGE] *= size
    return SlipTable(nominal_load_n, value, table.friction)


@njit(cache=True)
def _look_up(
    traction_n: Array,
    side_n: Array,
    load_n: Array,
    omega_radps: Array,
    soil: Ints,
    on_rock: NDArray[np.bool_],
    value: NDArray[np.float32],
    friction: Array,
    nominal_n: float,
    radius_m: float,
    slip: Array,
    side_creep: Array,
    sinkage_m: Array,
    torque_nm: Array,
    most: Array,
    slip_steepness: Array,
    side_steepness: Array,
) -> None:
    found = np.empty(6)
    for i in range(len(load_n)):
        load = max(load_n[i], _MIN_LOAD_N)
        standing = abs(omega_radps[i]) < STANDING_RADPS
        x = 0.0 if standing else traction_n[i] / load
        y = 0.0 if standing else abs(side_n[i]) / load
        k = len(value) - 1 if on_rock[i] else soil[i]
        u = math.log(load / nominal_n) * _NODES_PER_LOG + (LOAD_NODES - 1) / 2
        _interpolate(value[k], u, x, y, found)
        slip[i] = 1.0 - found[ADVANCE]
        side_creep[i] = -math.copysign(found[SIDE_CREEP], side_n[i])
        sinkage_m[i] = found[SINKAGE]
        torque_nm[i] = found[TORQUE] * load * radius_m
        slip_steepness[i], side_steepness[i] = abs(found[4]), abs(found[5])
        below, share = _cell(u, LOAD_NODES)
        most[i] = friction[k, below] + share * (friction[k, below + 1] - friction[k, below])


@njit(cache=True)
def _interpolate(value: NDArray[np.float32], u: float, x: float, y: float, found: Array) -> None:
    """Interpolate at node u of load, traction ratio x and side ratio y, in place.

    After the four quantities come the rise of advance with x and that of creep with y.
    """
    i, a = _cell(u, LOAD_NODES)
    j, b = _cell((x + RATIO_MAX) / (2 * RATIO_MAX) * (RATIO_NODES - 1), RATIO_NODES)
    k, c = _cell(y / RATIO_MAX * (SIDE_NODES - 1), SIDE_NODES)
    found[:] = 0.0
    for corner in range(8):
        di, dj, dk = corner & 1, (corner >> 1) & 1, corner >> 2
        weight = (a if di else 1 - a) * (b if dj else 1 - b) * (c if dk else 1 - c)
        at = value[i + di, j + dj, k + dk]
        for q in range(4):
            found[q] += weight * at[q]
        found[4] += (a if di else 1 - a) * (c if dk else 1 - c) * (at[0] if dj else -at[0])
        found[5] += (a if di else 1 - a) * (b if dj else 1 - b) * (at[1] if dk else -at[1])
    found[4] *= (RATIO_NODES - 1) / (2 * RATIO_MAX)
    found[5] *= (SIDE_NODES - 1) / RATIO_MAX


@njit(cache=True)
def _cell(at: float, nodes: int) -> tuple[int, float]:
    """Give the node below a place on an axis, and how far beyond it the place is."""
    held = min(max(at, 0.0), nodes - 1.0)
    below = min(int(held), nodes - 2)
    return below, held - below
