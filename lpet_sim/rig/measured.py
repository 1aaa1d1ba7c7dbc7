"""Measured rows beside the wheel rig, and how far the law's prediction is from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from lpet_sim.datasets import DataError
from lpet_sim.recording.arrays import Array
from lpet_sim.rig.published import is_of_library, is_wheel_of_library
from lpet_sim.rig.wheel import WheelRigSpec
from lpet_sim.soil.measured_wheels import (
    PredictionError,
    WheelName,
    measured_wheel,
    prediction_error,
    straight,
)
from lpet_sim.soil.spec import MechanicalSoilSpec
from lpet_sim.soil.wheel_law import rolling_radius

_WHEELS: Final[dict[str, WheelName]] = {"cmu_grouser": "grouser", "cmu_smooth": "smooth"}
_SOILS: Final = ("cmu_sand", "cmu_sand_smooth")


@dataclass(frozen=True)
class WheelMeasurements:
    """What others measured with the rig's wheel on its soil, rolling straight; Shape (n,).

    Attributes:
        label: What the legend calls it, with its source.
        slip: ``1 - v / (r omega)`` at the radius at which the law takes it, the tips of the
            grousers; minus infinity for a locked wheel.
        drawbar_ratio: Drawbar pull over load.
        sinkage_m: Sinkage [m]; nan where it was not recorded.
        error: Of the law's prediction of all rows, each at its measured load.
        error_driving: Of those with slip of 0 or more.
        error_skidding: Of those below.
    """

    label: str
    slip: Array
    drawbar_ratio: Array
    sinkage_m: Array
    error: PredictionError
    error_driving: PredictionError
    error_skidding: PredictionError


def measured_beside(spec: WheelRigSpec) -> tuple[WheelMeasurements, ...]:
    """Give what was measured with the rig's wheel on its soil; none where the data are absent.

    Args:
        spec: The rig. Carnegie Mellon's two wheels on their sand are the only ones there are; an
            altered copy of either, or another load, has nothing beside it.
    """
    if not (is_of_library(spec.soil) and is_wheel_of_library(spec.wheel)):
        return ()
    name = _WHEELS.get(spec.wheel.name)
    soil = spec.soil
    if name is None or not isinstance(soil, MechanicalSoilSpec) or soil.name not in _SOILS:
        return ()
    try:
        rows = straight(measured_wheel(name))
    except DataError:
        return ()
    with np.errstate(divide="ignore"):
        slip = 1 - rows.speed_mps / (
            rows.rim_mps * rolling_radius(spec.wheel) / spec.wheel.radius_m
        )
    return (
        WheelMeasurements(
            label=f"measured, {name} wheel (Carnegie Mellon)",
            slip=slip,
            drawbar_ratio=rows.drawbar_n / rows.load_n,
            sinkage_m=rows.sinkage_m,
            error=prediction_error(rows, soil, spec.wheel),
            error_driving=prediction_error(rows.only(rows.driving), soil, spec.wheel),
            error_skidding=prediction_error(rows.only(~rows.driving), soil, spec.wheel),
        ),
    )
