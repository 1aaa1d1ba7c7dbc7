"""Error and cost against the memory of the filter, M images or N landmarks, and its state size."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lpet_sim.errors import RowsError
from lpet_sim.evaluation.charts.style import (
    INK,
    blank,
    draw_band,
    log_error_axis,
    look,
    plain_ticks,
    swept_axis,
)
from lpet_sim.evaluation.families import (
    BOUNDED,
    KEEP_ALL,
    TIME_TO_LIVE,
    Variant,
    manners,
    size_families,
    variants_of,
)
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.statistics import Interval, draw_runs, interval_of, quantile
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream

Metric = Literal["end_percent", "worst_percent"]
LABELS = {
    "end_percent": "end error\n[% of distance]",
    "worst_percent": "worst error\n[% of distance so far]",
    "time_per_image_ms": "time per image [ms]",
}
SWEPT = {
    TIME_TO_LIVE: ("m", "time to live M [images]"),
    BOUNDED: ("n", "queue length N [landmarks]"),
}
_SEED = 0


@dataclass(frozen=True)
class _Line:
    """Medians of one family over what was swept, with their intervals."""

    name: str
    place: int
    x: Array
    medians: Sequence[Interval]

    @property
    def edges(self) -> tuple[Array, Array, Array]:
        """Median, lower and upper ends, Shape (k,) each."""
        rows = [(i.value, i.low, i.high) for i in self.medians]
        middle, low, high = np.array(rows).T
        return middle, low, high


def has_memory(rows: Rows) -> bool:
    """Tell whether the time to live or the queue was swept, so that there is a curve to draw."""
    return bool(_panels(rows))


def has_cost(rows: Rows) -> bool:
    """Tell whether there is a memory to draw over, and a time of any run."""
    return has_memory(rows) and bool(np.isfinite(rows.numbers("time_per_image_ms")).any())


def plot_error_over_memory(rows: Rows, metric: Metric = "end_percent") -> Figure:
    """Draw the error against M (top) and N (bottom), as the paper's figure 9 does.

    Medians over all runs of one arm, failed ones at infinity, with the 95 % bootstrap interval of
    the median; dashed lines are full SLAM with all images and landmarks.

    Args:
        rows: Rows of one arm.
        metric: Column of the error.

    Raises:
        RowsError: Neither M nor N was swept.
    """
    return _plot_over_memory(rows, metric, lambda of: of.errors(metric))


def plot_cost_over_memory(rows: Rows) -> Figure:
    """Draw the time per image against M (top) and N (bottom), over the completed runs of one arm.

    Args:
        rows: Rows of one arm.

    Raises:
        RowsError: Neither M nor N was swept.
    """
    return _plot_over_memory(rows, "time_per_image_ms", _completed_times)


def plot_error_over_size(
    rows: Rows, by: str = "state_max", metric: Metric = "end_percent"
) -> Figure:
    """Draw the error over the state size, multiframe against bounded, as the paper's figure 10.

    One panel for each manner of which both were swept: medians over the runs of one arm, failed
    ones at infinity, with the interval of the median; the size is the median over runs.

    Args:
        rows: Rows of one arm.
        by: Column of the size, ``state_max`` or ``state_mean``.
        metric: Column of the error.

    Raises:
        RowsError: No manner was swept over both M and N.
    """
    families = size_families(rows)
    if not families:
        raise RowsError("no manner was swept over both M and N: there are no sizes to compare")
    figure = blank(0.6 + 2.3 * len(families))
    panels = figure.subplots(len(families), 1, sharex=True, squeeze=False)[:, 0]
    drawn = [
        [_size_line(rows, name, place, labels, by, metric) for name, place, labels in both]
        for both in ([("multiframe (M)", 3, a), ("bounded (N)", 5, b)] for _, a, b in families)
    ]
    word = "maximum" if by == "state_max" else "mean"
    for axes, lines, (manner, _, _) in zip(panels, drawn, families, strict=True):
        _draw(axes, lines)
        axes.set(title=manner, ylabel=LABELS[metric], xscale="log")
        plain_ticks(axes.xaxis)
        axes.legend(loc="best")
    panels[-1].set_xlabel(f"{word} state size [landmarks]")
    return figure


def _plot_over_memory(rows: Rows, metric: str, values: Callable[[Rows], Array]) -> Figure:
    kinds = _panels(rows)
    if not kinds:
        raise RowsError("neither time to live nor queue length was swept: there is no curve")
    families = manners(variants_of(rows))
    figure = blank(0.9 + 2.4 * len(kinds))
    panels = figure.subplots(len(kinds), 1, squeeze=False)[:, 0]
    for axes, kind in zip(panels, kinds, strict=True):
        column, label = SWEPT[kind]
        lines = [
            _memory_line(rows, name, k, [v for v in of if v.retention == kind], column, values)
            for k, (name, of) in enumerate(families.items())
        ]
        whole = [_whole(rows, of, values) for of in families.values()]
        lines = [line for line in lines if len(line.x)]
        _draw(axes, lines, [(k, value) for k, value in enumerate(whole) if value is not None])
        swept_axis(axes, sorted({float(x) for line in lines for x in line.x}), label)
        axes.set_ylabel(LABELS[metric])
    _legend(figure, panels[0], any(value is not None for value in whole))
    return figure


def _panels(rows: Rows) -> list[str]:
    """Give the kinds of memory of which there are at least two sizes."""
    known = variants_of(rows)
    return [
        kind
        for kind, (column, _) in SWEPT.items()
        if len({getattr(v, column) for v in known if v.retention == kind}) > 1
    ]


def _draw(axes: Axes, lines: Sequence[_Line], whole: Sequence[tuple[int, float]] = ()) -> None:
    edges = [line.edges for line in lines]
    finite = np.concatenate([np.ravel(edge) for edge in edges] + [[v for _, v in whole]])
    top = log_error_axis(axes, finite)
    for line, (middle, low, high) in zip(lines, edges, strict=True):
        draw_band(axes, line.x, middle, low, high, line.place, line.name, top)
    for place, value in whole:
        axes.axhline(value, color=look(place)[0], ls="--", lw=1.2)


def _legend(figure: Figure, axes: Axes, dashed: bool) -> None:
    if dashed:
        axes.plot([], [], color=INK, ls="--", lw=1.2, label="full SLAM")
    handles, names = axes.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside upper center", ncols=2, frameon=False)


def _memory_line(
    rows: Rows,
    name: str,
    place: int,
    variants: Sequence[Variant],
    column: str,
    values: Callable[[Rows], Array],
) -> _Line:
    ordered = sorted(variants, key=lambda v: float(getattr(v, column)))
    x = np.array([getattr(v, column) for v in ordered], dtype=float)
    of = [_median(values(rows.select(variant=v.label))) for v in ordered]
    return _Line(name, place, x, of)


def _size_line(
    rows: Rows, name: str, place: int, labels: Sequence[str], by: str, metric: str
) -> _Line:
    groups = [rows.select(variant=label) for label in labels]
    groups = [group for group in groups if np.isfinite(group.numbers(by)).any()]
    sizes = [float(np.nanmedian(group.numbers(by))) for group in groups]
    order = np.argsort(sizes, kind="stable")
    medians = [_median(groups[k].errors(metric)) for k in order]
    return _Line(name, place, np.array(sizes)[order], medians)


def _whole(
    rows: Rows, variants: Sequence[Variant], values: Callable[[Rows], Array]
) -> float | None:
    """Give the median of the variant that keeps all."""
    labels = [v.label for v in variants if v.retention == KEEP_ALL]
    return _median(values(rows.select(variant=labels[0]))).value if labels else None


def _completed_times(rows: Rows) -> Array:
    return rows.times("time_per_image_ms")[~rows.failed]


def _median(values: Array) -> Interval:
    known = values[~np.isnan(values)]
    if not len(known):
        return Interval(np.nan, np.nan, np.nan)
    draws = draw_runs(len(known), stream(_SEED, "bootstrap", "runs", len(known)))
    return interval_of(quantile(known, 0.5), quantile(known[draws], 0.5))
