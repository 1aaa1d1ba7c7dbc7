"""A traverse's YAML finds its terrain by preset, beside itself, or inline."""

from pathlib import Path

import pytest

from lpet_sim.errors import BlockedPlaceError, PlanningError, SpecError, UnknownNameError
from lpet_sim.soil.load import load_soil
from lpet_sim.sweep.traverse import TraverseSpec, planned_drive
from lpet_sim.terrain.terrain import build_terrain

DRIVE = "drive: {waypoints_m: [[0, 0], [2, 0]]}\n"


def _traverse(folder: Path, terrain: str) -> TraverseSpec:
    path = folder / "traverse.yaml"
    path.write_text(f"terrain: {terrain}\n{DRIVE}")
    return TraverseSpec.from_yaml(path)


def test_a_terrain_file_is_found_beside_the_traverse(tmp_path: Path) -> None:
    """Wherever the command is run from."""
    (tmp_path / "plain.yaml").write_text("name: plain\nfar: null\n")
    assert _traverse(tmp_path, "plain.yaml").terrain.name == "plain"


def test_a_preset_and_an_inline_terrain_need_no_file(tmp_path: Path) -> None:
    """Both give a whole terrain."""
    assert _traverse(tmp_path, "pathfinder").terrain.name == "pathfinder"
    assert _traverse(tmp_path, "{name: inline}").terrain.name == "inline"


def test_a_traverse_goes_to_yaml_and_back(tmp_path: Path) -> None:
    """Every field, defaults and all."""
    spec = _traverse(tmp_path, "exomars")
    spec.to_yaml(tmp_path / "again.yaml")
    assert TraverseSpec.from_yaml(tmp_path / "again.yaml") == spec


def test_an_unknown_preset_is_answered_with_the_known_ones(tmp_path: Path) -> None:
    """It names them all."""
    with pytest.raises(UnknownNameError, match="exomars, gale, mer_spirit, pathfinder"):
        _traverse(tmp_path, "venus")


def test_a_blocked_waypoint_is_answered_with_the_ways_out_and_an_unreachable_one_is_not() -> None:
    """Moving a waypoint helps where it stands too close to a rock, not where there is no way."""
    rocky = {"name": "rocky", "far": None, "rocks": {"kind": "abundance", "k": 0.19}}
    refused: dict[type[Exception], str] = {}
    for moved in (0.0, 5.0):
        spec = TraverseSpec.from_mapping(
            {
                "terrain": rocky,
                "drive": {"waypoints_m": [[0, 0], [15, 0]]},
                "move_within_m": moved,
            }
        )
        with pytest.raises(PlanningError) as error:
            planned_drive(spec, build_terrain(spec.terrain, 0), 0)
        refused[error.type] = str(error.value)
    assert "move_within_m" in refused[BlockedPlaceError]
    assert "move_within_m" not in refused[PlanningError]


def test_a_soil_file_of_an_inline_terrain_is_found_beside_the_traverse(tmp_path: Path) -> None:
    """As the terrain's own file would be."""
    mine = load_soil("duricrust").model_copy(update={"name": "mine"})
    mine.to_yaml(tmp_path / "mine.yaml")
    spec = _traverse(tmp_path, "{soils: [{name: all of it, soil: mine.yaml}]}")
    assert spec.terrain.soils[0].soil == mine


def test_the_soil_of_rocks_is_found_beside_the_traverse(tmp_path: Path) -> None:
    """As those of the terrain are; a name that is neither is told with its key."""
    mine = load_soil("duricrust").model_copy(update={"name": "mine"})
    mine.to_yaml(tmp_path / "mine.yaml")
    rock = "{name: inline}\nrover: {wheel_soil: {rock: %s}}"
    wheels = _traverse(tmp_path, rock % "mine.yaml").rover.wheel_soil
    assert wheels is not None
    assert wheels.rock == mine
    with pytest.raises(SpecError, match=r"'rover\.wheel_soil\.rock': unknown soil 'jelly': choose"):
        _traverse(tmp_path, rock % "jelly")
