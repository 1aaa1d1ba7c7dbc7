"""What an estimator prints, while someone looks for its mistakes."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from tests.sweep.tiny_recordings import write_tiny

CHATTY = """
class Chatty:
    needs = ("wheels",)

    def estimate(self, measurements):
        print("encoders:", len(measurements.wheels))
        print("second line")
        raise ValueError("no more")
"""


def test_a_command_shows_what_a_class_printed_before_it_failed(tmp_path: Path) -> None:
    """Beside the sentence on the failure, line by line."""
    write_tiny(tmp_path / "tiny.rrd", 1)
    (tmp_path / "chatty.py").write_text(CHATTY)
    words = ["estimate", "tiny.rrd", "--estimator", "chatty:Chatty"]
    command = [sys.executable, "-c", "from lpet_sim.cli import main; main()", *words]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    lines = ended.stderr.splitlines()
    assert lines[0] == "lpet: what the estimator printed:"
    assert lines[1].startswith("encoders: ")
    assert lines[2] == "second line"
    assert "chatty.py, line 8: ValueError: no more" in lines[3]
    assert len(lines) == 4
