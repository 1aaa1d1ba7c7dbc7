"""Is one variant worse than another? Paired over the data sets that both ran on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, wilcoxon

from lpet_sim.errors import RowsError
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.statistics import (
    Interval,
    draw_runs,
    interval_of,
    pass_rate,
    quantile,
    rms,
)
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream

Decision = Literal["holds", "does not hold", "not decided"]
_SEED = 0


@dataclass(frozen=True)
class Ordering:
    """Whether an error of ``worse`` is larger than that of ``better``, paired over data sets.

    A failed run has an infinite error; where both failed the pair is a tie.

    Attributes:
        arm: Arm in which they are compared.
        worse: Label of what is claimed to be worse.
        better: Label of what is claimed to be better.
        runs: Number of pairs.
        failed_worse: Failed runs of ``worse`` among them.
        failed_better: Failed runs of ``better`` among them.
        median_difference: Median of ``worse - better`` over all pairs, with its paired bootstrap
            interval.
        mean_difference_completed: Mean of it over the pairs in which both completed.
        rms_ratio_completed: RMS of ``worse`` over that of ``better`` over those pairs, with its
            paired bootstrap interval.
        share: Share of the pairs that are no ties in which ``worse`` is worse, with its
            Clopper-Pearson interval; NaN if all are ties.
        ties: Pairs with equal errors.
        p_sign: One-sided p-value of the sign test.
        p_wilcoxon: One-sided p-value of the Wilcoxon signed-rank test.
        tolerance: ``better`` may be worse by this share of its error and the claim still holds.
        deciding: Interval of the median of ``worse - (1 - tolerance) better``, which decides.
    """

    arm: str
    worse: str
    better: str
    runs: int
    failed_worse: int
    failed_better: int
    median_difference: Interval
    mean_difference_completed: float
    rms_ratio_completed: Interval
    share: Interval
    ties: int
    p_sign: float
    p_wilcoxon: float
    tolerance: float
    deciding: Interval

    @property
    def verdict(self) -> Decision:
        """What the intervals say.

        ``holds`` where the deciding interval lies above zero, unless the ratio of the RMS errors
        says the opposite by its own; ``does not hold`` where it lies below; else ``not decided``.
        """
        if self.deciding.high < 0:
            return "does not hold"
        reversed_in_rms = self.rms_ratio_completed.high < 1 - self.tolerance
        if self.deciding.low > 0 and not reversed_in_rms:
            return "holds"
        return "not decided"


def paired_orderings(
    rows: Rows,
    pairs: Sequence[tuple[str, str]],
    metric: str = "end_percent",
    tolerance: float = 0.0,
) -> list[Ordering]:
    """Test in every arm whether the first variant of each pair is worse than the second.

    Args:
        rows: Rows of all variants.
        pairs: Labels of variants, (worse, better).
        metric: Column of the error.
        tolerance: See `Ordering`.

    Returns:
        One for each arm in which both variants have runs on a common data set.

    Raises:
        RowsError: A label is in no row.
    """
    known = rows.values("variant")
    missing = sorted({label for pair in pairs for label in pair} - set(known))
    if missing:
        raise RowsError(f"no row has the variant {missing[0]}; there are {', '.join(known)}")
    out = []
    for (arm,), group in rows.groups("arm"):
        for worse, better in pairs:
            a, b = (errors_by_data_set(group, label, metric) for label in (worse, better))
            if common := [key for key in a if key in b]:
                x, y = (np.array([e[key] for key in common]) for e in (a, b))
                out.append(compare_errors(arm, (worse, better), x, y, tolerance))
    return out


def errors_by_data_set(
    rows: Rows, variant: str, metric: str = "end_percent"
) -> dict[tuple[str, str], float]:
    """Give the error of a variant by data set and seed, infinite where its run failed.

    Raises:
        RowsError: The variant ran twice on a data set and seed, so that no pair is told apart.
    """
    of = rows.select(variant=variant)
    keys = list(zip(of["data_set"].tolist(), map(str, of.texts("seed").tolist()), strict=True))
    if len(set(keys)) < len(keys):
        raise RowsError(f"{variant} ran twice on one data set and seed: pairs are not told apart")
    return dict(zip(keys, of.errors(metric).tolist(), strict=True))


def compare_errors(
    arm: str, labels: tuple[str, str], worse: Array, better: Array, tolerance: float = 0.0
) -> Ordering:
    """Compare paired errors.

    Args:
        arm: Arm in which they are compared.
        labels: Labels of both, (worse, better).
        worse: Errors of what is claimed to be worse, infinite where it failed, Shape (runs,).
        better: Errors of the other on the same data sets, Shape (runs,).
        tolerance: See `Ordering`.
    """
    a, b = np.asarray(worse, dtype=float), np.asarray(better, dtype=float)
    difference = _difference(a, b)
    lenient = difference if tolerance == 0 else _difference(a, b * (1 - tolerance))
    draws = draw_runs(len(a), stream(_SEED, "bootstrap", "pairs", len(a)))
    both = np.isfinite(difference) & np.isfinite(a)
    of_a, of_b = (np.where(both, x, np.nan) for x in (a, b))
    ratio = interval_of(_ratio(rms(of_a), rms(of_b)), _ratio(rms(of_a[draws]), rms(of_b[draws])))
    wins, losses = int((difference > 0).sum()), int((difference < 0).sum())
    return Ordering(
        arm=arm,
        worse=labels[0],
        better=labels[1],
        runs=len(a),
        failed_worse=int(np.isinf(a).sum()),
        failed_better=int(np.isinf(b).sum()),
        median_difference=_median(difference, draws),
        mean_difference_completed=float(difference[both].mean()) if both.any() else np.nan,
        rms_ratio_completed=ratio,
        share=pass_rate(wins, wins + losses) if wins + losses else Interval(np.nan, 0.0, 1.0),
        ties=len(a) - wins - losses,
        p_sign=_sign_test(wins, losses),
        p_wilcoxon=_wilcoxon(difference),
        tolerance=tolerance,
        deciding=_median(lenient, draws),
    )


def _median(values: Array, draws: NDArray[np.int64]) -> Interval:
    return interval_of(quantile(values, 0.5), quantile(values[draws], 0.5))


def _difference(a: Array, b: Array) -> Array:
    """Subtract; where both are infinite there is no difference."""
    both = np.isinf(a) & np.isinf(b)
    return np.where(both, 0.0, np.where(both, 0.0, a) - np.where(both, 0.0, b))


def _ratio(a: Array, b: Array) -> Array:
    """Divide; over nothing lies infinity, and nothing over nothing is no number."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(a / b)


def _sign_test(wins: int, losses: int) -> float:
    if not wins + losses:
        return 1.0
    return float(binomtest(wins, wins + losses, 0.5, alternative="greater").pvalue)


def _wilcoxon(difference: Array) -> float:
    """Give the p-value; infinite differences share the highest rank, ties are left out."""
    finite = np.abs(difference[np.isfinite(difference)])
    beyond = 2 * finite.max(initial=1.0)
    ranked = np.clip(difference[difference != 0], -beyond, beyond)
    if not len(ranked):
        return 1.0
    return float(wilcoxon(ranked, alternative="greater").pvalue)
