"""Whether a goal can be reached from many starts on one terrain, and if not, why."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from lpet_sim.errors import BlockedPlaceError, PlanningError
from lpet_sim.planning.clearance import Ground, Point
from lpet_sim.planning.map_path import bridges_of, length_of, wave_from
from lpet_sim.planning.mobility_map import Bools, MobilityMap, map_mobility, regions
from lpet_sim.planning.path_measures import measure_path
from lpet_sim.planning.reach_result import Outcome, StartResult, TerrainResult
from lpet_sim.planning.reach_spec import Case, ReachSpec
from lpet_sim.planning.search import Pose, search_curves, search_straights
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import Ints
from lpet_sim.rng import stream
from lpet_sim.terrain.terrain import build_terrain

START_BLOCKED = "start blocked"
GOAL_BLOCKED = "goal blocked"
ROCKS = "walled in by rocks"
SLOPE = "walled in by steep ground"
BOTH = "walled in by rocks and steep ground"
TIGHT_START = "start too tight to turn"
TIGHT_GOAL = "goal too tight to turn"
BUDGET = "no way found within the budget"

_DRAWS = 2000
_GOAL_HEADINGS = 8
_PLACES_SEARCHED = 3
_DIGITS = 6


def reach_on(case: Case, spec: ReachSpec, progress: Progress = silent) -> TerrainResult:
    """Build one terrain of a study and find out from which starts its goal can be reached.

    Args:
        case: Which terrain.
        spec: The study.
        progress: Called with the fraction of the starts done.

    Raises:
        LpetError: The terrain cannot be built or mapped.
    """
    began_s = time.process_time()
    ground = build_terrain(case.terrain, case.seed)
    found = reach_from_all(ground, spec, case.seed, progress)
    starts = tuple(_measured(start, ground, spec) for start in found)
    took_s = time.process_time() - began_s
    return TerrainResult(case.abundance, case.factor, case.index, case.seed, took_s, starts)


def _measured(start: StartResult, ground: Ground, spec: ReachSpec) -> StartResult:
    # A start at the goal itself has no way to speak of.
    if len(start.path_m) < 2 or start.path_m[0][:2] == start.path_m[-1][:2]:
        return start
    return replace(start, measures=measure_path(start.path, ground, spec.mobility))


def reach_from_all(
    ground: Ground, spec: ReachSpec, seed: int, progress: Progress = silent
) -> list[StartResult]:
    """Find out from which starts a goal can be reached on given ground.

    Args:
        ground: The terrain.
        spec: The study; its terrain is not looked at.
        seed: Of the random starts and of the searches.
        progress: Called with the fraction of the starts done.
    """
    here = map_mobility(ground, spec.box, spec.mobility, spec.cell_m)
    return Reacher(here, spec, seed).all(progress)


class Reacher:
    """Answers for one map and goal."""

    def __init__(self, mobility_map: MobilityMap, spec: ReachSpec, seed: int) -> None:
        """Look at the goal once for all starts.

        Args:
            mobility_map: The map.
            spec: The study.
            seed: Of the random starts and of the searches.
        """
        self.map, self._spec, self._seed = mobility_map, spec, seed
        rows, columns = mobility_map.nodes_within(spec.goal_m, spec.goal_radius_m)
        self._goal_nodes = rows, columns
        self._bridges = bridges_of(mobility_map)
        self._wave = wave_from(mobility_map, self._bridges, rows, columns)
        self._place_of = self._goal_places(rows, columns)
        self._goal_regions = set(mobility_map.possible_region[rows, columns].tolist()) - {0}

    @property
    def goal_places(self) -> list[Point]:
        """One place to turn at within the goal for each group of joined regions [m]."""
        return list(self._place_of.values())

    def all(self, progress: Progress = silent) -> list[StartResult]:
        """Answer for the given starts, then for the random ones."""
        places = [*self._spec.starts_m, *self.random_starts()]
        answers = (self.reach(start, number) for number, start in enumerate(places))
        return list(track(answers, len(places), progress))

    def random_starts(self) -> list[Point]:
        """Draw the random starts."""
        rng = stream(self._seed, "reach", "starts")
        return [self._random_start(rng) for _ in range(self._spec.starts)]

    def reach(self, start: Point, number: int = 0, effort: int = 1) -> StartResult:
        """Find out whether the goal can be reached from a start.

        Args:
            start: Where the rover stands [m].
            number: Which start it is; another one searches with another seed.
            effort: How many times the budget of the planner is spent.
        """
        blocked = self._blocked(start)
        if blocked:
            return StartResult(start, "unreachable", blocked)
        if self.map.mobility.turning == "point_turn":
            return self._reach_by_straights(start, number, effort)
        return self._reach_by_curves(start, number, effort)

    def _goal_places(self, rows: Ints, columns: Ints) -> dict[int, Point]:
        """Give the goal's place nearest to its middle in each group of joined regions."""
        groups = self._bridges.joined[self.map.sure_region[rows, columns]]
        places: dict[int, Point] = {}
        # The rover may be able to turn at the very place, though not at the node nearest to it.
        if self.map.can_turn(self._spec.goal_m):
            places[int(groups[0])] = self._spec.goal_m
        if self._spec.goal_radius_m > 0:
            for group, row, column in zip(groups, rows, columns, strict=True):
                if group > 0:
                    places.setdefault(int(group), self.map.point(row, column))
        return places

    def _random_start(self, rng: np.random.Generator) -> Point:
        """Draw one; where the rover can stand at no place drawn, the last one counts as it is."""
        start: Point | None = None
        for _ in range(_DRAWS):
            drawn = self._draw(rng)
            if drawn is not None:
                start = drawn
                if not self._spec.starts_stand or self.map.can_turn(drawn):
                    break
        if start is None:
            raise PlanningError(
                "hardly a place of the ring start_distances_m lies in the square; bring it nearer "
                "to the goal, or enlarge size_m"
            )
        return start

    def _draw(self, rng: np.random.Generator) -> Point | None:
        """Draw a place evenly from the square, or from the ring; None where that is outside."""
        box, ring, goal = self._spec.box, self._spec.start_distances_m, self._spec.goal_m
        if ring is None:
            x, y = rng.uniform((box.x_min, box.y_min), (box.x_max, box.y_max)).tolist()
            return x, y
        radius = math.sqrt(rng.uniform(ring[0] ** 2, ring[1] ** 2))
        angle = rng.uniform(-math.pi, math.pi)
        x, y = goal[0] + radius * math.cos(angle), goal[1] + radius * math.sin(angle)
        inside = box.x_min <= x <= box.x_max and box.y_min <= y <= box.y_max
        return (x, y) if inside else None

    def _blocked(self, start: Point) -> str:
        """Say why even the inscribed disc cannot get to the goal; empty where it may."""
        rows, columns = self._goal_nodes
        if not self.map.possible[self.map.node(start)]:
            return START_BLOCKED
        if not self._goal_regions:
            return GOAL_BLOCKED
        if int(self.map.possible_region[self.map.node(start)]) in self._goal_regions:
            return ""
        joined = [
            self._joins(self.map.possible_over(rocks=rocks, slope=slope), start, rows, columns)
            for rocks, slope in ((True, False), (False, True))
        ]
        return {(False, True): ROCKS, (True, False): SLOPE}.get((joined[0], joined[1]), BOTH)

    def _joins(self, free: Bools, start: Point, rows: Ints, columns: Ints) -> bool:
        region = regions(free)
        here = region[self.map.node(start)]
        return bool(here > 0 and np.any(region[rows, columns] == here))

    def _reach_by_straights(self, start: Point, number: int, effort: int) -> StartResult:
        if not self.map.can_turn(start):
            return StartResult(start, "undecided", TIGHT_START)
        if not self.goal_places:
            return StartResult(start, "undecided", TIGHT_GOAL)
        # The wave is complete on its nodes and shorter, the planner finds what lies between them.
        by, corners = "map", self._wave.corners_from(start)
        if not corners:
            by, corners = "ompl", self._searched(start, number, effort)
        if not corners:
            return StartResult(start, "undecided", BUDGET)
        path = tuple((round(x, _DIGITS), round(y, _DIGITS)) for x, y in corners)
        return StartResult(start, "reachable", "", by, path, length_of(corners))

    def _searched(self, start: Point, number: int, effort: int) -> list[Point]:
        search, seed = self._spec.search, self._search_seed(number)
        for place in self.goal_places[:_PLACES_SEARCHED]:
            corners = search_straights(
                self.map, start, place, effort * search.iterations, search.stride_m, seed
            )
            if corners:
                return corners
        return []

    def _search_seed(self, number: int) -> int:
        return int(stream(self._seed, "reach", "search", number).integers(1, 2**31))

    def _reach_by_curves(self, start: Point, number: int, effort: int) -> StartResult:
        rng = stream(self._seed, "reach", "heading", number)
        begin = (*start, float(rng.uniform(-math.pi, math.pi)))
        search = self._spec.search
        seed = self._search_seed(number)
        poses = search_curves(
            self.map, begin, self._goal_poses(), effort * search.iterations, search.stride_m, seed
        )
        if not len(poses):
            return StartResult(start, "undecided", BUDGET)
        path = tuple(tuple(row) for row in np.round(poses, _DIGITS).tolist())
        length = float(np.linalg.norm(np.diff(poses[:, :2], axis=0), axis=1).sum())
        return StartResult(start, "reachable", "", "ompl", path, length)

    def _goal_poses(self) -> list[Pose]:
        places = self.goal_places[:_PLACES_SEARCHED] or [self._spec.goal_m]
        headings = 2 * np.pi * np.arange(_GOAL_HEADINGS) / _GOAL_HEADINGS
        return [(*place, float(heading)) for place in places for heading in headings]


def check_goal(results: tuple[TerrainResult, ...], spec: ReachSpec) -> None:
    """Refuse a goal at which the rover can stand on no terrain of a study.

    Raises:
        BlockedPlaceError: It says where.
    """
    reasons = {start.reason for terrain in results for start in terrain.starts}
    if reasons and reasons <= {GOAL_BLOCKED}:
        raise BlockedPlaceError(
            f"the goal ({spec.goal_m[0]:g}, {spec.goal_m[1]:g}) m lies in or too close to a rock, "
            f"or on ground too steep, with no free place within goal_radius_m "
            f"{spec.goal_radius_m:g}; move it, or raise goal_radius_m"
        )


__all__ = ["Outcome", "Reacher", "check_goal", "reach_from_all", "reach_on"]
