"""Measured rows beside the single-wheel rig, and how far its curve is from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.rig.wheel import WheelCurve, WheelRigSpec


@dataclass(frozen=True)
class WheelMeasurements:
    """What others measured with one wheel on one soil, rolling straight; arrays of Shape (n,).

    Attributes:
        label: What the legend calls it, with its source.
        slip: ``1 - v / (r omega)``.
        drawbar_ratio: Drawbar pull over load.
        sinkage_m: Sinkage [m].
    """

    label: str
    slip: Array
    drawbar_ratio: Array
    sinkage_m: Array


@dataclass(frozen=True)
class Misfit:
    """Law less measured over the rows within the curve's range of slip.

    Attributes:
        rows: How many rows lie there.
        drawbar_rms: RMS of drawbar pull over load.
        drawbar_mean: Its mean.
        sinkage_rms_m: RMS of sinkage [m].
        sinkage_mean_m: Its mean [m].
    """

    rows: int
    drawbar_rms: float
    drawbar_mean: float
    sinkage_rms_m: float
    sinkage_mean_m: float


def measured_beside(spec: WheelRigSpec) -> tuple[WheelMeasurements, ...]:
    """Give what was measured with the rig's wheel on its soil; none where the data are absent."""
    del spec
    return ()


def misfit(curve: WheelCurve, rows: WheelMeasurements) -> Misfit:
    """Compare a curve, in straight lines between its slips, with measured rows.

    Args:
        curve: The curve.
        rows: At least one of them within the curve's range of slip.
    """
    inside = (rows.slip >= curve.slip[0]) & (rows.slip <= curve.slip[-1])
    slip = rows.slip[inside]
    drawbar = np.interp(slip, curve.slip, curve.drawbar_ratio) - rows.drawbar_ratio[inside]
    sinkage = np.interp(slip, curve.slip, curve.sinkage_m) - rows.sinkage_m[inside]
    return Misfit(
        rows=int(inside.sum()),
        drawbar_rms=float(np.sqrt(np.mean(drawbar**2))),
        drawbar_mean=float(drawbar.mean()),
        sinkage_rms_m=float(np.sqrt(np.mean(sinkage**2))),
        sinkage_mean_m=float(sinkage.mean()),
    )
