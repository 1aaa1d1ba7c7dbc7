"""What the documentation says is run: tutorials as they stand, commands as far as they go."""

from __future__ import annotations

import contextlib
import csv
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml
from joblib.externals.loky import get_reusable_executor

from lpet_sim.cli import app, main
from lpet_sim.recording.reader import read_estimates, read_recording
from lpet_sim.sweep.sweep_store import read_table
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.tradeoff.recommend import RecommendedSensor

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
TUTORIALS = (
    "first_traverse.md",
    "reading_a_recording.md",
    "own_estimator.md",
    "choosing_a_sensor.md",
)
"""Pages that are run from top to bottom, each one where the first has left its recording."""
WRITTEN = {"yaml", "xml"}
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
_NAMED = re.compile(r"into `([\w.]+)`:\s*\Z")
_EXIT = re.compile(r"# exit code (\d)\s*\Z")
_COMMAND = re.compile(r"^\s*(?:\$ )?((?:lpet |python -m scenarios\.)[^\n]*)$", re.MULTILINE)


@pytest.fixture(autouse=True, scope="module")
def workers_of_its_own() -> Iterator[None]:
    """Let sweeps start their workers in the folder of a page, and leave none behind there."""
    get_reusable_executor().shutdown(wait=True)
    yield
    get_reusable_executor().shutdown(wait=True)


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder in which the first tutorial has been run."""
    folder = tmp_path_factory.mktemp("first")
    names = run_page(TUTORIALS[0], folder)
    assert names == {}
    return folder


@pytest.fixture
def folder(first: Path, tmp_path: Path) -> Path:
    """Give a folder of its own with what the first tutorial leaves, and the worked examples."""
    shutil.copytree(first, tmp_path, dirs_exist_ok=True)
    shutil.copy(DOCS / "examples" / "straight.c", tmp_path)
    return tmp_path


def test_the_first_traverse_leaves_a_recording(first: Path) -> None:
    """With estimates in it."""
    assert set(read_estimates(first / "first.rrd")) >= {"dead_reckoning", "frame_to_frame", "slam"}


def test_the_recording_is_read_as_the_page_reads_it(folder: Path) -> None:
    """The sightings of the first image are there."""
    names = run_page(TUTORIALS[1], folder)
    assert names["first"].shape[1] == 3


def test_an_estimator_written_from_the_page_runs_beside_our_own(folder: Path) -> None:
    """In Python and in C: rows of one sweep, the same to within the text of a TUM file."""
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler 'cc'")
    run_page(TUTORIALS[2], folder)
    rows = {str(row["variant"]): row for row in read_table(folder / "both" / "rows.parquet")[0]}
    ours, written, in_c = (
        rows[name] for name in ("dead_reckoning", "straight-scale1.0", "straight_c")
    )
    assert written["failure"] == in_c["failure"]
    assert written["end_error_m"] == pytest.approx(in_c["end_error_m"], rel=1e-6)
    assert written["end_error_m"] > 2 * ours["end_error_m"]


def test_a_sensor_is_chosen_as_the_page_chooses_it(folder: Path) -> None:
    """Survivors are simulated, and the recommended sensor is carried by a drive."""
    names = run_page(TUTORIALS[3], folder)
    simulated = [row for row in read_candidates(folder / "cameras") if int(row["runs"]) > 0]
    assert len(names["candidates"]) == 48
    assert len(simulated) == 4
    predicted = RecommendedSensor.from_yaml(folder / "predicted" / "recommended.yaml").candidate
    assert predicted.image_interval_m == 0.5
    assert names["picked"].candidate.image_interval_m == 0.1
    assert names["picked"].candidate.resolution_px == 1024
    declared = read_recording(folder / "second.rrd").measurements.calibration
    assert declared.stereo is not None
    assert declared.stereo.width_px == names["picked"].candidate.resolution_px


def test_the_code_of_the_readme_runs(first: Path, tmp_path: Path) -> None:
    """Its YAML is a traverse's, its Python runs beside a recording."""
    shutil.copy(first / "first.rrd", tmp_path / "run.rrd")
    blocks = _BLOCK.findall((ROOT / "README.md").read_text())
    drives = [yaml.safe_load(code) for kind, code in blocks if kind == "yaml"]
    assert [TraverseSpec.from_mapping(drive).drive.waypoints_m[-1] for drive in drives] == [
        (20.0, 5.0),
        (20.0, 5.0),
    ]
    names: dict[str, Any] = {}
    with contextlib.chdir(tmp_path):
        for kind, code in blocks:
            if kind == "python":
                exec(compile(code, "README", "exec"), names)
    assert names["bounded"].estimate(names["recording"].measurements).trajectory.t_ns.size > 3


