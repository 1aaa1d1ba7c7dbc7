"""What the page on formats says is true: its commands run, and its YAML is valid."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from lpet_sim.formats.topics import TopicsSpec
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.overlay import add_estimates
from lpet_sim.recording.writer import write_recording
from tests.command import Lpet, runner
from tests.formats.samples import small
from tests.house_rules import ROOT
from tests.recording.synthetic import estimate

PAGE = (ROOT / "docs" / "formats.md").read_text()


def blocks(kind: str) -> list[str]:
    """Give the code blocks of a kind."""
    return re.findall(rf"```{kind}\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run the command in this process."""
    return runner(monkeypatch, capsys)


def test_the_yaml_of_the_page_is_valid() -> None:
    """Topics as we export them, and a calibration."""
    topics, declared = (yaml.safe_load(block) for block in blocks("yaml"))
    assert TopicsSpec.from_mapping(topics) == TopicsSpec()
    assert Calibration.from_mapping(declared).imu is not None


def test_the_commands_of_the_page_run(
    lpet: Lpet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One after the other, on a recording with every stream and an estimate."""
    monkeypatch.chdir(tmp_path)
    write_recording("bare.rrd", small())
    add_estimates(Path("bare.rrd"), [(estimate("dead_reckoning", 4.0), None)], Path("run.rrd"))
    for name, block in zip(("topics.yaml", "declared.yaml"), blocks("yaml"), strict=True):
        Path(name).write_text(block)
    lines = [line for block in blocks("sh") for line in block.splitlines() if line]
    assert len(lines) == 16
    for line in lines:
        program, *arguments = shlex.split(line, comments=True)
        if program == "lpet":
            ended = lpet(*arguments)
            assert ended.code == 0, f"{line}: {ended.err}"
        else:
            run_other(program, arguments, tmp_path)


def run_other(program: str, arguments: list[str], folder: Path) -> None:
    """Run a program of others where it is installed."""
    found = shutil.which(program, path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    if found is not None:
        home = {**os.environ, "HOME": str(folder), "MPLBACKEND": "agg"}
        done = subprocess.run([found, *arguments], capture_output=True, text=True, env=home)
        assert done.returncode == 0, done.stdout + done.stderr
