"""The scenarios run as they stand, and the README says what the command understands."""

from __future__ import annotations

import csv
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import typer.main
import yaml

from estimators import ESTIMATORS, build_estimator
from lpet_sim import cli
from lpet_sim.datasets import data_folder, data_path
from lpet_sim.errors import LpetError
from lpet_sim.recording.reader import read_recording
from lpet_sim.study.spec import StudySpec
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.sweep_plan import expand
from lpet_sim.sweep.sweep_spec import SweepSpec
from lpet_sim.sweep.traverse import TraverseSpec
from tests.command import TINY

ROOT = Path(__file__).parents[1]
SCENARIOS = ROOT / "scenarios"
README = (ROOT / "README.md").read_text()


def run_quick(script: str, folder: Path, *more: str) -> str:
    """Run a scenario in a folder of its own and give what it prints."""
    command = [sys.executable, "-m", f"scenarios.{script.removesuffix('.py')}", "--quick", *more]
    done = subprocess.run(
        command,
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "COLUMNS": "120"},
        timeout=400,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert "Traceback" not in done.stderr
    return done.stdout


def written_by(printed: str) -> list[Path]:
    """Give the files that a scenario says it has written."""
    return [Path(found) for found in re.findall(r"^wrote (\S+)", printed, re.MULTILINE)]


def test_the_first_traverse_ends_in_a_table_and_three_files(tmp_path: Path) -> None:
    """A short drive among rocks is recorded, estimated by every estimator, scored and drawn."""
    printed = run_quick("first_traverse.py", tmp_path, "--out", str(tmp_path / "first"))
    assert all(word in printed for word in ("frame_to_frame", "verdict", "forced_slip"))
    run, *pictures = written_by(printed)
    assert len(pictures) == 2
    assert all(path.stat().st_size > 10_000 for path in pictures)
    recording = read_recording(run)
    assert recording.truth is not None
    assert recording.truth.events[-1].kind == "goal"


def test_a_kilometre_begins(tmp_path: Path) -> None:
    """The first metres of the kilometre are driven, with their memory and time."""
    printed = run_quick("kilometre.py", tmp_path, "--out", str(tmp_path / "km"))
    assert "times real time" in printed and "MB" in printed
    recording = read_recording(written_by(printed)[0])
    assert recording.truth is not None
    assert recording.truth.trajectory.arc_length_m[-1] > 9.0


def test_real_stereo_is_localized(tmp_path: Path) -> None:
    """A hundred real pairs go through the same front end and estimator."""
    try:
        data_folder()
    except LpetError as error:
        pytest.skip(str(error))
    printed = run_quick("real_stereo.py", tmp_path, "--out", str(tmp_path / "real"))
    assert "frame_to_frame, seed 0" in printed
    assert "from image 20" in printed


def test_real_data_are_scored_and_drawn(tmp_path: Path) -> None:
    """On 300 images of Starry Night full SLAM is nearer to the truth than what it starts from."""
    try:
        data_path("stereo/starry_night")
    except LpetError as error:
        pytest.skip(f"the Starry Night data set is not here: {error}")
    printed = run_quick("real_data.py", tmp_path, "--out", str(tmp_path / "real"))
    table, summary, picture = written_by(printed)
    rows = {row["variant"]: row for row in csv.DictReader(table.read_text().splitlines())}
    assert list(rows)[:2] == ["odometry", "frame_to_frame, at least 8"] and len(rows) == 4
    kept_all = next(row for name, row in rows.items() if name.startswith("m9999-n9999"))
    assert float(kept_all["rmse_m"]) < 0.5 * float(rows["odometry"]["rmse_m"])
    assert "1 landmark in the 7.9 s of standstill" in summary.read_text()
    assert picture.stat().st_size > 10_000


def test_the_error_on_real_images_is_predicted(tmp_path: Path) -> None:
    """Noise alone predicts far too little; with the camera's errors as measured it comes out."""
    printed = run_quick("kitti_prediction.py", tmp_path, "--out", str(tmp_path / "kitti"))
    if "skipped" in printed:
        pytest.skip(printed)
    table, _ = written_by(printed)
    rows = list(csv.DictReader(table.read_text().splitlines()))
    obtained, noise = float(rows[0]["end_percent"]), float(rows[1]["end_percent"])
    whole = float(next(r for r in rows if "its mounting" in r["sightings"])["end_percent"])
    assert noise < 0.1 * obtained
    assert 0.75 < whole / obtained < 1.33


