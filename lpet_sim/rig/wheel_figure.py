"""The wheel rig's figure: drawbar pull, sinkage and torque against slip, and measured rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lpet_sim.recording.arrays import Array
from lpet_sim.rig.measured import WheelMeasurements, misfit
from lpet_sim.rig.wheel import WheelCurve

_COLOUR: Final = "#D55E00"
_SIDE_COLOUR: Final = "#0072B2"
_MARKERS: Final = ("^", "v", "P", "X")
_EVERY: Final = 4  # points from one marker of the curve to the next


def plot_wheel(curve: WheelCurve, measured: Sequence[WheelMeasurements] = ()) -> Figure:
    """Draw a wheel rig; the band about the drawbar pull and sinkage is the RMS misfit, if any.

    Args:
        curve: The curve.
        measured: What others measured with the same wheel on the same soil.

    Returns:
        The figure; `results` writes it.
    """
    figure = Figure(figsize=(8.0, 10.0), layout="constrained")
    pull, angle, sinkage, torque = figure.subplots(4, 1, sharex=True, height_ratios=(3, 2, 2, 2))
    errors = [misfit(curve, rows) for rows in measured]
    _draw(pull, curve, curve.drawbar_ratio, max((e.drawbar_rms for e in errors), default=0.0))
    _draw(angle, curve, np.degrees(curve.traction_angle_rad))
    depth_error = max((1e3 * e.sinkage_rms_m for e in errors), default=0.0)
    _draw(sinkage, curve, 1e3 * curve.sinkage_m, depth_error)
    _draw(torque, curve, curve.torque_ratio, label="torque / (load r)")
    side = f"side force / load at {np.degrees(curve.spec.slip_angle_rad):.0f} deg"
    _draw(torque, curve, curve.side_ratio, colour=_SIDE_COLOUR, label=side)
    for k, rows in enumerate(measured):
        style = {"marker": _MARKERS[k % len(_MARKERS)], "ls": "", "color": "black", "mfc": "none"}
        pull.plot(100 * rows.slip, rows.drawbar_ratio, label=rows.label, ms=5, **style)
        angle.plot(100 * rows.slip, np.degrees(np.arctan(rows.drawbar_ratio)), ms=4, **style)
        sinkage.plot(100 * rows.slip, 1e3 * rows.sinkage_m, ms=4, **style)
    pull.set_ylabel("drawbar pull / load")
    angle.set_ylabel("traction angle\n[deg]")
    sinkage.set_ylabel("sinkage [mm]")
    torque.set_ylabel("ratio")
    torque.set_xlabel("slip [%]")
    _finish(figure, curve, (pull, angle, sinkage, torque))
    return figure


def _draw(
    axes: Axes,
    curve: WheelCurve,
    y: Array,
    band: float = 0.0,
    colour: str = _COLOUR,
    label: str = "law",
) -> None:
    slip = 100 * curve.slip
    axes.plot(slip, y, "o-", color=colour, lw=1.5, ms=4, markevery=_EVERY, label=label)
    if band > 0:
        text = f"law, RMS misfit {band:.2g}"
        axes.fill_between(slip, y - band, y + band, color=colour, alpha=0.18, lw=0, label=text)


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
