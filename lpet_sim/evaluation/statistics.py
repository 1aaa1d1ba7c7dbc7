"""Intervals over runs: never over the images of one run, which are not independent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import beta

from lpet_sim.recording.arrays import Array


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
    tail = (1 - confidence) / 2
    low, high = np.quantile(resampled, [tail, 1 - tail])
    return Interval(float(statistic(x, axis=-1)), float(low), float(high))


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
