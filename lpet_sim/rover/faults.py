"""Faults that a drive's spec asks for: forced slips, and wheels whose drive is locked."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lpet_sim.errors import UnknownNameError
from lpet_sim.recording.arrays import Array
from lpet_sim.rover.observer import Tick
from lpet_sim.rover.spec import DriveSpec, ForcedSlip, StuckWheel


class Fault:
    """A fault that lasts from one time to another, as a condition to be watched."""

    hold_s = 0.0

    def __init__(self, kind: str, start_s: float, end_s: float, text: str) -> None:
        """Name it, and say when it lasts [s]."""
        self.kind, self._start_s, self._end_s, self._text = kind, start_s, end_s, text

    def lasts(self, t_s: float) -> bool:
        """Tell whether it lasts at a time [s]."""
        return self._start_s <= t_s < self._end_s

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        return tick.t_s if self.lasts(tick.t_s) else None

    def describe(self, tick: Tick) -> str:
        """Say what it is, and where it begins."""
        return f"{self._text}, {tick.place}"


class Faults:
    """The faults of a drive.

    Attributes:
        all: Every one of them.
    """

    def __init__(self, spec: DriveSpec, wheels: Sequence[str]) -> None:
        """Read them from the spec.

        Args:
            spec: The drive.
            wheels: Names of the rover's wheels.

        Raises:
            UnknownNameError: A wheel that is to be stuck is none of the rover's.
        """
        check_stuck_wheels(spec, wheels)
        self._slips = [
            Fault("forced_slip", slip.start_s, slip.start_s + slip.duration_s, _slip_text(slip))
            for slip in spec.forced_slips
        ]
        self._locks = [
            (
                list(wheels).index(stuck.wheel),
                Fault("stuck_wheel", stuck.start_s, stuck.end_s, _lock_text(stuck)),
            )
            for stuck in spec.stuck_wheels
        ]
        self.all = (*self._slips, *(fault for _, fault in self._locks))

    def slipping(self, t_s: float) -> bool:
        """Tell whether a forced slip lasts at a time [s]."""
        return any(slip.lasts(t_s) for slip in self._slips)

    def lock(self, t_s: float, rate_radps: Array) -> Array:
        """Give the wheels' rates with 0 for those that are stuck at a time [s], Shape (w,).

        A drive that is told not to turn brakes with the motor's whole torque: more than friction
        can put on a wheel that carries its share of the weight.
        """
        stuck = [wheel for wheel, fault in self._locks if fault.lasts(t_s)]
        if stuck:
            rate_radps = rate_radps.copy()
            rate_radps[np.array(stuck)] = 0.0
        return rate_radps


def check_stuck_wheels(spec: DriveSpec, wheels: Sequence[str]) -> None:
    """Hold the wheels that are to be stuck to be wheels of the rover.

    Raises:
        UnknownNameError: One is not.
    """
    for k, stuck in enumerate(spec.stuck_wheels):
        if stuck.wheel not in wheels:
            raise UnknownNameError(f"wheel of drive.stuck_wheels.{k}", stuck.wheel, wheels)


def _slip_text(slip: ForcedSlip) -> str:
    return f"the wheels turn for {slip.duration_s:g} s and the rover does not move"


def _lock_text(stuck: StuckWheel) -> str:
    lasts = "for good" if stuck.duration_s is None else f"for {stuck.duration_s:g} s"
    return f"the {stuck.wheel.replace('_', ' ')} wheel's drive is locked {lasts}"
