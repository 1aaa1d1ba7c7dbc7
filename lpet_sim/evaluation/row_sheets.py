"""The tables of a sweep, from the summaries of its variants."""

from __future__ import annotations

from collections.abc import Sequence

from lpet_sim.evaluation.claims import CONFIDENCE, SHARE, Outcome, pass_claim
from lpet_sim.evaluation.consistency import Consistency
from lpet_sim.evaluation.equal_size import EqualSize
from lpet_sim.evaluation.ordering import Decision, Ordering
from lpet_sim.evaluation.requirement import AXES
from lpet_sim.evaluation.sheet import (
    ENDS,
    Cell,
    Heading,
    Sheet,
    Tone,
    heads,
    interval,
    no_value,
    number,
    shown,
    words,
)
from lpet_sim.evaluation.statistics import RUNS_MIN, Interval
from lpet_sim.evaluation.summary import NEES_DOF, Efficiency, ErrorSpread, InnovationTest, Summary

_TONES: dict[Outcome | Decision, Tone] = {
    "shown": "good",
    "holds": "good",
    "refuted": "bad",
    "does not hold": "bad",
    "not decided": "warn",
}
_SHARE, _SURE = (f"{100 * share:.0f} %" for share in (SHARE, CONFIDENCE))
_WHO = heads("arm", "variant", words_first=2)
_ALL = "over all runs with failed ones at infinity"


def summary_sheets(summaries: Sequence[Summary]) -> list[Sheet]:
    """Make the tables of the variants: verdicts, errors, consistency, state and cost, failures."""
    return [
        pass_sheet(summaries),
        position_sheet(summaries),
        attitude_sheet(summaries),
        line_sheet(summaries),
        consistency_sheet(summaries),
        state_sheet(summaries),
        failure_sheet(summaries),
    ]


def pass_sheet(summaries: Sequence[Summary]) -> Sheet:
    """Make the table of who passes the requirement as a whole, and how surely."""
    rows = []
    for summary in summaries:
        claim = pass_claim(summary)
        rate = interval(summary.passes["passed"], ".1f", scale=100)
        sure = (number(100 * c, ".1f") for c in (claim.confidence, claim.against))
        verdict = words(claim.outcome, _TONES[claim.outcome])
        counts = (number(n, "d") for n in (summary.passed, summary.runs, summary.failed))
        rows.append((*_who(summary), verdict, *counts, rate, *sure))
    headings = (
        *_WHO,
        Heading(f"passes {_SHARE} of runs", words=True),
        *heads("passed", "runs", "failed"),
        Heading("pass rate [%]", ENDS),
        *heads("confidence [%]"),
        *heads("confidence against [%]", page_only=True),
    )
    note = (
        f"shown, or refuted: with {_SURE} confidence, one-sided, that at least {_SHARE} "
        "of runs meet every line of the requirement. Pass rates with their 95 % Clopper-Pearson "
        "intervals; a failed run is no pass unless it meets every line."
    )
    return Sheet("requirement", "Who meets the requirement", note, headings, tuple(rows))


def line_sheet(summaries: Sequence[Summary]) -> Sheet:
    """Make the table of the pass rate of each line of the requirement."""
    lines = list(dict.fromkeys(name for s in summaries for name in s.passes if name != "passed"))
    rows = [
        (*_who(s), *(_rate(s.passes[name]) if name in s.passes else no_value(3) for name in lines))
        for s in summaries
    ]
    texts = [name.removeprefix("pass_").replace("_", ", ").replace("end", "at the end")
             for name in lines]  # fmt: skip
    headings = (*_WHO, *heads(*(f"{text} [%]" for text in texts), parts=ENDS))
    note = "Share of all runs that meet the line, with its 95 % Clopper-Pearson interval."
    return Sheet("lines", "Requirement, line by line", note, headings, tuple(rows))


def position_sheet(summaries: Sequence[Summary]) -> Sheet:
    """Make the table of the position errors, at the end and at the worst moment."""
    columns = ("end_percent", "worst_percent")
    rows = [
        (*_who(s), number(s.runs - s.failed, "d"), *(c for n in columns for c in _spread(s, n)))
        for s in summaries
    ]
    kinds = ("RMS, completed", "median", "95th percentile")
    end, worst = ([f"{when} {kind} [%]" for kind in kinds] for when in ("end", "worst"))
    spreads = (*heads(*end, parts=ENDS), *heads(*worst, parts=ENDS, page_only=True))
    headings = (*_WHO, Heading("completed"), *spreads)
    note = (
        "Position error as a share of the distance driven, at the end and at the worst moment "
        f"after the first metres. Median and 95th percentile {_ALL}; RMS over completed runs. "
        f"95 % bootstrap intervals over runs, where there are {RUNS_MIN} or more."
    )
    return Sheet("position", "Position error", note, headings, tuple(rows))


