"""Traction and load of the wheels, from the net contact forces: asked at every physics step."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints


@njit(cache=True)
def split_forces(
    force: Array,
    geom_xmat: Array,
    wheel_geom: Ints,
    torque: Array,
    dof: Ints,
    qvel: Array,
    radius_m: float,
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Split the net force on each wheel along its rolling, along its axle, and the rest.

    The ground's torque about the axle is that of the traction alone, ``T = -torque / r``, since the
    normal force of a round wheel passes through its axle. So ``N^2 = |F|^2 - T^2 - F_axle^2``.

    Args:
        force: Contacts with anything, net force in the world [N], contacts with soil, Shape (6, 5).
        geom_xmat: Rotations of all geoms, row-major, Shape (g, 9); a wheel's axle is its z.
        wheel_geom: Which geoms are the wheels, Shape (6,).
        torque: Constraint torques [N m], Shape (nv,).
        dof: Which of them are the wheels', Shape (6,).
        qvel: Joint rates, Shape (nv,).
        radius_m: Radius of the wheels [m].

    Returns:
        Traction, positive along the rolling [N]; load [N]; wheel rates [rad/s]; whether on rock;
        Shape (6,) each.
    """
    traction, load, omega = np.empty(6), np.empty(6), np.empty(6)
    on_rock = np.empty(6, dtype=np.bool_)
    for i in range(6):
        axle, f = geom_xmat[wheel_geom[i]], force[i, 1:4]
        side = f[0] * axle[2] + f[1] * axle[5] + f[2] * axle[8]
        along = -torque[dof[i]] / radius_m
        rest = f[0] * f[0] + f[1] * f[1] + f[2] * f[2] - side * side - along * along
        load[i] = math.sqrt(max(rest, 0.0))
        omega[i] = qvel[dof[i]]
        traction[i] = math.copysign(1.0, omega[i]) * along
        on_rock[i] = force[i, 0] > force[i, 4]
    return traction, load, omega, on_rock


@njit(cache=True)
def turn_surfaces_back(
    surfacevel: Array, wheel_geom: Ints, slip: Array, target: Array, gain: float, omega: Array
) -> None:
    """Let the slip follow its target, and turn each wheel's surface back by it, in place.

    ``slip += gain (target - slip)``; the surface then moves at ``r omega (1 - slip)``.

    Args:
        surfacevel: Surface velocities of all geoms, Shape (g, 6).
        wheel_geom: Which geoms are the wheels, Shape (6,).
        slip: Slip of the wheels, Shape (6,).
        target: What the law asks for, Shape (6,).
        gain: Share of the difference taken in this step.
        omega: Wheel rates [rad/s], Shape (6,).
    """
    for i in range(6):
        slip[i] += gain * (target[i] - slip[i])
        surfacevel[wheel_geom[i], 5] = -slip[i] * omega[i]
