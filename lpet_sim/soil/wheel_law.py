"""The forward law: slip, side creep and load in; drawbar pull, side force, torque, sinkage out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array
from lpet_sim.soil.spec import BekkerSpec, MechanicalSoilSpec, ReeceSpec, WheelSpec
from lpet_sim.soil.stress_kernels import (
    COMPACTION,
    DRAWBAR,
    ENTRY_LIMIT_RAD,
    SIDE,
    SUMS,
    TORQUE,
    Law,
    forces_into,
)


@dataclass(frozen=True)
class WheelForces:
    """What the soil does to a wheel; all arrays have the broadcast shape of what was asked.

    Attributes:
        drawbar_n: Net force along the rolling [N]: shear less compaction resistance.
        side_n: Net force across, against the side creep [N].
        torque_nm: What turns the wheel against the soil [N m].
        sinkage_m: Depth of the lowest point, the grousers' tips, below the undisturbed surface.
        compaction_n: Part of the normal stress that holds the wheel back [N].
        entry_angle_rad: Where the tips' circle meets the surface, from straight down.
        carried: Whether the soil carries the load before the wheel is sunk to its axle; where not,
            the forces are those at that depth.
    """

    drawbar_n: Array
    side_n: Array
    torque_nm: Array
    sinkage_m: Array
    compaction_n: Array
    entry_angle_rad: Array
    carried: NDArray[np.bool_]


def wheel_forces(
    soil: MechanicalSoilSpec,
    wheel: WheelSpec,
    slip: ArrayLike,
    side_creep: ArrayLike,
    load_n: ArrayLike,
    gravity_mps2: float,
) -> WheelForces:
    """Compute what a soil does to a rolling wheel in steady motion.

    With r the radius of the grousers' tips (`rolling_radius`) and stresses from the entry angle
    ``theta_1``, at which the vertical force balances the load, to the rear angle ``theta_2``:

        N = r b Integral (sigma cos + tau_x sin) dtheta
        T = r b Integral (tau_x cos - sigma sin) dtheta
        M = r^2 b Integral tau_x dtheta
        S = -r b Integral tau_y dtheta - Integral R(theta) r cos dtheta

    and ``R`` the resistance of the soil that the sunk flank pushes aside.

    Args:
        soil: The soil.
        wheel: The wheel.
        slip: ``1 - v / (r omega)``; below 0 the wheel skids, without bound; above 1 is read as 1.
        side_creep: Sideways speed over ``r |omega|``.
        load_n: Vertical load, above 0 [N].
        gravity_mps2: Gravity, for the weight of the soil.

    Returns:
        The forces, arrays of the broadcast shape.

    Reference:
        Wong and Reece, J. Terramechanics 4(1) and 4(2), 1967; Ishigami et al., J. Field Robotics
        24(3), 2007 [recalled].
    """
    s, creep, load = np.broadcast_arrays(
        *(np.asarray(x, dtype=np.float64) for x in (slip, side_creep, load_n))
    )
    law = law_of(soil, wheel, gravity_mps2)
    out = np.empty((s.size, SUMS + 1))
    forces_into(law, s.ravel(), creep.ravel(), load.ravel(), out)
    columns = out.T.reshape(SUMS + 1, *s.shape)
    entry = columns[SUMS]
    return WheelForces(
        drawbar_n=columns[DRAWBAR],
        side_n=columns[SIDE],
        torque_nm=columns[TORQUE],
        sinkage_m=law.radius * (1.0 - np.cos(entry)),
        compaction_n=columns[COMPACTION],
        entry_angle_rad=np.abs(entry),
        carried=entry > -ENTRY_LIMIT_RAD,
    )


def law_of(soil: MechanicalSoilSpec, wheel: WheelSpec, gravity_mps2: float) -> Law:
    """Gather the numbers that the stresses need.

    Raises:
        SpecError: The soil's pressure modulus is not above 0 for this wheel and this gravity.
    """
    pressure, depth_unit = _pressure(soil, wheel.width_m, gravity_mps2)
    linear, square = flank_coefficients(soil, gravity_mps2)
    return Law(
        radius=rolling_radius(wheel),
        width=wheel.width_m,
        pressure=pressure,
        depth_unit=depth_unit,
        exponent=soil.sinkage_exponent,
        exponent_slip=soil.sinkage_exponent_slip,
        exponent_skid=soil.sinkage_exponent_skid,
        cohesion=soil.cohesion_pa,
        tan_phi=math.tan(soil.friction_rad),
        shear_x=soil.shear_modulus_x_m,
        shear_x_per_rad=soil.shear_modulus_x_per_rad_m,
        shear_y=soil.shear_modulus_y_m,
        shear_y_per_rad=soil.shear_modulus_y_per_rad_m,
        peak=soil.peak_angle,
        peak_slip=soil.peak_angle_slip,
        rear=soil.rear_angle,
        rear_slip=soil.rear_angle_slip,
        flank_linear=linear,
        flank_square=square,
    )


def rolling_radius(wheel: WheelSpec) -> float:
    """Give the radius at which the wheel rolls and the soil shears, ``r = rim + h`` [m].

    Slip is taken at it, so that a grousered wheel without slip does not plough. Soil between
    grousers is taken to be carried along, so that the wheel acts as a cylinder through their tips:
    true where many grousers are in the soil at a time, an assumption where few are.

    Reference:
        Ding et al., J. Terramechanics 48, 2011: shearing radius [recalled].
    """
    return wheel.radius_m + (wheel.grouser_height_m if wheel.grouser_count else 0.0)


def _pressure(soil: MechanicalSoilSpec, width_m: float, gravity_mps2: float) -> tuple[float, float]:
    """Give the pressure at a unit of depth [Pa], and that unit [m]."""
    form, depth_unit = soil.pressure, 1.0
    if isinstance(form, BekkerSpec):
        pressure = form.kc / width_m + form.kphi
    elif isinstance(form, ReeceSpec):
        weight = soil.density_kgpm3 * gravity_mps2 * width_m
        pressure, depth_unit = soil.cohesion_pa * form.kc + weight * form.kphi, width_m
    else:
        pressure = form.k
    if pressure <= 0.0:
        raise SpecError(
            f"'{soil.name}' bears no wheel of width {width_m:g} m at {gravity_mps2:g} m/s2: its "
            f"pressure modulus is {pressure:g} and must be above 0"
        )
    return pressure, depth_unit


def flank_coefficients(soil: MechanicalSoilSpec, gravity_mps2: float) -> tuple[float, float]:
    """Give what soil pushed sideways resists, per width: times depth [Pa], times its square [N/m3].

    ``D1 (c z + D2 rho g z^2 / 2)`` with ``X = 45 deg - phi / 2``, ``D1 = cot X + tan(X + phi)``,
    ``D2 = cot X + cot^2 X / cot phi``.

    Reference:
        Hegedus, A simplified method for the determination of bulldozing resistance, 1960, as used
        by Ishigami et al., J. Field Robotics 24(3), 2007 [recalled].
    """
    phi = soil.friction_rad
    failure = math.pi / 4 - phi / 2
    cot = 1.0 / math.tan(failure)
    first = cot + math.tan(failure + phi)
    second = cot + cot**2 * math.tan(phi)
    return first * soil.cohesion_pa, 0.5 * first * second * soil.density_kgpm3 * gravity_mps2
