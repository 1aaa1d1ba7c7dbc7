"""The scenarios that compare prediction and simulation, and seeds, run as they stand."""

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


def test_a_trade_off_is_repeated_with_other_seeds_on_a_short_drive(tmp_path: Path) -> None:
    """Two sensors, two seeds: a sentence and a row for each."""
    printed = run_quick("tradeoff_stability.py", tmp_path, "--out", str(tmp_path / "stability"))
    assert "of 2 seeds recommend the same sensor" in printed
    (table,) = written_by(printed)
    rows = table.read_text().splitlines()
    assert rows[0].startswith("seed,field_of_view_rad")
    assert [row.split(",")[0] for row in rows[1:]] == ["0", "1"]