def attitude_sheet(summaries: Sequence[Summary]) -> Sheet:
    """Make the table of the attitude errors of each axis."""
    rows = []
    for s in summaries:
        cells = []
        for axis in AXES:
            end, worst = (s.errors.get(f"{when}_{axis}_deg") for when in ("end", "worst"))
            cells += [_of(end, "rms_completed"), _of(worst, "median")]
        rows.append((*_who(s), *cells))
    kinds = ("end RMS, completed", "worst median")
    texts = [f"{axis} {kind} [deg]" for axis in AXES for kind in kinds]
    note = f"RMS at the end over completed runs; median of the worst moment {_ALL}."
    headings = (*_WHO, *heads(*texts, parts=ENDS))
    return Sheet("attitude", "Attitude error", note, headings, tuple(rows))


def consistency_sheet(summaries: Sequence[Summary]) -> Sheet:
    """Make the table of NEES, NIS and efficiency."""
    rows = []
    for s in summaries:
        nees = [_nees(s.nees.get(block)) for block in NEES_DOF]
        sizes = [_efficient(e) for e in (s.position_efficiency, s.attitude_efficiency)]
        rows.append((*_who(s), *nees, _innovations(s.nis), *sizes))
    named = [f"ANEES {block} ({dof} dof)" for block, dof in NEES_DOF.items()]
    headings = (
        *_WHO,
        *heads(*named, parts=("", "band low", "band high", "runs")),
        Heading("NIS per dof", (*ENDS, "band low", "band high")),
        *heads("efficiency, position", parts=(*ENDS, "runs")),
        *heads("efficiency, attitude", parts=(*ENDS, "runs"), page_only=True),
    )
    note = (
        "ANEES at the end with the two-sided 95 % chi-square band of so many runs in parentheses; "
        "above it a filter is overconfident. NIS: mean with its bootstrap interval; the band is "
        "that of three coordinates for each matched sighting, and a gate cuts the mean a little. "
        "Efficiency: RMS error over the RMS of the Cramer-Rao bound, completed runs; below 1 "
        "within its interval is marked, for then the truth may leak."
    )
    return Sheet("consistency", "Consistency and efficiency", note, headings, tuple(rows))


_STATE = {
    "state mean": ("state_mean", ".1f"),
    "state max, mean": ("state_max", ".1f"),
    "new": ("new_mean", ".2f"),
    "matched": ("matched_mean", ".2f"),
    "dropped": ("dropped_mean", ".2f"),
    "images with an anchor": ("anchors_seen_share", ".1%"),
    "images bridged": ("bridged_share", ".1%"),
    "covered": ("completion", ".1%"),
    "path [m]": ("path_m", ".1f"),
    "ms per image": ("time_per_image_ms", ".2f"),
}


def state_sheet(summaries: Sequence[Summary]) -> Sheet:
    """Make the table of state size, landmarks per image, anchors and cost."""
    rows = []
    for s in summaries:
        means = (number(s.means.get(name, float("nan")), form) for name, form in _STATE.values())
        rows.append((*_who(s), *means, number(s.state_max, ".0f")))
    note = "Means over all runs that have the number; state sizes and sightings in landmarks."
    told = {"state mean", "state max, mean", "images with an anchor", "ms per image"}
    named = tuple(Heading(name, page_only=name not in told) for name in _STATE)
    headings = (*_WHO, *named, Heading("largest state"))
    return Sheet("state", "State, anchors and cost", note, headings, tuple(rows))


def failure_sheet(summaries: Sequence[Summary]) -> Sheet:
    """Make the table of failed runs by kind."""
    kinds = sorted({kind for summary in summaries for kind in summary.failures})
    rows = [
        (*_who(s), number(s.runs, "d"), number(s.failed, "d", "bad" if s.failed else ""),
         *(number(s.failures.get(kind, 0), "d") for kind in kinds))
        for s in summaries
    ]  # fmt: skip
    note = "Every failed run is counted in the tables above, in quantiles with an infinite error."
    headings = (*_WHO, *heads("runs", "failed", *kinds))
    return Sheet("failures", "Failed runs by kind", note, headings, tuple(rows))


