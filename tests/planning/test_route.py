"""Routes keep clear, are short, are the same for the same seed, and say why there is none."""

import math
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.errors import PlanningError
from lpet_sim.planning.clearance import Point, RouteSpec, map_clearance
from lpet_sim.planning.route import (
    nearest_clear,
    plan_route,
    plan_route_over,
    with_turns_on_the_spot,
)
from lpet_sim.rng import stream
from lpet_sim.rover.path import plan_legs
from lpet_sim.rover.spec import DriveSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.spec import TerrainSpec
from lpet_sim.terrain.terrain import build_terrain
from tests.planning.flat_terrain import FlatTerrain

SPEC = RouteSpec(iterations=4000)
START, GOAL = (0.0, 0.0), (12.0, 4.0)
ROOT = Path(__file__).parents[2]


def _scattered(count: int = 60) -> FlatTerrain:
    rng = stream(3, "rocks")
    xy = rng.uniform([-5, -8], [18, 12], (count, 2))
    away = np.minimum(np.linalg.norm(xy - START, axis=1), np.linalg.norm(xy - GOAL, axis=1)) > 2.5
    return FlatTerrain([(x, y, 0.5) for x, y in xy[away]])


def _length(route: tuple[Point, ...]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise(route))


def _ring(centre: Point, radius: float, count: int) -> list[tuple[float, float, float]]:
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    x, y = centre
    return [(x + radius * math.cos(a), y + radius * math.sin(a), 0.5) for a in angles]


def test_the_drive_of_a_route_keeps_clear_of_every_high_rock() -> None:
    """With corners rounded as the drive rounds them, against the rocks and not the map."""
    terrain = _scattered()
    route = plan_route(terrain, START, GOAL, SPEC, 1)
    assert len(route) > 2
    legs = plan_legs(route, SPEC.min_turn_radius_m, SPEC.corner_cut_m)
    driven = np.concatenate([leg.xy for leg in legs])
    rocks = terrain.rocks(Box(-20, -20, 30, 30))
    away = np.linalg.norm(driven[:, None] - rocks.p_world_rock[None, :, :2], axis=2)
    assert (away - rocks.reach_m).min() >= SPEC.clearance_m
    assert route[0] == START
    assert route[-1] == GOAL


def test_a_drive_takes_the_route_as_it_is() -> None:
    """The corners are valid waypoints."""
    route = plan_route(_scattered(), START, GOAL, SPEC, 1)
    assert DriveSpec(waypoints_m=route).waypoints_m == route


def test_equal_seeds_give_equal_routes_and_other_seeds_others() -> None:
    """To the bit, with other plans made in between."""
    terrain = _scattered()
    routes = [plan_route(terrain, START, GOAL, SPEC, seed) for seed in (1, 2, 1)]
    assert routes[0] == routes[2]
    assert routes[0] != routes[1]


def test_another_process_plans_the_same_route_and_prints_nothing_else() -> None:
    """The route does not hang on what the process did before; OMPL stays silent, at exit too."""
    code = (
        "import tests.planning.test_route as t\n"
        "print(repr(t.plan_route(t._scattered(), t.START, t.GOAL, t.SPEC, 1)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True
    )
    assert done.stdout.strip() == repr(plan_route(_scattered(), START, GOAL, SPEC, 1))
    assert done.stderr == ""


def test_a_route_over_several_places_passes_them_in_order() -> None:
    """And its drive keeps clear at the places too."""
    places = (START, (6.0, -5.0), GOAL)
    terrain = FlatTerrain([(6.0, -3.6, 0.5), (2.5, -2.5, 0.5)])
    route = plan_route_over(terrain, places, SPEC, 1)
    assert [route.index(place) for place in places] == sorted(route.index(p) for p in places)
    legs = plan_legs(route, SPEC.min_turn_radius_m, SPEC.corner_cut_m)
    driven = np.concatenate([leg.xy for leg in legs])
    rocks = terrain.rocks(Box(-20, -20, 30, 30))
    away = np.linalg.norm(driven[:, None] - rocks.p_world_rock[None, :, :2], axis=2)
    assert (away - rocks.reach_m).min() >= SPEC.clearance_m


def test_open_ground_is_crossed_in_a_straight_line() -> None:
    """Two corners, also past rocks too low to matter."""
    low = [(x, y, 0.28) for x in range(-2, 14) for y in range(-2, 8)]
    for terrain in (FlatTerrain(), FlatTerrain(low)):
        assert plan_route(terrain, START, GOAL, SPEC, 1) == (START, GOAL)


def test_the_way_around_one_rock_is_nearly_the_shortest() -> None:
    """Two tangents and an arc around the disc that the route keeps out of, within 3 %."""
    terrain = FlatTerrain([(6.0, 0.0, 1.0)])
    radius = float(terrain.rocks(Box(0, -1, 10, 1)).reach_m[0]) + SPEC.needed_m
    tangent = math.sqrt(6**2 - radius**2)
    shortest = 2 * tangent + radius * (math.pi - 2 * math.acos(radius / 6))
    length = _length(plan_route(terrain, START, (12.0, 0.0), RouteSpec(), 1))
    assert shortest - 2 * SPEC.grid_error_m < length < 1.03 * shortest


