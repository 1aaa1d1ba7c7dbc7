"""Forces on the wheels, and what moves them: the two compiled calls of every physics step."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rover.wheel_soil import DEEPEST, STANDING_RADPS

GEOM, BODY, DOF = range(3)

_AIRBORNE_N = 1.0  # a wheel with less load keeps its depth
_YIELD_S = 0.3  # a wheel at rest settles into soft soil in this time (an assumption)
# Contacts take the ground to stand still: faster, and they begin to chatter. In motion a little
# of that is borne, since digging in must not take for ever.
_SINK_MPS, _YIELD_MPS = 0.001, 0.0005
_ALONG_PER_S = 200.0  # what a contact answers to a mismatch of speed, over its share of the mass:
_ACROSS_PER_S = 4500.0  # measured with the solver settings of the model, where forces scatter least
_SMOOTH_RADPS = 0.05  # below this rate the soil's torque fades, as stiff as dt = 5 ms bears


@njit(cache=True)
def read_wheels(
    contacts: Array,
    geom_xmat: Array,
    qfrc_constraint: Array,
    qvel: Array,
    index: Ints,
    normal: Array,
    arm: Array,
    force: Array,
    on_rock: NDArray[np.bool_],
) -> None:
    """Split the net force on each wheel along its heading, across it, and the rest, in place.

    The ground's torque about the axle is that of the traction alone, ``T = -torque / r``, since the
    normal force of a round wheel passes through its axle. Across is the axle's direction in the
    plane of the ground; the facets of a rock are not known, so there it is none. The rest is load:
    ``N^2 = |F|^2 - T^2 - S^2``.

    Args:
        contacts: Contacts with anything, net force on the ground in the world [N], contacts with
            soil, Shape (w, 5).
        geom_xmat: Rotations of all geoms, row-major, Shape (g, 9); a wheel's axle is its z.
        qfrc_constraint: Constraint torques [N m], Shape (nv,).
        qvel: Joint rates, Shape (nv,).
        index: Geoms, bodies and joint rates of the wheels, Shape (3, w).
        normal: Normal of the ground under each wheel, Shape (w, 3).
        arm: Distance from each axle to the contact [m], Shape (w,).
        force: Out: forward, to the left and normal on the wheels [N], and their rates [rad/s],
            Shape (4, w).
        on_rock: Out, Shape (w,).
    """
    for i in range(len(arm)):
        geom, dof = index[GEOM, i], index[DOF, i]
        on_rock[i] = contacts[i, 0] > contacts[i, 4]
        traction = -qfrc_constraint[dof] / arm[i]
        side = 0.0 if on_rock[i] else _across(contacts[i, 1:4], geom_xmat[geom], normal[i])
        fx, fy, fz = contacts[i, 1], contacts[i, 2], contacts[i, 3]
        rest = fx * fx + fy * fy + fz * fz - traction * traction - side * side
        force[0, i], force[1, i], force[2, i] = traction, side, math.sqrt(max(rest, 0.0))
        force[3, i] = qvel[dof]


@njit(cache=True)
def follow_forces(
    force: Array,
    pace: Array,
    slip_steepness: Array,
    side_steepness: Array,
    mean: Array,
    traction_n: Array,
    side_n: Array,
    load_n: Array,
    omega_radps: Array,
) -> None:
    """Let the means that the law is told follow the forces, in place.

    The law is far from straight, so that it is asked for the mean force and not for the mean of
    its answers. A mean goes a share g of the way at every step. Contacts are stiff: when the
    surface's speed changes by dv the force changes by B dv, and the law answers with more speed by
    ``k = r |omega| steepness / N``, which an explicit step bears up to ``g k B = 2``. So the share
    is that of an implicit one, ``g / (1 + g k B)``: the same end, no chatter.

    Args:
        force: Forces and rates of the wheels as `read_wheels` gives them, Shape (4, w).
        pace: See `move_wheels`.
        slip_steepness: The law's last, Shape (w,).
        side_steepness: The law's last, Shape (w,).
        mean: Means of forces and rates, Shape (4, w), kept here.
        traction_n: Out: mean force along the rolling, Shape (w,).
        side_n: Out: mean force to the left, Shape (w,).
        load_n: Out: mean normal force, Shape (w,).
        omega_radps: Out: mean rate, Shape (w,).
    """
    gain, side_gain, radius, mass = pace[1], pace[2], pace[4], pace[6]
    for i in range(mean.shape[1]):
        answer = mass * radius * abs(mean[3, i]) / max(mean[2, i], _AIRBORNE_N)
        share = gain / (1.0 + gain * answer * _ALONG_PER_S * slip_steepness[i])
        side_share = side_gain / (1.0 + side_gain * answer * _ACROSS_PER_S * side_steepness[i])
        mean[0, i] += share * (force[0, i] - mean[0, i])
        mean[1, i] += side_share * (force[1, i] - mean[1, i])
        mean[2, i] += share * (force[2, i] - mean[2, i])
        mean[3, i] += gain * (force[3, i] - mean[3, i])
        traction_n[i] = math.copysign(1.0, mean[3, i]) * mean[0, i]
        side_n[i], load_n[i], omega_radps[i] = mean[1, i], mean[2, i], mean[3, i]


@njit(cache=True)
def _across(force: Array, xmat: Array, normal: Array) -> float:
    """Give the part of a force along the axle's direction in the plane of the ground."""
    lean = xmat[2] * normal[0] + xmat[5] * normal[1] + xmat[8] * normal[2]
    x, y, z = (
        xmat[2] - lean * normal[0],
        xmat[5] - lean * normal[1],
        xmat[8] - lean * normal[2],
    )
    length = math.sqrt(x * x + y * y + z * z)
    # The sensor tells the force of the wheel on the ground.
    return float(-(force[0] * x + force[1] * y + force[2] * z) / max(length, 1e-6))


