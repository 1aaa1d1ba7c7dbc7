"""A route among rocks, found by OMPL over a map of clearances.

The only file that knows OMPL. Its generators take their seeds from one sequence of the whole
process; setting that sequence anew before each plan, with every object of the plan made after it,
makes equal seeds give routes that are equal to the bit, whatever was planned before.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou

from lpet_sim.errors import BlockedPlaceError, PlanningError
from lpet_sim.planning.clearance import ClearanceMap, Ground, Point, RouteSpec, map_clearance
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.rover.path import plan_legs
from lpet_sim.terrain.box import Box

# OMPL writes to the console and calls a second setting of the seed an error, which it is not here.
ou.setLogLevel(ou.LogLevel.LOG_NONE)

_ROUNDS, _SHARP_M = 8, 0.02


def plan_route(
    terrain: Ground, start_xy: Point, goal_xy: Point, spec: RouteSpec, seed: int
) -> tuple[Point, ...]:
    """Plan a short route that keeps clear of rocks and steep ground.

    RRT* over the plane with each branch checked against the map of clearances, then shortened.
    Between its corners the route is straight; the drive rounds them. Where a rounded corner would
    come too close, a second waypoint just before it makes the drive turn there on the spot.

    Args:
        terrain: The terrain.
        start_xy: Where the rover stands, (x, y) in the world [m].
        goal_xy: Where it shall go [m].
        spec: What to keep clear of.
        seed: Any integer; equal seeds give equal routes.

    Returns:
        Corners from start to goal [m], for ``DriveSpec.waypoints_m`` with the same
        ``corner_cut_m`` and ``min_turn_radius_m``.

    Raises:
        PlanningError: Start or goal is not clear, or no clear way joins them; it says which.

    Reference:
        Karaman and Frazzoli (2011), Sampling-based algorithms for optimal motion planning.
    """
    return plan_route_over(terrain, (start_xy, goal_xy), spec, seed)


def plan_route_over(
    terrain: Ground, places_xy: Sequence[Point], spec: RouteSpec, seed: int
) -> tuple[Point, ...]:
    """Plan a route from place to place, as `plan_route` does for two.

    Args:
        terrain: The terrain.
        places_xy: Start, places to pass in this order, and goal [m], at least two.
        spec: What to keep clear of.
        seed: Any integer; equal seeds give equal routes.

    Returns:
        Corners from start to goal over all places [m].

    Raises:
        PlanningError: A place is not clear, or no clear way joins two of them; it says which.
    """
    _check_finite(places_xy)
    clearance = map_clearance(terrain, _box(places_xy, spec.margin_m), spec)
    corners = [places_xy[0]]
    for k, (start, goal) in enumerate(pairwise(places_xy)):
        _check_reachable(clearance, start, goal, spec)
        leg_seed = int(stream(seed, "planning", "route", k).integers(1, 2**31))
        corners += _solve(clearance, start, goal, spec, leg_seed)[1:]
    return tuple(with_turns_on_the_spot(clearance, corners, spec))


def nearest_clear(terrain: Ground, xy: Point, within_m: float, spec: RouteSpec) -> Point:
    """Give the place nearest to a point at which a rover may stand.

    Args:
        terrain: The terrain.
        xy: Where it would be [m].
        within_m: How far away it may be, along x and along y [m].
        spec: What to keep clear of.

    Raises:
        PlanningError: There is none.
    """
    found = map_clearance(terrain, _box([xy], within_m), spec).nearest_free(xy)
    if found is None:
        raise PlanningError(
            f"within {within_m:g} m of {_name(xy)} no place is {spec.needed_m:.2f} m clear; "
            "search farther, or lower the clearance"
        )
    return found


def _box(places: Sequence[Point], margin_m: float) -> Box:
    x, y = zip(*places, strict=True)
    # A box may not be empty, and a margin may be 0.
    return Box(min(x) - 1e-3, min(y) - 1e-3, max(x) + 1e-3, max(y) + 1e-3).grown(margin_m)


def _check_finite(places: Sequence[Point]) -> None:
    for xy in places:
        if not all(map(math.isfinite, xy)):
            raise PlanningError(f"the place {_name(xy)} must be finite")


def _name(xy: Point) -> str:
    return f"({xy[0]:.2f}, {xy[1]:.2f}) m"


def _check_reachable(clearance: ClearanceMap, start: Point, goal: Point, spec: RouteSpec) -> None:
    """Say at once, from the map, why there is no route; what is left is a matter of search."""
    for what, xy in (("start", start), ("goal", goal)):
        if not clearance.is_clear(xy, xy):
            row, column = clearance.node(xy)
            raise BlockedPlaceError(
                f"the {what} {_name(xy)} is {clearance.distance_m[row, column]:.2f} m from an "
                f"obstacle or the edge; {spec.needed_m:.2f} m are needed"
            )
    if clearance.region[clearance.node(start)] != clearance.region[clearance.node(goal)]:
        raise PlanningError(
            f"no way {spec.needed_m:.2f} m clear joins {_name(start)} and {_name(goal)} within "
            f"{spec.margin_m:g} m around them; widen margin_m, or lower the clearance"
        )


class _Motions(ob.MotionValidator):  # type: ignore[misc]
    """Straight motions over the map of clearances."""

    def __init__(self, space: ob.SpaceInformation, clearance: ClearanceMap) -> None:
        super().__init__(space)
        self._clearance = clearance

    def checkMotion(self, a: ob.State, b: ob.State, *_: object) -> bool:
        return self._clearance.is_clear((a[0], a[1]), (b[0], b[1]))


def _solve(
    clearance: ClearanceMap, start: Point, goal: Point, spec: RouteSpec, seed: int
) -> list[Point]:
    # First the seed, then everything else: see the head of the file.
    ou.RNG.setSeed(seed)
    space = _space(clearance)
    problem = _problem(space, start, goal)
    planner = og.RRTstar(space)
    planner.setRange(spec.stride_m)
    planner.setProblemDefinition(problem)
    planner.setup()
    for _ in range(_ROUNDS):
        planner.solve(_after(spec.iterations))
        if problem.hasExactSolution():
            break
    else:
        raise PlanningError(
            f"the planner did not reach {_name(goal)} in {_ROUNDS * spec.iterations} iterations, "
            "though a clear way exists; raise iterations"
        )
    path = problem.getSolutionPath()
    simplifier = og.PathSimplifier(space)
    simplifier.partialShortcutPath(path)
    simplifier.reduceVertices(path)
    corners = [(float(state[0]), float(state[1])) for state in path.getStates()]
    return _straightened(clearance, [start, *corners[1:-1], goal])


def _space(clearance: ClearanceMap) -> ob.SpaceInformation:
    plane = ob.RealVectorStateSpace(2)
    bounds = ob.RealVectorBounds(2)
    for axis, (first, count) in enumerate(
        zip((clearance.x0, clearance.y0), clearance.free.shape[::-1], strict=True)
    ):
        bounds.setLow(axis, first * clearance.cell_m)
        bounds.setHigh(axis, (first + count - 1) * clearance.cell_m)
    plane.setBounds(bounds)
    space = ob.SpaceInformation(plane)
    space.setStateValidityChecker(lambda s: clearance.is_clear((s[0], s[1]), (s[0], s[1])))
    space.setMotionValidator(_Motions(space, clearance))
    space.setup()
    return space


def _problem(space: ob.SpaceInformation, start: Point, goal: Point) -> ob.ProblemDefinition:
    problem = ob.ProblemDefinition(space)
    ends = []
    for xy in (start, goal):
        state = space.allocState()
        state[0], state[1] = xy
        ends.append(state)
    problem.setStartAndGoalStates(*ends, 1e-6)
    problem.setOptimizationObjective(ob.PathLengthOptimizationObjective(space))
    return problem


def _after(iterations: int) -> ob.PlannerTerminationCondition:
    """Stop after so many iterations: a stop after some time would not be the same twice."""
    left = iter(range(iterations))
    return ob.PlannerTerminationCondition(lambda: next(left, None) is None)


def _straightened(clearance: ClearanceMap, corners: list[Point]) -> list[Point]:
    """Leave out every corner that the straight way can do without, looking as far as it goes."""
    kept, at = [corners[0]], 0
    while at < len(corners) - 1:
        seen = [
            k for k in range(at + 2, len(corners)) if clearance.is_clear(corners[at], corners[k])
        ]
        at = max(seen, default=at + 1)
        kept.append(corners[at])
    return kept


def with_turns_on_the_spot(
    clearance: ClearanceMap, corners: list[Point], spec: RouteSpec
) -> list[Point]:
    """Sharpen each corner whose rounding comes too close, until the whole drive is clear.

    Args:
        clearance: The map; the straight sides must be clear on it.
        corners: Corners of the route [m].
        spec: Clearance, and how the drive rounds corners.

    Returns:
        The corners, with a waypoint just before each one to turn at on the spot [m].
    """
    sharp: set[Point] = set()
    for _ in corners:
        route = _sharpened(corners, sharp)
        legs = plan_legs(route, spec.min_turn_radius_m, spec.corner_cut_m)
        driven = np.concatenate([leg.xy for leg in legs])
        close = driven[clearance.distance_at(driven) < spec.clearance_m + spec.grid_error_m]
        nearest = _nearest(corners[1:-1], close)
        if nearest <= sharp:
            return route
        sharp |= nearest
    return _sharpened(corners, sharp)


def _nearest(corners: list[Point], xy: Array) -> set[Point]:
    """Give those corners that are the nearest one to some of the points."""
    if not corners:
        return set()
    away = np.linalg.norm(xy[:, None] - np.array(corners), axis=-1)
    return {corners[k] for k in np.unique(away.argmin(axis=1))}


def _sharpened(corners: list[Point], sharp: set[Point]) -> list[Point]:
    """Put a waypoint just before each sharp corner: no side is left there to round it in."""
    route = corners[:1]
    for before, corner in pairwise(corners):
        if corner in sharp:
            share = min(_SHARP_M / math.dist(before, corner), 0.5)
            dx, dy = before[0] - corner[0], before[1] - corner[1]
            route.append((corner[0] + share * dx, corner[1] + share * dy))
        route.append(corner)
    return route
