"""The scenario that compares prediction and simulation runs as it stands."""

from __future__ import annotations

from pathlib import Path

from tests.test_scenarios import run_quick, written_by


def test_prediction_and_simulation_are_compared_on_a_short_drive(tmp_path: Path) -> None:
    """Four settings: rank correlations, a table and a picture."""
    printed = run_quick("tradeoff_check.py", tmp_path, "--out", str(tmp_path / "check"))
    assert "Cramer-Rao bound: rank correlation with the prediction" in printed
    assert "unobservable-invariant: rank correlation" in printed
    table, picture = written_by(printed)
    assert len(table.read_text().splitlines()) == 5
    assert picture.stat().st_size > 10_000
