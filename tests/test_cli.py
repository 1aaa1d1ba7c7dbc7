"""The `lpet` command: exit codes, one sentence on bad input, and what it leaves behind."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lpet_sim.recording.reader import read_estimates, read_recording
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec
from tests.command import TINY, Ended, Lpet, runner


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run the command in this process."""
    return runner(monkeypatch, capsys)


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    """Write a traverse of 30 cm without images."""
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY)
    return path


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record the traverse of 30 cm; not to be changed."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "tiny.yaml").write_text(TINY)
    return simulate(TraverseSpec.from_yaml(folder / "tiny.yaml"), 1, folder / "run.rrd").path


@pytest.fixture
def run(recorded: Path, tmp_path: Path) -> Path:
    """Give a copy of the recording that a test may change."""
    return Path(shutil.copy(recorded, tmp_path / "run.rrd"))


def assert_refused(ended: Ended, *words: str) -> None:
    """Hold a command to have refused its input in one sentence that has the given words."""
    assert ended.code == 2
    assert ended.out == ""
    assert len(ended.err.splitlines()) == 1
    assert ended.err.startswith("lpet: ")
    assert "Traceback" not in ended.err
    missing = [word for word in words if word not in ended.err]
    assert missing == [], ended.err


BAD_SPECS = {
    "unknown key": (TINY + "wheels: 6\n", ("unknown key 'wheels'", "terrain", "images")),
    "unknown key deep inside": (
        TINY.replace("settle_s", "settle_seconds"),
        ("unknown key 'drive.settle_seconds'", "settle_s", "waypoints_m"),
    ),
    "value out of range": (
        TINY.replace("speed_mps: 0.1", "speed_mps: 7"),
        ("'drive.speed_mps'", "less than or equal to 0.5", "got 7"),
    ),
    "value of the wrong kind": (
        TINY.replace("speed_mps: 0.1", "speed_mps: fast"),
        ("'drive.speed_mps'", "valid number", "'fast'"),
    ),
    "missing key": (TINY.replace("drive", "# drive"), ("'drive'", "required")),
    "unknown preset": (
        "terrain: moon\n" + TINY.replace("terrain:", "# "),
        ("'moon'", "exomars", "gale", "mer_spirit", "pathfinder"),
    ),
    "unknown kind of rocks": (
        TINY.replace("rocks: null", "rocks: {kind: pebbles}"),
        ("rocks", "abundance", "table"),
    ),
    "not YAML": ("terrain: [", ("not valid YAML",)),
    "an empty file": ("", ("valid",)),
    "a list": ("- 1\n", ("valid",)),
    "rates that do not fit": (
        TINY.replace("settle_s: 1.0", "imu_rate_hz: 33"),
        ("imu_rate_hz 33", "must divide", "100"),
    ),
    "a period that does not fit": (
        TINY.replace("images: null", "images: {period_s: 0.123456}").replace("stereo: null", ""),
        ("images.period_s", "multiple", "0.12"),
    ),
    "a goal that is too far": (
        TINY.replace("route: null", "").replace("[0.3, 0]", "[1.0e+7, 0]"),
        ("too far to plan", "route.cell_m", "waypoints between"),
    ),
    "a model that is not there": (
        TINY + "rover: {model: sojourner}\n",
        ("sojourner", "exomars"),
    ),
}


@pytest.mark.parametrize("case", BAD_SPECS)
def test_a_bad_traverse_is_refused_before_anything_is_written(
    case: str, lpet: Lpet, tmp_path: Path
) -> None:
    """The sentence names the key or value and what is valid; the folder stays as it was."""
    text, words = BAD_SPECS[case]
    spec = tmp_path / "bad.yaml"
    spec.write_text(text)
    assert_refused(lpet("simulate", spec, "--out", tmp_path / "run.rrd"), *words)
    assert list(tmp_path.iterdir()) == [spec]


def test_a_file_that_is_not_there_is_named(lpet: Lpet, tmp_path: Path) -> None:
    """Each command names the missing file and the kind that it wants."""
    gone = tmp_path / "gone"
    assert_refused(lpet("simulate", f"{gone}.yaml"), f"{gone}.yaml", "YAML")
    assert_refused(lpet("terrain", f"{gone}.yaml"), f"{gone}.yaml", "YAML")
    assert_refused(lpet("import", "kitti", gone, tmp_path / "out.rrd"), str(gone))
    assert_refused(lpet("import", "starry-night", gone, tmp_path / "out.rrd"), str(gone))
    for command in ("sight", "estimate", "evaluate", "view"):
        assert_refused(lpet(command, f"{gone}.rrd"), f"{gone}.rrd", "recording")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["sight", "estimate", "evaluate", "view"])
