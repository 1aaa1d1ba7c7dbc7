"""Reachability is right or undecided on maps with a known answer, and its ways can be driven."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from lpet_sim.errors import BlockedPlaceError, SpecError
from lpet_sim.planning.map_path import length_of
from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.planning.mobility_map import map_mobility
from lpet_sim.planning.reach import (
    BOTH,
    GOAL_BLOCKED,
    ROCKS,
    SLOPE,
    START_BLOCKED,
    Reacher,
    reach_from_all,
    reach_on,
)
from lpet_sim.planning.reach_result import StartResult, TerrainResult
from lpet_sim.planning.reach_run import run_reach
from lpet_sim.planning.reach_spec import ReachSpec, cases_of
from lpet_sim.planning.search import search_straights
from lpet_sim.planning.worst_paths import drives_forwards, rank_worst, save_worst
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.terrain import build_terrain
from scenarios.reach.swept_body import touched
from tests.command import runner
from tests.planning.flat_terrain import FlatTerrain

ROOT = Path(__file__).parents[2]
FLAT: dict[str, Any] = {"relief": {"rms_slope_rad": 0.0}, "craters": None, "far": None}
ROCKY: dict[str, Any] = FLAT | {"rocks": {"kind": "abundance", "k": 0.12}}
# A rover without margin, so that a gap of its own width is what the test says.
BARE = MobilitySpec(margin_m=0.0)
WIDTH = 2 * BARE.half_width_m


def _spec(**fields: Any) -> ReachSpec:
    basic: dict[str, Any] = {
        "terrain": FLAT, "size_m": 16.0, "goal_m": [5.0, 0.0], "goal_radius_m": 0.0,
        "starts_m": [[-5.0, 0.0]], "starts": 0,
    }  # fmt: skip
    return ReachSpec.from_mapping(basic | fields)


def _one(terrain: FlatTerrain, **fields: Any) -> StartResult:
    return reach_from_all(terrain, _spec(**fields), 1)[0]


class Slabs(FlatTerrain):
    """Level ground with a straight wall along y, whose gap is exactly as wide as asked."""

    def __init__(self, gap_m: float) -> None:
        super().__init__([(0.0, 0.0, 1.0)] * 2)
        self._gap_m = gap_m

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> Any:
        """Give the wall as two rocks with rectangular outlines."""
        rocks = super().rocks(box, min_diameter_m)
        return _Wall(rocks, self._gap_m)


class _Wall:
    """Rocks with outlines of the test's own."""

    def __init__(self, rocks: Any, gap_m: float) -> None:
        self.height_m, self.reach_m = rocks.height_m, rocks.reach_m
        self._gap_m = gap_m

    def select(self, which: Any) -> _Wall:
        """Give the wall where it is asked for, else nothing."""
        self_or_empty = _Wall(self, self._gap_m)
        self_or_empty.height_m, self_or_empty.reach_m = self.height_m[which], self.reach_m[which]
        return self_or_empty

    def outlines(self) -> list[Any]:
        """Give two long slabs, 0.4 m thick."""
        half, far = self._gap_m / 2, 12.0
        above = np.array([[-0.2, half], [0.2, half], [0.2, far], [-0.2, far]])
        below = np.array([[-0.2, -far], [0.2, -far], [0.2, -half], [-0.2, -half]])
        return [above, below] if len(self.height_m) else []


@pytest.mark.parametrize("turning", ["point_turn", "reeds_shepp", "dubins"])
def test_open_ground_is_reachable(turning: str) -> None:
    """Straight on, or by curves from a heading of chance."""
    found = _one(FlatTerrain(), mobility={"turning": turning})
    assert found.outcome == "reachable"
    if turning == "point_turn":
        assert found.length_m == pytest.approx(10.0, abs=1e-3)
    assert found.path_m[0][:2] == (-5.0, 0.0)
    assert math.dist(found.path_m[-1][:2], (5.0, 0.0)) < 1e-3


@pytest.mark.parametrize("turning", ["point_turn", "reeds_shepp", "dubins"])
def test_a_wall_without_a_gap_is_unreachable_and_rocks_are_the_reason(turning: str) -> None:
    """Not only not found."""
    found = _one(Slabs(0.0), mobility={"turning": turning})
    assert (found.outcome, found.reason) == ("unreachable", ROCKS)