def ordering_sheet(orderings: Sequence[Ordering], key: str = "orderings") -> Sheet:
    """Make the table of paired orderings."""
    rows = [(words(o.arm), words(o.worse), words(o.better), *_ordering_cells(o)) for o in orderings]
    headings = (*heads("arm", "worse", "better", words_first=3), *_ORDERING_HEADS)
    return Sheet(key, "Orderings, paired over data sets", _ORDERING_NOTE, headings, tuple(rows))


def size_sheet(points: Sequence[EqualSize]) -> Sheet:
    """Make the table of two families at equal state size."""
    rows = [
        (
            *(words(x) for x in (p.ordering.arm, p.ordering.worse, p.ordering.better)),
            words(p.by.removeprefix("state_")),
            number(p.size, ".1f"),
            *_ordering_cells(p.ordering),
        )
        for p in points
    ]
    names = heads("arm", "worse", "better", "size by", words_first=4)
    headings = (*names, Heading("size"), *_ORDERING_HEADS)
    note = (
        "Errors between the swept sizes are interpolated on each data set, logarithm over "
        f"logarithm. {_ORDERING_NOTE} Here the claim holds as well where what is called better is "
        f"worse by at most {100 * max((p.ordering.tolerance for p in points), default=0.0):.0f} %."
    )
    return Sheet("equal_size", "At equal state size", note, headings, tuple(rows))


_ORDERING_HEADS = (
    Heading("verdict", words=True),
    *heads("pairs", "failed worse", "failed better", page_only=True),
    Heading("median difference [%]", ENDS),
    Heading("mean difference, completed [%]", page_only=True),
    Heading("RMS ratio, completed", ENDS, page_only=True),
    Heading("worse in [%] of pairs", ENDS, page_only=True),
    *heads("p sign", "p Wilcoxon", page_only=True),
)
_ORDERING_NOTE = (
    "End errors in % of the distance. Median difference over all pairs, a failed run at infinity "
    "and two of them a tie; mean and RMS ratio over pairs in which both completed; paired 95 % "
    "bootstrap intervals, Clopper-Pearson on the share of pairs that are no tie; one-sided "
    "p-values, not corrected for the number of comparisons. The interval of the median difference "
    "gives the verdict."
)


def _ordering_cells(o: Ordering) -> tuple[Cell, ...]:
    return (
        words(o.verdict, _TONES[o.verdict]),
        *(number(n, "d") for n in (o.runs, o.failed_worse, o.failed_better)),
        interval(o.median_difference),
        number(o.mean_difference_completed),
        interval(o.rms_ratio_completed),
        interval(o.share, ".1f", scale=100),
        number(o.p_sign, ".2g"),
        number(o.p_wilcoxon, ".2g"),
    )


def _who(summary: Summary) -> tuple[Cell, Cell]:
    return words(summary.arm), words(summary.variant)


def _rate(rate: Interval) -> Cell:
    return interval(rate, ".0f", scale=100)


def _spread(summary: Summary, name: str) -> tuple[Cell, ...]:
    spread = summary.errors.get(name)
    return tuple(_of(spread, kind) for kind in ("rms_completed", "median", "high"))


def _of(spread: ErrorSpread | None, kind: str) -> Cell:
    return no_value(3) if spread is None else interval(getattr(spread, kind))


def _nees(average: Consistency | None) -> Cell:
    if average is None:
        return no_value(4)
    values = (average.value, average.low, average.high, float(average.runs))
    value, low, high = (shown(v, ".2f") for v in values[:3])
    return Cell(f"{value} ({low}-{high})", values, "good" if average.is_consistent else "bad")


def _innovations(test: InnovationTest | None) -> Cell:
    if test is None:
        return no_value(5)
    of = interval(test.mean, "#.4g", "good" if test.is_consistent else "bad")
    return Cell(of.text, (*of.values, test.low, test.high), of.tone)


def _efficient(efficiency: Efficiency | None) -> Cell:
    if efficiency is None:
        return no_value(4)
    of = interval(efficiency.ratio, tone="warn" if efficiency.is_suspicious else "")
    text = f"{of.text} below the bound" if efficiency.is_suspicious else of.text
    return Cell(text, (*of.values, float(efficiency.runs)), of.tone)
