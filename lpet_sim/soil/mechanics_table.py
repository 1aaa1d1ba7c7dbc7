"""The slip table of a soil known by its mechanics: the forward law on a grid, then inverted.

For every side force the slip that gives a traction is read off the rising branch of the law, from
a nearly locked wheel up to the most that the soil can give. Where slip-sinkage makes the traction
fall again at still higher slip, no wheel stays on that falling branch: a wheel asked for more than
the most digs in. Beyond the most the advance therefore falls, within `DROP_RATIO` of traction over
load, to a standstill, and then backwards, to `BACKWARDS` at the Coulomb limit. How fast it falls is
a choice, made for a drive that stays stable; that it falls is the law's.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    RATIO_NODES,
    SIDE_CREEP,
    SIDE_NODES,
    SINKAGE,
    TORQUE,
    SlipTable,
    load_nodes,
    side_ratios,
    traction_ratios,
)
from lpet_sim.soil.spec import MechanicalSoilSpec, WheelSpec
from lpet_sim.soil.stress_kernels import DRAWBAR, SIDE, SUMS, Law, forces_into
from lpet_sim.soil.stress_kernels import TORQUE as MOMENT
from lpet_sim.soil.wheel_law import law_of

SKID_MAX: Final = 0.95
"""Skid of the table's most braked wheel: its advance is 20."""
CREEP_MAX: Final = 2.0
"""Most side creep over the greater of 1 and the advance on the grid: a slip angle of 63 deg."""
CREEP_GAIN: Final = 10.0
"""What the side creep grows by for side force over load that the soil cannot give."""
DROP_RATIO: Final = 0.05
BACKWARDS: Final = 1.0

_SKIDS: Final = 40
_SLIPS: Final = 64
_CREEPS: Final = 24
_T, _S, _Z, _M, _C = range(5)


def mechanics_table(
    soil: MechanicalSoilSpec, wheel: WheelSpec, nominal_load_n: float, gravity_mps2: float
) -> SlipTable:
    """Tabulate a soil that is known by its mechanical parameters.

    The radius by which slip and torque are scaled is that of the grousers' tips.

    Args:
        soil: The soil.
        wheel: The wheel.
        nominal_load_n: Middle of the load axis [N].
        gravity_mps2: Gravity.
    """
    law = law_of(soil, wheel, gravity_mps2)
    loads = load_nodes(nominal_load_n)
    grid = forward_grid(law, loads)
    friction = _friction(law, loads, grid)
    value = np.empty((LOAD_NODES, RATIO_NODES, SIDE_NODES, 4))
    for k in range(LOAD_NODES):
        _invert(
            slip_nodes(), grid[k], traction_ratios(), side_ratios(), float(friction[k]), value[k]
        )
    return SlipTable(nominal_load_n, value, friction)


def slip_nodes() -> Array:
    """Give the slips of the grid, rising, close together about 0, Shape (105,)."""
    skid = -SKID_MAX * np.linspace(1.0, 0.0, _SKIDS, endpoint=False) ** 2
    return np.concatenate([skid / (1.0 + skid), np.linspace(0.0, 1.0, _SLIPS + 1) ** 2])


def creep_nodes() -> Array:
    """Give the side creeps of the grid over ``max(1, advance)``, rising from 0, Shape (25,)."""
    return CREEP_MAX * np.linspace(0.0, 1.0, _CREEPS + 1) ** 2


def forward_grid(law: Law, loads: Array) -> Array:
    """Compute the forward law on the grid.

    Args:
        law: Soil, wheel and gravity.
        loads: Loads [N], Shape (n,).

    Returns:
        Traction over load, side force over load, sinkage [m], torque over load and radius, and
        side creep, Shape (n, slips, creeps, 5).
    """
    slip = slip_nodes()[:, None]
    creep = creep_nodes() * np.maximum(1.0, 1.0 - slip)
    shape = (loads.size, *creep.shape)
    load, slip, creep = (np.broadcast_to(x, shape) for x in (loads[:, None, None], slip, creep))
    out = np.empty((load.size, SUMS + 1))
    forces_into(law, slip.ravel(), creep.ravel(), load.ravel(), out)
    sums = out.reshape(*shape, SUMS + 1)
    depth = law.radius * (1.0 - np.cos(sums[..., SUMS]))
    ratios = (sums[..., DRAWBAR] / load, -sums[..., SIDE] / load)
    return np.stack([*ratios, depth, sums[..., MOMENT] / (load * law.radius), creep], axis=-1)


