"""Soils, wheels and published curves: what the library holds, and the sentences for bad ones."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from pydantic import TypeAdapter

from lpet_sim.errors import SpecError, UnknownNameError
from lpet_sim.soil.load import load_soil, load_wheel, published_curves, soil_names, wheel_names
from lpet_sim.soil.published import PublishedCurve
from lpet_sim.soil.spec import FirmSoilSpec, MeasuredSoilSpec, MechanicalSoilSpec, SoilSpec

TABLE = load_soil("grc1_loose").to_mapping()
SAND = load_soil("mars_sand").to_mapping()
ROCK = load_soil("rock").to_mapping()

BAD_TABLE: list[tuple[dict[str, object], str]] = [
    ({"slip": [0.1, 0.2]}, "must have the same length"),
    ({"slope_rad": [0.1, 0.1], "slip": [0.1, 0.2]}, "slope_rad must increase"),
    ({"slope_rad": [0.1, 0.2], "slip": [0.3, 0.2]}, "slip must not decrease"),
    ({"slope_rad": [0.1, 0.2], "slip": [0.3, 1.0]}, "between 0 and 1"),
    ({"holding_friction_rad": 0.4}, "exceed the steepest slope"),
    ({"rolling_resistance": 0.0}, "rolling_resistance"),
]
BAD_SAND: list[tuple[dict[str, object], str]] = [
    ({"peak_angle": 0.9}, "must be below 1"),
    ({"friction_rad": 30.0}, "friction_rad"),
    ({"pressure": {"kind": "hertz"}}, "'bekker', 'reece', 'modulus'"),
    ({"pressure": {"kind": "reece", "kc": 1.0, "kphi": 2.0, "k": 1.0}}, "keys are kind, kc, kphi"),
    ({"evidence": "hearsay"}, "'measured', 'published', 'fitted' or 'assumed'"),
    ({"source": ""}, "source"),
    ({"sinkage_exponent_slip": -1.0, "sinkage_exponent": 1.0}, "exponent_slip must be above 0"),
    ({"sinkage_exponent_skid": -1.0, "sinkage_exponent": 0.5}, "exponent_skid must be above 0"),
    ({"rear_angle": -0.6, "rear_angle_slip": -0.5}, "must be at least -1"),
]
BAD_ROCK: list[tuple[dict[str, object], str]] = [
    ({"friction": 1.2}, "less than 1"),
    ({"friction": 0.3, "rolling_resistance": 0.4}, "must be below friction"),
    ({"kind": "gravel"}, "'mechanics', 'table', 'firm'"),
]
BAD = [
    *(({**TABLE, **bad}, sentence) for bad, sentence in BAD_TABLE),
    *(({**SAND, **bad}, sentence) for bad, sentence in BAD_SAND),
    *(({**ROCK, **bad}, sentence) for bad, sentence in BAD_ROCK),
]


@pytest.mark.parametrize("name", soil_names())
def test_every_soil_loads_and_says_where_it_is_from(name: str) -> None:
    """Its name is the file's, it is whole after a round trip, and every guess is marked."""
    soil = load_soil(name)
    assert soil.name == name
    assert TypeAdapter(SoilSpec).validate_python(soil.to_mapping()) == soil
    assert hash(soil) == hash(TypeAdapter(SoilSpec).validate_python(soil.to_mapping()))
    assert any(word in soil.source for word in ("[seen]", "[recalled]", "assumption"))
    assert soil.measured_with is None or soil.measured_with in wheel_names()


def test_the_library_holds_the_soils_that_are_promised() -> None:
    """Of each kind, firm ones marked as assumed."""
    soils = {name: load_soil(name) for name in soil_names()}
    mechanical = {name for name, soil in soils.items() if isinstance(soil, MechanicalSoilSpec)}
    assert mechanical >= {"grc1_fitted", "mars_sand", "mars_regolith", "cmu_sand", "lunar_simulant"}
    assert isinstance(soils["grc1_loose"], MeasuredSoilSpec)
    firm = [soil for soil in soils.values() if isinstance(soil, FirmSoilSpec)]
    assert {soil.name for soil in firm} == {"duricrust", "bedrock", "rock"}
    assert {soil.evidence for soil in firm} == {"assumed"}
    assert soils["grc1_fitted"].evidence == "fitted"


@pytest.mark.parametrize("name", wheel_names())
def test_every_wheel_loads(name: str) -> None:
    """With its test, and as a wheel alone."""
    wheel = load_wheel(name)
    assert wheel.name == name
    assert 1.0 < wheel.load_n < 1000.0
    assert "load_n" not in wheel.bare().to_mapping()
    assert wheel.bare().radius_m == wheel.radius_m


def test_published_curves_belong_to_soils_that_exist() -> None:
    """GRC-1 has both years, and the first is the table of the soil."""
    curves = {name: published_curves(name) for name in soil_names()}
    assert all(set(curve.soils) <= set(soil_names()) for of in curves.values() for curve in of)
    first, second = sorted(curves["grc1_loose"], key=lambda curve: curve.label, reverse=True)
    soil = load_soil("grc1_loose")
    assert isinstance(soil, MeasuredSoilSpec)
    assert (first.slope_rad, first.slip) == (soil.slope_rad, soil.slip)
    assert len(second.slip) == 6
    assert curves["bedrock"][0].upper_bound
    assert published_curves("nothing") == ()


@pytest.mark.parametrize(("mapping", "sentence"), BAD)
def test_a_bad_soil_is_answered_by_a_sentence(
    mapping: dict[str, object], sentence: str, tmp_path: Path
) -> None:
    """The sentence names the file and what would be valid."""
    path = tmp_path / "soil.yaml"
    path.write_text(yaml.safe_dump(mapping))
    with pytest.raises(SpecError, match=rf"soil\.yaml.*{sentence}"):
        load_soil(path)


def test_a_soil_without_a_kind_is_told_the_kinds_alone(tmp_path: Path) -> None:
    """Not the words that other keys take."""
    (tmp_path / "soil.yaml").write_text("name: mine\nevidence: fitted\n")
    with pytest.raises(SpecError, match=r"lacks 'kind': one of firm, mechanics, table$"):
        load_soil(tmp_path / "soil.yaml")


def test_an_unknown_name_lists_the_valid_ones() -> None:
    """For soils and for wheels; a file that is not there is another matter."""
    with pytest.raises(UnknownNameError, match="unknown soil 'jelly': choose one of bedrock"):
        load_soil("jelly")
    with pytest.raises(UnknownNameError, match="unknown wheel 'square': choose one of cmu_grouser"):
        load_wheel("square")
    with pytest.raises(SpecError, match=r"cannot read .*jelly\.yaml"):
        load_soil("jelly.yaml")


def test_a_curve_needs_columns_of_one_length() -> None:
    """Else a point would be drawn at another's slope."""
    curve = published_curves("bedrock")[0].to_mapping()
    with pytest.raises(SpecError, match="must have the same length"):
        PublishedCurve.from_mapping({**curve, "slip": [0.1, 0.2]})