@pytest.mark.parametrize("cell_m", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("wider_m", [-0.30, -0.05, 0.05, 0.30])
def test_a_gap_about_as_wide_as_the_rover_is_right_or_undecided(
    wider_m: float, cell_m: float
) -> None:
    """Never wrong, and decided where there are 30 cm to spare or to miss."""
    found = _one(Slabs(WIDTH + wider_m), mobility=BARE.to_mapping(), cell_m=cell_m)
    wrong = "unreachable" if wider_m > 0 else "reachable"
    assert found.outcome != wrong
    if abs(wider_m) > 0.2:
        assert found.outcome != "undecided"


def test_a_gap_five_centimetres_wider_than_the_rover_is_found_on_a_fine_map() -> None:
    """At 1 cm."""
    fine = {"cell_m": 0.01, "size_m": 9.0, "goal_m": [3.0, 0.0], "starts_m": [[-3.0, 0.0]]}
    found = _one(Slabs(WIDTH + 0.05), mobility=BARE.to_mapping(), **fine)
    assert found.outcome == "reachable"


def test_steep_ground_is_the_reason_where_rocks_are_not() -> None:
    """A ridge across the square, and a wall behind a ridge."""
    ridge = FlatTerrain(ridge_x=-2.0, ridge_slope=0.6)
    assert _one(ridge).reason == SLOPE
    walled = FlatTerrain([(5 + 1.3 * math.cos(a), 1.3 * math.sin(a), 0.7) for a in range(7)])
    assert _one(walled, goal_m=[5.0, 0.0]).outcome == "unreachable"
    assert _one(FlatTerrain(ridge_x=-2.0, ridge_slope=0.2)).outcome == "reachable"


def test_where_rocks_and_slopes_each_leave_a_way_both_are_the_reason() -> None:
    """A wall with a gap, which lies on a slope that does not reach as far as the wall."""

    class HalfSteep(FlatTerrain):
        def patch(self, x0: int, y0: int, shape: tuple[int, int], cell_m: float) -> Any:
            y = (y0 + np.arange(shape[0])) * cell_m
            x = (x0 + np.arange(shape[1])) * cell_m
            return np.where(y[:, None] > 0, 0.6 * np.clip(np.minimum(x, 4 - x), 0, 2), 0.0)

    wall = [(0.0, float(y), 1.0) for y in np.arange(-9, 0.9, 0.5)]
    assert _one(HalfSteep(wall), goal_m=[7.0, 4.0], starts_m=[[-5.0, 4.0]]).reason == BOTH


def test_a_start_or_a_goal_in_a_rock_is_named() -> None:
    """The start in one, the goal in one, and a goal beside one that may be moved."""
    rock = FlatTerrain([(5.0, 0.0, 1.0)])
    assert _one(rock, goal_m=[-5.0, 0.0], starts_m=[[5.0, 0.0]]).reason == START_BLOCKED
    assert _one(rock).reason == GOAL_BLOCKED
    near = _one(rock, goal_radius_m=2.0)
    assert near.outcome == "reachable"
    assert math.dist(near.path_m[-1], (5.0, 0.0)) <= 2.0


@pytest.mark.parametrize("turning", ["point_turn", "reeds_shepp", "dubins"])
def test_no_way_touches_an_obstacle_on_random_terrains(turning: str) -> None:
    """By the test of polygons every centimetre; the thousand are in scenarios/reach_checks.py."""
    curves = turning != "point_turn"
    sparse = FLAT | {"rocks": {"kind": "abundance", "k": 0.05}}
    mobility = MobilitySpec.from_mapping({"turning": turning})
    spec = _spec(
        terrain=sparse if curves else ROCKY, starts=2 if curves else 5, starts_m=[],
        goal_radius_m=2.0, size_m=20.0, terrains=2, search={"iterations": 3000},
        mobility=mobility.to_mapping(),
    )  # fmt: skip
    ways = 0
    for case in cases_of(spec, 4):
        rocks = build_terrain(case.terrain, case.seed).rocks(spec.box.grown(4.0))
        for start in reach_on(case, spec).starts:
            if start.path_m:
                ways += 1
                assert touched(start.path, rocks, mobility) == []
    assert ways >= (1 if curves else 5)


def test_a_longer_search_does_not_reach_what_is_called_unreachable() -> None:
    """Over twice the budget, on terrain where many starts are walled in."""
    dense = FLAT | {"rocks": {"kind": "abundance", "k": 0.19, "number_multiplier": 1.2}}
    spec = _spec(terrain=dense, starts=8, starts_m=[], size_m=16.0, goal_radius_m=1.0, terrains=2)
    spec = spec.model_copy(update={"mobility": MobilitySpec(straddle_width_m=0.0)})
    unreachable = 0
    for case in cases_of(spec, 5):
        here = map_mobility(
            build_terrain(case.terrain, case.seed), spec.box, spec.mobility, spec.cell_m
        )
        reacher = Reacher(here, spec, case.seed)
        for start in reacher.all():
            if start.outcome == "unreachable":
                unreachable += 1
                for goal in reacher.goal_places:
                    assert not search_straights(here, start.start_m, goal, 50_000, 12.0, 1)
    assert unreachable > 1


def test_more_rocks_never_make_more_starts_reachable_within_the_intervals(tmp_path: Path) -> None:
    """From no failures to few successes, by K."""
    spec = _spec(
        terrain=ROCKY, starts=6, starts_m=[], size_m=20.0, terrains=4, rock_factors=[0.5, 2.0],
        goal_radius_m=2.0, mobility={"straddle_width_m": 0.0},
    )  # fmt: skip
    few, many = run_reach(spec, 1, tmp_path).rates
    assert few.reachable.value > many.reachable.high
    assert few.reachable.value + few.unreachable + few.undecided == pytest.approx(1.0)


def test_a_study_is_the_same_with_two_workers_and_goes_on_where_it_was(tmp_path: Path) -> None:
    """A terrain that is done is read, one that was cut off or made from another spec is not."""
    spec = _spec(terrain=ROCKY, starts=3, starts_m=[], terrains=2, goal_radius_m=2.0)
    one = run_reach(spec, 3, tmp_path / "one")
    two = run_reach(spec, 3, tmp_path / "two", workers=2)
    assert [t.starts for t in one.terrains] == [t.starts for t in two.terrains]
    files = sorted((tmp_path / "one" / "terrains").glob("*.json"))
    files[0].write_text(files[0].read_text()[:100])
    kept = files[1].stat().st_mtime_ns
    again = run_reach(spec, 3, tmp_path / "one")
    assert [t.starts for t in again.terrains] == [t.starts for t in one.terrains]
    assert files[1].stat().st_mtime_ns == kept
    other = spec.model_copy(update={"starts": 4})
    assert [len(t.starts) for t in run_reach(other, 3, tmp_path / "one").terrains] == [4, 4]


def test_results_come_back_from_json_as_they_were() -> None:
    """Ways and measures too."""
    spec = _spec(terrain=ROCKY, starts=3, starts_m=[], goal_radius_m=2.0)
    result = reach_on(cases_of(spec, 2)[0], spec)
    assert TerrainResult.from_mapping(json.loads(json.dumps(result.to_mapping()))) == result


def test_the_worst_way_is_the_crooked_one_and_becomes_a_traverse(tmp_path: Path) -> None:
    """Ranked above straight ones; read back as a traverse over the same corners."""
    spec = _spec(terrain=ROCKY, starts=8, starts_m=[], size_m=24.0, goal_radius_m=2.0)
    report = run_reach(spec, 2, tmp_path)
    ranked = rank_worst(report, spec)
    assert [way.score for way in ranked] == sorted((w.score for w in ranked), reverse=True)
    first, last = ranked[0].start.measures, ranked[-1].start.measures
    assert first is not None and last is not None
    assert first.length_ratio > last.length_ratio
    path = save_worst(ranked, spec.mobility, tmp_path / "worst", 1)[0]
    traverse = TraverseSpec.from_yaml(path)
    assert traverse.route is None
    driven = [(float(x), float(y)) for x, y in traverse.drive.waypoints_m]
    assert set(ranked[0].start.path_m) <= set(driven)
    assert length_of(driven) == pytest.approx(ranked[0].start.length_m, abs=1e-3)
    assert f"seed {ranked[0].case.seed}" in path.read_text()


def test_only_ways_without_stretches_backwards_are_saved() -> None:
    """Reeds and Shepp's car may have to back out."""
    ahead = StartResult((0, 0), "reachable", path_m=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)))
    back = StartResult((0, 0), "reachable", path_m=((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0)))
    assert drives_forwards(ahead)
    assert not drives_forwards(back)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"goal_m": [50.0, 0.0]}, "outside the square"),
        ({"starts_m": []}, "there is no start"),
        ({"start_distances_m": [5.0, 2.0]}, "two distances in order"),
        ({"start_distances_m": [500.0, 600.0]}, "no place of the square"),
        ({"rock_factors": [1.0, 2.0]}, "without rocks"),
        ({"abundances": [0.1]}, "without rocks"),
        ({"terrain": ROCKY, "rock_factors": [100.0]}, "less than or equal to 10"),
        ({"terrain": ROCKY, "rock_factors": [8.0]}, "must be at most"),
    ],
)
def test_a_study_that_cannot_be_is_refused(
    fields: dict[str, Any], words: str, tmp_path: Path
) -> None:
    """In one sentence that says what is valid."""
    with pytest.raises(SpecError, match=words):
        run_reach(_spec(**fields), 0, tmp_path)