def test_a_walled_in_goal_has_no_way_and_says_so() -> None:
    """The rocks stand too close; a narrower rover would pass."""
    terrain = FlatTerrain(_ring(GOAL, 3.0, 12))
    with pytest.raises(PlanningError, match=r"no way 0\.97 m clear joins .* widen margin_m"):
        plan_route(terrain, START, GOAL, SPEC, 1)
    narrow = RouteSpec(clearance_m=0.3, corner_cut_m=0.05)
    assert plan_route(terrain, START, GOAL, narrow, 1)[-1] == GOAL


def test_a_start_beside_a_rock_is_refused_with_the_distance() -> None:
    """And the nearest clear place is where a rover may stand."""
    terrain = FlatTerrain([(0.5, 0.0, 0.5)])
    with pytest.raises(PlanningError, match=r"the start \(0\.00, 0\.00\) m is 0\.\d\d m from an"):
        plan_route(terrain, START, GOAL, SPEC, 1)
    start = nearest_clear(terrain, START, 3.0, SPEC)
    assert 0.5 < math.dist(start, START) < 1.5
    assert plan_route(terrain, start, GOAL, SPEC, 1)[0] == start


def test_where_all_is_rock_there_is_no_clear_place() -> None:
    """The sentence says what to change."""
    terrain = FlatTerrain([(x, y, 0.5) for x in range(-5, 6) for y in range(-5, 6)])
    with pytest.raises(PlanningError, match="search farther, or lower the clearance"):
        nearest_clear(terrain, START, 3.0, SPEC)


def test_a_goal_off_the_drivable_ground_is_refused() -> None:
    """A terrain with an edge."""
    with pytest.raises(PlanningError, match="the goal"):
        plan_route(FlatTerrain(drivable=Box(-5, -5, 10, 10)), START, GOAL, SPEC, 1)


def test_a_place_that_is_not_finite_is_refused() -> None:
    """Rather than mapped."""
    with pytest.raises(PlanningError, match="finite"):
        plan_route(FlatTerrain(), START, (math.nan, 0.0), SPEC, 1)


def test_ground_that_is_too_steep_is_not_crossed() -> None:
    """A ridge across the whole map: passable at 15 deg, not at 25."""
    gentle, steep = (
        FlatTerrain(ridge_x=5.0, ridge_slope=math.tan(math.radians(a))) for a in (15, 25)
    )
    assert plan_route(gentle, START, GOAL, SPEC, 1) == (START, GOAL)
    with pytest.raises(PlanningError, match="no way"):
        plan_route(steep, START, GOAL, SPEC, 1)


def test_the_map_gives_the_distance_to_the_nearest_rock() -> None:
    """Against the circles themselves, within the stated error of the grid."""
    terrain = _scattered()
    rocks = terrain.rocks(Box(-20, -20, 30, 30))
    clearance = map_clearance(terrain, Box(0, 0, 10, 5), SPEC)
    xy = stream(4, "points").uniform([0, 0], [10, 5], (500, 2))
    exact = np.linalg.norm(xy[:, None] - rocks.p_world_rock[None, :, :2], axis=2) - rocks.reach_m
    error = clearance.distance_at(xy) - np.maximum(exact.min(axis=1), 0)
    near = exact.min(axis=1) < SPEC.needed_m
    assert np.abs(error[near]).max() <= SPEC.grid_error_m


def test_a_corner_that_cannot_be_rounded_is_turned_on_the_spot() -> None:
    """A rock inside a right angle: its arc would pass too close, its sides do not."""
    corners = [START, (5.0, 0.0), (5.0, 5.0)]
    for x, pieces in ((-30.0, 1), (3.8, 2)):
        terrain = FlatTerrain([(x, 1.2, 0.5)])
        clearance = map_clearance(terrain, Box(-1, -1, 6, 6), SPEC)
        route = with_turns_on_the_spot(clearance, corners, SPEC)
        assert len(plan_legs(route, SPEC.min_turn_radius_m, SPEC.corner_cut_m)) == pieces
        assert len(route) == len(corners) + pieces - 1


def test_a_real_terrain_is_crossed() -> None:
    """Twenty metres of ExoMars ground with its rocks."""
    terrain = build_terrain(
        TerrainSpec.from_yaml(ROOT / "lpet_sim/terrain/presets/exomars.yaml"), 1
    )
    start, goal = (nearest_clear(terrain, xy, 3.0, SPEC) for xy in (START, (20.0, 5.0)))
    route = plan_route(terrain, start, goal, SPEC, 1)
    rocks = terrain.rocks(Box(-15, -15, 35, 20))
    corners = np.array(route)
    away = (
        np.linalg.norm(corners[:, None] - rocks.p_world_rock[None, :, :2], axis=2) - rocks.reach_m
    )
    assert away[:, rocks.height_m > SPEC.obstacle_height_m].min() >= SPEC.clearance_m
    assert _length(route) < 2.5 * math.dist(start, goal)
