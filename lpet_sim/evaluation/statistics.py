"""Intervals over runs: never over the images of one run, which are not independent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import beta, binom

from lpet_sim.recording.arrays import Array

RUNS_MIN = 6
"""Fewest runs with a bootstrap interval: of five, not even smallest and largest hold the median
with 95 % confidence, ``1 - 2 / 2^5``."""


@dataclass(frozen=True)
class Interval:
    """A value with its confidence interval.

    Attributes:
        value: The statistic of the runs.
        low: Lower end.
        high: Upper end.
    """

    value: float
    low: float
    high: float


def bootstrap(
    values: ArrayLike,
    rng: np.random.Generator,
    statistic: Callable[..., Array] = np.median,
    confidence: float = 0.95,
    resamples: int = 2000,
) -> Interval:
    """Give a statistic over runs with its percentile bootstrap interval.

    Args:
        values: One value for each run, Shape (runs,).
        rng: Generator of the resamples.
        statistic: A numpy reduction that takes ``axis``.
        confidence: Coverage of the interval.
        resamples: Number of resamples.
    """
    x = np.asarray(values, dtype=float)
    resampled = statistic(x[rng.integers(len(x), size=(resamples, len(x)))], axis=-1)
    return interval_of(statistic(x, axis=-1), resampled, confidence)


def interval_of(value: ArrayLike, resampled: ArrayLike, confidence: float = 0.95) -> Interval:
    """Give a statistic with the percentile interval of its resamples.

    Args:
        value: The statistic of the runs.
        resampled: Its values over the resamples, Shape (resamples,); those that are not a number,
            of resamples that hold no run to speak of, are left out.
        confidence: Coverage of the interval.
    """
    known = np.asarray(resampled, dtype=float)
    known = known[~np.isnan(known)]
    if not len(known):
        return Interval(float(np.asarray(value)), np.nan, np.nan)
    tail = (1 - confidence) / 2
    ends = (float(quantile(known, share)) for share in (tail, 1 - tail))
    return Interval(float(np.asarray(value)), *ends)


def quantile(values: ArrayLike, share: float, in_order: bool = False) -> Array:
    """Give a quantile by linear interpolation, where values may be infinite.

    A failed run has an infinite error and keeps its place among the others; between two values of
    which one is infinite lies that infinity, and between the two infinities zero.

    Args:
        values: Values along the last axis, Shape (..., n).
        share: Share of the values below it, 0 to 1.
        in_order: Whether the values are sorted already.
    """
    x = np.asarray(values, dtype=float)
    x = x if in_order else np.sort(x, axis=-1)
    at = round(share * (x.shape[-1] - 1), 9)
    low, high = x[..., int(np.floor(at))], x[..., int(np.ceil(at))]
    with np.errstate(invalid="ignore"):
        between = low + (high - low) * (at % 1)
        # Of two equal infinities the difference is no number, of two opposite ones the sum.
        between = np.where(np.isnan(between) & ~np.isnan(low + high), low, between)
        opposite = np.isinf(low) & np.isinf(high) & (low != high)
    return np.where(low == high, low, np.where(opposite, 0.0, between))


def rms(values: ArrayLike, axis: int = -1) -> Array:
    """Give the root mean square of the finite values along an axis; NaN where there are none."""
    x = np.asarray(values, dtype=float)
    known = np.isfinite(x)
    squares = np.where(known, x, 0.0) ** 2
    count = known.sum(axis=axis)
    mean = squares.sum(axis=axis) / np.maximum(count, 1)
    return np.where(count > 0, np.sqrt(mean), np.nan)


def draw_runs(runs: int, rng: np.random.Generator, resamples: int = 2000) -> NDArray[np.int64]:
    """Draw resamples of runs, each in order, so that a sorted array stays sorted under them.

    One set of draws serves many statistics: values indexed by it are resampled together, run by
    run, as a ratio or a paired difference needs it.

    Args:
        runs: Number of runs.
        rng: Generator of the resamples.
        resamples: Number of resamples.

    Returns:
        Indices, Shape (resamples, runs); no resample of fewer than `RUNS_MIN` runs, so that a
        statistic of them has no interval.
    """
    resamples = resamples if runs >= RUNS_MIN else 0
    return np.sort(rng.integers(runs, size=(resamples, runs)), axis=-1)


def pass_rate(passes: int, runs: int, confidence: float = 0.95) -> Interval:
    """Give a pass rate with its Clopper-Pearson interval, which is exact for any count.

    Args:
        passes: Runs that passed.
        runs: All runs, failed ones included.
        confidence: Coverage, two-sided.

    Reference:
        Clopper and Pearson (1934), Biometrika 26, 404-413.
    """
    tail = (1 - confidence) / 2
    low = 0.0 if passes == 0 else float(beta.ppf(tail, passes, runs - passes + 1))
    high = 1.0 if passes == runs else float(beta.ppf(1 - tail, passes + 1, runs - passes))
    return Interval(passes / runs, low, high)


def confidence_of_share(passes: int, runs: int, share: float = 0.95) -> float:
    """Give the confidence with which at least a share of all runs passes.

    The one-sided level at which the lower Clopper-Pearson end is the share: the chance of fewer
    passes than were seen if exactly that share passed, ``P(X < passes)``.

    Args:
        passes: Runs that passed.
        runs: All runs, failed ones included.
        share: The share that is to be shown.
    """
    return float(binom.cdf(passes - 1, runs, share))


def confidence_against_share(passes: int, runs: int, share: float = 0.95) -> float:
    """Give the confidence with which less than a share of all runs passes, ``P(X > passes)``.

    Args:
        passes: Runs that passed.
        runs: All runs, failed ones included.
        share: The share that is to be refuted.
    """
    return float(binom.sf(passes, runs, share))


def paired_difference(
    a: ArrayLike, b: ArrayLike, rng: np.random.Generator, confidence: float = 0.95
) -> Interval:
    """Give the median of ``a - b`` over runs on the same seeds, with its bootstrap interval.

    Two estimators differ where the interval leaves zero out.

    Args:
        a: Values of one estimator, Shape (runs,).
        b: Values of the other on the same recordings, Shape (runs,).
        rng: Generator of the resamples.
        confidence: Coverage of the interval.
    """
    difference = np.asarray(a, dtype=float) - np.asarray(b, dtype=float)
    return bootstrap(difference, rng, confidence=confidence)
