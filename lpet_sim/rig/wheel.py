"""The single-wheel rig: what one wheel pulls, sinks and needs, against its slip."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Final

import numpy as np
from pydantic import Field

from lpet_sim.recording.arrays import Array
from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.model_spec import load_rover_model, model_names
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.soil.published import ReferenceWheelSpec
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    SINKAGE,
    TORQUE,
    SlipTable,
    traction_ratios,
)
from lpet_sim.soil.spec import MechanicalSoilSpec, SoilSpec
from lpet_sim.soil.tabulate import tabulate
from lpet_sim.soil.wheel_law import rolling_radius, wheel_forces
from lpet_sim.spec import Spec

SLIP_ANGLE_END_DEG: Final = 80.0  # the slip angle is below it
_SLIP_SCALE: Final = np.arange(-38, 39) / 40  # -0.95 to 0.95
_NOMINAL: Final = LOAD_NODES // 2


def slip_scale(slip: Array) -> Array:
    """Give slip as it is drawn: itself, and below 0 the skid ``r omega / v - 1 = s / (1 - s)``.

    So a locked wheel, whose slip ``1 - v / (r omega)`` is minus infinity, is drawn at -1.

    Args:
        slip: Slip, Shape (n,).
    """
    return np.where(slip < 0, 1.0 / (1.0 - np.minimum(slip, 0.0)) - 1.0, slip)


def slip_of_scale(scale: Array) -> Array:
    """Undo `slip_scale`; above -1, Shape (n,)."""
    return np.where(scale < 0, 1.0 - 1.0 / (1.0 + np.minimum(scale, 0.0)), scale)


SLIPS: Final = tuple(slip_of_scale(_SLIP_SCALE).tolist())


class WheelRigSpec(Spec):
    """A wheel, a soil, and the slips to hold the wheel at.

    Attributes:
        soil: The soil.
        wheel: The wheel, with its load and the gravity of the test.
        slip: Slips ``1 - v / (r omega)``, increasing.
        slip_angle_rad: Angle of the motion against the wheel's plane for the side force; the other
            quantities are those of straight rolling.
    """

    soil: SoilSpec
    wheel: ReferenceWheelSpec
    slip: tuple[Annotated[float, Field(ge=-100.0, lt=1.0)], ...] = SLIPS
    slip_angle_rad: Annotated[float, Field(ge=0.0, lt=math.radians(SLIP_ANGLE_END_DEG))] = (
        math.radians(15.0)
    )


@dataclass(frozen=True)
class WheelCurve:
    """One wheel on one soil against slip; every array has Shape (n,).

    Attributes:
        spec: What was asked.
        slip: ``1 - v / (r omega)``; `slip_scale` is for drawing.
        drawbar_ratio: Drawbar pull over load; like all below it is nan where the soil's curve does
            not reach, or where the soil does not carry the load.
        torque_ratio: Torque over load and radius.
        sinkage_m: Depth of the lowest point [m].
        side_ratio: Side force over load at the spec's slip angle.
    """

    spec: WheelRigSpec
    slip: Array
    drawbar_ratio: Array
    torque_ratio: Array
    sinkage_m: Array
    side_ratio: Array

    @property
    def traction_angle_rad(self) -> Array:
        """Slope that the wheel climbs at this slip, ``atan(drawbar / load)`` [rad]."""
        return np.arctan(self.drawbar_ratio)


def rover_wheel(model: str) -> ReferenceWheelSpec:
    """Give a wheel of a rover under its equal share of the weight.

    Args:
        model: Name of the rover model.

    Raises:
        UnknownNameError: There is no such rover model.
    """
    frames, path = rover_frames(RoverSpec(model=model)), load_rover_model(model).path
    return ReferenceWheelSpec(
        name=f"wheel of {model}",
        source=f"models/{path.name}" if model in model_names() else str(path),
        radius_m=frames.wheel_radius_m,
        width_m=frames.wheel_width_m,
        load_n=frames.wheel_share_n,
        gravity_mps2=frames.gravity_mps2,
    )


def wheel_rig_spec(
    soil: SoilSpec,
    wheel: ReferenceWheelSpec | None = None,
    rover: str = "exomars",
    load_n: float | None = None,
    gravity_mps2: float | None = None,
    slip_angle_rad: float = math.radians(15.0),
) -> WheelRigSpec:
    """Put a wheel rig together.

    Args:
        soil: The soil.
        wheel: The wheel; None for that of the rover.
        rover: Name of the rover model.
        load_n: Load [N]; None for the wheel's own.
        gravity_mps2: Gravity [m/s^2]; None for that of the wheel's test.
        slip_angle_rad: Slip angle of the side force [rad].

    Raises:
        UnknownNameError: There is no such rover model.
        SpecError: A value out of its range.
    """
    load_rover_model(rover)
    of = wheel or rover_wheel(rover)
    test = {"load_n": load_n, "gravity_mps2": gravity_mps2}
    given = {name: value for name, value in test.items() if value is not None}
    values = {
        "soil": soil,
        "wheel": {**of.model_dump(), **given},
        "slip_angle_rad": slip_angle_rad,
    }
    return WheelRigSpec.from_mapping(values, "wheel rig")


def run_wheel_rig(spec: WheelRigSpec) -> WheelCurve:
    """Hold a wheel at every slip of a spec.

    A soil given by its mechanics is asked through the forward law. One that is given as a curve or
    is firm has no more than its slip table, which is read backwards.

    Args:
        spec: What to run.
    """
    if isinstance(spec.soil, MechanicalSoilSpec):
        return _by_mechanics(spec, spec.soil)
    wheel = spec.wheel
    table = tabulate(spec.soil, wheel.bare(), wheel.load_n, wheel.gravity_mps2)
    return curve_of_table(spec, table)


def _by_mechanics(spec: WheelRigSpec, soil: MechanicalSoilSpec) -> WheelCurve:
    slip, wheel = np.array(spec.slip), spec.wheel
    load, creep = wheel.load_n, (1 - slip) * math.tan(spec.slip_angle_rad)
    ahead = wheel_forces(soil, wheel, slip, 0.0, load, wheel.gravity_mps2)
    aslant = wheel_forces(soil, wheel, slip, creep, load, wheel.gravity_mps2)
    return WheelCurve(
        spec=spec,
        slip=slip,
        drawbar_ratio=np.where(ahead.carried, ahead.drawbar_n / load, np.nan),
        torque_ratio=np.where(
            ahead.carried, ahead.torque_nm / (load * rolling_radius(wheel)), np.nan
        ),
        sinkage_m=np.where(ahead.carried, ahead.sinkage_m, np.nan),
        side_ratio=np.where(aslant.carried, np.abs(aslant.side_n) / load, np.nan),
    )


def curve_of_table(spec: WheelRigSpec, table: SlipTable) -> WheelCurve:
    """Read a slip table backwards, at its nominal load.

    Args:
        spec: What to run.
        table: The table of the spec's soil and wheel.
    """
    slip, ratio = np.array(spec.slip), traction_ratios()
    value = table.value[_NOMINAL, :, 0]
    drawbar = _back(slip, 1 - value[:, ADVANCE], ratio)
    drawbar[np.abs(drawbar) > table.friction[_NOMINAL]] = np.nan  # there the wheel slides
    return WheelCurve(
        spec=spec,
        slip=slip,
        drawbar_ratio=drawbar,
        torque_ratio=np.interp(drawbar, ratio, value[:, TORQUE]),
        sinkage_m=np.interp(drawbar, ratio, value[:, SINKAGE]),
        side_ratio=_side_of_table(spec, table),
    )


def _back(wanted: Array, rising: Array, ratio: Array) -> Array:
    """Find where a curve that does not fall takes the wanted values; nan beyond its ends."""
    distinct = np.r_[True, np.diff(rising) > 0]
    return np.interp(wanted, rising[distinct], ratio[distinct], left=np.nan, right=np.nan)


def _side_of_table(spec: WheelRigSpec, table: SlipTable) -> Array:
    """Find the side force over load at the spec's slip angle, for ground alike in all directions.

    There the force that the ground must give is along the slip, and its size is that which straight
    rolling needs for as much slip. The soils that only have a table are of this kind; the side
    force of a mechanical soil is not looked for in its table, and is nan.
    """
    slip, value = np.array(spec.slip), table.value[_NOMINAL, :, 0]
    if isinstance(spec.soil, MechanicalSoilSpec):
        return np.full(len(slip), np.nan)
    resistance, advance = spec.soil.rolling_resistance, 1 - slip
    along = slip / np.maximum(advance, 1.0)
    across = np.minimum(advance, 1.0) * math.tan(spec.slip_angle_rad)
    length = np.maximum(np.hypot(along, across), 1e-12)
    force = _back(length, 1 - value[:, ADVANCE], traction_ratios()) + resistance
    force = np.maximum(force, 0.0)  # rounded, at no slip
    drawbar, side = force * along / length - resistance, force * across / length
    beyond = np.hypot(drawbar, side) > table.friction[_NOMINAL]  # there the wheel slides
    return np.where(beyond | (advance > value[:, ADVANCE].max()), np.nan, side)