def test_the_command_writes_its_tables_and_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A small study of two factors."""
    fields = {"terrain": ROCKY, "starts": 4, "starts_m": [], "rock_factors": [0.5, 1.0]}
    spec = _spec(**fields, goal_radius_m=2.0).to_mapping()
    (tmp_path / "spec.yaml").write_text(yaml.safe_dump(spec))
    out = tmp_path / "out"
    ended = runner(monkeypatch, capsys)(
        "reach", tmp_path / "spec.yaml", "--out", out, "--workers=1"
    )
    assert ended.code == 0, ended.err
    assert "reachability: reach" in ended.out and "1.46" in ended.out
    names = {path.name for path in out.iterdir()}
    assert names >= {"reach.json", "rates.png", "worst", "terrains"}
    assert sum(name.startswith("map_") for name in names) == 2
    assert json.loads((out / "reach.json").read_text())["rates"][0]["starts"] == 4


def test_a_goal_inside_a_rock_ends_the_study_with_one_sentence(tmp_path: Path) -> None:
    """Where no terrain of the study has room at the goal."""
    table = {"kind": "table", "rows": [
        {"diameter_min_m": 2.0, "diameter_max_m": 2.4, "count_per_m2": 0.03}
    ]}  # fmt: skip
    spec = _spec(terrain=FLAT | {"rocks": table})
    rock = build_terrain(spec.terrain, cases_of(spec, 0)[0].seed).rocks(spec.box.grown(-4.0))
    goal = tuple(round(float(value), 3) for value in rock.p_world_rock[0, :2])
    with pytest.raises(BlockedPlaceError, match="raise goal_radius_m"):
        run_reach(spec.model_copy(update={"goal_m": goal}), 0, tmp_path)


@pytest.mark.parametrize("path", sorted((ROOT / "scenarios" / "reach").glob("*.yaml")))
def test_every_study_of_the_scenarios_can_be_read(path: Path) -> None:
    """And its terrains can be laid out."""
    assert cases_of(ReachSpec.from_yaml(path), 0)


def test_starts_of_a_ring_are_spread_over_it_evenly_and_can_be_stood_at() -> None:
    """Half of them beyond the radius that halves its area."""
    spec = _spec(
        starts=200, starts_m=[], goal_m=[0, 0], start_distances_m=[3.0, 7.0], goal_radius_m=1.0
    )
    here = map_mobility(FlatTerrain(), spec.box, spec.mobility, spec.cell_m)
    starts = Reacher(here, spec, 1).random_starts()
    away = np.hypot(*np.array(starts).T)
    assert away.min() >= 3.0
    assert away.max() <= 7.0
    assert np.mean(away > math.sqrt((9 + 49) / 2)) == pytest.approx(0.5, abs=0.12)
    assert all(here.can_turn(start) for start in starts)
