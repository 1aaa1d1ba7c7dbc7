"""The map of mobility bounds true distances, and its checks hold for what the body sweeps."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lpet_sim.errors import PlanningError, SpecError
from lpet_sim.planning.map_path import bridges_of, wave_from
from lpet_sim.planning.mobility import MobilitySpec, kinds_of
from lpet_sim.planning.mobility_kernels import least_distance
from lpet_sim.planning.mobility_map import MobilityMap, map_mobility
from lpet_sim.planning.reach_spec import ReachSpec
from lpet_sim.planning.wave_kernels import UNSEEN
from lpet_sim.rng import stream
from lpet_sim.terrain.box import Box
from scenarios.reach.swept_body import disc_gets_there, touched
from tests.planning.flat_terrain import FlatTerrain

BOX = Box.around(0.0, 0.0, 10.0)
SPEC = MobilitySpec()


def _scattered(count: int, seed: int = 0, low: float = 0.2, high: float = 1.2) -> FlatTerrain:
    rng = stream(seed, "scattered")
    columns = [*rng.uniform(-11, 11, (2, count)), rng.uniform(low, high, count)]
    return FlatTerrain([(float(x), float(y), float(d)) for x, y, d in zip(*columns, strict=True)])


def _mapped(terrain: FlatTerrain, spec: MobilitySpec = SPEC, cell_m: float = 0.1) -> MobilityMap:
    return map_mobility(terrain, BOX, spec, cell_m)


def test_distances_between_the_nodes_are_never_too_large_and_within_half_a_diagonal() -> None:
    """Against distances to densely sampled outlines."""
    terrain = _scattered(25, low=0.7)
    here = _mapped(terrain)
    outlines = terrain.rocks(BOX.grown(5)).outlines()
    share = np.linspace(0, 1, 400)[:, None, None]
    rims = np.concatenate(
        [(o + share * (np.roll(o, -1, axis=0) - o)).reshape(-1, 2) for o in outlines]
    )
    for x, y in stream(1, "points").uniform(-9, 9, (200, 2)):
        bound = least_distance(here.obstacle_m, here.grid, x, y)
        true = np.linalg.norm(rims - (x, y), axis=1).min()
        if bound > 0:
            assert bound <= min(true, SPEC.circumscribed_m + 2.0)
        if 0.1 < true < SPEC.circumscribed_m + 1.9:
            # Inside a rock the map says 0 and the rim is some way off.
            assert bound >= true - 0.1 / math.sqrt(2) - 0.01 or bound <= 0


def test_a_straight_that_can_be_driven_touches_nothing_by_the_independent_test() -> None:
    """Random straights between places to turn at, rocks to straddle among them."""
    terrain = _scattered(90, low=0.25, high=0.8)
    here, rocks = _mapped(terrain), terrain.rocks(BOX.grown(3))
    straddled = kinds_of(rocks, SPEC)[1]
    assert 5 < straddled.sum() < 85
    rng, driven, over = stream(2, "straights"), 0, 0
    while driven < 150:
        a, b = rng.uniform(-9, 9, (2, 2))
        turns = here.can_turn(tuple(a)) and here.can_turn(tuple(b))
        if turns and math.dist(a, b) < 6 and here.can_drive(tuple(a), tuple(b)):
            path = np.array([a, b])
            assert touched(path, rocks, SPEC) == []
            driven += 1
            without = SPEC.model_copy(update={"straddle_width_m": 0.0})
            over += bool(touched(path, rocks, without))
    # Some of them do lead over rocks, or the wheel tracks were never put to the test.
    assert over > 0


def test_the_independent_test_finds_a_way_through_a_rock() -> None:
    """It can fail."""
    rocks = FlatTerrain([(2.0, 0.0, 1.0)]).rocks(BOX)
    assert touched(np.array([[0.0, 0.0], [4.0, 0.0]]), rocks, SPEC)
    assert touched(np.array([[0.0, 1.1], [4.0, 1.1]]), rocks, SPEC)
    assert touched(np.array([[0.0, 1.45], [4.0, 1.45]]), rocks, SPEC) == []


def test_the_independent_disc_gets_through_a_gap_just_wider_than_it_and_no_narrower() -> None:
    """Rocks of the shape library in a row; the gap is measured on their outlines."""
    spec = ReachSpec.from_mapping(
        {"terrain": {}, "size_m": 8.0, "goal_m": [3, 0], "starts_m": [[-3, 0]], "starts": 0}
    )
    below = [(0.0, -float(y), 1.6) for y in np.arange(1.4, 6.5, 0.4)]
    above = [(0.0, float(y), 1.6) for y in np.arange(1.4, 6.5, 0.4)]
    low, high = (FlatTerrain(row).rocks(spec.box.grown(4)).outlines() for row in (below, above))
    gap = min(o[:, 1].min() for o in high) - max(o[:, 1].max() for o in low)
    through = []
    for wider in (-0.08, 0.08):
        shift = 2 * (spec.mobility.inscribed_m + 0.04) + wider - gap
        wall = FlatTerrain([*below, *((x, y + shift, d) for x, y, d in above)])
        through.append(disc_gets_there((-3.0, 0.0), wall.rocks(spec.box.grown(4)), spec))
    assert through == [False, True]


def test_a_low_rock_is_passed_between_the_wheels_but_not_under_one() -> None:
    """Straight over it, a little beside, and under the left wheels."""
    here = _mapped(FlatTerrain([(0.0, 0.0, 0.5)]))
    assert here.can_drive((-3.0, 0.0), (3.0, 0.0))
    assert here.can_drive((-3.0, 0.1), (3.0, 0.1))
    assert not here.can_drive((-3.0, 0.6), (3.0, 0.6))
    assert here.can_drive((-3.0, 1.3), (3.0, 1.3))
    assert not here.can_turn((0.0, 0.0))
    high = _mapped(FlatTerrain([(0.0, 0.0, 0.7)]))
    assert not high.can_drive((-3.0, 0.0), (3.0, 0.0))


def test_a_rock_as_low_as_the_wheels_climb_is_no_obstacle() -> None:
    """Just below and just above the height; the test's rocks are half as high as wide."""
    low, high = (_mapped(FlatTerrain([(0.0, 0.0, d)])) for d in (0.299, 0.302))
    assert low.can_turn((0.0, 0.0))
    assert not high.can_turn((0.0, 0.0))


