"""The inverse of a wheel-soil law as a table: forces a wheel must supply in, its slip out.

All tables have the same axes of force, so that those of several soils can be stacked into one array
and looked up by compiled code.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from lpet_sim.recording.arrays import Array

# These numbers are frozen into @njit code.
RATIO_MAX: Final = 1.0
RATIO_NODES: Final = 513
SIDE_NODES: Final = 33
LOAD_NODES: Final = 9
LOAD_SPAN: Final = 4.0  # from the nominal load over this to the nominal load times this

ADVANCE, SIDE_CREEP, SINKAGE, TORQUE = range(4)


def traction_ratios() -> Array:
    """Give the nodes of traction over load, Shape (`RATIO_NODES`,)."""
    return np.linspace(-RATIO_MAX, RATIO_MAX, RATIO_NODES)


def side_ratios() -> Array:
    """Give the nodes of side force over load, Shape (`SIDE_NODES`,)."""
    return np.linspace(0.0, RATIO_MAX, SIDE_NODES)


def load_nodes(nominal_load_n: float) -> Array:
    """Give the nodes of load, in geometric steps about the nominal [N], Shape (`LOAD_NODES`,)."""
    return nominal_load_n * np.geomspace(1 / LOAD_SPAN, LOAD_SPAN, LOAD_NODES)


@dataclass(frozen=True)
class SlipTable:
    """What one wheel does on one soil for the forces that it must supply.

    ``r`` is the wheel's nominal radius, ``omega`` its rate, ``N`` its load. Beyond the most that
    the soil can give, the advance goes on falling below 0: a spinning wheel slides back. At the
    Coulomb limit ``friction`` the wheel slides whether it turns or not.

    Attributes:
        nominal_load_n: Middle of the load axis [N].
        value: Over load, traction ratio, side ratio and the four quantities in the order of
            `ADVANCE` (v / (r omega) = 1 - slip), `SIDE_CREEP` (sideways speed / (r |omega|), along
            the side force that acts on the rover), `SINKAGE` [m] and `TORQUE` (M / (N r): what
            the motor must supply), Shape (`LOAD_NODES`, `RATIO_NODES`, `SIDE_NODES`, 4).
        friction: Most tangential force over load, wheel turning or locked, Shape (`LOAD_NODES`,).
    """

    nominal_load_n: float
    value: Array
    friction: Array