@njit(cache=True)
def move_wheels(
    index: Ints,
    geom_xmat: Array,
    surfacevel: Array,
    geom_size: Array,
    geom_friction: Array,
    xfrc_applied: Array,
    pace: Array,
    held: bool,
    force: Array,
    mean: Array,
    slip: Array,
    side_creep: Array,
    sinkage_m: Array,
    torque_nm: Array,
    friction: Array,
    motion: Array,
    arm: Array,
) -> None:
    """Let the wheels do what the law says, and write it for MuJoCo's next step, in place.

    The surface turns back so that the axle advances at ``v = r omega (1 - slip)``, and drifts at
    ``r |omega| creep``; neither jumps. The wheel stands with a radius of ``r - z``, whose depth z
    follows the law with the distance rolled, and at rest yields but never rebounds, down to
    `DEEPEST`. Traction T has the arm ``r - z``; what the law's torque M has more, less what the
    load N does by sinking, brakes the wheel::

        M - T (r - z) - N dz / (|omega| dt),  M no less than T r (1 - slip): no energy is made

    Args:
        index: Geoms, bodies and joint rates of the wheels, Shape (3, w).
        geom_xmat: Rotations of all geoms, Shape (g, 9).
        surfacevel: Surface velocities of all geoms, Shape (g, 6).
        geom_size: Sizes of all geoms [m], Shape (g, 3).
        geom_friction: Friction of all geoms, Shape (g, 3).
        xfrc_applied: Forces and torques on all bodies, Shape (b, 6).
        pace: Step [s], shares taken of the forces along and across, distance in which the depth
            follows [m], radius [m], 1 where wheels stand as deep as they sink, else 0, a
            wheel's share of the mass [kg], and the gap at which contacts hold the wheels [m].
        held: Whether surfaces are to stand still, as in a forced slip.
        force: Forces and rates of the wheels, Shape (4, w).
        mean: Their means, Shape (4, w).
        slip: The law's, Shape (w,).
        side_creep: The law's, Shape (w,).
        sinkage_m: The law's, Shape (w,).
        torque_nm: The law's, Shape (w,).
        friction: The law's, Shape (w,).
        motion: Slip, side creep and depth [m] as they are, Shape (3, w); kept here.
        arm: Out: distance from each axle to the contact [m], Shape (w,).
    """
    dt, gain, side_gain, length, radius, sinks, _, margin = pace
    for i in range(len(arm)):
        geom, body = index[GEOM, i], index[BODY, i]
        omega, turning = force[3, i], abs(mean[3, i])
        motion[0, i] += _held(1.0 if held else slip[i], motion[0, i], gain)
        motion[1, i] += _held(0.0 if held else side_creep[i], motion[1, i], side_gain)
        advance = 1.0 - motion[0, i]
        rise = 0.0
        if force[2, i] > _AIRBORNE_N and not held:
            rolled = 0.0 if turning < STANDING_RADPS else radius * turning * dt
            rise = _sink(motion[2], i, min(sinkage_m[i], DEEPEST * radius), rolled, dt, length)
        stand = radius - sinks * motion[2, i]
        arm[i] = stand - margin / 2  # MuJoCo puts contacts in the middle of the gap
        surfacevel[geom, 2] = -motion[1, i] * radius * turning
        surfacevel[geom, 5] = (radius * advance / arm[i] - 1.0) * mean[3, i]
        geom_size[geom, 0] = stand - margin
        geom_friction[geom, 0] = friction[i]
        ahead = math.copysign(1.0, mean[3, i])
        traction = ahead * mean[0, i]
        drawn = max(torque_nm[i], traction * radius * advance)
        brake = drawn - traction * arm[i] - sinks * mean[2, i] * rise * radius
        fade = max(min(omega / _SMOOTH_RADPS, 1.0), -1.0)
        for axis in range(3):
            xfrc_applied[body, 3 + axis] = -fade * brake * geom_xmat[geom, 2 + 3 * axis]


@njit(cache=True)
def _held(target: float, now: float, most: float) -> float:
    """Give the step towards a target, held to a most."""
    return min(max(target - now, -most), most)


@njit(cache=True)
def _sink(depth: Array, i: int, target: float, rolled: float, dt: float, length: float) -> float:
    """Let the depth of wheel i follow, in place; give how much of it for each metre rolled."""
    lack = target - depth[i]
    if rolled > 0.0:
        step = _held(-math.expm1(-rolled / length) * lack, 0.0, _SINK_MPS * dt)
        depth[i] += step
        return step / rolled
    depth[i] += min(-math.expm1(-dt / _YIELD_S) * max(lack, 0.0), _YIELD_MPS * dt)
    return 0.0
