"""Grades of inertial units by name, from tactical to industrial, with their masses."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from lpet_sim.errors import UnknownNameError
from lpet_sim.sensors.imu import STANDARD_GRAVITY_MPS2, ImuSpec

_RAD_RTS_PER_DEG_RTH: Final = math.radians(1.0) / 60.0
_RADPS_PER_DEG_PER_H: Final = math.radians(1.0) / 3600.0


@dataclass(frozen=True)
class ImuGrade:
    """One grade of inertial unit.

    Attributes:
        spec: The unit.
        mass_kg: Its mass [kg].
    """

    spec: ImuSpec
    mass_kg: float


def _unit(walk_deg_rth: float, bias_deg_per_h: float, accel_bias_g: float) -> ImuSpec:
    """Give the LN-200 with another gyro and accelerometer bias; quanta stay."""
    walk = walk_deg_rth * _RAD_RTS_PER_DEG_RTH
    return ImuSpec(
        gyro_random_walk_radps_rthz=(walk, walk, walk),
        gyro_bias_radps=bias_deg_per_h * _RADPS_PER_DEG_PER_H,
        accel_bias_mps2=accel_bias_g * STANDARD_GRAVITY_MPS2,
    )


IMU_GRADES: Final[dict[str, ImuGrade]] = {
    "navigation": ImuGrade(_unit(0.002, 0.003, 25e-6), 3.0),
    "ln200": ImuGrade(ImuSpec(), 0.75),
    "tactical_mems": ImuGrade(_unit(0.15, 10.0, 2e-3), 0.055),
    "industrial_mems": ImuGrade(_unit(0.3, 100.0, 5e-3), 0.048),
}
"""From the best down.

``navigation``: ring laser unit of the HG9900 class, 0.002 deg/sqrt(h), 0.003 deg/h, 25 ug, 3 kg.
``ln200``: `ImuSpec`, from real data at rest; 0.75 kg.
``tactical_mems``: STIM300 class, 0.15 deg/sqrt(h), about 10 deg/h from turn-on to turn-on, 2 mg,
55 g.
``industrial_mems``: ADIS16488 class, 0.3 deg/sqrt(h), about 100 deg/h after calibration, 5 mg,
48 g.
All but the LN-200's noise are [recalled] from data sheets.
"""


def imu_grade(name: str) -> ImuGrade:
    """Look up a grade by its name.

    Raises:
        UnknownNameError: There is no such grade; the sentence lists those there are.
    """
    if name not in IMU_GRADES:
        raise UnknownNameError("IMU grade", name, IMU_GRADES)
    return IMU_GRADES[name]
