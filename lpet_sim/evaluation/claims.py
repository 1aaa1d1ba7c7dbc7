"""What a number of passes shows: which variants meet the requirement, and how surely."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from lpet_sim.evaluation.statistics import confidence_against_share, confidence_of_share
from lpet_sim.evaluation.summary import Summary

Outcome = Literal["shown", "refuted", "not decided"]
SHARE = 0.95
"""Share of runs that is to pass."""
CONFIDENCE = 0.95
"""One-sided confidence with which that is to be shown, or refuted."""


@dataclass(frozen=True)
class PassClaim:
    """The claim that a variant passes the requirement in at least `SHARE` of all runs.

    Attributes:
        arm: The arm.
        variant: The variant's label.
        passes: Runs that passed as a whole.
        runs: All runs, failed ones included.
        confidence: Confidence of the claim, one-sided.
        against: Confidence of its opposite.
    """

    arm: str
    variant: str
    passes: int
    runs: int
    confidence: float
    against: float

    @property
    def outcome(self) -> Outcome:
        """Whether the runs show the claim, refute it, or are too few to tell."""
        if self.confidence >= CONFIDENCE:
            return "shown"
        return "refuted" if self.against >= CONFIDENCE else "not decided"


def pass_claim(summary: Summary) -> PassClaim:
    """Hold the passes of a variant to the claim."""
    of = summary.passed, summary.runs, SHARE
    return PassClaim(
        arm=summary.arm,
        variant=summary.variant,
        passes=summary.passed,
        runs=summary.runs,
        confidence=confidence_of_share(*of),
        against=confidence_against_share(*of),
    )


def fewest_runs(share: float = SHARE, confidence: float = CONFIDENCE) -> int:
    """Give the fewest runs that can show the claim, if all of them pass: ``share^n <= 1 - c``."""
    return math.ceil(math.log(1 - confidence) / math.log(share))


def headline(claims: Sequence[PassClaim]) -> list[tuple[str, Outcome]]:
    """Say in a sentence for each arm which variants are shown to pass, the surest first."""
    out: list[tuple[str, Outcome]] = []
    for arm in dict.fromkeys(claim.arm for claim in claims):
        of = [claim for claim in claims if claim.arm == arm]
        shown = sorted((c for c in of if c.outcome == "shown"), key=lambda c: -c.confidence)
        refuted = sum(c.outcome == "refuted" for c in of)
        best: Outcome = "shown" if shown else "refuted" if refuted == len(of) else "not decided"
        out.append((f"{_sentence(arm, of, shown)} {_rest(of, len(shown), refuted)}", best))
    return out


def _sentence(arm: str, of: Sequence[PassClaim], shown: Sequence[PassClaim]) -> str:
    claim = (
        f"shown with {100 * CONFIDENCE:.0f} % confidence to pass the requirement in at least "
        f"{100 * SHARE:.0f} % of runs"
    )
    head = f"Arm {arm}: {len(shown) or 'none'} of {len(of)} variants {claim}"
    if not shown:
        best = max(of, key=lambda c: (c.passes / c.runs, c.runs))
        return f"{head}; most often {best.variant} passes ({best.passes}/{best.runs})."
    named = ", ".join(f"{c.variant} ({c.passes}/{c.runs})" for c in shown[:5])
    more = f", and {len(shown) - 5} more" if len(shown) > 5 else ""
    return f"{head}: {named}{more}."


def _rest(of: Sequence[PassClaim], shown: int, refuted: int) -> str:
    open_ = len(of) - shown - refuted
    text = f"Refuted: {refuted}; not decided by so many runs: {open_}."
    if max(claim.runs for claim in of) < fewest_runs():
        text += f" It takes {fewest_runs()} runs, all passing, to show it."
    return text
