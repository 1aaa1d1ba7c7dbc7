"""The wheel-soil law: how much a wheel slips for the traction it has to supply.

This is the one place for it. The scene asks the law at every physics step, for all wheels at once,
and turns each wheel's surface back by the slip, so that slip emerges from slope, rocks and load
transfer. Another law needs only a class with the method of `WheelSoilLaw`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Protocol, Self

import numpy as np
from numba import njit
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.spec import Spec

_MIN_LOAD_N = 1.0


@dataclass
class WheelState:
    """What the law is told of the wheels, in their usual order; every array has Shape (6,).

    Attributes:
        traction_n: Tangential force of the ground on the wheel, positive along its rolling [N].
        load_n: Normal force [N].
        omega_radps: Turning rate of the wheel about its axle [rad/s].
        soil: Index of the soil class under the wheel.
        on_rock: Whether the wheel touches a rock.
    """

    traction_n: Array
    load_n: Array
    omega_radps: Array
    soil: Ints
    on_rock: NDArray[np.bool_]


class WheelSoilLaw(Protocol):
    """A law of wheel slip."""

    def slip(self, wheels: WheelState) -> Array:
        """Give the slip ``1 - v / (r omega)`` of each wheel, Shape (6,); below 0 it skids."""
        ...


class SoilLike(Protocol):
    """What the law needs to know of a soil class."""

    @property
    def firm(self) -> bool:
        """Whether it is bedrock or crust rather than loose soil."""
        ...


class TabulatedSlipSpec(Spec):
    """Slip as a table over the traction ratio T/N: a placeholder until a soil-mechanics law.

    The default table is NASA's MGRU3 rover on a tilt bed of loose GRC-1, as digitised from its
    published curve, read at ``T/N = tan(slope)``. It holds for driving and, mirrored about its
    value at zero, for braking; the mirror and all factors are assumptions.

    Attributes:
        traction_ratio: T/N of the nodes, increasing from 0.
        slip: Slip at the nodes, not decreasing.
        firm_factor: Multiplies the slip on firm ground.
        rock_factor: Multiplies the slip on rock.
        filter_s: Time constant with which slip follows the law (0.1 s is stable: measured).
    """

    traction_ratio: tuple[float, ...] = (0.0, 0.0981, 0.1763, 0.2736, 0.3640, 0.4706, 0.5797)
    slip: tuple[float, ...] = (0.025, 0.051, 0.104, 0.355, 0.738, 0.838, 0.897)
    firm_factor: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    rock_factor: Annotated[float, Field(ge=0.0, le=1.0)] = 0.1
    filter_s: Annotated[float, Field(ge=0.02, le=2.0)] = 0.1

    @model_validator(mode="after")
    def _table(self) -> Self:
        ratio, slip = np.array(self.traction_ratio), np.array(self.slip)
        if len(ratio) != len(slip) or len(ratio) < 2:
            raise ValueError("traction_ratio and slip must have the same length, 2 or more")
        if ratio[0] != 0 or np.any(np.diff(ratio) <= 0) or np.any(np.diff(slip) < 0):
            raise ValueError("traction_ratio must increase from 0, and slip must not decrease")
        if slip[0] < 0 or slip[-1] >= 1:
            raise ValueError("slip must lie in 0 <= slip < 1")
        return self


class TabulatedSlip:
    """The law of `TabulatedSlipSpec`: ``s(x) = s(0) + sign(x) (table(|x|) - s(0))``, x = T/N."""

    def __init__(self, spec: TabulatedSlipSpec, soils: Sequence[SoilLike]) -> None:
        """Read the table and the soils' factors.

        Args:
            spec: The table.
            soils: The terrain's soil classes, in the order of their index.
        """
        self._ratio = np.array(spec.traction_ratio)
        self._slip = np.array(spec.slip)
        self._factor = np.array([spec.firm_factor if soil.firm else 1.0 for soil in soils])
        self._rock_factor = spec.rock_factor

    def slip(self, wheels: WheelState) -> Array:
        """Give the slip of each wheel, Shape (6,)."""
        factor = np.where(wheels.on_rock, self._rock_factor, self._factor[wheels.soil])
        return _look_up(wheels.traction_n, wheels.load_n, factor, self._ratio, self._slip)


@njit(cache=True)
def _look_up(traction_n: Array, load_n: Array, factor: Array, ratio: Array, slip: Array) -> Array:
    out = np.empty(len(factor))
    for i in range(len(factor)):
        x = traction_n[i] / max(load_n[i], _MIN_LOAD_N)
        rise = np.interp(abs(x), ratio, slip) - slip[0]
        out[i] = factor[i] * (slip[0] + math.copysign(rise, x))
    return out
