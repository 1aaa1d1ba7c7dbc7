"""Curves of the wheels as they are read: slow enough to see, and in units that one thinks in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpet_sim.recording import layout
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.truth import WheelTruth
from lpet_sim.recording.visuals import Pen

CURVE_PERIOD_NS = NS_PER_S
_PERIODS_AT_ONCE = 512
# A wheel that turns or carries less in the mean of a period has no slip and no ratio to show.
_LEAST_TURN_RAD, _LEAST_LOAD_N = 0.03, 1.0

TITLES = {
    "slip": "Wheel slip, true",
    "slip_angle_deg": "Wheel slip angle [deg]",
    "sinkage_mm": "Wheel sinkage [mm]",
    "load_n": "Wheel load [N]",
    "traction_over_load": "Wheel traction over load",
}
"""The curves of the wheels, each with the title of its view."""


@dataclass(frozen=True)
class _Sums:
    """Sums over the rows of a period: weights of the turn and what they weigh, Shape (n, w)."""

    t_ns: Ints
    values: Array

    @classmethod
    def of(cls, wheels: WheelTruth, turned_rad: Array) -> _Sums:
        """Take slip and its angle for as much as the wheel turned meanwhile, the rest by time."""
        weight = np.abs(turned_rad)
        columns = (
            weight,
            weight * wheels.slip,
            weight * wheels.slip_angle_rad,
            np.ones_like(weight),
            wheels.sinkage_m,
            wheels.load_n,
            wheels.traction_n,
        )
        return cls(wheels.t_ns, np.stack(columns, axis=1))

    def curves(self) -> dict[str, Array]:
        """Give the mean of each quantity, Shape (n, w) each; NaN is a gap in the curve."""
        turn, slip, angle, count, sinkage, load, traction = np.moveaxis(self.values, 1, 0)
        return {
            "slip": _ratio(slip, turn, _LEAST_TURN_RAD),
            "slip_angle_deg": np.degrees(_ratio(angle, turn, _LEAST_TURN_RAD)),
            "sinkage_mm": 1000.0 * sinkage / count,
            "load_n": load / count,
            "traction_over_load": _ratio(traction, load, _LEAST_LOAD_N * count),
        }


class WheelCurves:
    """Draws the mean of each second of the wheels' truth, over any number of pieces.

    Slip is ``1 - v / (r omega)``, of any size where a wheel barely turns. Its mean over a second is
    weighted by the turn, ``sum s |d_angle| / sum |d_angle|``: the slip of the whole second; a wheel
    that turns by less than 0.03 rad meanwhile leaves a gap. The exact stream is stored beside it.
    """

    def __init__(self, pen: Pen, names: Sequence[str]) -> None:
        """Name the curves after the wheels."""
        self._pen = pen
        self._angle: Array | None = None
        self._pending: list[_Sums] = []
        for quantity in TITLES:
            pen.wheel_curve_style(layout.wheel_curve(quantity), [_short(name) for name in names])

    def add(self, wheels: WheelTruth) -> None:
        """Add a piece, and draw when there is enough of it."""
        if not len(wheels):
            return
        before = wheels.drive_angle_rad[:1] if self._angle is None else self._angle[None]
        turned = np.diff(np.concatenate([before, wheels.drive_angle_rad]), axis=0)
        self._angle = wheels.drive_angle_rad[-1]
        self._pending.append(_Sums.of(wheels, turned))
        span = int(wheels.t_ns[-1] - self._pending[0].t_ns[0])
        if span > _PERIODS_AT_ONCE * CURVE_PERIOD_NS:
            self._draw(whole=False)

    def flush(self) -> None:
        """Draw what is left, the last second as far as it goes."""
        if self._pending:
            self._draw(whole=True)

    def _draw(self, whole: bool) -> None:
        t_ns = np.concatenate([piece.t_ns for piece in self._pending])
        values = np.concatenate([piece.values for piece in self._pending])
        period = t_ns // CURVE_PERIOD_NS
        # The last period may go on in the next piece.
        cut = len(period) if whole else int(np.searchsorted(period, period[-1]))
        self._pending = [] if whole else [_Sums(t_ns[cut:], values[cut:])]
        first = np.flatnonzero(np.diff(period[:cut], prepend=-1))
        if not len(first):
            return
        sums = np.add.reduceat(values[:cut], first, axis=0)
        ends = np.append(first[1:], cut) - 1
        for quantity, curve in _Sums(t_ns[ends], sums).curves().items():
            self._pen.curve(layout.wheel_curve(quantity), t_ns[ends], curve)


def _ratio(above: Array, below: Array, least: Array | float) -> Array:
    """Divide where the divisor is more than the least, and give NaN elsewhere."""
    fits = below > least
    return np.where(fits, above / np.where(fits, below, 1.0), np.nan)


def _short(name: str) -> str:
    """Shorten ``front_left`` to ``FL``, for a legend beside the curves."""
    parts = name.split("_")
    return "".join(part[0] for part in parts).upper() if len(parts) > 1 else name
