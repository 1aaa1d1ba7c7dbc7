"""Drivable ways found by OMPL over a map of mobility: straights and turns, or limited curvature.

Beside ``route.py`` the only file that knows OMPL; the same holds of its seeds as there.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import ompl.base as ob
import ompl.geometric as og
import ompl.util as ou

from lpet_sim.planning.clearance import Point
from lpet_sim.planning.map_path import shortened
from lpet_sim.planning.mobility_map import MobilityMap
from lpet_sim.recording.arrays import Array

ou.setLogLevel(ou.LogLevel.LOG_NONE)

Pose = tuple[float, float, float]

_STEP_M = 0.05
POSE_SPACING_M = 0.1
"""Distance of the poses of a way of limited curvature [m]; on an arc of 1.5 m the chord between
two of them is within 1 mm of it."""


class _Straights(ob.MotionValidator):  # type: ignore[misc]
    """Straights between places at which the rover can turn on the spot."""

    def __init__(self, space: ob.SpaceInformation, mobility_map: MobilityMap) -> None:
        super().__init__(space)
        self._map = mobility_map

    def checkMotion(self, a: ob.State, b: ob.State, *_: object) -> bool:
        to = (b[0], b[1])
        return self._map.can_turn(to) and self._map.can_drive((a[0], a[1]), to)


class _Curves(ob.MotionValidator):  # type: ignore[misc]
    """Shortest curves of limited curvature, looked at as densely as the room around asks for."""

    def __init__(self, space: ob.SpaceInformation, mobility_map: MobilityMap) -> None:
        super().__init__(space)
        self._map, self._space = mobility_map, space.getStateSpace()
        self._at = self._space.allocState()
        spec = mobility_map.mobility
        # Between two looks a corner of the body moves by at most this.
        self._slack_m = 0.5 * _STEP_M * (1.0 + spec.circumscribed_m / spec.turn_radius_m)

    def stands(self, state: ob.State) -> bool:
        """Tell whether the rover surely can stand at a state."""
        return self._map.room_at(_pose_of(state), self._slack_m) >= 0.0

    def checkMotion(self, a: ob.State, b: ob.State, *_: object) -> bool:
        length, done = self._space.distance(a, b), 0.0
        while done < length:
            self._space.interpolate(a, b, done / length, self._at)
            room = self._map.room_at(_pose_of(self._at), self._slack_m)
            if room < 0.0:
                return False
            done += max(_STEP_M, min(room, _LEAP_M))
        return self.stands(b)


# Slopes are looked at on the way, too, however far the rocks are.
_LEAP_M = 0.3


def _pose_of(state: ob.State) -> Pose:
    return state.getX(), state.getY(), state.getYaw()


def search_straights(
    mobility_map: MobilityMap,
    start: Point,
    goal: Point,
    iterations: int,
    stride_m: float,
    seed: int,
) -> list[Point]:
    """Search for a way of straights and turns on the spot, by RRT-Connect.

    Args:
        mobility_map: The map.
        start: Where the rover stands [m].
        goal: Where it shall go [m].
        iterations: Iterations of the planner.
        stride_m: Longest branch of its trees [m].
        seed: At least 1; equal seeds give equal ways.

    Returns:
        Corners from start to goal [m]; empty where none was found.

    Reference:
        Kuffner and LaValle (2000), RRT-Connect: an efficient approach to single-query planning.
    """
    if not (mobility_map.can_turn(start) and mobility_map.can_turn(goal)):
        return []
    ou.RNG.setSeed(seed)
    plane = ob.RealVectorStateSpace(2)
    plane.setBounds(_bounds(mobility_map))
    space = ob.SpaceInformation(plane)
    space.setStateValidityChecker(lambda state: mobility_map.can_turn((state[0], state[1])))
    space.setMotionValidator(_Straights(space, mobility_map))
    space.setup()
    problem = ob.ProblemDefinition(space)
    problem.setStartAndGoalStates(_at(space, start), _at(space, goal), 1e-6)
    path = _solved(space, problem, iterations, stride_m)
    if path is None:
        return []
    og.PathSimplifier(space).reduceVertices(path)
    corners = [(float(state[0]), float(state[1])) for state in path.getStates()]
    return shortened(mobility_map, [start, *corners[1:-1], goal])


def search_curves(
    mobility_map: MobilityMap,
    start: Pose,
    goals: Sequence[Pose],
    iterations: int,
    stride_m: float,
    seed: int,
) -> Array:
    """Search for a way of limited curvature to any of some poses, by RRT-Connect.

    Args:
        mobility_map: The map; its rover turns as Reeds and Shepp's car, or as Dubins'.
        start: Where the rover stands, (x, y, heading) [m, rad].
        goals: Where it may end.
        iterations: Iterations of the planner.
        stride_m: Longest branch of its trees [m].
        seed: At least 1; equal seeds give equal ways.

    Returns:
        Poses (x, y, heading) every `POSE_SPACING_M` [m, rad], Shape (n, 3); n is 0 where no way
        was found.

    Reference:
        Reeds and Shepp (1990), Optimal paths for a car that goes both forwards and backwards.
    """
    ou.RNG.setSeed(seed)
    spec = mobility_map.mobility
    kind = ob.DubinsStateSpace if spec.turning == "dubins" else ob.ReedsSheppStateSpace
    plane = kind(spec.turn_radius_m)
    plane.setBounds(_bounds(mobility_map))
    space = ob.SpaceInformation(plane)
    curves = _Curves(space, mobility_map)
    space.setStateValidityChecker(curves.stands)
    space.setMotionValidator(curves)
    space.setup()
    begin, ends = _pose_at(space, start), ob.GoalStates(space)
    standing = [state for pose in goals if curves.stands(state := _pose_at(space, pose))]
    if not standing or not curves.stands(begin):
        return np.empty((0, 3))
    for state in standing:
        ends.addState(state)
    problem = ob.ProblemDefinition(space)
    problem.addStartState(begin)
    problem.setGoal(ends)
    path = _solved(space, problem, iterations, stride_m)
    if path is None:
        return np.empty((0, 3))
    if spec.turning == "reeds_shepp":
        # Dubins' distances are not the same both ways, which shortcuts rely on.
        og.PathSimplifier(space).reduceVertices(path)
    return _sampled(plane, path.getStates())


def _solved(
    space: ob.SpaceInformation, problem: ob.ProblemDefinition, iterations: int, stride_m: float
) -> og.PathGeometric | None:
    planner = og.RRTConnect(space)
    planner.setRange(stride_m)
    planner.setProblemDefinition(problem)
    planner.setup()
    left = iter(range(iterations))
    planner.solve(ob.PlannerTerminationCondition(lambda: next(left, None) is None))
    return problem.getSolutionPath() if problem.hasExactSolution() else None


def _bounds(mobility_map: MobilityMap) -> ob.RealVectorBounds:
    box = mobility_map.box
    bounds = ob.RealVectorBounds(2)
    for axis, (low, high) in enumerate(((box.x_min, box.x_max), (box.y_min, box.y_max))):
        bounds.setLow(axis, low)
        bounds.setHigh(axis, high)
    return bounds


def _at(space: ob.SpaceInformation, xy: Point) -> ob.State:
    state = space.allocState()
    state[0], state[1] = xy
    return state


def _pose_at(space: ob.SpaceInformation, pose: Pose) -> ob.State:
    state = space.allocState()
    state.setXY(pose[0], pose[1])
    state.setYaw(math.remainder(pose[2], 2 * math.pi))
    return state


def _sampled(plane: ob.StateSpace, states: Sequence[ob.State]) -> Array:
    """Lay poses along the curves between the states."""
    at, poses = plane.allocState(), [_pose_of(states[0])]
    for a, b in pairwise(states):
        count = max(1, math.ceil(plane.distance(a, b) / POSE_SPACING_M))
        for k in range(1, count + 1):
            plane.interpolate(a, b, k / count, at)
            poses.append(_pose_of(at))
    return np.array(poses)
