"""Compiled search over the nodes of a map: straights across narrow places, and waves of costs."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.planning.mobility_kernels import Floats, can_drive
from lpet_sim.recording.arrays import Array, Ints

Bools = NDArray[np.bool_]
Numbers = NDArray[np.int32]

# A step to the next node costs 12, a diagonal one 17: their ratio is within 0.2 % of sqrt(2).
SIDE, DIAGONAL = 12, 17
UNSEEN = 2**31 - 1
_DIRECTIONS = 48


@njit(cache=True)
def find_bridges(
    obstacle: Floats,
    straddle: Floats,
    gradient: Floats,
    grid: Array,
    lattice: Array,
    needs: Array,
    region: Numbers,
    reach: int,
    ends: Ints,
) -> int:
    """Find straights that join regions across places where the rover fits but cannot turn.

    From each node at the rim of a region rays go out, and each ends at the first node of a region.

    Args:
        obstacle: Distances to obstacles [m]; as the next five, of `MobilityMap.layers`.
        straddle: Distances to rocks to straddle [m].
        gradient: Slopes of the ground.
        grid: Of the distances.
        lattice: Of the slopes.
        needs: What `MobilitySpec.needs` gives.
        region: Number of each node's region, 0 where the rover cannot turn, Shape (ny, nx).
        reach: Longest ray [nodes].
        ends: Filled with the two nodes of each straight, row * nx + column, Shape (room, 2).

    Returns:
        How many straights there are, at most as many as have room.
    """
    ny, nx = region.shape
    cell, count = grid[2], 0
    for i in range(1, ny - 1):
        for j in range(1, nx - 1):
            here = region[i, j]
            if here == 0 or not _is_rim(region, i, j):
                continue
            for direction in range(_DIRECTIONS):
                angle = 2.0 * math.pi * direction / _DIRECTIONS
                a, b = _first_beyond(obstacle, region, needs, cell, i, j, angle, reach)
                if a < 0 or region[a, b] == here or count == len(ends):
                    continue
                if can_drive(
                    obstacle, straddle, gradient, grid, lattice, needs,
                    (grid[0] + j) * cell, (grid[1] + i) * cell,
                    (grid[0] + b) * cell, (grid[1] + a) * cell,
                ):  # fmt: skip
                    ends[count, 0], ends[count, 1] = i * nx + j, a * nx + b
                    count += 1
    return count


@njit(cache=True)
def _is_rim(region: Numbers, i: int, j: int) -> bool:
    return (
        region[i - 1, j] == 0
        or region[i + 1, j] == 0
        or region[i, j - 1] == 0
        or region[i, j + 1] == 0
    )


@njit(cache=True)
def _first_beyond(
    obstacle: Floats,
    region: Numbers,
    needs: Array,
    cell: float,
    i: int,
    j: int,
    angle: float,
    reach: int,
) -> tuple[int, int]:
    """Give the first node of a region on a ray that leaves the rim, (-1, -1) where there is none.

    A ray ends where not even half the width of the rover is free.
    """
    cos, sin = math.cos(angle), math.sin(angle)
    for step in range(1, reach + 1):
        a, b = round(i + step * sin), round(j + step * cos)
        if a < 0 or b < 0 or a >= region.shape[0] or b >= region.shape[1]:
            break
        if region[a, b] > 0:
            # The very next node of the own region: the ray does not leave it.
            return (a, b) if step > 1 else (-1, -1)
        if obstacle[a, b] < needs[0] - cell:
            break
    return -1, -1


@njit(cache=True)
def spread(
    free: Bools,
    seeds: Ints,
    bridges: Ints,
    prices: Numbers,
    first: Numbers,
    cost: Numbers,
    toward: Numbers,
) -> None:
    """Settle nodes in the order of their costs from the seeds; a ring of buckets keeps the order.

    Args:
        free: Nodes to go over, Shape (ny, nx).
        seeds: Nodes of no cost, row * nx + column, Shape (n,).
        bridges: For each straight across, where it leads to and the next one from the same node,
            -1 at the end, Shape (b, 2).
        prices: Cost of each straight, Shape (b,).
        first: First straight from each node, -1: none, Shape (ny * nx,).
        cost: Filled with the costs; `UNSEEN` at first, Shape (ny * nx,).
        toward: Filled with the next node on the way to a seed, Shape (ny * nx,).

    Reference:
        Dial (1969), Algorithm 360: shortest-path forest with topological ordering.
    """
    ny, nx = free.shape
    dearest = DIAGONAL if len(prices) == 0 else max(DIAGONAL, prices.max())
    # The head of each bucket, then the list of spare entries, how many were used, and are waiting.
    head = np.full(dearest + 4, -1, np.int64)
    head[-2], head[-1] = 0, 0
    entries = np.empty((2 * free.size + len(seeds) + 2 * len(prices) + 64, 2), np.int64)
    for k in range(len(seeds)):
        cost[seeds[k]] = 0
        _push(head, entries, seeds[k], 0)
    now = 0
    while head[-1] > 0:
        slot = now % (len(head) - 3)
        while head[slot] >= 0:
            node = _pop(head, entries, slot)
            if cost[node] != now:
                continue
            i, j = node // nx, node % nx
            for a in range(max(i - 1, 0), min(i + 2, ny)):
                for b in range(max(j - 1, 0), min(j + 2, nx)):
                    if free[a, b]:
                        price = DIAGONAL if a != i and b != j else SIDE
                        _relax(head, entries, cost, toward, node, a * nx + b, now + price)
            bridge = first[node]
            while bridge >= 0:
                to = bridges[bridge, 0]
                _relax(head, entries, cost, toward, node, to, now + prices[bridge])
                bridge = bridges[bridge, 1]
        now += 1


@njit(cache=True)
def _relax(
    head: Ints, entries: Ints, cost: Numbers, toward: Numbers, node: int, to: int, then: int
) -> None:
    if then < cost[to]:
        cost[to], toward[to] = then, node
        _push(head, entries, to, then)


@njit(cache=True)
def _push(head: Ints, entries: Ints, node: int, cost: int) -> None:
    slot, entry = cost % (len(head) - 3), head[-3]
    if entry >= 0:
        head[-3] = entries[entry, 1]
    else:
        entry = head[-2]
        head[-2] += 1
    entries[entry, 0], entries[entry, 1] = node, head[slot]
    head[slot] = entry
    head[-1] += 1


@njit(cache=True)
def _pop(head: Ints, entries: Ints, slot: int) -> int:
    entry = head[slot]
    head[slot] = entries[entry, 1]
    entries[entry, 1], head[-3] = head[-3], entry
    head[-1] -= 1
    return int(entries[entry, 0])


@njit(cache=True)
def follow(toward: Numbers, cost: Numbers, node: int, nodes: Ints) -> int:
    """Go from node to node to a seed and write down the nodes passed.

    Args:
        toward: The next node on the way, of `spread`.
        cost: The costs, of `spread`.
        node: Where to begin; a node that was reached.
        nodes: Filled with the nodes, Shape (room,).

    Returns:
        How many nodes there are, both ends included.
    """
    count = 0
    while True:
        nodes[count] = node
        count += 1
        if cost[node] == 0:
            return count
        node = toward[node]