def test_a_slope_holds_along_the_heading_where_it_is_too_steep_across() -> None:
    """17 deg along x: within the slope, beyond the roll."""
    slope = FlatTerrain(ridge_x=-2.0, ridge_slope=math.tan(math.radians(17.0)))
    here = _mapped(slope)
    assert here.can_drive((-5.0, 0.0), (6.0, 0.0))
    assert not here.can_drive((0.0, -3.0), (0.0, 3.0))
    assert not here.can_turn((0.0, 0.0))
    assert here.possible[here.node((0.0, 0.0))]
    steep = _mapped(FlatTerrain(ridge_x=-2.0, ridge_slope=math.tan(math.radians(21.0))))
    assert not steep.can_drive((-5.0, 0.0), (6.0, 0.0))
    assert not steep.possible[steep.node((0.0, 0.0))]


def test_where_the_rover_surely_can_turn_it_possibly_can_be() -> None:
    """The sure set lies in the possible one, whatever the resolution."""
    for cell in (0.05, 0.1, 0.2):
        here = _mapped(_scattered(60), cell_m=cell)
        assert here.sure.any() and not here.sure.all()
        assert not np.any(here.sure & ~here.possible)


def test_a_wave_costs_what_the_shortest_way_over_the_nodes_costs() -> None:
    """Against SciPy's Dijkstra on a small map, without bridges."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import dijkstra

    here = _mapped(_scattered(40), cell_m=0.25)
    free, (ny, nx) = here.sure, here.sure.shape
    links = []
    for di, dj, price in ((0, 1, 12), (1, 0, 12), (1, 1, 17), (1, -1, 17)):
        i, j = np.nonzero(free[: ny - di, max(-dj, 0) : nx - max(dj, 0)])
        j = j + max(-dj, 0)
        both = free[i + di, j + dj]
        links.append((i[both] * nx + j[both], (i[both] + di) * nx + j[both] + dj, price))
    a, b = (np.concatenate([link[end] for link in links]) for end in (0, 1))
    prices = np.concatenate([np.full(len(link[0]), link[2]) for link in links])
    graph = coo_matrix((prices, (a, b)), shape=(free.size, free.size)).tocsr()
    goal = np.flatnonzero(free)[7]
    expected = dijkstra(graph, directed=False, indices=goal)
    bridges = bridges_of(here)
    none = type(bridges)(
        bridges.links[:0], bridges.prices[:0], np.full_like(bridges.first, -1), bridges.joined
    )
    wave = wave_from(here, none, np.array([goal // nx]), np.array([goal % nx]))
    found = np.where(wave.cost == UNSEEN, np.inf, wave.cost)
    assert np.array_equal(found, expected)


def test_bridges_join_what_a_narrow_place_keeps_apart() -> None:
    """A wall of rocks with a gap too narrow to turn in, and wide enough to drive through."""
    wall = [(0.0, y, 1.0) for y in np.arange(-12, 12.1, 0.5) if abs(y) > 1.4]
    here = _mapped(FlatTerrain(wall))
    assert here.sure_region[here.node((-5.0, 0.0))] != here.sure_region[here.node((5.0, 0.0))]
    wave = wave_from(here, bridges_of(here), *here.nodes_within((5.0, 0.0), 0.0))
    corners = wave.corners_from((-5.0, 0.0))
    assert corners[0] == (-5.0, 0.0)
    rocks = FlatTerrain(wall).rocks(BOX.grown(3))
    assert touched(np.array(corners), rocks, SPEC) == []


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"wheel_width_m": 0.7}, "below half_width_m"),
        ({"straddle_width_m": 1.1}, "at most 0.9"),
        ({"turning": "crab"}, "turning"),
    ],
)
def test_a_rover_that_cannot_be_is_refused(fields: dict[str, object], words: str) -> None:
    """In one sentence that says what is valid."""
    with pytest.raises(SpecError, match=words):
        MobilitySpec.from_mapping(fields)


def test_a_map_that_is_too_large_says_how_large_it_may_be() -> None:
    """At once, before anything is built."""
    with pytest.raises(PlanningError, match="or a larger cell"):
        map_mobility(FlatTerrain(), Box.around(0, 0, 500), SPEC, 0.05)
