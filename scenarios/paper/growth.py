"""How the error grows along the traverse, and what the forced slip does to it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np

from lpet_sim.evaluation.charts.growth import curve_quartiles
from lpet_sim.evaluation.rows import CURVE, Rows
from lpet_sim.evaluation.sheet import ENDS, Cell, Heading, Sheet, heads, interval, number, words
from lpet_sim.evaluation.statistics import Interval, draw_runs, interval_of, quantile
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream

SHARES: Final = (0.25, 0.5, 0.75, 1.0)
AROUND_M: Final = 0.6
"""Half of the stretch around the start of a slip over which the error's rise is taken [m]."""
_SEED = 0


def growth_sheet(rows: Rows) -> Sheet:
    """Make the table of the error at quarters of the distance, and of images with an anchor."""
    ideal = rows.where(rows["arm"] == "ideal")
    lines = [_growth_line(str(label), of) for (label,), of in ideal.groups("variant")]
    told = heads(*(f"at {100 * share:.0f} % [cm]" for share in SHARES))
    headings = (
        Heading("variant", words=True),
        Heading("data sets"),
        *told,
        Heading("end over half-way", ENDS),
        Heading("images with an anchor"),
    )
    note = (
        "Ideal arm. Median position error at shares of the distance; median of the ratio of the "
        "error at the end to that half-way, with its 95 % bootstrap interval over data sets: 1 is "
        "a band, 2 grows with the distance, 2.8 with its power of 1.5."
    )
    return Sheet("growth", "Growth of the error along the traverse", note, headings, tuple(lines))


def _growth_line(label: str, rows: Rows) -> tuple[Cell, ...]:
    _, middle, _ = curve_quartiles(rows)
    at = [middle[round(share * (len(middle) - 1))] for share in SHARES]
    curve = rows[CURVE]
    ratio = _end_m(rows) / curve[:, (curve.shape[1] - 1) // 2]
    anchors = rows.numbers("anchors_seen_share")
    seen = float(np.mean(anchors)) if np.isfinite(anchors).all() else np.nan
    return (
        words(label),
        number(len(rows), "d"),
        *(number(100 * error, ".2f") for error in at),
        interval(_median(np.where(np.isnan(ratio), np.inf, ratio)), ".2f"),
        number(seen, ".1%"),
    )


def slip_sheet(rows: Rows, slips_m: Mapping[str, float]) -> Sheet:
    """Make the table of what the long forced slip does to the error.

    Args:
        rows: Rows of all arms.
        slips_m: Distance at which the slip of each data set began [m].
    """
    ideal = rows.where(rows["arm"] == "ideal")
    lines = []
    for (label,), of in ideal.groups("variant"):
        at_m = np.array([slips_m.get(str(name), np.nan) for name in of["data_set"]])
        before, after = (_error_at(of, at_m + side * AROUND_M) for side in (-1.0, 1.0))
        elsewhere = _usual_rise(of)
        known = np.isfinite(before + after)
        cells = [_median(100 * x[known]) for x in (before, after, after - before, elsewhere)]
        lines.append((words(str(label)), number(int(known.sum()), "d"),
                      *(interval(cell, ".2f") for cell in cells)))  # fmt: skip
    texts = ("before [cm]", "after [cm]", "rise [cm]", "rise elsewhere [cm]")
    headings = (Heading("variant", words=True), Heading("data sets"), *heads(*texts, parts=ENDS))
    note = (
        f"Ideal arm. Median position error {AROUND_M:g} m before and after the place of the 5 s "
        "slip, and the median of its rise between; beside it the mean rise over as long a stretch "
        "of the same traverse."
    )
    return Sheet("slip", "The forced slip", note, headings, tuple(lines))


def _error_at(rows: Rows, at_m: Array) -> Array:
    """Give each run's error at a distance of its own [m], NaN beyond its curve."""
    errors = []
    for curve, path_m, at in zip(rows[CURVE], rows.numbers("path_m"), at_m, strict=True):
        along = np.linspace(0.0, path_m, len(curve))
        errors.append(np.interp(at, along, curve, left=np.nan, right=np.nan))
    return np.array(errors)


def _usual_rise(rows: Rows) -> Array:
    """Give the mean rise of the error over as long a stretch, Shape (runs,) [m]."""
    return np.asarray(_end_m(rows) / rows.numbers("path_m") * 2.0 * AROUND_M)


def _end_m(rows: Rows) -> Array:
    """Give the error where the estimate ends, which may be just short of the end [m]."""
    return rows.numbers("end_error_m")


def _median(values: Array) -> Interval:
    if not len(values):
        return Interval(np.nan, np.nan, np.nan)
    draws = draw_runs(len(values), stream(_SEED, "bootstrap", "runs", len(values)))
    return interval_of(quantile(values, 0.5), quantile(values[draws], 0.5))
