"""The wheel rig's figure: drawbar pull, sinkage and torque against slip, and measured rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lpet_sim.recording.arrays import Array
from lpet_sim.rig.measured import WheelMeasurements
from lpet_sim.rig.wheel import WheelCurve, slip_scale
from lpet_sim.soil.measured_wheels import PredictionError

_COLOUR: Final = "#D55E00"
_SIDE_COLOUR: Final = "#0072B2"
_MARKERS: Final = ("^", "v", "P", "X")
_MARKED: Final = (2, 4)  # first marked point of the curve, and points to the next: whole tenths


def plot_wheel(curve: WheelCurve, measured: Sequence[WheelMeasurements] = ()) -> Figure:
    """Draw a wheel rig; a band is the RMS difference from the measured rows.

    Args:
        curve: The curve.
        measured: What others measured with the same wheel on the same soil.

    Returns:
        The figure; `results` writes it.
    """
    figure = Figure(figsize=(8.0, 10.0), layout="constrained")
    pull, angle, sinkage, torque = figure.subplots(4, 1, sharex=True, height_ratios=(3, 2, 2, 2))
    _draw(pull, curve, curve.drawbar_ratio)
    _draw(angle, curve, np.degrees(curve.traction_angle_rad))
    _draw(sinkage, curve, 1e3 * curve.sinkage_m)
    _draw(torque, curve, curve.torque_ratio, label="torque / (load r)")
    side = f"side force / load at {np.degrees(curve.spec.slip_angle_rad):.0f} deg"
    _draw(torque, curve, curve.side_ratio, colour=_SIDE_COLOUR, label=side)
    for k, rows in enumerate(measured):
        style = {"marker": _MARKERS[k % len(_MARKERS)], "ls": "", "color": "black", "mfc": "none"}
        slip = 100 * slip_scale(rows.slip)
        _band(pull, curve, curve.drawbar_ratio, rows, lambda error: error.drawbar_ratio)
        _band(sinkage, curve, 1e3 * curve.sinkage_m, rows, lambda error: 1e3 * error.sinkage_m)
        pull.plot(slip, rows.drawbar_ratio, label=rows.label, ms=5, **style)
        angle.plot(slip, np.degrees(np.arctan(rows.drawbar_ratio)), ms=5, **style)
        sinkage.plot(slip, 1e3 * rows.sinkage_m, ms=5, **style)
    pull.set_ylabel("drawbar pull / load")
    angle.set_ylabel("traction angle\n[deg]")
    sinkage.set_ylabel("sinkage [mm]")
    sinkage.set_ylim(0.0, max(sinkage.get_ylim()[1], 1.0))
    torque.set_ylabel("ratio")
    torque.set_xlabel("slip 1 - v / (r ω), and below 0 skid r ω / v - 1 [%]")
    _finish(figure, curve, (pull, angle, sinkage, torque))
    return figure


def _draw(
    axes: Axes, curve: WheelCurve, y: Array, colour: str = _COLOUR, label: str = "law"
) -> None:
    slip = 100 * slip_scale(curve.slip)
    axes.plot(slip, y, "o-", color=colour, lw=1.5, ms=4, markevery=_MARKED, label=label)


def _band(
    axes: Axes,
    curve: WheelCurve,
    y: Array,
    rows: WheelMeasurements,
    size: Callable[[PredictionError], float],
) -> None:
    """Shade the RMS difference from the measured rows, of the skidding and the driving part."""
    slip = 100 * slip_scale(curve.slip)
    half = np.where(slip < 0, size(rows.error_skidding), size(rows.error_driving))
    label = f"RMS difference: {half[-1]:.2g} driving, {half[0]:.2g} skidding"
    axes.fill_between(slip, y - half, y + half, color=_COLOUR, alpha=0.18, lw=0, label=label)


def _finish(figure: Figure, curve: WheelCurve, rows: Sequence[Axes]) -> None:
    spec = curve.spec
    for row in rows:
        row.grid(alpha=0.3)
        row.axvline(0.0, color="black", lw=0.8)
    for row in (rows[0], rows[2], rows[3]):
        row.legend(loc="best", fontsize="small")
    figure.suptitle(
        f"{spec.wheel.name} on {spec.soil.name} ({spec.soil.evidence}): "
        f"{spec.wheel.load_n:g} N, {spec.wheel.gravity_mps2:g} m/s2",
        fontsize="medium",
    )
