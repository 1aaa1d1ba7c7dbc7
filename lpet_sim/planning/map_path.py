"""Ways over the nodes where a rover surely can turn: one wave from the goal serves all starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.planning.clearance import Point
from lpet_sim.planning.mobility_kernels import Floats, can_drive
from lpet_sim.planning.mobility_map import MobilityMap
from lpet_sim.recording.arrays import Array, Ints

Bools = NDArray[np.bool_]
Costs = NDArray[np.int32]

# A step to the next node costs 12, a diagonal one 17: their ratio is within 0.2 % of sqrt(2).
_SIDE, _DIAGONAL = 12, 17
_BUCKETS = _DIAGONAL + 1
_PULLS, _DENSE_M = 4, 0.5
_UNSEEN = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class GoalWave:
    """How far every node of `MobilityMap.sure` is from the goal.

    Attributes:
        mobility_map: The map.
        cost: Cost of the way to the goal, 12 for each cell; the largest integer where there is
            none, Shape (ny, nx).
    """

    mobility_map: MobilityMap
    cost: Costs

    def reaches(self, start: Point) -> bool:
        """Tell whether a way leads from the node nearest to a start to the goal."""
        return bool(self.cost[self.mobility_map.node(start)] < _UNSEEN)

    def corners_from(self, start: Point) -> list[Point]:
        """Give a short way to the goal: straights between places to turn at, from the start on.

        Args:
            start: A place from which the goal is reached, and where the rover can turn [m].

        Returns:
            Corners [m]; the wave's way pulled taut wherever the rover can drive straight. Empty
            where the start is too tight to set out from.
        """
        here = self.mobility_map
        if not (self.reaches(start) and here.can_turn(start)):
            return []
        nodes = np.empty((self.cost.size, 2), dtype=np.int64)
        count = _descend(self.cost, *here.node(start), nodes)
        xy = np.column_stack([here.x[nodes[:count, 1]], here.y[nodes[:count, 0]]])
        if not here.can_drive(start, (float(xy[0, 0]), float(xy[0, 1]))):
            return []
        return shortened(here, pulled_taut(here, np.concatenate([[start], xy])))


def wave_from(mobility_map: MobilityMap, rows: Ints, columns: Ints) -> GoalWave:
    """Spread a wave over `MobilityMap.sure` from the nodes that make up the goal.

    Args:
        mobility_map: The map.
        rows: Of the goal's nodes; those off `sure` are left out, Shape (n,).
        columns: Of the goal's nodes, Shape (n,).

    Reference:
        Dial (1969), Algorithm 360: shortest-path forest with topological ordering.
    """
    free = mobility_map.sure
    on = free[rows, columns]
    cost = np.full(free.shape, _UNSEEN, dtype=np.int32)
    seeds = np.column_stack([rows[on], columns[on]]).astype(np.int64)
    _spread(free, seeds, cost)
    return GoalWave(mobility_map, cost)


def pulled_taut(mobility_map: MobilityMap, xy: Array) -> list[Point]:
    """Leave out the corners of a way that the rover can do without, going on as far as it sees.

    Args:
        mobility_map: The map.
        xy: Corners; each straight between two of them can be driven [m], Shape (n, 2).
    """
    kept = np.empty(len(xy), dtype=np.int64)
    count = _pull(*mobility_map.layers, np.ascontiguousarray(xy, dtype=np.float64), kept)
    return [(float(x), float(y)) for x, y in xy[kept[:count]]]


def shortened(mobility_map: MobilityMap, corners: list[Point]) -> list[Point]:
    """Move the corners of a way towards a taut string, by pulling it from either end in turn.

    Args:
        mobility_map: The map.
        corners: Corners of a way that can be driven [m].
    """
    for _ in range(_PULLS):
        dense = _between_corners(mobility_map, corners[::-1])
        shorter = pulled_taut(mobility_map, dense)[::-1]
        if length_of(shorter) > length_of(corners) - 1e-3:
            # Pulling from this end gives nothing; the other end may.
            shorter = corners
        corners = shorter[::-1]
    return corners if _PULLS % 2 == 0 else corners[::-1]


def _between_corners(mobility_map: MobilityMap, corners: list[Point]) -> Array:
    """Put places to turn at between the corners of a way."""
    places = [corners[0]]
    for a, b in pairwise(corners):
        count = math.ceil(math.dist(a, b) / _DENSE_M)
        share = np.arange(1, count) / count
        between = zip(a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), strict=True)
        places += [(float(x), float(y)) for x, y in between if mobility_map.can_turn((x, y))]
        places.append(b)
    return np.array(places)


def length_of(corners: list[Point]) -> float:
    """Give the length of a polyline [m]."""
    return float(sum(math.dist(a, b) for a, b in pairwise(corners)))


@njit(cache=True)
def _spread(free: Bools, seeds: Ints, cost: Costs) -> None:
    """Settle nodes in the order of their costs, which a ring of buckets keeps."""
    ny, nx = free.shape
    room = 2 * free.size + len(seeds) + 64
    held, behind = np.empty(room, np.int64), np.empty(room, np.int64)
    head = np.full(_BUCKETS, -1, np.int64)
    spare, used, waiting = -1, 0, 0
    for k in range(len(seeds)):
        cost[seeds[k, 0], seeds[k, 1]] = 0
        held[used], behind[used] = seeds[k, 0] * nx + seeds[k, 1], head[0]
        head[0] = used
        used, waiting = used + 1, waiting + 1
    now = 0
    while waiting > 0:
        slot = now % _BUCKETS
        while head[slot] >= 0:
            entry = head[slot]
            head[slot], node = behind[entry], held[entry]
            behind[entry], spare = spare, entry
            waiting -= 1
            i, j = node // nx, node % nx
            if cost[i, j] != now:
                continue
            for di in range(-1, 2):
                for dj in range(-1, 2):
                    a, b = i + di, j + dj
                    if a < 0 or b < 0 or a >= ny or b >= nx or not free[a, b]:
                        continue
                    then = now + (_DIAGONAL if di != 0 and dj != 0 else _SIDE)
                    if then >= cost[a, b]:
                        continue
                    cost[a, b] = then
                    entry = spare
                    if entry >= 0:
                        spare = behind[entry]
                    else:
                        entry, used = used, used + 1
                    held[entry], behind[entry] = a * nx + b, head[then % _BUCKETS]
                    head[then % _BUCKETS] = entry
                    waiting += 1
        now += 1


@njit(cache=True)
def _descend(cost: Costs, row: int, column: int, nodes: Ints) -> int:
    """Go down the costs to the goal and write down the nodes passed."""
    count, i, j = 0, row, column
    while True:
        nodes[count, 0], nodes[count, 1] = i, j
        count += 1
        if cost[i, j] == 0:
            return count
        best, to_i, to_j = cost[i, j], i, j
        for a in range(max(i - 1, 0), min(i + 2, cost.shape[0])):
            for b in range(max(j - 1, 0), min(j + 2, cost.shape[1])):
                if cost[a, b] < best:
                    best, to_i, to_j = cost[a, b], a, b
        i, j = to_i, to_j


@njit(cache=True)
def _pull(
    obstacle: Floats,
    straddle: Floats,
    gradient: Floats,
    grid: Array,
    lattice: Array,
    needs: Array,
    xy: Array,
    kept: Ints,
) -> int:
    """From each corner go on to the farthest one found by ever longer, then ever shorter leaps."""
    kept[0] = 0
    count, at, last = 1, 0, len(xy) - 1
    while at < last:
        good, leap = at + 1, 2
        while leap >= 1:
            to = min(good + leap, last)
            clear = to > good and can_drive(
                obstacle, straddle, gradient, grid, lattice, needs,
                xy[at, 0], xy[at, 1], xy[to, 0], xy[to, 1],
            )  # fmt: skip
            good, leap = (to, 2 * leap) if clear else (good, leap // 2 if leap < 4 else leap // 4)
        kept[count] = good
        count, at = count + 1, good
    return count