def test_the_experiments_fill_their_tables(tmp_path: Path) -> None:
    """Two short drives give a row for each seed, arm and estimator."""
    printed = run_quick("experiments.py", tmp_path, "--out", str(tmp_path), "--workers", "1")
    table, summary = written_by(printed)
    rows = list(csv.DictReader(table.read_text().splitlines()))
    fed = [name for name in ESTIMATORS if "odometry" not in build_estimator(name).needs]
    assert len(rows) == 2 * (len(fed) + 1)
    assert {row["arm"] for row in rows} == {"true calibration", "wrong calibration"}
    assert "forced_slip" in summary.read_text()


def test_the_fitted_soil_is_set_beside_what_was_measured(tmp_path: Path) -> None:
    """The table has every measured slope, and says which the fitted soil cannot climb."""
    printed = run_quick("grc1_fit.py", tmp_path, "--out", str(tmp_path / "fit"))
    rows = list(csv.DictReader(written_by(printed)[0].read_text().splitlines()))
    assert len(rows) == 7
    assert [row["slip_fitted_percent"] for row in rows[5:]] == ["cannot climb"] * 2


def test_soils_on_the_tilt_bed_give_slip_drift_and_the_table_again(tmp_path: Path) -> None:
    """Steeper is more slip and more drift, and the measured table comes back."""
    printed = run_quick("soil_slopes.py", tmp_path, "--out", str(tmp_path), "--workers", "1")
    assert "| yes |" in printed and "| no |" not in printed
    found = re.search(r"Greatest difference: ([0-9.]+) points", printed)
    assert found is not None and float(found[1]) < 1.0


def test_rough_ground_is_driven_measured_and_drawn(tmp_path: Path) -> None:
    """Every part has its row, energy is lost and never made, and the parked rover stays."""
    printed = run_quick("rough_ground.py", tmp_path, "--out", str(tmp_path), "--workers", "1")
    table, _, parked, picture = written_by(printed)
    assert [row["dt_ms"] for row in csv.DictReader(table.read_text().splitlines())] == ["5", "2.5"]
    least = re.search(r"^\| rocks \| (-?[0-9.]+) \| [0-9.]+ \|$", printed, re.MULTILINE)
    assert least is not None and float(least[1]) > 0
    moved = re.findall(r"\| (?:up|down|across) \| ([0-9.]+) \|", parked.read_text())
    assert len(moved) == 3 and all(float(mm) < 0.1 for mm in moved)
    assert picture.stat().st_size > 10_000


def test_a_hundred_metres_begin_and_every_estimator_has_its_line(tmp_path: Path) -> None:
    """The filter is consistent over its first metres, and one told half the noise is not."""
    printed = run_quick("hundred_metres.py", tmp_path, "--out", str(tmp_path), "--workers", "1")
    table, summary = written_by(printed)
    rows = list(csv.DictReader(table.read_text().splitlines()))
    assert len({row["method"] for row in rows}) == 14 and len(rows) == 3 * 14
    assert all(row["failure"] == "" for row in rows)
    lines = [line.split(" | ") for line in summary.read_text().splitlines() if "SLAM" in line]
    pose = {cells[0].removeprefix("| "): cells[9] for cells in lines}
    assert pose["SLAM M = 10, right-invariant"].startswith("**")
    assert not pose["SLAM M = 10, told half the noise"].startswith("**")


def test_the_papers_experiment_runs_on_data_sets_driven_for_it(tmp_path: Path) -> None:
    """A short drive gives tables and pictures; multiframe is far better than odometry."""
    few = ("--count", "1", "--workers", "1")
    driven = run_quick("paper_data_sets.py", tmp_path, *few, "--out", str(tmp_path / "sets"))
    assert re.findall(r"data set (\d): .* m, goal$", driven, re.MULTILINE) == ["2"]
    where = ("--data-sets", str(tmp_path / "sets"), "--work", str(tmp_path / "work"))
    written = written_by(run_quick("paper_experiment.py", tmp_path, *few, *where))
    assert sum(path.suffix == ".png" for path in written) == 7
    with next(path for path in written if path.name == "paper_variants.csv").open() as file:
        rows = {row["variant"]: row for row in csv.DictReader(file)}
    best = float(rows["m10-n9999-coupled-observable-standard"]["worst median [%]"])
    assert best < 0.1 * float(rows["odometry"]["worst median [%]"])
    bands = run_quick("paper_bands.py", tmp_path, *few, *where[:2], "--out", str(tmp_path / "out"))
    with written_by(bands)[1].open() as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 5
    assert all(float(line["at the end [cm]"]) < 3 for line in lines)


