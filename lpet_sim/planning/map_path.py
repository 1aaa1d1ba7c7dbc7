"""Ways over the nodes where a rover surely can turn: one wave from the goal serves all starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lpet_sim.planning.clearance import Point
from lpet_sim.planning.mobility_kernels import Floats, can_drive
from lpet_sim.planning.mobility_map import MobilityMap
from lpet_sim.planning.wave_kernels import SIDE, UNSEEN, find_bridges, follow, spread
from lpet_sim.recording.arrays import Array, Ints

Numbers = NDArray[np.int32]

_BRIDGE_M = 5.0
_BRIDGES_MAX = 2_000_000
_PULLS, _DENSE_M = 4, 0.5


@dataclass(frozen=True, eq=False)
class Bridges:
    """Straights that join the regions of `MobilityMap.sure` where the rover fits but cannot turn.

    Attributes:
        links: For each direction of each straight, the node that it leads to, and which one is next
            from the same node, -1: none, Shape (b, 2).
        prices: Cost of each, 12 for each cell of length, Shape (b,).
        first: First one from each node, -1: none, Shape (ny * nx,).
        joined: For each number of a region, the number of the group of regions that are joined,
            Shape (regions + 1,); 0 stays 0.
    """

    links: Ints
    prices: Numbers
    first: Numbers
    joined: Ints


@dataclass(frozen=True, eq=False)
class GoalWave:
    """How far every node of `MobilityMap.sure` is from the goal.

    Attributes:
        mobility_map: The map.
        cost: Cost of the way to the goal, 12 for each cell; `UNSEEN` where there is none,
            Shape (ny * nx,).
        toward: The next node on the way, Shape (ny * nx,).
    """

    mobility_map: MobilityMap
    cost: Numbers
    toward: Numbers

    def reaches(self, start: Point) -> bool:
        """Tell whether a way leads from the node nearest to a start to the goal."""
        return bool(self.cost[self._index(start)] < UNSEEN)

    def corners_from(self, start: Point) -> list[Point]:
        """Give a short way to the goal: straights between places to turn at, from the start on.

        Args:
            start: Where the rover stands [m].

        Returns:
            Corners [m]; the wave's way pulled taut wherever the rover can drive straight. Empty
            where the wave did not come, or the start is too tight to turn at.
        """
        here = self.mobility_map
        if not (self.reaches(start) and here.can_turn(start)):
            return []
        nodes = np.empty(self.cost.size, dtype=np.int64)
        nodes = nodes[: follow(self.toward, self.cost, self._index(start), nodes)]
        rows, columns = np.divmod(nodes, len(here.x))
        xy = np.column_stack([here.x[columns], here.y[rows]])
        if not here.can_drive(start, (float(xy[0, 0]), float(xy[0, 1]))):
            return []
        return shortened(here, pulled_taut(here, np.concatenate([[start], xy])))

    def _index(self, xy: Point) -> int:
        row, column = self.mobility_map.node(xy)
        return row * len(self.mobility_map.x) + column


def bridges_of(mobility_map: MobilityMap) -> Bridges:
    """Find the straights that join regions of `MobilityMap.sure` across narrow places."""
    region, cell = mobility_map.sure_region, mobility_map.cell_m
    ends = np.empty((_BRIDGES_MAX, 2), dtype=np.int64)
    reach = int(_BRIDGE_M / cell)
    ends = ends[: find_bridges(*mobility_map.layers, region, reach, ends)].copy()
    columns = region.shape[1]
    (from_row, to_row), (from_column, to_column) = ends.T // columns, ends.T % columns
    away = np.hypot(to_row - from_row, to_column - from_column)
    price = np.ceil(SIDE * away).astype(np.int32)
    begins, leads = ends.T.ravel(), ends[:, ::-1].T.ravel()
    first, after = _chained(begins, region.size)
    links = np.column_stack([leads, after])
    return Bridges(links, np.tile(price, 2), first, _groups(region.ravel(), ends))


def _chained(begins: Ints, nodes: int) -> tuple[Numbers, Ints]:
    """Chain what begins at the same node: the first of each node, and the next of each."""
    order = np.argsort(begins, kind="stable")
    same = begins[order][1:] == begins[order][:-1]
    after = np.full(len(begins), -1, dtype=np.int64)
    after[order[:-1][same]] = order[1:][same]
    first = np.full(nodes, -1, dtype=np.int32)
    leads = np.concatenate([[True], ~same])[: len(order)]
    first[begins[order[leads]]] = order[leads]
    return first, after


def _groups(region: Numbers, ends: Ints) -> Ints:
    count = int(region.max(initial=0)) + 1
    a, b = region[ends[:, 0]], region[ends[:, 1]]
    graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    label = np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
    # No straight begins or ends off the regions, so number 0 is alone in its group.
    return np.where(label == label[0], 0, label + 1)


def wave_from(mobility_map: MobilityMap, bridges: Bridges, rows: Ints, columns: Ints) -> GoalWave:
    """Spread a wave over `MobilityMap.sure` and the bridges from the nodes that make up the goal.

    Args:
        mobility_map: The map.
        bridges: Of the map.
        rows: Of the goal's nodes; those off `sure` are left out, Shape (n,).
        columns: Of the goal's nodes, Shape (n,).
    """
    free = mobility_map.sure
    on = free[rows, columns]
    cost = np.full(free.size, UNSEEN, dtype=np.int32)
    toward = np.full(free.size, -1, dtype=np.int32)
    seeds = (rows[on] * free.shape[1] + columns[on]).astype(np.int64)
    spread(free, seeds, bridges.links, bridges.prices, bridges.first, cost, toward)
    return GoalWave(mobility_map, cost, toward)


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
