"""A whole small study as a user runs it: from requirement to verdict, killed, changed, replaced."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from lpet_sim.planning.reach_spec import terrain_seed
from lpet_sim.recording.reader import read_estimates, read_recording
from lpet_sim.study.chain import DRIVES, REACH, RUNS, SENSOR, WAYS
from lpet_sim.study.stages import STAMPS, digest
from lpet_sim.sweep.sweep_run import TABLE
from lpet_sim.sweep.sweep_store import read_table
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.terrain import build_terrain
from tests.browser import look, needs_chromium
from tests.command import Ended
from tests.sweep.tiny_recordings import without_timing

TINY: dict[str, Any] = {
    "name": "tiny",
    "reachable_min": 0.1,
    "requirement": {"start_m": 2.0},
    "reach": {
        "terrain": "exomars",
        "size_m": 30.0,
        "goal_m": [0.0, 0.0],
        "goal_radius_m": 1.0,
        "starts": 6,
        "start_distances_m": [6.0, 8.0],
        "search": {"iterations": 2000},
    },
    "drives": {
        "worst": 1,
        "random": 1,
        "speed_mps": 0.1,
        "standstill_s": 4.0,
        "forced_slip_s": 2.0,
    },
    "sensors": {
        "space": {"depression_rad": [0.2, 0.5], "image_interval_m": 0.2},
        "sampling": {"kind": "grid"},
        "survivors": 1,
        "draws": 1,
    },
    "algorithms": [{"estimator": "frame_to_frame"}, {"estimator": "slam", "name": "slam"}],
    "draws": 1,
}


@pytest.fixture(scope="module")
def studied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Ended]:
    """Run the study once."""
    folder = tmp_path_factory.mktemp("study")
    return folder, _study(folder, TINY)


def _command(folder: Path, mapping: dict[str, Any], *words: str) -> list[str]:
    (folder / "study.yaml").write_text(yaml.safe_dump(mapping))
    run = [sys.executable, "-c", "from lpet_sim.cli import main; main()", "study"]
    return [*run, str(folder / "study.yaml"), "--out", str(folder / "out"), *words]


def _study(folder: Path, mapping: dict[str, Any], *words: str) -> Ended:
    done = subprocess.run(
        _command(folder, mapping, *words),
        capture_output=True,
        text=True,
        env=os.environ | {"COLUMNS": "140"},
        check=False,
    )
    return Ended(done.returncode, done.stdout, done.stderr)


def states(ended: Ended) -> dict[str, str]:
    """Read what became of each stage."""
    lines = [
        line for line in ended.out.splitlines() if line.endswith(("(made)", "(kept)", "(yours)"))
    ]
    return {line.split(":")[0]: line.rsplit("(", 1)[1][:-1] for line in lines}


def test_a_study_ends_in_a_verdict(studied: tuple[Path, Ended]) -> None:
    """On the terminal, as JSON, and as a page; too few runs to show anything say so."""
    folder, ended = studied
    assert ended.code == 0, ended.err
    assert set(states(ended).values()) == {"made"} and len(states(ended)) == 5
    told = json.loads((folder / "out" / "verdict.json").read_text())
    assert told["verdict"] == "NOT DECIDED"
    assert "NOT DECIDED: The goal is reachable from" in ended.out
    assert re.search(r"resolution_px +│ +1024 ", ended.out)
    assert {one["variant"] for one in told["algorithms"]} == {"frame_to_frame", "slam"}
    assert all(one["whole"]["claim"]["runs"] == 2 for one in told["algorithms"])
    lines = told["algorithms"][0]["by_line"]
    assert set(lines) >= {"pass_position_throughout", "pass_yaw_end"}


def _kill_in(stage: str, folder: Path) -> None:
    """Start the study and kill it, workers and all, as soon as a stage is under way."""
    stamp, end_s = folder / "out" / STAMPS / f"{stage}.json", time.monotonic() + 300.0
    run = subprocess.Popen(
        _command(folder, TINY),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        process_group=0,
    )
    while not stamp.exists():
        assert run.poll() is None and time.monotonic() < end_s, f"{stage} was not begun"
        time.sleep(0.01)
    os.killpg(run.pid, signal.SIGKILL)
    assert run.wait() == -signal.SIGKILL
    assert json.loads(stamp.read_text())["product"] is None


def test_a_study_killed_in_every_stage_ends_as_an_undisturbed_one(
    studied: tuple[Path, Ended], tmp_path: Path
) -> None:
    """The same command after each kill: the same sensor, rows and verdict."""
    for stage in (REACH, WAYS, DRIVES, SENSOR, RUNS):
        _kill_in(stage, tmp_path)
    ended = _study(tmp_path, TINY)
    assert ended.code == 0, ended.err
    assert [name for name, state in states(ended).items() if state == "made"] == ["runs"]
    outs = [folder / "out" for folder in (studied[0], tmp_path)]
    assert len({digest(out / "sensor.yaml") for out in outs}) == 1
    rows = [read_table(out / "algorithms" / TABLE)[0] for out in outs]
    for row in [*rows[0], *rows[1]]:
        del row["key"]  # Names the bytes of the recording, which hold when it was written.
    assert without_timing(rows[0]) == without_timing(rows[1])
    assert len(rows[0]) == 4
    told = [json.loads((out / "verdict.json").read_text()) for out in outs]
    assert told[0]["verdict"] == told[1]["verdict"]


def test_the_worst_runs_are_kept_as_recordings(studied: tuple[Path, Ended]) -> None:
    """Each holds what was measured and what was estimated."""
    folder, _ = studied
    told = json.loads((folder / "out" / "verdict.json").read_text())
    kept = {path.stem: path for path in (folder / "out" / "worst_runs").glob("*.rrd")}
    assert set(kept) == {run for run, _ in told["worst_runs"]}
    run = next(iter(kept.values()))
    assert read_recording(run).measurements.sightings is not None
    assert len(read_estimates(run)) == 1


@needs_chromium
def test_the_page_of_a_study_works_in_a_browser(
    studied: tuple[Path, Ended], tmp_path_factory: pytest.TempPathFactory
) -> None:
    """No errors, nothing asked for, all pictures there, and no sideways scrolling."""
    folder, _ = studied
    for width_px in (390, 1400):
        seen = look(folder / "out" / "report.html", width_px, tmp_path_factory.mktemp("browser"))
        assert seen.wrong == [] and seen.asked == []
        assert seen.images >= 6 and seen.broken == 0
        assert seen.wide <= width_px and seen.narrow == 0
        assert [c["text"] for c in seen.once] != [c["text"] for c in seen.twice]


def test_a_study_goes_on_makes_what_changed_and_takes_what_the_user_brings(
    studied: tuple[Path, Ended],
) -> None:
    """Nothing is made twice; other algorithms rerun their runs alone; an own sensor is used."""
    folder, _ = studied
    again = _study(folder, TINY)
    assert set(states(again).values()) == {"kept"}
    other = _study(folder, TINY | {"algorithms": [{"estimator": "slam", "name": "slam"}]})
    assert [name for name, state in states(other).items() if state == "made"] == ["runs"]
    sensor = folder / "out" / "sensor.yaml"
    mine = yaml.safe_load(sensor.read_text())
    mine["landmarks"]["noise"] |= {"sigma_left_px": 2.0, "sigma_right_px": 2.0, "sigma_v_px": 2.0}
    sensor.write_text(yaml.safe_dump(mine))
    before = json.loads((folder / "out" / "verdict.json").read_text())
    replaced = _study(folder, TINY | {"algorithms": [{"estimator": "slam", "name": "slam"}]})
    assert states(replaced)["sensor"] == "yours" and states(replaced)["runs"] == "made"
    after = json.loads((folder / "out" / "verdict.json").read_text())
    worse = [told["algorithms"][0]["median_percent"] for told in (before, after)]
    assert worse[1] > worse[0]


def test_an_impossible_requirement_fails_honestly(studied: tuple[Path, Ended]) -> None:
    """A micrometre in a metre: the verdict is FAIL and, where asked for, the exit code 1."""
    folder, _ = studied
    strict = TINY | {
        "requirement": {"start_m": 2.0, "position_ratio": 1e-6},
        "algorithms": [{"estimator": "frame_to_frame"}],
        "draws": 2,
    }
    ended = _study(folder, strict, "--check")
    assert ended.code == 1
    assert "FAIL: " in ended.out


def test_a_goal_that_no_start_reaches_is_an_honest_fail(tmp_path: Path) -> None:
    """Nothing is driven, and the page says so."""
    flat = TINY["reach"] | {"mobility": {"max_slope_rad": 1e-4, "max_roll_rad": 1e-4}}
    ended = _study(tmp_path, TINY | {"reach": flat}, "--check")
    assert ended.code == 1
    assert "FAIL: The goal is reachable from 0 of 6 starts" in ended.out
    assert states(ended) == {"reachability": "made"}
    assert (tmp_path / "out" / "report.html").exists()


def test_a_goal_in_a_rock_and_an_empty_space_are_told_in_a_sentence(tmp_path: Path) -> None:
    """Exit code 2, and no verdict."""
    empty = TINY | {"sensors": {"space": {"baseline_m": []}}}
    ended = _study(tmp_path, empty)
    assert ended.code == 2 and "is empty" in ended.err
    unknown = _study(tmp_path, TINY | {"algorithms": [{"estimator": "magic"}]})
    assert unknown.code == 2 and "frame_to_frame" in unknown.err
    assert not (tmp_path / "out").exists()
    terrain = build_terrain(load_terrain_spec("exomars"), terrain_seed(0, 0))
    rocks = terrain.rocks(Box.around(0.0, 0.0, 8.0), 0.6)
    x, y, _ = rocks.p_world_rock[int(np.argmax(rocks.height_m))]
    inside = TINY["reach"] | {"goal_m": [float(x), float(y)], "goal_radius_m": 0.0}
    ended = _study(tmp_path, TINY | {"reach": inside})
    assert ended.code == 2 and "lies in or too close to a rock" in ended.err
    assert not (tmp_path / "out" / "verdict.json").exists()
