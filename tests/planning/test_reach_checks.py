"""The checks of reachability run as they stand."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from tests.test_scenarios import run_quick, written_by


def test_reachability_is_checked_swept_and_timed(tmp_path: Path) -> None:
    """No way touches a rock, nothing called unreachable is reached, and all tables are there."""
    printed = run_quick("reach_checks.py", tmp_path, "--out", str(tmp_path), "--workers", "1")
    for what in ("touching a rock", "reached by a search", "a disc 4 cm larger"):
        assert re.search(rf"^\| .*{what}.* \| 0 \| 0 \| 0 \|$", printed, re.MULTILINE), printed
    assert "it does NOT fall" not in printed
    text, table, *pictures = written_by(printed)
    assert "Perseverance drove 1.46" in text.read_text()
    assert len(list(csv.DictReader(table.read_text().splitlines()))) == 5
    assert all(picture.stat().st_size > 5000 for picture in pictures)
