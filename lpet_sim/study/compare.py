"""Whether the worst ways are worse for localization than ways at random."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.statistics import Interval, interval_of
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.study.drives import RANDOM, WORST
from lpet_sim.study.runs import DRIVE

_RESAMPLES = 2000


@dataclass(frozen=True)
class WorstAgainstRandom:
    """How an algorithm does on the worst ways and on others.

    Attributes:
        variant: Its label.
        worst_percent: RMS end error over the distance on the worst ways, completed runs [%].
        random_percent: On those at random [%].
        ratio: The former over the latter, with its bootstrap interval over drives.
    """

    variant: str
    worst_percent: float
    random_percent: float
    ratio: Interval

    @property
    def decision(self) -> Literal["worse", "easier", "not decided"]:
        """Whether the interval is on one side of 1."""
        if self.ratio.low > 1:
            return "worse"
        return "easier" if self.ratio.high < 1 else "not decided"


def worst_against_random(rows: Rows) -> list[WorstAgainstRandom]:
    """Compare the worst ways with the random ones for each algorithm.

    A failed run has no error and is left out here; the verdict counts it.

    Args:
        rows: Runs on drives whose names say which of both they are.
    """
    out = []
    for (variant,), of in rows.groups("variant"):
        squares = [_squares(of, kind) for kind in (WORST, RANDOM)]
        if all(len(kind) for kind in squares):
            out.append(_compared(str(variant), *squares))
    return out


def _squares(rows: Rows, kind: str) -> list[Array]:
    """Give the squared errors of the completed runs of each drive of a kind."""
    of = rows.where(np.array([str(name).startswith(kind) for name in rows[DRIVE]], dtype=bool))
    found = [
        np.square(runs.where(~runs.failed).numbers("end_percent")) for _, runs in of.groups(DRIVE)
    ]
    return [squares for squares in found if len(squares)]


def _compared(variant: str, worst: list[Array], random: list[Array]) -> WorstAgainstRandom:
    rng = stream(0, "study", "worst against random", variant)
    drawn = [[_rms_of(drives, rng) for _ in range(_RESAMPLES)] for drives in (worst, random)]
    high, low = (float(np.sqrt(np.mean(np.concatenate(kind)))) for kind in (worst, random))
    few = min(len(worst), len(random)) < 2
    ratios = np.array(drawn[0]) / np.array(drawn[1])
    told = Interval(high / low, 0.0, np.inf) if few else interval_of(high / low, ratios)
    return WorstAgainstRandom(variant, high, low, told)


def _rms_of(drives: list[Array], rng: np.random.Generator) -> float:
    """Give the RMS of drives drawn with replacement, each with all its draws."""
    chosen = rng.integers(len(drives), size=len(drives))
    return float(np.sqrt(np.mean(np.concatenate([drives[k] for k in chosen]))))