def read_candidates(folder: Path) -> list[dict[str, str]]:
    """Read the rows of a trade-off's candidates."""
    with (folder / "candidates.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def run_page(page: str, folder: Path) -> dict[str, Any]:
    """Run every block: YAML and modules into the file that is named, commands, and Python."""
    names: dict[str, Any] = {}
    text = (DOCS / page).read_text()
    for block in _BLOCK.finditer(text):
        named = _NAMED.search(text[: block.start()])
        _run_block(block[1], block[2], None if named is None else folder / named[1], names, folder)
    return names


def _run_block(
    kind: str, code: str, file: Path | None, names: dict[str, Any], folder: Path
) -> None:
    if file is not None:
        file.write_text(code)
        return
    assert kind not in WRITTEN, f"no file is named for:\n{code}"
    with contextlib.chdir(folder):
        if kind == "sh":
            for line in code.splitlines():
                expected = _EXIT.search(line)
                ended = _run(shlex.split(line, comments=True))
                assert ended == (int(expected[1]) if expected else 0), line
        elif kind == "python":
            exec(compile(code, "page", "exec"), names)


def _run(words: list[str]) -> int:
    """Run a command, ours in this process, and give its exit code."""
    if words[0] != "lpet":
        return subprocess.run(words, check=False).returncode
    with pytest.MonkeyPatch.context() as patch, pytest.raises(SystemExit) as stop:
        patch.setattr(sys, "argv", words)
        main()
    assert isinstance(stop.value.code, int)
    return stop.value.code


def _command(words: list[str]) -> Any:
    """Find a command and give its options, with what is left of the words."""
    found: Any = typer.main.get_command(app)
    rest = words[1:]
    while getattr(found, "commands", None):
        assert rest and rest[0] in found.commands, f"there is no '{' '.join(words)}'"
        found, rest = found.commands[rest[0]], rest[1:]
    return found, rest


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda page: page.name)
def test_commands_on_a_page_are_there(page: Path) -> None:
    """Each names a command, options that it has, and files of the repository that are there."""
    for line in _COMMAND.findall(page.read_text()):
        words = shlex.split(line.split("#")[0].replace("|", " "))
        if words[0] == "python":
            module = words[2].rstrip(".,;:`")
            assert (ROOT / f"{module.replace('.', '/')}.py").exists(), line
            continue
        if len(words) < 2 or not re.fullmatch(r"[a-z-]+", words[1]):
            continue
        found, rest = _command([word for word in words if word != "--help"])
        options = {name for p in found.params for name in [*p.opts, *p.secondary_opts]}
        asked = [w.split("=")[0].strip("[]") for w in rest if w.strip("[").startswith("--")]
        assert [name for name in asked if name not in options] == [], line
        for word in rest:
            if word.startswith(("scenarios/", "models/")):
                assert (ROOT / word).exists(), line


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """All pages are in its navigation, no link leads nowhere, and nothing is asked from outside."""
    pytest.importorskip("mkdocs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(tmp_path)]
    told = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=told, check=False)
    assert done.returncode == 0, done.stderr
    pages = list(tmp_path.rglob("*.html"))
    assert {"index.html", "cli.html", "lpet_sim.plugins.html"} <= {page.name for page in pages}
    asked = re.compile(r'(?:src|href)="(https?://[^"]+\.(?:js|css|woff2?|png|jpg))"')
    assert [found for page in pages for found in asked.findall(page.read_text())] == []
