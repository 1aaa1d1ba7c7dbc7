"""The tables of a study: verdict, lines, reachability, sensor, ways, worst runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from lpet_sim.evaluation.claims import CONFIDENCE, SHARE
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.sheet import (
    ENDS,
    Cell,
    Heading,
    Sheet,
    Tone,
    heads,
    interval,
    number,
    words,
)
from lpet_sim.evaluation.study_verdict import AlgorithmOutcome, LineOutcome, Word, worst_runs
from lpet_sim.planning.reach_result import ReachabilityReport
from lpet_sim.study.compare import WorstAgainstRandom
from lpet_sim.study.runs import DRIVE
from lpet_sim.tradeoff.candidate import PARAMETERS, Candidate

TONES: Final[dict[Word, Tone]] = {"PASS": "good", "FAIL": "bad", "NOT DECIDED": "warn"}
_SHARE, _SURE = (f"{100 * share:.0f} %" for share in (SHARE, CONFIDENCE))
_DEGREES: Final = ("field_of_view_rad", "depression_rad")


def verdict_sheet(outcomes: Sequence[AlgorithmOutcome]) -> Sheet:
    """Make the table of the algorithms, the best first."""
    rows = tuple(
        (
            words(one.variant),
            words(one.whole.word, TONES[one.whole.word]),
            *_confidence(one.whole),
            _margin(one.margin),
            number(one.median_percent, ".3f"),
            number(one.ms_per_image, ".2f"),
        )
        for one in outcomes
    )
    headings = (
        Heading("algorithm", words=True),
        Heading("verdict", words=True),
        *heads("passed", "runs", "confidence [%]"),
        Heading("pass rate [%]", ENDS),
        *heads("margin [%]", "median error [%]", "ms per image"),
    )
    note = (
        f"PASS: with {_SURE} confidence at least {_SHARE} of runs meet every line; FAIL: with as "
        "much confidence they do not. Margin: how far the error that "
        f"{_SHARE} of the runs stay below is from its limit, on the line with the least. "
        "Confidence and intervals take runs as independent; draws of one drive share its way and "
        "slip."
    )
    return Sheet("verdict-table", "Algorithms, the best first", note, headings, rows)


def _confidence(line: LineOutcome) -> tuple[Cell, ...]:
    claim = line.claim
    surest = claim.against if line.word == "FAIL" else claim.confidence
    counts = (number(claim.passes, "d"), number(claim.runs, "d"))
    return (*counts, number(100 * surest, ".1f"), interval(line.rate, ".1f", scale=100))


def _margin(margin: float) -> Cell:
    tone: Tone = "" if math.isnan(margin) else "good" if margin >= 0 else "bad"
    return number(100 * margin, ".0f", tone)


def line_sheet(outcomes: Sequence[AlgorithmOutcome]) -> Sheet:
    """Make the table of each line of the requirement for each algorithm."""
    rows = tuple(
        (
            words(one.variant),
            words(line.line.removeprefix("pass_").replace("_", ", ")),
            words(line.word, TONES[line.word]),
            *_confidence(line),
            number(line.reached),
            number(line.limit),
            _margin(line.margin),
        )
        for one in outcomes
        for line in one.lines
    )
    headings = (
        *heads("algorithm", "line", "verdict", words_first=3),
        *heads("passed", "runs", "confidence [%]"),
        Heading("pass rate [%]", ENDS),
        *heads("reached", "limit", "margin [%]"),
    )
    note = (
        f"Reached: the error that {_SHARE} of the runs stay below, failed ones at infinity, in "
        "percent of the distance or degrees."
    )
    return Sheet("verdict-lines", "Verdict, line by line", note, headings, rows)


def reach_sheet(report: ReachabilityReport) -> Sheet:
    """Make the table of reachability."""
    rows = tuple(
        (
            number(100 * rate.abundance, ".3g"),
            number(rate.factor, "g"),
            number(rate.terrains, "d"),
            number(rate.starts, "d"),
            interval(rate.reachable, ".1f", scale=100),
            number(100 * rate.unreachable, ".1f"),
            number(100 * rate.undecided, ".1f"),
            number(rate.length_ratio[0], ".2f"),
            number(rate.length_ratio[2], ".2f"),
            words(", ".join(f"{why} {n}" for why, n in rate.reasons.items()) or "none failed"),
        )
        for rate in report.rates
    )
    headings = (
        *heads("rocks [% of ground]", "K", "terrains", "starts"),
        Heading("reachable [%]", ENDS),
        *heads("unreachable [%]", "undecided [%]", "median length ratio", "largest"),
        Heading("why not", words=True),
    )
    note = (
        f"Maps of {100 * report.cell_m:g} cm. Unreachable: not even the disc that the body covers "
        "at every heading can get there. Length ratio: way over straight distance."
    )
    return Sheet("reachability", "Goal reachability", note, headings, rows)


def sensor_sheet(candidate: Candidate) -> Sheet:
    """Make the table of the chosen sensor."""
    rows = []
    for name in PARAMETERS:
        value = getattr(candidate, name)
        if name in _DEGREES:
            cell = number(math.degrees(value), ".1f")
            rows.append((words(name.replace("_rad", "_deg")), cell))
        else:
            shown = words(value) if isinstance(value, str) else number(value, ".4g")
            rows.append((words(name), shown))
    headings = (Heading("parameter", words=True), Heading("value"))
    note = "The sensor that all algorithms ran with: sensor.yaml, which may be replaced."
    return Sheet("sensor", "Sensor", note, headings, tuple(rows))


def drive_sheet(rows: Rows, best: AlgorithmOutcome) -> Sheet:
    """Make the table of the drives, with what the best algorithm made of each."""
    of = rows.select(arm=best.arm, variant=best.variant)
    lines = []
    for (name,), runs in of.groups(DRIVE):
        errors = runs.errors("worst_percent")
        passed = int(np.sum(runs["passed"].astype(bool)))
        lines.append(
            (
                words(str(name)),
                words(str(runs.texts("ended")[0]) or "unknown"),
                number(float(runs.numbers("path_m")[0]), ".1f"),
                number(passed, "d"),
                number(len(runs), "d"),
                number(float(np.median(errors)), ".3f"),
            )
        )
    headings = (
        *heads("drive", "ended", words_first=2),
        *heads("length [m]", "passed", "runs", "median worst error [%]"),
    )
    note = f"Runs of {best.variant}. A drive that ends otherwise than at its goal counts with it."
    return Sheet("drives", "Drives", note, headings, tuple(lines))


def comparison_sheet(found: Sequence[WorstAgainstRandom]) -> Sheet:
    """Make the table that holds the worst ways against those at random."""
    rows = tuple(
        (
            words(one.variant),
            interval(one.ratio, ".2f"),
            words(one.decision, "warn" if one.decision == "not decided" else ""),
            number(one.worst_percent, ".3f"),
            number(one.random_percent, ".3f"),
        )
        for one in found
    )
    headings = (
        Heading("algorithm", words=True),
        Heading("RMS error, worst over random", ENDS),
        Heading("worst ways", words=True),
        *heads("RMS on worst [%]", "on random [%]"),
    )
    note = (
        "End error over the distance on the worst ways against ways at random, with a 95 % "
        "bootstrap interval over drives, whose draws stay together."
    )
    return Sheet("worst-ways", "Worst ways against random ones", note, headings, rows)


def worst_run_sheet(rows: Rows, best: AlgorithmOutcome) -> Sheet:
    """Make the table of the worst runs of the best algorithm."""
    of = rows.select(arm=best.arm, variant=best.variant)
    told = {str(run): k for k, run in enumerate(of["run"])}
    lines = []
    for run, data_set in worst_runs(rows, best):
        k = told[run]
        error = float(of.errors("worst_percent")[k])
        failure = str(of["failure"][k]) or "none"
        where = words(f"worst_runs/{run}.rrd")
        lines.append((words(data_set), words(failure), number(error, ".3f"), where))
    headings = (
        *heads("drive", "failure", words_first=2),
        Heading("worst error [%]"),
        Heading("recording", words=True, page_only=True),
    )
    note = (
        "Recordings of what was measured and estimated lie in worst_runs/, named by their drives: "
        "open them with lpet view."
    )
    return Sheet("worst-runs", "The worst runs of the best algorithm", note, headings, tuple(lines))
