"""The laws of soils that are known by one curve of slip over traction: measured soil, firm ground.

With traction over load x, side force over load y and rolling resistance rr, a wheel must make the
soil give ``f = (x + rr, y)``. The curve gives the slip ``s(|f|)``, and the slip's direction is that
of ``f``: the ground answers alike along and across the wheel. That is an assumption, as is that a
braked wheel (x + rr < 0) skids as much as a driven one slips, and that load does not matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    SIDE_CREEP,
    SINKAGE,
    TORQUE,
    SlipTable,
    side_ratios,
    traction_ratios,
)
from lpet_sim.soil.spec import FirmSoilSpec, MeasuredSoilSpec

SLIP_MAX: Final = 1.25
"""Most slip: sliding back at a quarter of the wheel's speed, as VO saw on Mars (125 %)."""
SKID_MAX: Final = 0.8
"""Most skid, so that a nearly locked wheel's advance ``1 / (1 - skid)`` stays finite. A choice."""

Curve = Callable[[Array], Array]


def measured_table(soil: MeasuredSoilSpec, nominal_load_n: float) -> SlipTable:
    """Tabulate a measured soil.

    Slip rises from 0 at no demand to the first measured point, in straight lines through the
    others, and beyond the last with the last line's steepness through 1 to `SLIP_MAX`.

    Args:
        soil: The soil.
        nominal_load_n: Middle of the load axis [N]; the values are the same at every load.
    """
    demand = _demand(soil)
    depth = np.array(soil.sinkage_m or (0.0,) * len(soil.slip))
    return _table(
        lambda f: measured_slip(soil, f),
        lambda f: np.interp(f, demand, depth),
        soil.rolling_resistance,
        math.tan(soil.holding_friction_rad),
        nominal_load_n,
    )


def firm_table(soil: FirmSoilSpec, nominal_load_n: float) -> SlipTable:
    """Tabulate firm ground, into which no wheel sinks.

    Args:
        soil: The ground.
        nominal_load_n: Middle of the load axis [N]; the values are the same at every load.
    """
    return _table(
        lambda f: firm_slip(soil, f),
        np.zeros_like,
        soil.rolling_resistance,
        soil.friction,
        nominal_load_n,
    )


def measured_slip(soil: MeasuredSoilSpec, demand: Array) -> Array:
    """Give the slip of a measured soil for the force over load that it must give, 0 or more.

    Args:
        soil: The soil.
        demand: ``|f| = |(x + rr, y)|``, Shape (n,).
    """
    nodes = np.concatenate([[0.0], _demand(soil)])
    slip = np.concatenate([[0.0], soil.slip])
    steepness = (slip[-1] - slip[-2]) / (nodes[-1] - nodes[-2])
    beyond = np.maximum(demand - nodes[-1], 0.0)
    return np.minimum(np.interp(demand, nodes, slip) + steepness * beyond, SLIP_MAX)


def firm_slip(soil: FirmSoilSpec, demand: Array) -> Array:
    """Give the slip on firm ground: the inverse of ``|f| = mu (1 - exp(-C s / mu))``.

    Args:
        soil: The ground.
        demand: ``|f| = |(x + rr, y)|``, Shape (n,).
    """
    most = -math.expm1(-SLIP_MAX * soil.slip_stiffness / soil.friction)
    # On very stiff ground what is most rounds to all that friction gives.
    most = min(most, math.nextafter(1.0, 0.0))
    share = np.minimum(demand / soil.friction, most)
    slip = -soil.friction / soil.slip_stiffness * np.log1p(-share)
    return np.where(share < most, slip, SLIP_MAX)


def _demand(soil: MeasuredSoilSpec) -> Array:
    return np.tan(soil.slope_rad) + soil.rolling_resistance


def _table(
    slip: Curve, depth: Curve, resistance: float, friction: float, nominal_load_n: float
) -> SlipTable:
    forward = traction_ratios()[:, None] + resistance
    side = side_ratios()[None, :]
    force = np.hypot(forward, side)
    slip_per_force = slip(force) / np.maximum(force, 1e-12)
    advance = _advance(slip_per_force * forward)
    value = np.empty((*force.shape, 4))
    value[..., ADVANCE] = advance
    value[..., SIDE_CREEP] = slip_per_force * side * np.maximum(advance, 1.0)
    value[..., SINKAGE] = depth(force)
    value[..., TORQUE] = (
        forward  # least dissipation: M omega - T v = N r omega (x + rr - x advance)
    )
    whole = np.tile(value, (LOAD_NODES, 1, 1, 1))
    return SlipTable(nominal_load_n, whole, np.full(LOAD_NODES, friction))


def _advance(slip: Array) -> Array:
    """Give ``v / (r omega)``: ``1 - s`` in slip, ``1 / (1 - |s'|)`` in skid ``s'``."""
    return np.where(slip >= 0, 1.0 - slip, 1.0 / (1.0 + np.maximum(slip, -SKID_MAX)))
