"""Compiled checks over a map of mobility: distances to outlines, straights and single poses."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints

Floats = NDArray[np.float32]

_ROUNDING_M = 1e-6  # distances are kept in single precision


@njit(cache=True)
def stamp_polygons(
    distance: Floats, x0: int, y0: int, cell: float, corners: Array, offsets: Ints
) -> None:
    """Lower a map of distances to those from convex polygons, as far as its cap reaches.

    Args:
        distance: Distances at nodes [m], filled with the cap at first, changed in place,
            Shape (ny, nx).
        x0: Index of the first column: node (i, j) is at ``((x0 + j), (y0 + i)) * cell``.
        y0: Index of the first row.
        cell: Distance of the nodes [m].
        corners: Corners of all polygons one after the other, counter-clockwise [m], Shape (v, 2).
        offsets: Where each polygon begins, and the end, Shape (n + 1,).
    """
    cap = distance.max() if distance.size else 0.0
    for k in range(len(offsets) - 1):
        a, b = offsets[k], offsets[k + 1]
        first_j = max(math.ceil((corners[a:b, 0].min() - cap) / cell) - x0, 0)
        last_j = min(math.floor((corners[a:b, 0].max() + cap) / cell) - x0, distance.shape[1] - 1)
        first_i = max(math.ceil((corners[a:b, 1].min() - cap) / cell) - y0, 0)
        last_i = min(math.floor((corners[a:b, 1].max() + cap) / cell) - y0, distance.shape[0] - 1)
        for i in range(first_i, last_i + 1):
            for j in range(first_j, last_j + 1):
                away = polygon_distance(corners, a, b, (x0 + j) * cell, (y0 + i) * cell)
                if away < distance[i, j]:
                    distance[i, j] = away


@njit(cache=True)
def polygon_distance(corners: Array, a: int, b: int, x: float, y: float) -> float:
    """Give the distance from a point to a convex polygon, 0 inside [m].

    Args:
        corners: Corners, counter-clockwise [m], Shape (v, 2).
        a: The polygon's first corner.
        b: One past its last.
        x: The point [m].
        y: The point [m].
    """
    nearest, inside = np.inf, True
    for k in range(a, b):
        px, py = corners[k, 0], corners[k, 1]
        after = k + 1 if k + 1 < b else a
        ex, ey = corners[after, 0] - px, corners[after, 1] - py
        dx, dy = x - px, y - py
        inside = inside and ex * dy - ey * dx >= 0.0
        along = min(max((dx * ex + dy * ey) / max(ex * ex + ey * ey, 1e-18), 0.0), 1.0)
        nearest = min(nearest, (dx - along * ex) ** 2 + (dy - along * ey) ** 2)
    return 0.0 if inside else math.sqrt(nearest)


@njit(cache=True)
def least_distance(distance: Floats, grid: Array, x: float, y: float) -> float:
    """Give what a distance at a point is at least: it changes no faster than the point moves.

    Args:
        distance: Exact distances at nodes [m], Shape (ny, nx).
        grid: First column and row, and the distance of the nodes [m], Shape (3,).
        x: The point [m].
        y: The point [m].

    Returns:
        The bound [m]; -1 beyond the map.
    """
    cell = grid[2]
    u, v = x / cell - grid[0], y / cell - grid[1]
    if u < 0.0 or v < 0.0 or u > distance.shape[1] - 1 or v > distance.shape[0] - 1:
        return -1.0
    j, i = min(int(u), distance.shape[1] - 2), min(int(v), distance.shape[0] - 2)
    best = -1.0
    for di in range(2):
        for dj in range(2):
            off = cell * math.hypot(u - j - dj, v - i - di)
            best = max(best, distance[i + di, j + dj] - off)
    return best - _ROUNDING_M


@njit(cache=True)
def is_farther(distance: Floats, grid: Array, x: float, y: float, needed: float) -> bool:
    """Tell whether a distance at a point surely is as large as needed.

    The nearest node alone tells where there is room to spare, which is nearly everywhere.

    Args:
        distance: Exact distances at nodes [m], Shape (ny, nx).
        grid: First column and row, and the distance of the nodes [m], Shape (3,).
        x: The point [m].
        y: The point [m].
        needed: What is needed [m].
    """
    j, i = int(x / grid[2] - grid[0] + 0.5), int(y / grid[2] - grid[1] + 0.5)
    within = 0 < j < distance.shape[1] - 1 and 0 < i < distance.shape[0] - 1
    # Half a diagonal of a cell, and what single precision may be off by.
    if within and distance[i, j] - 0.70711 * grid[2] - _ROUNDING_M >= needed:
        return True
    return least_distance(distance, grid, x, y) >= needed


@njit(cache=True)
def ground_holds(
    gradient: Floats, lattice: Array, needs: Array, x: float, y: float, cos: float, sin: float
) -> bool:
    """Tell whether the ground at a point is neither too steep nor too steep across a heading.

    Args:
        gradient: Slopes (dz/dx, dz/dy) at the nodes of a lattice; each holds for its square,
            Shape (my, mx, 2).
        lattice: First column and row, and the distance of the lattice's nodes [m], Shape (3,).
        needs: What `MobilitySpec.needs` gives.
        x: The point [m].
        y: The point [m].
        cos: Of the heading; 0 together with ``sin`` stands for every heading.
        sin: Of the heading.
    """
    i = min(max(int(math.floor(y / lattice[2] + 0.5) - lattice[1]), 0), gradient.shape[0] - 1)
    j = min(max(int(math.floor(x / lattice[2] + 0.5) - lattice[0]), 0), gradient.shape[1] - 1)
    gx, gy = gradient[i, j, 0], gradient[i, j, 1]
    steepness = math.hypot(gx, gy)
    if steepness > needs[4]:
        return False
    across = steepness if cos == 0.0 and sin == 0.0 else abs(gy * cos - gx * sin)
    return across <= needs[5]


@njit(cache=True)
def can_turn(
    obstacle: Floats,
    straddle: Floats,
    gradient: Floats,
    grid: Array,
    lattice: Array,
    needs: Array,
    x: float,
    y: float,
) -> bool:
    """Tell whether a rover surely can turn on the spot at a point: no rock in its circle."""
    if not is_farther(obstacle, grid, x, y, needs[3]):
        return False
    if not is_farther(straddle, grid, x, y, needs[3]):
        return False
    return ground_holds(gradient, lattice, needs, x, y, 0.0, 0.0)


@njit(cache=True)
def can_drive(
    obstacle: Floats,
    straddle: Floats,
    gradient: Floats,
    grid: Array,
    lattice: Array,
    needs: Array,
    ax: float,
    ay: float,
    bx: float,
    by: float,
) -> bool:
    """Tell whether a rover surely can drive straight between two points that it can turn at.

    The body sweeps the strip of its width along the straight, and at the ends no more than the
    circles that it turns in. Rocks to straddle keep off both wheel tracks.
    """
    length = math.hypot(bx - ax, by - ay)
    steps = math.ceil(2.0 * length / grid[2]) + 1
    slack = length / steps / 2.0
    cos, sin = ((bx - ax) / length, (by - ay) / length) if length > 0.0 else (0.0, 0.0)
    side_x, side_y = -sin * needs[1], cos * needs[1]
    for k in range(steps + 1):
        x, y = ax + (bx - ax) * k / steps, ay + (by - ay) * k / steps
        if not is_farther(obstacle, grid, x, y, needs[0] + slack):
            return False
        if not ground_holds(gradient, lattice, needs, x, y, cos, sin):
            return False
        if is_farther(straddle, grid, x, y, needs[0] + slack):
            continue
        for side in (-1.0, 1.0):
            px, py = x + side * side_x, y + side * side_y
            if not is_farther(straddle, grid, px, py, needs[2] + slack):
                return False
    return True


@njit(cache=True)
def room_at(
    obstacle: Floats,
    straddle: Floats,
    gradient: Floats,
    grid: Array,
    lattice: Array,
    needs: Array,
    body: Array,
    tracks: Array,
    slack: float,
    x: float,
    y: float,
    yaw: float,
) -> float:
    """Tell how far a rover at a pose surely can move on, turning as it likes [m].

    Args:
        obstacle: Distances to obstacles [m].
        straddle: Distances to rocks to straddle [m].
        gradient: Slopes of the ground.
        grid: Of the distances.
        lattice: Of the slopes.
        needs: What `MobilitySpec.needs` gives.
        body: Discs that cover the body, Shape (n, 3).
        tracks: Discs that cover the wheel tracks, Shape (m, 3).
        slack: How far a point of the body may move before the next check [m].
        x: Place of the body's origin [m].
        y: Place of the body's origin [m].
        yaw: Heading [rad].

    Returns:
        -1 where the body may touch something, or stands too steep; else at least 0.
    """
    cos, sin = math.cos(yaw), math.sin(yaw)
    if not ground_holds(gradient, lattice, needs, x, y, cos, sin):
        return -1.0
    rock, low = least_distance(obstacle, grid, x, y), least_distance(straddle, grid, x, y)
    if rock < 0.0:
        return -1.0
    room = min(rock, low) - needs[3]
    if room > slack:
        return room
    if rock < needs[3] + slack and not _all_clear(obstacle, grid, body, slack, x, y, cos, sin):
        return -1.0
    if low < needs[3] + slack and not _all_clear(straddle, grid, tracks, slack, x, y, cos, sin):
        return -1.0
    return 0.0


@njit(cache=True)
def _all_clear(
    distance: Floats,
    grid: Array,
    discs: Array,
    slack: float,
    x: float,
    y: float,
    cos: float,
    sin: float,
) -> bool:
    for k in range(len(discs)):
        px = x + cos * discs[k, 0] - sin * discs[k, 1]
        py = y + sin * discs[k, 0] + cos * discs[k, 1]
        if least_distance(distance, grid, px, py) < discs[k, 2] + slack:
            return False
    return True
