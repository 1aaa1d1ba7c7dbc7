"""A few parameters of a soil fitted to a measured curve of slip over slope.

A rover that climbs at constant speed asks each wheel for a traction of ``tan(slope)`` times its
load, so that the measured slip at a slope is the slip at which the law gives that traction.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from lpet_sim.recording.arrays import Array
from lpet_sim.soil.published import ReferenceWheelSpec
from lpet_sim.soil.spec import MechanicalSoilSpec
from lpet_sim.soil.wheel_law import wheel_forces

BOUNDS: Final[dict[str, tuple[float, float]]] = {
    "friction_rad": (np.radians(30.0), np.radians(44.0)),
    "shear_modulus_m": (2e-3, 6e-2),
    "pressure_k": (3e4, 3e7),
    "rear_angle_slip": (-0.9, -0.01),
}
"""What is fitted, and within what: friction as published for GRC-1, moduli as for loose soils."""

STARTS: Final = (
    (np.radians(33.0),),
    (5e-3, 1.2e-2),
    (3e5, 1.5e6),
    (-0.2, -0.6),
)
AXLE_LOADS: Final = (0.863, 1.087, 1.050)
"""Loads of front, middle and rear axle over their mean on level ground: as measured on the tilt
bed's rover (the exomars model). MGRU3's are not published: that they are alike is an assumption."""
AXLE_SHIFTS: Final = (-1.35, 0.30, 1.05)
"""What each unit of the slope's tangent adds to them; measured there too, from 10 to 20 deg."""

_SCALE: Final = (0.1, 0.5, 1.0, 0.5)  # of the fitted values as the solver sees them
_POWER: Final = 4  # of a residual that is squared again: near the least greatest error
_EXCESS_SLOPE: Final = 10.0
_GRID: Final = np.concatenate(
    [-0.3 * np.linspace(1.0, 0.0, 10, endpoint=False) ** 2, np.linspace(0.0, 1.0, 49) ** 1.5]
)


@dataclass(frozen=True)
class Climb:
    """What slip a wheel climbs at, on each slope; arrays have Shape (n,).

    Attributes:
        slip: Slip at which traction over load is ``tan(slope)``; where the soil cannot give that,
            the slip of its greatest traction and `_EXCESS_SLOPE` for each unit that lacks.
        climbs: Whether the soil can give it.
        most: Greatest traction over load.
    """

    slip: Array
    climbs: NDArray[np.bool_]
    most: Array


@dataclass(frozen=True)
class SoilFit:
    """A fitted soil.

    Attributes:
        soil: The start with the fitted values in it.
        values: The fitted values, rounded to four digits as they stand in `soil`.
        greatest: Greatest error over its tolerance at the points of the fit.
    """

    soil: MechanicalSoilSpec
    values: dict[str, float]
    greatest: float


def climb(soil: MechanicalSoilSpec, wheel: ReferenceWheelSpec, slope_rad: Array) -> Climb:
    """Find the slip at which a rover climbs: on the branch on which traction rises with slip.

    The wheels of all axles turn at one rate, so that they slip alike, each under its own load
    (`AXLE_LOADS`, `AXLE_SHIFTS`); together they pull ``tan(slope)`` times the load of all.

    Args:
        soil: The soil.
        wheel: The wheel, its mean load on level ground and its gravity.
        slope_rad: Slopes, Shape (n,).
    """
    level = wheel.load_n * np.cos(slope_rad)
    load = (axle_shares(slope_rad) * level[:, None])[..., None]
    pulls = wheel_forces(soil, wheel, _GRID, 0.0, load, wheel.gravity_mps2).drawbar_n
    pull = pulls.sum(axis=1) / load.sum(axis=1)
    found = [_on_rise(row, x) for row, x in zip(pull, np.tan(slope_rad), strict=True)]
    most = pull.max(axis=1)
    return Climb(np.array(found), np.tan(slope_rad) <= most, most)


def axle_shares(slope_rad: Array) -> Array:
    """Give the load of each axle over the mean of all, Shape (n, 3); none is lifted off."""
    shares = AXLE_LOADS + np.tan(slope_rad)[:, None] * AXLE_SHIFTS
    return np.maximum(shares, 0.05)


