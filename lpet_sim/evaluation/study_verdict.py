"""The verdict of a study: each line of the requirement for each algorithm, and which is best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from lpet_sim.evaluation.claims import SHARE, Outcome, PassClaim
from lpet_sim.evaluation.requirement import AXES, Requirement
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.statistics import (
    Interval,
    confidence_against_share,
    confidence_of_share,
    pass_rate,
    quantile,
)

Word = Literal["PASS", "FAIL", "NOT DECIDED"]
WORDS: Final[dict[Outcome, Word]] = {
    "shown": "PASS",
    "refuted": "FAIL",
    "not decided": "NOT DECIDED",
}
_BEST_FIRST: Final[tuple[Word, ...]] = ("PASS", "NOT DECIDED", "FAIL")
WHOLE: Final = "passed"
"""Column of the requirement as a whole."""
_WHEN: Final = {"throughout": "worst", "end": "end"}


@dataclass(frozen=True)
class LineOutcome:
    """One line of the requirement for one algorithm.

    Attributes:
        line: Its column in the rows, such as ``pass_yaw_throughout``; `WHOLE` for all together.
        claim: That it is met in at least `SHARE` of all runs.
        rate: Share of runs that meet it, with its Clopper-Pearson interval.
        limit: The limit [% or deg]; NaN where the line is no limit on an error.
        reached: The error that `SHARE` of the runs stay below, infinite if more fail.
    """

    line: str
    claim: PassClaim
    rate: Interval
    limit: float = np.nan
    reached: float = np.nan

    @property
    def word(self) -> Word:
        """PASS if it is shown, FAIL if it is refuted."""
        return WORDS[self.claim.outcome]

    @property
    def margin(self) -> float:
        """How far `reached` is below the limit, as a share of it; negative beyond it."""
        return 1.0 - self.reached / self.limit


@dataclass(frozen=True)
class AlgorithmOutcome:
    """What a study says of one algorithm.

    Attributes:
        arm: Conditions under which it ran.
        variant: Its label.
        estimator: Its name for `build_estimator`.
        spec: Its parameters as JSON.
        whole: The requirement as a whole.
        lines: Its lines.
        median_percent: Median end error over all runs, failed ones at infinity [%].
        ms_per_image: Cost.
    """

    arm: str
    variant: str
    estimator: str
    spec: str
    whole: LineOutcome
    lines: tuple[LineOutcome, ...]
    median_percent: float
    ms_per_image: float

    @property
    def margin(self) -> float:
        """The least margin of its lines."""
        return min((line.margin for line in self.lines if np.isfinite(line.limit)), default=np.nan)


def judge(rows: Rows, requirement: Requirement) -> list[AlgorithmOutcome]:
    """Hold every algorithm to the requirement, the best first.

    Best is the one that passes most surely, then most often, then with the widest margin: its
    worst line's, at the error that `SHARE` of the runs stay below.

    Args:
        rows: Runs of all algorithms, failed ones included.
        requirement: The requirement that the rows were held to.
    """
    found = [
        _algorithm(arm, variant, of, requirement)
        for (arm, variant), of in rows.groups("arm", "variant")
    ]
    return sorted(found, key=_rank)


def _rank(outcome: AlgorithmOutcome) -> tuple[int, float, float, float]:
    return (
        _BEST_FIRST.index(outcome.whole.word),
        -outcome.whole.rate.value,
        -outcome.margin,
        outcome.median_percent,
    )


def _algorithm(arm: str, variant: str, rows: Rows, requirement: Requirement) -> AlgorithmOutcome:
    lines = [_line(arm, variant, rows, name, *of) for name, of in _limits(requirement).items()]
    return AlgorithmOutcome(
        arm=arm,
        variant=variant,
        estimator=str(rows.texts("estimator")[0]),
        spec=str(rows.texts("spec")[0]),
        whole=_line(arm, variant, rows, WHOLE),
        lines=tuple(line for line in lines if line is not None and line.line in rows),
        median_percent=float(quantile(np.sort(rows.errors("end_percent")), 0.5, True)),
        ms_per_image=float(np.nanmean(rows.times("time_per_image_ms"))),
    )


def _limits(requirement: Requirement) -> dict[str, tuple[str, float]]:
    """Give for each line the column of its error and its limit [% or deg]."""
    named = {"position": ("percent", 100.0 * requirement.position_ratio)}
    for axis, limit_rad in zip(AXES, requirement.attitude_rad, strict=True):
        named[axis] = (f"{axis}_deg", float(np.degrees(limit_rad)))
    held = {"throughout": requirement.throughout, "end": requirement.at_end}
    return {
        f"pass_{what}_{when}": (f"{_WHEN[when]}_{column}", limit)
        for when, is_held in held.items()
        if is_held
        for what, (column, limit) in named.items()
    }


def _line(
    arm: str, variant: str, rows: Rows, line: str, column: str = "", limit: float = np.nan
) -> LineOutcome:
    passes, runs = int(np.sum(rows[line].astype(bool))), len(rows)
    of = passes, runs, SHARE
    claim = PassClaim(
        arm, variant, passes, runs, confidence_of_share(*of), confidence_against_share(*of)
    )
    errors = np.sort(rows.errors(column)) if column else np.array([np.nan])
    reached = float(quantile(errors, SHARE, True))
    return LineOutcome(line, claim, pass_rate(passes, runs), limit, reached)


def worst_runs(rows: Rows, outcome: AlgorithmOutcome, count: int = 5) -> list[tuple[str, str]]:
    """Name the worst runs of an algorithm and their data sets, failed ones first."""
    of = rows.select(arm=outcome.arm, variant=outcome.variant)
    order = np.argsort(-of.errors("worst_percent"), kind="stable")[:count]
    return [(str(of["run"][k]), str(of["data_set"][k])) for k in order]


def verdict_of(outcomes: Sequence[AlgorithmOutcome]) -> Word:
    """Say the study's verdict: that of the best algorithm."""
    return outcomes[0].whole.word