def _friction(law: Law, loads: Array, grid: Array) -> Array:
    """Give ``tan(phi) + c A / N`` with A the contact of a rolling wheel without slip.

    Nothing below the law's own greatest traction, which a deeper contact may give.
    """
    rolling = grid[:, _SKIDS, 0, _Z]
    entry = np.arccos(1.0 - rolling / law.radius)
    area = law.radius * law.width * entry * (1.0 - law.rear)
    coulomb = law.tan_phi + law.cohesion * area / loads
    return np.maximum(coulomb, grid[..., 0, _T].max(axis=1) + DROP_RATIO)


@njit(cache=True)
def _invert(
    slips: Array, grid: Array, ratios: Array, sides: Array, friction: float, value: Array
) -> None:
    """Write the table of one load, Shape (ratios, sides, 4), from its grid (slips, creeps, 5)."""
    curve = np.empty((slips.size, 5))
    for j in range(sides.size):
        for i in range(slips.size):
            _at_side_force(grid[i], sides[j], 1.0 / max(1.0, 1.0 - slips[i]), curve[i])
        _along_curve(slips, curve, ratios, friction, value[:, j])


@njit(cache=True)
def _at_side_force(row: Array, side: float, scale: float, out: Array) -> None:
    """Write what the wheel does at one slip under a side force over load, into `out` (5,).

    Args:
        row: The law over creep, Shape (creeps, 5).
        side: Side force over load.
        scale: What the gain of creep beyond the soil's strength is divided by.
        out: Filled.
    """
    last = row.shape[0] - 1
    for k in range(1, last + 1):
        if row[k, _S] >= side:
            t = (side - row[k - 1, _S]) / max(row[k, _S] - row[k - 1, _S], 1e-12)
            out[:] = row[k - 1] + max(t, 0.0) * (row[k] - row[k - 1])
            return
    out[:] = row[last]
    out[_C] += CREEP_GAIN * (side - row[last, _S]) / scale


@njit(cache=True)
def _along_curve(slips: Array, curve: Array, ratios: Array, friction: float, value: Array) -> None:
    """Write the inverse of one curve of traction over slip, Shape (ratios, 4)."""
    peak = int(np.argmax(curve[:, _T]))
    k = 0
    for i in range(ratios.size):
        ratio = ratios[i]
        while k < peak and curve[k, _T] < ratio:
            k += 1
        if ratio > curve[peak, _T]:
            advance = _beyond(
                1.0 - slips[peak], ratio - curve[peak, _T], friction - curve[peak, _T]
            )
            _write(slips, curve, advance, value[i])
        elif k == 0:
            _write(slips, curve, 1.0 - slips[0], value[i])
        else:
            t = (ratio - curve[k - 1, _T]) / (curve[k, _T] - curve[k - 1, _T])
            _write(slips, curve, 1.0 - slips[k - 1] - t * (slips[k] - slips[k - 1]), value[i])
        value[i, TORQUE] = max(value[i, TORQUE], ratio * value[i, ADVANCE])


@njit(cache=True)
def _beyond(advance: float, excess: float, room: float) -> float:
    """Give the advance where traction over load exceeds what the soil gives by `excess`."""
    drop = min(DROP_RATIO, 0.5 * max(room, 1e-6))
    if excess < drop:
        return advance * (1.0 - excess / drop)
    return -BACKWARDS * min(1.0, (excess - drop) / (max(room, 1e-6) - drop))


@njit(cache=True)
def _write(slips: Array, curve: Array, advance: float, out: Array) -> None:
    """Write what the wheel does at an advance; backwards it does what it does at a standstill."""
    slip = min(max(1.0 - advance, slips[0]), 1.0)
    k = min(max(np.searchsorted(slips, slip), 1), slips.size - 1)
    t = (slip - slips[k - 1]) / (slips[k] - slips[k - 1])
    out[ADVANCE] = advance
    for column, source in ((SIDE_CREEP, _C), (SINKAGE, _Z), (TORQUE, _M)):
        out[column] = curve[k - 1, source] + t * (curve[k, source] - curve[k - 1, source])
