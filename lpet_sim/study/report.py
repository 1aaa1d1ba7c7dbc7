"""What a study says in the end: verdict, page, JSON, and the recordings of its worst runs."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import yaml

from lpet_sim.evaluation.claims import Outcome
from lpet_sim.evaluation.sheet import Sheet
from lpet_sim.evaluation.statistics import confidence_against_share, confidence_of_share
from lpet_sim.evaluation.study_verdict import (
    WORDS,
    AlgorithmOutcome,
    Word,
    judge,
    worst_runs,
)
from lpet_sim.outputs import whole_file
from lpet_sim.progress import Progress, silent
from lpet_sim.study.chain import StudyResult
from lpet_sim.study.compare import worst_against_random
from lpet_sim.study.sheets import (
    comparison_sheet,
    drive_sheet,
    line_sheet,
    reach_sheet,
    sensor_sheet,
    verdict_sheet,
    worst_run_sheet,
)
from lpet_sim.sweep.page import write_page
from lpet_sim.sweep.sweep_report import Drawing, SweepReport, build_report

PAGE: Final = "report.html"
JSON: Final = "verdict.json"
_SURE: Final = 0.95
_OUTCOMES: Final[dict[Word, Outcome]] = {word: outcome for outcome, word in WORDS.items()}


@dataclass(frozen=True, eq=False)
class StudyVerdict:
    """The end of a study.

    Attributes:
        word: PASS if the goal is shown to be reachable often enough and an algorithm is shown to
            meet the requirement; FAIL if either is refuted; else NOT DECIDED.
        reach: The same of reachability alone.
        reach_text: Why, in a sentence.
        outcomes: The algorithms, the best first; none where no way leads to the goal.
        text: What the study says, in a sentence or two.
    """

    word: Word
    reach: Word
    reach_text: str
    outcomes: tuple[AlgorithmOutcome, ...]
    text: str

    @property
    def best(self) -> AlgorithmOutcome | None:
        """The best algorithm."""
        return self.outcomes[0] if self.outcomes else None


def verdict_of(result: StudyResult) -> StudyVerdict:
    """Judge a study."""
    reach, reach_text = _reached(result)
    told = () if result.rows is None else tuple(judge(result.rows, result.spec.requirement))
    words = [reach, told[0].whole.word if told else "FAIL"]
    word: Word = "FAIL" if "FAIL" in words else "PASS" if set(words) == {"PASS"} else "NOT DECIDED"
    return StudyVerdict(word, reach, reach_text, told, f"{reach_text} {_localized(told)}")


def _reached(result: StudyResult) -> tuple[Word, str]:
    """Hold the share of reachable starts to the least one asked for, where rocks are fewest."""
    rate, share = result.reach.rates[0], result.spec.reachable_min
    found = round(rate.reachable.value * rate.starts)
    said = (
        f"The goal is reachable from {found} of {rate.starts} starts "
        f"({100 * rate.reachable.low:.0f} to {100 * rate.reachable.high:.0f} %); "
        f"{100 * share:.0f} % are asked for."
    )
    if share == 0 or confidence_of_share(found, rate.starts, share) >= _SURE:
        return "PASS", said
    refuted = confidence_against_share(found, rate.starts, share) >= _SURE
    return ("FAIL" if refuted or found == 0 else "NOT DECIDED"), said


def _localized(outcomes: tuple[AlgorithmOutcome, ...]) -> str:
    if not outcomes:
        return "No way to it can be driven, so no localization was studied."
    best, claim = outcomes[0], outcomes[0].whole.claim
    margin = "no margin" if not math.isfinite(best.margin) else f"margin {100 * best.margin:.0f} %"
    return (
        f"Best algorithm: {best.variant}, {best.whole.word}: {claim.passes} of {claim.runs} runs "
        f"meet the requirement ({margin} on its tightest line)."
    )


def study_sheets(
    result: StudyResult, verdict: StudyVerdict, best_lines: bool = False
) -> list[Sheet]:
    """Make the tables of a study, the verdict first.

    Args:
        result: The study.
        verdict: Its verdict.
        best_lines: Give the requirement line by line for the best algorithm only.
    """
    reach = reach_sheet(result.reach)
    if result.rows is None or result.sensor is None or verdict.best is None:
        return [reach]
    return [
        verdict_sheet(verdict.outcomes),
        line_sheet(verdict.outcomes[:1] if best_lines else verdict.outcomes),
        reach,
        sensor_sheet(result.sensor.candidate),
        drive_sheet(result.rows, verdict.best),
        comparison_sheet(worst_against_random(result.rows)),
        worst_run_sheet(result.rows, verdict.best),
    ]


def write_study(
    result: StudyResult, verdict: StudyVerdict, progress: Progress = silent
) -> list[Path]:
    """Write the verdict as JSON, and the study as one page.

    Args:
        result: The study.
        verdict: Its verdict.
        progress: Told the share done.

    Raises:
        OutputError: The folder cannot be written.
    """
    paths = [result.folder / JSON, result.folder / PAGE]
    with whole_file(paths[0]) as temporary:
        temporary.write_text(json.dumps(_plain(_told(result, verdict)), indent=1, allow_nan=False))
    write_page(_page(result, verdict, progress), paths[1])
    return paths


def _page(result: StudyResult, verdict: StudyVerdict, progress: Progress) -> SweepReport:
    sheets = [sheet for sheet in study_sheets(result, verdict) if sheet.rows]
    verdicts: list[tuple[str, Outcome]] = [
        (verdict.text, _OUTCOMES[verdict.word]),
        (verdict.reach_text, _OUTCOMES[verdict.reach]),
    ]
    spec = yaml.safe_dump(result.spec.to_mapping(), sort_keys=False)
    facts = [("Study", spec), ("Seed", str(result.seed)), ("Stages", _stages(result))]
    drawings, warnings = [("the study", pictures(result))], list[str]()
    if result.rows is not None:
        told = build_report(result.rows, result.spec.name, True, progress)
        sheets += told.sheets
        drawings += told.drawings
        warnings += told.warnings
        facts += told.facts
    return SweepReport(
        title=result.spec.name,
        scope=f"{verdict.word}: from requirement to verdict",
        verdicts=tuple(verdicts),
        warnings=tuple(warnings),
        facts=tuple(facts),
        sheets=tuple(sheets),
        drawings=tuple(drawings),
    )


_PICTURES: Final = {
    "reachability/map_*.png": ("Terrain", "Rocks, starts, ways and goal of one terrain."),
    "reachability/rates.png": (
        "Reachability",
        "Share of the starts from which the goal is reachable, against the rocks.",
    ),
    "tradeoff/pareto.png": (
        "Sensors: accuracy against cost",
        "Predicted error of every candidate against its data, computing and mass.",
    ),
    "tradeoff/sensitivity.png": (
        "Sensors: what each parameter does",
        "How strongly the predicted error hangs on it, over the space and about the choice.",
    ),
    "tradeoff/agreement.png": (
        "Sensors: static prediction against simulation",
        "Of the candidates that were simulated on the drives.",
    ),
}


def pictures(result: StudyResult) -> tuple[Drawing, ...]:
    """Give the pictures that the stages left."""
    return tuple(
        Drawing(f"study-{path.stem}", title, caption, path)
        for pattern, (title, caption) in _PICTURES.items()
        for path in sorted(result.folder.glob(pattern))
    )


def _stages(result: StudyResult) -> str:
    return "\n".join(f"{s.name}: {s.path.name}, {s.state}" for s in result.stages)


def _told(result: StudyResult, verdict: StudyVerdict) -> dict[str, Any]:
    """Give all that a script would want to know."""
    rows, best = result.rows, verdict.best
    return {
        "study": result.spec.name,
        "seed": result.seed,
        "verdict": verdict.word,
        "text": verdict.text,
        "reachability": {"verdict": verdict.reach, **result.reach.to_mapping()},
        "sensor": None if result.sensor is None else result.sensor.to_mapping(),
        "algorithms": [asdict(one) | _words(one) for one in verdict.outcomes],
        "worst_runs": [] if rows is None or best is None else worst_runs(rows, best),
        "stages": [{"name": s.name, "state": s.state} for s in result.stages],
    }


def _words(one: AlgorithmOutcome) -> dict[str, Any]:
    lines = {line.line: {"verdict": line.word, "margin": line.margin} for line in one.lines}
    return {"verdict": one.whole.word, "margin": one.margin, "by_line": lines}


def _plain(value: Any) -> Any:
    """Put null in place of what is no finite number, which JSON does not know."""
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
