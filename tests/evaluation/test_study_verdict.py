"""The verdict of a study: who passes how surely, who is best, which runs were worst."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.evaluation.requirement import Requirement
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.study_verdict import AlgorithmOutcome, judge, verdict_of, worst_runs

LINES = [
    f"{what}_{when}"
    for what in ("position", "roll", "pitch", "yaw")
    for when in ("throughout", "end")
]


def runs_of(variant: str, percent: np.ndarray, failed: int = 0) -> dict[str, np.ndarray]:
    """Make the runs of one algorithm with given position errors, the last ones failed."""
    n = len(percent)
    fine = np.arange(n) < n - failed
    texts = {"variant": variant, "arm": "ideal", "estimator": "slam", "spec": "{}"}
    columns = {name: np.full(n, text, dtype=object) for name, text in texts.items()}
    columns["data_set"] = np.array([f"set{k:03d}" for k in range(n)], dtype=object)
    columns["run"] = np.array([f"set{k:03d}-{variant}" for k in range(n)], dtype=object)
    columns["failure"] = np.where(fine, "", "lost").astype(object)
    for when in ("end", "worst"):
        columns[f"{when}_percent"] = percent
        columns |= {f"{when}_{axis}_deg": np.full(n, 0.2) for axis in ("roll", "pitch", "yaw")}
    columns |= {f"pass_{line}": fine.copy() for line in LINES}
    for when in ("throughout", "end"):
        columns[f"pass_position_{when}"] = fine & (percent <= 1.0)
    columns["passed"] = fine & (percent <= 1.0)
    columns["time_per_image_ms"] = np.ones(n)
    return columns


def table(*parts: dict[str, np.ndarray]) -> Rows:
    """Put the runs of several algorithms into one table."""
    return Rows({name: np.concatenate([part[name] for part in parts]) for name in parts[0]})


def judged(*parts: dict[str, np.ndarray]) -> list[AlgorithmOutcome]:
    """Hold them to the paper's requirement."""
    return judge(table(*parts), Requirement())


def test_so_many_passes_show_a_line_and_one_less_leaves_it_open() -> None:
    """Of 100 runs 99 are needed (Clopper-Pearson), of 58 all are too few, of 59 they are not."""
    for runs, bad, word in ((100, 1, "PASS"), (100, 2, "NOT DECIDED"), (58, 0, "NOT DECIDED")):
        percent = np.where(np.arange(runs) < bad, 2.0, 0.5)
        assert judged(runs_of("a", percent))[0].whole.word == word
    assert judged(runs_of("a", np.full(59, 0.5)))[0].whole.word == "PASS"
    assert judged(runs_of("a", np.full(20, 2.0)))[0].whole.word == "FAIL"


def test_the_margin_is_that_of_the_error_that_most_runs_stay_below() -> None:
    """0.5 % of 1 % leaves half; failed runs stand at infinity and leave none."""
    best = judged(runs_of("a", np.full(100, 0.5)))[0]
    assert best.margin == pytest.approx(0.5)
    lines = {line.line: line for line in best.lines}
    assert lines["pass_yaw_end"].margin == pytest.approx(0.8)
    assert lines["pass_position_throughout"].limit == 1.0
    assert judged(runs_of("a", np.full(100, 0.5), failed=6))[0].margin == -np.inf


def test_algorithms_are_ranked_by_what_is_shown_then_by_how_often_then_by_margin() -> None:
    """Shown, not decided, refuted; among the shown the wider margin."""
    found = judged(
        runs_of("refuted", np.full(100, 3.0)),
        runs_of("close", np.full(100, 0.9)),
        runs_of("wide", np.full(100, 0.3)),
        runs_of("open", np.where(np.arange(100) < 4, 2.0, 0.1)),
    )
    assert [outcome.variant for outcome in found] == ["wide", "close", "open", "refuted"]
    assert verdict_of(found) == "PASS"


def test_lines_that_are_not_required_are_not_judged() -> None:
    """A requirement on the end says nothing of the way there."""
    end_only = Requirement(throughout=False)
    lines = judge(table(runs_of("a", np.full(9, 0.5))), end_only)[0].lines
    assert {line.line for line in lines} == {f"pass_{line}" for line in LINES if "end" in line}


def test_the_worst_runs_are_named_failed_ones_first() -> None:
    """The last ones of the table failed."""
    rows = table(runs_of("a", np.linspace(0.1, 0.9, 20), failed=1))
    best = judge(rows, Requirement())[0]
    assert [data_set for _, data_set in worst_runs(rows, best, 3)] == ["set019", "set018", "set017"]
