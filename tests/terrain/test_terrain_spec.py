"""Terrain specs: presets, YAML and the sentences for what is not valid."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.datasets import DataError, data_folder, data_path
from lpet_sim.errors import SpecError, UnknownNameError
from lpet_sim.soil.load import load_soil
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.load import PRESETS, load_terrain_spec, preset_names
from lpet_sim.terrain.spec import RockAbundanceSpec, RockTableSpec, TerrainSpec

BAD = [
    ({"relief": {"hurst": 1.0}}, "relief.hurst"),
    ({"relief": {"rms_slope_rad": -0.1}}, "relief.rms_slope_rad"),
    ({"relief": {"slope": 0.1}}, "valid keys are hurst, rms_slope_rad"),
    ({"craters": {"diameter_min_m": 9.0, "diameter_max_m": 3.0}}, "must be below the maximum"),
    ({"rocks": {"kind": "abundance", "k": -0.07}}, "greater than 0"),
    ({"rocks": {"kind": "abundance", "k": 7}}, "less than or equal to 0.4"),
    ({"rocks": {"kind": "abundance", "k": 0.07, "number_multiplier": 0}}, "number_multiplier"),
    ({"rocks": {"kind": "heap"}}, "'abundance', 'table'"),
    ({"rocks": {"kind": "table", "rows": []}}, "at least 1 item"),
    ({"soils": [{"name": "a", "area_fraction": 0.4}]}, "must sum to 1"),
    ({"soils": [{"name": "a", "soil": "jelly"}]}, "soils.0.soil.*choose one of bedrock"),
    ({"soils": [{"name": "a", "soil": {"kind": "jelly"}}]}, "'mechanics', 'table', 'firm'"),
    ({"soils": [{"name": "a", "firm": True}]}, "valid keys are name, area_fraction, soil, tone"),
    ({"sun": {"elevation_rad": -0.2}}, "sun.elevation_rad"),
    ({"albedo": {"mean": 1.2}}, "albedo.mean"),
    ({"seed": 3}, "unknown key 'seed'"),
]


@pytest.mark.parametrize("name", preset_names())
def test_presets_survive_a_round_trip_through_yaml(name: str, tmp_path: Path) -> None:
    """A preset written to YAML and read back is the same spec."""
    spec = load_terrain_spec(name)
    spec.to_yaml(tmp_path / "spec.yaml")
    assert TerrainSpec.from_yaml(tmp_path / "spec.yaml") == spec
    assert spec.name == name


def test_presets_have_the_abundances_of_their_sites() -> None:
    """K is 7, 5 and 19 %, and gale has a DEM."""
    k = {"exomars": 0.07, "mer_spirit": 0.05, "pathfinder": 0.19}
    for name, value in k.items():
        rocks = load_terrain_spec(name).rocks
        assert isinstance(rocks, RockAbundanceSpec)
        assert rocks.k == value
    assert load_terrain_spec("gale").dem is not None


def test_a_terrain_holds_the_numbers_of_its_soils() -> None:
    """A soil given by its name is whole in the spec, and firm by its kind."""
    crust, drift = load_terrain_spec("exomars").soils
    assert (crust.soil, drift.soil) == (load_soil("duricrust"), load_soil("mars_regolith"))
    assert (crust.firm, drift.firm) == (True, False)


@pytest.mark.parametrize(("mapping", "sentence"), BAD)
def test_bad_values_are_named(mapping: dict[str, object], sentence: str) -> None:
    """Each bad value gives a SpecError that says what is wrong."""
    with pytest.raises(SpecError, match=sentence):
        TerrainSpec.from_mapping(mapping)


def test_a_table_must_be_possible() -> None:
    """A class cannot cover more ground than its largest rocks would, nor overlap another."""
    row = {"diameter_min_m": 0.1, "diameter_max_m": 0.2, "count_per_m2": 1.0}
    table = {"kind": "table", "rows": [{**row, "area_fraction": 0.02}]}
    assert isinstance(TerrainSpec.from_mapping({"rocks": table}).rocks, RockTableSpec)
    with pytest.raises(SpecError, match=r"between 0.007854 and 0.03142"):
        TerrainSpec.from_mapping({"rocks": {**table, "rows": [{**row, "area_fraction": 0.1}]}})
    with pytest.raises(SpecError, match="must not overlap"):
        TerrainSpec.from_mapping({"rocks": {**table, "rows": [row, row]}})


def test_an_unknown_preset_lists_the_presets() -> None:
    """The sentence names every preset."""
    with pytest.raises(UnknownNameError, match="exomars, gale, mer_spirit, pathfinder"):
        load_terrain_spec("venus")
    with pytest.raises(SpecError, match=r"cannot read .*venus\.yaml"):
        load_terrain_spec("venus.yaml")


def test_a_dem_beside_the_yaml_is_found_first(tmp_path: Path) -> None:
    """A relative DEM is taken from the YAML's folder where it is there, else left as it is."""
    shutil.copy(PRESETS / "gale.yaml", tmp_path / "mine.yaml")
    relative = load_terrain_spec(tmp_path / "mine.yaml").dem
    assert relative is not None
    assert relative.path == "mars_dem/mmgis_gale/missionDEM.tif"
    (tmp_path / relative.path).parent.mkdir(parents=True)
    (tmp_path / relative.path).touch()
    beside = load_terrain_spec(tmp_path / "mine.yaml").dem
    assert beside is not None
    assert beside.path == str((tmp_path / relative.path).resolve())


def test_an_absent_data_folder_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The variable decides where data is looked for, and the sentence names it."""
    monkeypatch.setenv("LPET_DATA", str(tmp_path))
    assert data_folder() == tmp_path
    with pytest.raises(DataError, match="LPET_DATA"):
        data_path("wheel")
    monkeypatch.setenv("LPET_DATA", str(tmp_path / "absent"))
    with pytest.raises(DataError, match="LPET_DATA"):
        data_folder()


def test_a_box_is_closed_below_and_open_above() -> None:
    """Neighbouring boxes share no point, and an empty box is refused."""
    box = Box(0.0, 0.0, 2.0, 1.0)
    points = np.array([[0.0, 0.0], [2.0, 0.5], [1.0, 1.0], [1.9, 0.9]])
    assert box.contains(points).tolist() == [True, False, False, True]
    assert box.area_m2 == 2.0
    assert box.grown(1.0) == Box(-1.0, -1.0, 3.0, 2.0)
    with pytest.raises(SpecError, match="must exceed"):
        Box(1.0, 0.0, 1.0, 1.0)


def test_a_soil_of_your_own_is_found_beside_the_terrain_that_names_it(tmp_path: Path) -> None:
    """The file lies beside the terrain's, wherever the command is run."""
    mine = load_soil("duricrust").model_copy(update={"name": "mine"})
    mine.to_yaml(tmp_path / "mine.yaml")
    (tmp_path / "ground.yaml").write_text("soils:\n  - {name: all of it, soil: mine.yaml}\n")
    assert load_terrain_spec(tmp_path / "ground.yaml").soils[0].soil == mine


def test_a_file_that_is_called_as_a_soil_of_the_library_is_not_taken(tmp_path: Path) -> None:
    """The library goes first wherever a soil is named."""
    load_soil("duricrust").to_yaml(tmp_path / "bedrock")
    (tmp_path / "ground.yaml").write_text("soils:\n  - {name: all of it, soil: bedrock}\n")
    assert load_terrain_spec(tmp_path / "ground.yaml").soils[0].soil == load_soil("bedrock")
