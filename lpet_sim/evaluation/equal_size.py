"""Two families of variants compared at states of equal size, between the sizes that were swept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lpet_sim.evaluation.ordering import Ordering, compare_errors
from lpet_sim.evaluation.rows import Rows
from lpet_sim.recording.arrays import Array

Size = Literal["state_max", "state_mean"]
_SMALLEST = 1e-12
"""An error of zero has no logarithm: this one, far below any error that is looked at [%]."""


@dataclass(frozen=True)
class Curve:
    """Error against state size on one data set, by size.

    Attributes:
        size: State sizes in rising order [landmarks], Shape (k,).
        error: Errors there, infinite where the run failed, Shape (k,).
    """

    size: Array
    error: Array

    def at(self, size: Array) -> Array:
        """Give the error at other sizes; NaN beyond the smallest and largest that were swept.

        The logarithm of the error is linear in the logarithm of the size, so that a power law is
        met exactly; between a failed and a completed run the error is infinite.

        Args:
            size: Sizes [landmarks], Shape (n,).
        """
        right = np.clip(np.searchsorted(self.size, size), 1, len(self.size) - 1)
        x, y = np.log(self.size), np.log(np.maximum(self.error, _SMALLEST))
        share = (np.log(size) - x[right - 1]) / (x[right] - x[right - 1])
        left_part = np.where(share < 1, y[right - 1], 0.0) * (1 - share)
        right_part = np.where(share > 0, y[right], 0.0) * share
        # A hair for the rounding of the logarithm: the ends of the sweep are within it.
        inside = (size >= self.size[0] * (1 - 1e-9)) & (size <= self.size[-1] * (1 + 1e-9))
        with np.errstate(over="ignore"):
            return np.where(inside, np.exp(left_part + right_part), np.nan)


@dataclass(frozen=True)
class EqualSize:
    """Two families at one state size.

    Attributes:
        size: The size [landmarks].
        by: Whether it is the maximum or the mean size of each run.
        ordering: Family b claimed to be worse than family a, paired over the data sets on which
            the sweeps of both reach this size.
    """

    size: float
    by: Size
    ordering: Ordering


def at_equal_size(
    rows: Rows,
    family_a: Sequence[str],
    family_b: Sequence[str],
    names: tuple[str, str] = ("a", "b"),
    by: Size = "state_max",
    metric: str = "end_percent",
    tolerance: float = 0.0,
    points: int = 5,
) -> list[EqualSize]:
    """Compare two families of variants at equal state size, in every arm.

    On each data set the error of each family is interpolated between its variants in the logarithm
    of the state size, and the two are paired. The sizes are spread evenly in the logarithm over
    those that both families reach by the medians of their variants.

    Args:
        rows: Rows of all variants.
        family_a: Variants claimed to be at least as good, of at least two sizes.
        family_b: Variants that they are compared with.
        names: What to call the families.
        by: Column of the size.
        metric: Column of the error.
        tolerance: See `Ordering`.
        points: Number of sizes.

    Returns:
        Nothing for an arm in which the sizes do not overlap.
    """
    out = []
    for (arm,), group in rows.groups("arm"):
        sized = _with_every_size(group, by)
        curves = [_curves(sized, family, by, metric) for family in (family_a, family_b)]
        for size in _common_sizes(sized, family_a, family_b, by, points):
            a, b = (_errors_at(of, size) for of in curves)
            if common := [key for key in a if key in b]:
                x, y = (np.array([e[key] for key in common]) for e in (b, a))
                ordering = compare_errors(arm, (names[1], names[0]), x, y, tolerance)
                out.append(EqualSize(size, by, ordering))
    return out


def size_curve(rows: Rows, by: Size, metric: str) -> Curve | None:
    """Make the curve of the variants on one data set; None with fewer than two sizes.

    Of variants of one size the errors are averaged in the logarithm.

    Args:
        rows: Rows of one family on one data set.
        by: Column of the size.
        metric: Column of the error.
    """
    size, error = rows.numbers(by), rows.errors(metric)
    known = np.isfinite(size) & (size > 0)
    sizes, place = np.unique(size[known], return_inverse=True)
    if len(sizes) < 2:
        return None
    logs = np.log(np.maximum(error[known], _SMALLEST))
    with np.errstate(over="ignore"):
        return Curve(sizes, np.exp(np.bincount(place, logs) / np.bincount(place)))


def _with_every_size(rows: Rows, by: Size) -> Rows:
    """Give a run that failed before it had a size the median of its variant, and so its place."""
    size, variant = rows.numbers(by).copy(), rows["variant"]
    for label in rows.values("variant"):
        of = variant == label
        known = np.isfinite(size) & of
        if known.any():
            size[of & ~known] = np.median(size[known])
    return rows.with_columns(**{by: size})


def _curves(
    rows: Rows, family: Sequence[str], by: Size, metric: str
) -> dict[tuple[str, ...], Curve]:
    """Make the curve of a family on each data set and seed that has one."""
    of = rows.where(np.isin(rows["variant"].astype(str), list(family)))
    groups = of.groups("data_set", *(["seed"] if "seed" in of else []))
    curves = ((key, size_curve(group, by, metric)) for key, group in groups)
    return {key: curve for key, curve in curves if curve is not None}


def _errors_at(
    curves: Mapping[tuple[str, ...], Curve], size: float
) -> dict[tuple[str, ...], float]:
    """Give the error at one size by data set and seed, where the sweep reaches it."""
    errors = ((key, float(curve.at(np.array([size]))[0])) for key, curve in curves.items())
    return {key: error for key, error in errors if not np.isnan(error)}


def _common_sizes(
    rows: Rows, family_a: Sequence[str], family_b: Sequence[str], by: Size, points: int
) -> list[float]:
    spans = []
    for family in (family_a, family_b):
        sizes = [rows.select(variant=label).numbers(by) for label in family]
        medians = [float(np.median(s[np.isfinite(s)])) for s in sizes if np.isfinite(s).any()]
        if len(medians) < 2:
            return []
        spans.append((min(medians), max(medians)))
    low, high = max(s[0] for s in spans), min(s[1] for s in spans)
    return [float(s) for s in np.geomspace(low, high, points)] if 0 < low < high else []