@pytest.mark.parametrize("path", sorted(SCENARIOS.glob("*.yaml")), ids=lambda path: path.stem)
def test_a_scenario_file_is_a_traverse_or_a_study(path: Path) -> None:
    """It loads, is called what its file is called, and goes to YAML and back unchanged."""
    kind = StudySpec if "reach" in yaml.safe_load(path.read_text()) else TraverseSpec
    spec = kind.from_yaml(path)
    assert spec.name == path.stem
    assert kind.from_mapping(yaml.safe_load(yaml.safe_dump(spec.to_mapping()))) == spec


@pytest.mark.parametrize(
    "path", sorted(SCENARIOS.glob("sweeps/*.yaml")), ids=lambda path: path.stem
)
def test_a_sweep_file_is_a_sweep(path: Path) -> None:
    """It loads, is called what its file is called, and all its variants can be built."""
    spec = SweepSpec.from_yaml(path)
    assert spec.name == path.stem
    assert len(expand(spec.variants)) >= len(spec.variants)


def test_every_scenario_is_run_by_a_test() -> None:
    """A new script cannot be forgotten."""
    tests = "".join(path.read_text() for path in Path(__file__).parent.rglob("test_*.py"))
    scripts = {path.name for path in SCENARIOS.glob("*.py")} - {"__init__.py"}
    assert [script for script in sorted(scripts) if f'run_quick("{script}"' not in tests] == []


def blocks(language: str) -> list[str]:
    """Give the README's code blocks of a language."""
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.MULTILINE | re.DOTALL)


def parse_lpet(words: list[str]) -> None:
    """Parse a command line of ``lpet`` without running it; it raises what the command would."""
    command = typer.main.get_command(cli.app)
    while hasattr(command, "commands"):
        name, *words = words
        command = command.commands[name]
    command.make_context("lpet", words)


def test_the_readme_speaks_the_language_of_the_command() -> None:
    """Each line parses: lpet with its options, make with its targets, scripts that are there."""
    lines = "\n".join(blocks("sh")).splitlines()
    words_of = [words for line in lines if (words := shlex.split(line, comments=True))]
    assert sum(words[0] == "lpet" for words in words_of) >= 8
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    for first, *words in words_of:
        if Path(first).name == "lpet":
            parse_lpet(words)
        elif first == "make":
            assert set(words) <= targets
        else:
            assert first in ("git", "cd") or Path(first).name.startswith("python"), first
    assert set(re.findall(r"`make (\w+)`", README)) <= targets


def test_a_line_that_is_wrong_would_be_seen() -> None:
    """The parser used above refuses an option and a command that are not there."""
    with pytest.raises(Exception, match="No such option"):
        parse_lpet(["evaluate", "run.rrd", "--strict"])
    with pytest.raises(KeyError, match="fly"):
        parse_lpet(["fly"])


def test_the_readme_names_files_and_estimators_that_are_there() -> None:
    """Paths in code marks exist, the table has every estimator, the YAML is a traverse."""
    named = set(re.findall(r"`((?:scenarios|lpet_sim|tests|models|docs)/[\w./-]*)`", README))
    assert named
    assert sorted(path for path in named if not (ROOT / path).exists()) == []
    assert [name for name in ESTIMATORS if f"`{name}`" not in README] == []
    traverses = [yaml.safe_load(text) for text in blocks("yaml")]
    assert traverses
    for traverse in traverses:
        TraverseSpec.from_mapping(traverse)


def test_the_readmes_python_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a recording of the name that it uses."""
    monkeypatch.chdir(tmp_path)
    simulate(TraverseSpec.from_mapping(yaml.safe_load(TINY)), 1, tmp_path / "run.rrd")
    assert blocks("python")
    for text in blocks("python"):
        exec(compile(text, "README.md", "exec"), {})
