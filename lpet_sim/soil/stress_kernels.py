"""Stresses under a rolling wheel and their sums over the contact, compiled.

Angles are measured from straight down, positive towards the front: the rim meets the soil at
``theta_1`` and leaves it at ``theta_2 <= 0``; the normal stress is greatest at ``theta_m``.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array

VERTICAL, DRAWBAR, SIDE, TORQUE, COMPACTION = range(5)
SUMS: Final = 5
ENTRY_LIMIT_RAD: Final = math.pi / 2
"""The deepest contact that the law is asked for: sunk to the axle."""

NODES: Final = 12
_x, _w = np.polynomial.legendre.leggauss(NODES)
_POINTS: Final = 0.5 * (_x + 1.0)
_WEIGHTS: Final = 0.5 * _w
_SCAN_STEPS: Final = 12
_ITERATIONS: Final = 80
_BALANCE: Final = 1e-11  # of the load, within which the vertical force meets it
_NEAR: Final = 0.04  # share of a guessed angle by which the right one may differ


class Law(NamedTuple):
    """A soil, a wheel and a gravity as the numbers that the stresses need.

    Attributes:
        radius: r, of the grousers' tips, at which the wheel rolls and the soil shears [m].
        width: b [m].
        pressure: Normal stress at the depth `depth_unit` [Pa].
        depth_unit: Depth in which the exponent counts [m].
        exponent: n0; `exponent_slip` n1 and `exponent_skid` n2 are added for slip and skid.
        cohesion: c [Pa].
        tan_phi: Tangent of the angle of internal friction.
        shear_x: K along the wheel [m]; `shear_x_per_rad` is added for each radian of slip angle.
        shear_y: K across the wheel [m]; `shear_y_per_rad` likewise.
        peak: a0; `peak_slip` a1: ``theta_m = (a0 + a1 s) theta_1``.
        rear: b0; `rear_slip` b1: ``theta_2 = (b0 + b1 s) theta_1``.
        flank_linear: Resistance of soil pushed sideways, per width and depth [Pa].
        flank_square: The same per width and squared depth [N/m^3].
    """

    radius: float
    width: float
    pressure: float
    depth_unit: float
    exponent: float
    exponent_slip: float
    exponent_skid: float
    cohesion: float
    tan_phi: float
    shear_x: float
    shear_x_per_rad: float
    shear_y: float
    shear_y_per_rad: float
    peak: float
    peak_slip: float
    rear: float
    rear_slip: float
    flank_linear: float
    flank_square: float


class Motion(NamedTuple):
    """How the wheel moves, and what of the law depends on that alone.

    Attributes:
        advance: v / (r omega) = 1 - slip, 0 or above.
        creep: Sideways speed over r |omega|.
        exponent: n at this slip.
        peak: ``theta_m / theta_1``.
        rear: ``theta_2 / theta_1``.
        shear_x: K along the wheel at this slip angle [m]; `shear_y` that across it.
    """

    advance: float
    creep: float
    exponent: float
    peak: float
    rear: float
    shear_x: float
    shear_y: float


@njit(cache=True)
def motion_of(law: Law, slip: float, creep: float) -> Motion:
    """Give what depends on slip and side creep alone; slip above 1 is read as 1.

    Skid is counted as ``s' = r omega / v - 1 = s / (1 - s)``, so that a locked wheel has -1; the
    angles of peak and rear stay in skid what they are at slip 0.
    """
    advance = max(0.0, 1.0 - slip)
    forward = 1.0 - min(advance, 1.0)
    skid = 1.0 - 1.0 / max(advance, 1.0)
    exponent = law.exponent + law.exponent_slip * forward + law.exponent_skid * skid
    slip_angle = math.atan2(abs(creep), advance)
    shear_x = law.shear_x + law.shear_x_per_rad * slip_angle
    shear_y = law.shear_y + law.shear_y_per_rad * slip_angle
    peak, rear = law.peak + law.peak_slip * forward, law.rear + law.rear_slip * forward
    return Motion(advance, creep, exponent, peak, rear, shear_x, shear_y)


@njit(cache=True)
def depth_at(law: Law, theta: float, entry: float) -> float:
    """Give the depth of the tips' circle below the surface [m].

    ``z = r (cos theta - cos theta_1)``, written as a product so that nothing cancels.
    """
    return 2.0 * law.radius * math.sin(0.5 * (entry + theta)) * math.sin(0.5 * (entry - theta))


@njit(cache=True)
def normal_stress(law: Law, exponent: float, depth: float) -> float:
    """Give the pressure at a depth, ``sigma = p (z / z_unit)^n`` [Pa]."""
    return law.pressure * (max(depth, 0.0) / law.depth_unit) ** exponent


@njit(cache=True)
def shear_stress(
    law: Law, motion: Motion, theta: float, entry: float, sigma: float
) -> tuple[float, float]:
    """Give the shear stress that the soil puts on the rim, along and across [Pa].

    The rim's displacement against soil at rest, from entry on, with ``a = v / (r omega)``:
    ``j_x = r ((theta_1 - theta) - a (sin theta_1 - sin theta))`` and
    ``j_y = r creep (theta_1 - theta)``. Then ``tau = (c + sigma tan phi) (1 - exp(-|e|)) e / |e|``
    with ``e = (j_x / K_x, j_y / K_y)``: in no direction more than Mohr and Coulomb allow.
    """
    turned = entry - theta
    along = turned - motion.advance * (math.sin(entry) - math.sin(theta))
    e_x = law.radius * along / motion.shear_x
    e_y = law.radius * motion.creep * turned / motion.shear_y
    size = math.sqrt(e_x * e_x + e_y * e_y)
    if size < 1e-12:
        return 0.0, 0.0
    tau = (law.cohesion + sigma * law.tan_phi) * -math.expm1(-size) / size
    return tau * e_x, tau * e_y


@njit(cache=True)
def flank_resistance(law: Law, motion: Motion, theta: float, entry: float) -> float:
    """Give the resistance of soil pushed aside by the sunk flank, per length of flank [N/m].

    ``D1 (c z + D2 rho g z^2 / 2)`` after Hegedus, mobilised with the sideways displacement as
    shear is: ``1 - exp(-|j_y| / K_y)``.
    """
    z = max(0.0, depth_at(law, theta, entry))
    moved = abs(law.radius * motion.creep * (entry - theta)) / motion.shear_y
    return (law.flank_linear * z + law.flank_square * z * z) * -math.expm1(-moved)


@njit(cache=True)
def _add_stresses(
    law: Law, motion: Motion, theta: float, entry: float, sigma: float, step: float, sums: Array
) -> None:
    """Add what an arc of `step` [rad] at `theta` contributes."""
    tau_x, tau_y = shear_stress(law, motion, theta, entry, sigma)
    area = law.radius * law.width * step
    sine, cosine = math.sin(theta), math.cos(theta)
    flank = 0.0
    if motion.creep != 0.0:
        flank = flank_resistance(law, motion, theta, entry) * law.radius * cosine * step
    sums[VERTICAL] += area * (sigma * cosine + tau_x * sine)
    sums[DRAWBAR] += area * (tau_x * cosine - sigma * sine)
    sums[SIDE] -= area * tau_y + math.copysign(flank, motion.creep)
    sums[TORQUE] += area * law.radius * tau_x
    sums[COMPACTION] += area * sigma * sine


@njit(cache=True)
def contact_sums(law: Law, motion: Motion, entry: float, sums: Array) -> None:
    """Sum the stresses over the contact into `sums` of Shape (`SUMS`,).

    Front and rear are both swept by ``u`` in (0, 1), from the end without stress to the peak, at
    ``theta = end + (theta_m - end) u^2``: there the stress, ``(1 - u^2 ...)^n`` of the depth, is
    smooth enough for Gauss and Legendre even with n below 1. By Wong and Reece's mirror, front
    and rear have the same normal stress at the same ``u``.
    """
    sums[:] = 0.0
    peak, rear = motion.peak * entry, motion.rear * entry
    for i in range(NODES):
        u = _POINTS[i]
        ahead = entry + (peak - entry) * u * u
        sigma = normal_stress(law, motion.exponent, depth_at(law, ahead, entry))
        step = 2.0 * u * _WEIGHTS[i]
        _add_stresses(law, motion, ahead, entry, sigma, step * (entry - peak), sums)
        behind = rear + (peak - rear) * u * u
        _add_stresses(law, motion, behind, entry, sigma, step * (peak - rear), sums)


@njit(cache=True)
def solve_entry(law: Law, motion: Motion, load: float, guess: float, sums: Array) -> float:
    """Find the entry angle at which the vertical force is the load [rad]; sums are left in `sums`.

    A crossing close to the guess is taken if there is one; else the first is bracketed by steps
    from the surface. It is closed in by regula falsi with the Illinois halving.

    Args:
        law: Soil, wheel and gravity.
        motion: The wheel's motion.
        load: Vertical load [N].
        guess: A likely angle, such as that of a wheel which moves nearly alike; 0 for none.
        sums: Filled.

    Returns:
        The angle, or minus `ENTRY_LIMIT_RAD` where no contact up to the limit carries the load.
    """
    low, high = guess * (1.0 - _NEAR), min(guess * (1.0 + _NEAR), ENTRY_LIMIT_RAD)
    if guess > 0.0:
        f_low = _excess(law, motion, load, low, sums)
        if f_low < 0.0:
            f_high = _excess(law, motion, load, high, sums)
            if f_high >= 0.0:
                return _close_in(law, motion, load, low, f_low, high, f_high, sums)
    low, f_low, high, f_high = 0.0, -load, 0.0, -load
    for k in range(1, _SCAN_STEPS + 1):
        high = ENTRY_LIMIT_RAD * (k / _SCAN_STEPS) ** 1.5
        f_high = _excess(law, motion, load, high, sums)
        if f_high >= 0.0:
            return _close_in(law, motion, load, low, f_low, high, f_high, sums)
        low, f_low = high, f_high
    return -ENTRY_LIMIT_RAD


@njit(cache=True)
def _excess(law: Law, motion: Motion, load: float, entry: float, sums: Array) -> float:
    """Give the vertical force at an entry angle less the load [N]."""
    contact_sums(law, motion, entry, sums)
    return float(sums[VERTICAL]) - load


@njit(cache=True)
def _close_in(
    law: Law,
    motion: Motion,
    load: float,
    low: float,
    f_low: float,
    high: float,
    f_high: float,
    sums: Array,
) -> float:
    entry, side = high, 0
    for _ in range(_ITERATIONS):
        entry = (low * f_high - high * f_low) / (f_high - f_low)
        f = _excess(law, motion, load, entry, sums)
        if abs(f) <= _BALANCE * load or high - low < 1e-15:
            break
        if f < 0.0:
            low, f_low, f_high = entry, f, f_high * (0.5 if side < 0 else 1.0)
            side = -1
        else:
            high, f_high, f_low = entry, f, f_low * (0.5 if side > 0 else 1.0)
            side = 1
    return entry


@njit(cache=True)
def forces_into(law: Law, slip: Array, creep: Array, load: Array, out: Array) -> None:
    """Write, for each wheel, the contact's sums and its entry angle, Shape (n, `SUMS` + 1)."""
    sums, guess = np.empty(SUMS), 0.0
    for i in range(slip.size):
        motion = motion_of(law, slip[i], creep[i])
        guess = solve_entry(law, motion, load[i], guess, sums)
        out[i, SUMS] = guess
        out[i, :SUMS] = sums
