"""`lpet rig`: what a user types, what is written, and one sentence for what cannot be."""

import csv
from pathlib import Path

import pytest

from lpet_sim.soil.load import LIBRARY, soil_names
from tests.command import Ended, Lpet, runner


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run the command in this process."""
    return runner(monkeypatch, capsys)


def assert_refused(ended: Ended, *words: str) -> None:
    """Hold a command to have refused its input in one sentence that has the given words."""
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1
    assert [word for word in words if word not in ended.err] == [], ended.err


def test_the_slope_rig_writes_its_table_and_its_picture(lpet: Lpet, tmp_path: Path) -> None:
    """Two slopes in two processes; the tested wheel is named, and its law's curve comes out."""
    out = tmp_path / "rig"
    ended = lpet(
        *("rig", "slope", "--soil", "grc1_loose", "--out", out),
        *("--slopes", "0,10.03", "--speed", "0.2", "--workers", "2"),
    )
    assert ended.code == 0, ended.err
    assert "mgru3 (the soil's own" in ended.out
    assert "MGRU3" in ended.out
    assert sorted(path.name for path in out.iterdir()) == ["slope.csv", "slope.png"]
    with (out / "slope.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["heading"] for row in rows] == ["up"] * 2 + ["down"] * 2 + ["across"] * 2
    assert float(rows[1]["slip_percent"]) == pytest.approx(10.4, abs=1.0)


@pytest.mark.parametrize("soil", ["mars_sand", "grc1_loose", "duricrust"])
def test_the_wheel_rig_writes_its_table_and_its_picture(
    lpet: Lpet, tmp_path: Path, soil: str
) -> None:
    """One soil of each kind, with the rover's wheel."""
    ended = lpet("rig", "wheel", "--soil", soil, "--wheel", "rover", "--out", tmp_path)
    assert ended.code == 0, ended.err
    assert "wheel: that of exomars" in ended.out
    assert sorted(path.name for path in tmp_path.iterdir()) == ["wheel.csv", "wheel.png"]


def test_a_missing_or_unknown_soil_lists_those_that_there_are(lpet: Lpet) -> None:
    """Both rigs say the names."""
    for rig in ("slope", "wheel"):
        assert_refused(lpet("rig", rig), "--soil is missing", *soil_names())
        assert_refused(lpet("rig", rig, "--soil", "cheese"), "'cheese'", *soil_names())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--slopes", "0,steep"), ("--slopes", "0,10,20")),
        (("--slopes", "60"), ("--slopes 60", "from 0 to 45 degrees")),
        (("--slopes", "nan"), ("--slopes nan", "from 0 to 45 degrees")),
        (("--speed", "0"), ("speed_mps", "greater than 0")),
        (("--dt", "0.5"), ("physics_dt_s", "0.01")),
        (("--rover", "sojourner"), ("sojourner", "exomars")),
        (("--wheel", "round"), ("unknown wheel 'round'", "mgru3", "rover")),
        (("--workers", "0"), ("workers",)),
    ],
)
def test_bad_input_is_refused_in_one_sentence(
    lpet: Lpet, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    """The sentence names what was wrong or what would be right."""
    ended = lpet("rig", "slope", "--soil", "grc1_loose", *options)
    assert ended.code == 2
    assert "Traceback" not in ended.err
    assert [word for word in words if word not in ended.err] == [], ended.err


def test_a_place_that_cannot_be_written_is_refused_before_any_drive(
    lpet: Lpet, tmp_path: Path
) -> None:
    """A file in place of the folder."""
    (tmp_path / "taken").write_text("")
    ended = lpet("rig", "slope", "--soil", "grc1_loose", "--out", tmp_path / "taken")
    assert_refused(ended, "cannot make the folder")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--slip-angle", "80"), ("--slip-angle 80", "below 80 degrees")),
        (("--slip-angle", "-5"), ("--slip-angle -5", "0 or more")),
        (("--rover", "nope"), ("nope", "exomars")),
        (("--out", "{taken}"), ("cannot make the folder",)),
    ],
)
def test_the_wheel_rig_refuses_bad_input_before_it_prints_anything(
    lpet: Lpet, tmp_path: Path, options: tuple[str, ...], words: tuple[str, ...]
) -> None:
    """The soil brings its own wheel, and the rover's name is checked all the same."""
    taken = tmp_path / "taken"
    taken.write_text("")
    typed = [text.format(taken=taken) for text in options]
    ended = lpet("rig", "wheel", "--soil", "grc1_loose", "--out", tmp_path / "rig", *typed)
    assert_refused(ended, *words)
    assert ended.out == ""


def test_a_soil_that_names_no_wheel_there_is_is_itself_to_blame(lpet: Lpet, tmp_path: Path) -> None:
    """The user gave no wheel; the sentence names the soil and the key in its file."""
    text = (LIBRARY / "duricrust.yaml").read_text()
    (tmp_path / "mine.yaml").write_text(f"{text}\nmeasured_with: nosuch\n")
    ended = lpet("rig", "wheel", "--soil", tmp_path / "mine.yaml", "--out", tmp_path)
    assert_refused(ended, "duricrust", "measured_with", "'nosuch'", "mgru3")


def test_the_help_keeps_the_units(lpet: Lpet) -> None:
    """Units stand in brackets, which a formatter of the help may take for its own marks."""
    ended = lpet("rig", "slope", "--help")
    assert [unit for unit in ("[m/s]", "[s]", "[deg]") if unit not in ended.out] == []
    assert "[N]" in lpet("rig", "wheel", "--help").out
    assert "[m]" in lpet("terrain", "--help").out


def test_the_library_of_soils_can_be_listed(lpet: Lpet) -> None:
    """Every name with its kind."""
    ended = lpet("rig", "soils")
    assert ended.code == 0
    assert [name for name in soil_names() if name not in ended.out] == []