def _on_rise(pull: Array, wanted: float) -> float:
    peak = int(np.argmax(pull))
    if wanted > pull[peak]:
        return float(_GRID[peak] + _EXCESS_SLOPE * (wanted - pull[peak]))
    rise = np.maximum.accumulate(pull[: peak + 1]) + 1e-12 * np.arange(peak + 1)
    return float(np.interp(wanted, rise, _GRID[: peak + 1]))


def with_values(soil: MechanicalSoilSpec, values: Mapping[str, float]) -> MechanicalSoilSpec:
    """Put fitted values, named as in `BOUNDS`, into a soil; K is the same in both directions."""
    changed = {
        "friction_rad": values["friction_rad"],
        "shear_modulus_x_m": values["shear_modulus_m"],
        "shear_modulus_y_m": values["shear_modulus_m"],
        "pressure": {"kind": "modulus", "k": values["pressure_k"]},
        "rear_angle_slip": values["rear_angle_slip"],
    }
    return MechanicalSoilSpec.model_validate({**soil.model_dump(), **changed})


def fit_soil(
    start: MechanicalSoilSpec,
    wheel: ReferenceWheelSpec,
    slope_rad: Array,
    slip: Array,
    tolerance: Array,
) -> SoilFit:
    """Fit the parameters of `BOUNDS` to measured slips.

    Minimises the sum of the eighth powers of error over tolerance, from each of `STARTS`: nearly
    the least greatest error, as the tolerances are bands and not standard deviations.

    Args:
        start: The soil whose other parameters stay.
        wheel: The wheel that was measured.
        slope_rad: Slopes, Shape (n,).
        slip: Slip on each, Shape (n,).
        tolerance: Error of slip that may be claimed on each, Shape (n,).
    """

    def error(x: Array) -> Array:
        return (climb(_soil_at(start, x), wheel, slope_rad).slip - slip) / tolerance

    found = [_solve(error, _free(first)) for first in product(*STARTS)]
    _, best = min(found, key=lambda pair: pair[0])
    values = {n: float(f"{v:.4g}") for n, v in zip(BOUNDS, _bound(best), strict=True)}
    soil = with_values(start, values)
    worst = np.abs(climb(soil, wheel, slope_rad).slip - slip) / tolerance
    return SoilFit(soil, values, float(worst.max()))


def _solve(error: Callable[[Array], Array], first: Array) -> tuple[float, Array]:
    """Give the least cost that is found from a start, and where."""
    low, high = np.array([_free(b) for b in zip(*BOUNDS.values(), strict=True)])
    found = least_squares(
        lambda x: error(x) ** _POWER,
        first,
        bounds=(low, high),
        x_scale=_SCALE,
        diff_step=1e-5,
        max_nfev=200,
    )
    return float(found.cost), found.x


def left_out(
    start: MechanicalSoilSpec,
    wheel: ReferenceWheelSpec,
    slope_rad: Array,
    slip: Array,
    tolerance: Array,
) -> Climb:
    """Predict each point from a fit to the others, Shape (n,).

    Args:
        start: As for `fit_soil`; the other arguments too.
        wheel: The wheel that was measured.
        slope_rad: Slopes, Shape (n,).
        slip: Slip on each, Shape (n,).
        tolerance: Error that may be claimed on each, Shape (n,).
    """
    found = []
    for i in range(slip.size):
        others = np.arange(slip.size) != i
        fitted = fit_soil(start, wheel, slope_rad[others], slip[others], tolerance[others])
        found.append(climb(fitted.soil, wheel, slope_rad[i : i + 1]))
    return Climb(
        slip=np.concatenate([one.slip for one in found]),
        climbs=np.concatenate([one.climbs for one in found]),
        most=np.concatenate([one.most for one in found]),
    )


def _free(values: tuple[float, ...]) -> Array:
    """Give the values as the solver sees them: moduli as their logarithms."""
    friction, shear, pressure, rear = values
    return np.array([friction, np.log(shear), np.log(pressure), rear])


def _bound(x: Array) -> Array:
    return np.array([x[0], np.exp(x[1]), np.exp(x[2]), x[3]])


def _soil_at(start: MechanicalSoilSpec, x: Array) -> MechanicalSoilSpec:
    return with_values(start, dict(zip(BOUNDS, _bound(x), strict=True)))
