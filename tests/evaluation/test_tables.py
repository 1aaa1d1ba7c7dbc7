"""Tables say what the scores are, with units."""

import io

from rich.console import Console
from rich.table import Table

from lpet_sim.evaluation import Requirement, evaluate, failed
from lpet_sim.evaluation.attribution import ErrorAttribution
from lpet_sim.evaluation.slip_match import SlipMatch
from lpet_sim.evaluation.slip_onset import SlipFound
from lpet_sim.evaluation.tables import (
    attribution_table,
    result_table,
    segment_table,
    slip_table,
    verdict_table,
)
from lpet_sim.recording.truth import Event
from tests.evaluation.trajectories import as_estimate, as_truth, scaled, straight


def _text(table: Table) -> str:
    file = io.StringIO()
    Console(file=file, width=200, color_system=None).print(table)
    return file.getvalue()


def test_each_run_has_a_column_that_ends_in_its_verdict_in_colour() -> None:
    """Green for PASS, red for FAIL, and the failure by name."""
    truth = straight(20.0, 201)
    good = evaluate(as_estimate(scaled(truth, 1.005)), as_truth(truth))
    bad = evaluate(as_estimate(scaled(truth, 1.02)), as_truth(truth))
    table = result_table([good, bad, failed("broken")])
    verdicts = [list(column.cells)[-1] for column in table.columns[1:]]
    assert [str(verdict) for verdict in verdicts] == ["PASS", "FAIL", "FAIL (exception)"]
    assert [verdict.style for verdict in verdicts] == ["bold green", "bold red", "bold red"]
    assert len(_text(table).splitlines()) > 6


def test_the_numbers_are_in_the_units_of_the_headings() -> None:
    """0.5 % of 20 m is 0.1 m, and the RMS of a line from 0 to that in 200 steps is 0.0578 m."""
    truth = straight(20.0, 201)
    text = _text(result_table([evaluate(as_estimate(scaled(truth, 1.005)), as_truth(truth))]))
    for part in ("[m]", "[% of dist.]", "[deg]", "20.00", "100.0", "0.1000", "0.500"):
        assert part in text
    assert f"{0.1 * (401 / 1200) ** 0.5:.4f}" in text
    assert "RMS error [m]" in text


def test_a_drive_too_short_for_the_worst_share_shows_its_end_and_says_so() -> None:
    """Of 4 m and 20 m, only one has anything after 5 m."""
    short, long = straight(4.0, 201), straight(20.0, 201)
    results = [evaluate(as_estimate(scaled(t, 1.005)), as_truth(t)) for t in (short, long)]
    row = next(s for s in _text(result_table(results)).splitlines() if "worst after" in s)
    assert row.count("0.500") == 2
    assert row.count("0.500 (at the end)") == 1


def test_the_verdict_names_every_line_with_its_limit_and_each_run_beside_it() -> None:
    """2 % against 1 % fails, 0.5 % passes."""
    truth = straight(20.0, 201)
    results = [evaluate(as_estimate(scaled(truth, s)), as_truth(truth)) for s in (1.02, 1.005)]
    text = _text(verdict_table([Requirement().check(result) for result in results]))
    for part in ("position, throughout", "1.000 %", "2.000 % FAIL", "0.500 % PASS", "1.000 deg"):
        assert part in text


def test_segments_are_columns_and_what_does_not_fit_is_a_dash() -> None:
    """A short run has no long segments."""
    results = [
        evaluate(as_estimate(scaled(t, 1.02)), as_truth(t))
        for t in (straight(4.0, 201), straight(20.0, 201))
    ]
    text = _text(segment_table(results))
    assert "10 m" in text
    assert "-" in text
    assert "2.000%, 0.0000" in text


def test_the_causes_of_the_error_are_rows() -> None:
    """Vectors in metres, lengths as a share."""
    split = ErrorAttribution(10.0, (0.3, 0.4, 0.0), {"scale": (0.3, 0, 0), "slip": (0, 0.4, 0)})
    text = _text(attribution_table(split))
    for part in ("scale", "slip", "total", "+0.4000", "5.000%"):
        assert part in text


def test_a_slip_is_told_with_its_delay_and_what_it_cost() -> None:
    """Found in time, late, missed, with nothing to find, and found without anything forced."""
    event = Event(300_000_000_000, "forced_slip", 5.0)
    times = (300_200_000_000, 305_000_000_000, 306_000_000_000, (298_800_000_000, 302_400_000_000))
    found = SlipFound(*times, lost_m=0.137, slip=0.7, sigmas=5.0)
    matches = [
        SlipMatch(event, found, 0.139, 3.6, 0.02),
        SlipMatch(event, found, 0.139, 0.1, 0.02),
        SlipMatch(event, None, 0.139, 3.6, 0.02),
        SlipMatch(event, None, -0.001, 3.6, 0.02),
        SlipMatch(None, found, 0.139, 3.6, 0.02),
    ]
    table = slip_table(matches)
    text = _text(table)
    for part in ("forced slip at 300.0 s for 5.0 s", "300.2 s", "0.137 (0.139)", "- (0.139)"):
        assert part in text
    late = [str(cell) for cell in table.columns[2].cells]
    assert late == ["+0.2 s (3.6 s) PASS", "+0.2 s (0.1 s) FAIL", "FAIL", "-", "-"]
    assert "no forced slip" in text and "not found" in text