@pytest.mark.parametrize("damage", ["truncated", "garbage", "empty", "a folder"])
def test_a_recording_that_is_none_is_refused(
    command: str, damage: str, lpet: Lpet, run: Path
) -> None:
    """A file that is cut, or was never a recording, is named; it is not touched."""
    whole = run.read_bytes()
    left = {"truncated": whole[: len(whole) // 2], "garbage": b"no rrd" * 1000, "empty": b""}
    run.unlink()
    if damage in left:
        run.write_bytes(left[damage])
    else:
        run.mkdir()
    assert_refused(lpet(command, run), str(run), "recording")
    assert run.is_dir() or run.read_bytes() == left[damage]
    assert list(run.parent.iterdir()) == [run]


def test_an_unknown_name_is_answered_with_the_valid_ones(lpet: Lpet, run: Path) -> None:
    """Estimators and presets are listed."""
    before = run.read_bytes()
    ended = lpet("estimate", run, "--estimator", "oracle")
    assert_refused(ended, "'oracle'", "dead_reckoning", "fused_odometry", "frame_to_frame")
    assert run.read_bytes() == before
    assert_refused(lpet("terrain", "moon"), "'moon'", "exomars", "gale", "mer_spirit", "pathfinder")


def test_a_step_that_was_left_out_is_named(lpet: Lpet, run: Path) -> None:
    """Scores need estimates, sightings need images, visual motion needs sightings."""
    before = run.read_bytes()
    assert_refused(lpet("evaluate", run), "no estimates", "lpet estimate")
    assert_refused(lpet("sight", run), "no stream 'images'", "imu, wheels")
    ended = lpet("estimate", run, "--estimator", "frame_to_frame")
    assert_refused(ended, "no stream 'sightings'", "imu, wheels")
    assert run.read_bytes() == before


def test_a_bad_requirement_or_front_end_is_refused(lpet: Lpet, run: Path, tmp_path: Path) -> None:
    """Their keys are checked like those of a traverse."""
    bad = tmp_path / "bad.yaml"
    bad.write_text("position_percent: 1\n")
    assert_refused(lpet("evaluate", run, "--requirement", bad), "position_ratio", "yaw_rad")
    assert_refused(lpet("sight", run, "--spec", bad), "unknown key 'position_percent'")


@pytest.mark.parametrize("parent", ["file", "/proc/nowhere"])
def test_a_folder_that_cannot_be_written_is_refused(
    parent: str, lpet: Lpet, spec: Path, tmp_path: Path
) -> None:
    """Where no folder can be made nothing is computed first."""
    (tmp_path / "file").write_text("in the way")
    folder = tmp_path / parent
    began = time.perf_counter()
    assert_refused(lpet("simulate", spec, "--out", folder / "run.rrd"), str(folder), "can be writ")
    assert_refused(lpet("terrain", "exomars", "--out", folder), str(folder), "can be writ")
    assert_refused(lpet("demo", "--out", folder), str(folder), "can be writ")
    assert time.perf_counter() - began < 10.0


def test_a_recording_is_not_written_over_a_folder(lpet: Lpet, spec: Path, tmp_path: Path) -> None:
    """The name of a folder is not taken for a file's."""
    assert_refused(lpet("simulate", spec, "--out", tmp_path), str(tmp_path), "folder", ".rrd")


def test_a_viewer_without_a_display_says_what_to_do(
    lpet: Lpet, run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a machine without a screen the sentence names the way around."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert_refused(lpet("view", run), "display", "--web-viewer")


@pytest.mark.parametrize(
    "arguments",
    [("simulate",), ("fly",), ("simulate", "x.yaml", "--seed", "one"), ("terrain", "--size", "1")],
)
def test_a_command_line_that_is_wrong_ends_with_2(arguments: tuple[str, ...], lpet: Lpet) -> None:
    """A missing argument, an unknown command, a number that is none, one out of range."""
    ended = lpet(*arguments)
    assert ended.code == 2
    assert "Usage" in ended.err
    assert "Traceback" not in ended.err


def test_the_chain_of_commands_ends_in_a_verdict(lpet: Lpet, spec: Path, tmp_path: Path) -> None:
    """Simulate, estimate, evaluate: 0 where nothing is checked or all pass, 1 where one fails."""
    run, lax, strict = (tmp_path / name for name in ("run.rrd", "lax.yaml", "strict.yaml"))
    limits = "{position_ratio: 10, roll_rad: 3, pitch_rad: 3, yaw_rad: 3, completion: 0}"
    lax.write_text(limits)
    strict.write_text(limits.replace("position_ratio: 10", "position_ratio: 1.0e-9"))
    ended = lpet("simulate", spec, "--seed", "5", "--out", run)
    assert (ended.code, ended.err) == (0, "")
    assert "The drive, ended by goal" in ended.out
    assert ended.out.endswith(f"wrote {run}\n")
    assert read_recording(run).manifest.seed == 5
    ended = lpet("estimate", run)
    assert (ended.code, ended.err) == (0, "")
    # Without images frame-to-frame has nothing to work on.
    assert sorted(read_estimates(run)) == ["dead_reckoning", "fused_odometry"]
    for held_to, check, code in ((strict, [], 0), (strict, ["--check"], 1), (lax, ["--check"], 0)):
        ended = lpet("evaluate", run, "--requirement", held_to, *check)
        assert (ended.code, ended.err) == (code, "")
        verdict = next(line for line in ended.out.splitlines() if "verdict" in line)
        assert ("FAIL" if held_to == strict else "PASS") in verdict
        assert ("PASS" if held_to == strict else "FAIL") not in verdict
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "lax.yaml", "run.rrd", "strict.yaml", "tiny.yaml"
    ]  # fmt: skip


def test_an_estimator_is_run_by_a_spec_and_under_a_name_of_its_own(
    lpet: Lpet, run: Path, tmp_path: Path
) -> None:
    """It stands beside the one by default; a spec is for one estimator, and has its keys."""
    before, spec = run.read_bytes(), tmp_path / "own.yaml"
    spec.write_text("scal: 2\n")
    one = ("--estimator", "dead_reckoning")
    assert_refused(lpet("estimate", run, *one, "--spec", spec), "'scal'", "valid keys")
    assert_refused(lpet("estimate", run, "--spec", spec), "one estimator")
    assert_refused(lpet("estimate", run, *one, "--estimator", "slam", "--name", "x"), "one only")
    assert_refused(lpet("estimate", run, *one, "--name", ""), "is empty")
    assert run.read_bytes() == before
    spec.write_text("tilt_sigma_rad: 0.5\n")
    assert lpet("estimate", run, *one).code == 0
    assert lpet("estimate", run, *one, "--spec", spec, "--name", "mine").code == 0
    found = read_estimates(run)
    assert sorted(found) == ["dead_reckoning", "mine"]
    doubted, usual = found["mine"].covariance, found["dead_reckoning"].covariance
    assert doubted is not None and usual is not None
    assert doubted[-1, 2, 2] > 2 * usual[-1, 2, 2]


def test_a_terrain_is_drawn_from_above_and_in_relief(lpet: Lpet, tmp_path: Path) -> None:
    """Two pictures and a table of what was measured."""
    out = tmp_path / "pictures"
    ended = lpet("terrain", "pathfinder", "--size", "8", "--out", out)
    assert (ended.code, ended.err) == (0, "")
    assert sorted(path.name for path in out.iterdir()) == [
        "pathfinder_map.png",
        "pathfinder_relief.png",
    ]
    assert all(path.read_bytes().startswith(b"\x89PNG") for path in out.iterdir())
    assert "rocks by diameter" in ended.out


def started(spec: Path, out: Path) -> subprocess.Popen[str]:
    """Start a long drive in a process of its own and wait until its file grows.

    It hears interrupts even where these tests run in a shell's background, which ignores them.
    """
    heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    command = [sys.executable, "-c", heard + "from lpet_sim.cli import main; main()"]
    arguments = ["simulate", str(spec), "--out", str(out)]
    process = subprocess.Popen([*command, *arguments], stderr=subprocess.PIPE, text=True)
    patience = time.monotonic() + 120
    while not any(part.stat().st_size > 10_000 for part in out.parent.glob(f".{out.name}*")):
        assert process.poll() is None and time.monotonic() < patience
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("blow", [signal.SIGKILL, signal.SIGINT])
def test_a_drive_that_is_cut_off_leaves_the_name_as_it_was(
    blow: signal.Signals, recorded: Path, tmp_path: Path
) -> None:
    """The recording of that name stays the old one; an interrupt also tidies up, without a word."""
    spec, out = tmp_path / "long.yaml", tmp_path / "out" / "run.rrd"
    spec.write_text(TINY.replace("[0.3, 0]", "[300, 0]"))
    out.parent.mkdir()
    shutil.copy(recorded, out)
    process = started(spec, out)
    os.kill(process.pid, blow)
    _, err = process.communicate(timeout=60)
    assert out.read_bytes() == recorded.read_bytes()
    assert err == ""
    if blow == signal.SIGINT:
        assert process.returncode == 130
        assert list(out.parent.iterdir()) == [out]
