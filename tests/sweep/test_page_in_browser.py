"""The report's page in a real browser."""

from __future__ import annotations

from pathlib import Path

import pytest

from lpet_sim.evaluation.rows import rows_of
from lpet_sim.sweep.page import write_page
from lpet_sim.sweep.sweep_report import build_report
from tests.browser import look, needs_chromium, numbers
from tests.evaluation.made_rows import made_rows


@needs_chromium
def test_the_page_of_a_sweep_works_in_a_browser_on_a_telephone_and_on_a_screen(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """No errors, nothing asked for, all charts drawn, no sideways scrolling, and tables sort."""
    page = tmp_path / "report.html"
    write_page(build_report(rows_of(made_rows(), "made up")), page)
    for width_px in (390, 1400):
        seen = look(page, width_px, tmp_path_factory.mktemp("browser"))
        assert seen.wrong == [] and seen.asked == []
        assert seen.images > 5 and seen.broken == 0
        assert seen.wide <= width_px
        assert seen.narrow == 0
        once, twice = ([c["text"] for c in column] for column in (seen.once, seen.twice))
        assert once == list(reversed(twice)) or numbers(seen.once) == numbers(seen.twice)[::-1]
        assert once != twice
