"""How charts of a sweep look: one width, and colours that every eye tells apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullLocator

from lpet_sim.evaluation.figures import COLOURS
from lpet_sim.recording.arrays import Array

INK, PAPER, GRID = "#1b1f24", "#fffffe", "#d5d9de"
"""Colours of text, background and grid; no curve has one of them, so that a page may swap them."""
_MARKERS = "osD^vPX*"
_WIDTH_IN = 5.5
_FONT_PT = 9.0
_WIDE = 8.0
_DECADES_ONLY = 3.0
_SETTINGS: Any = {
    "text.color": INK,
    "axes.labelcolor": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.edgecolor": INK,
    "axes.facecolor": PAPER,
    "figure.facecolor": PAPER,
    "savefig.facecolor": PAPER,
    "legend.facecolor": PAPER,
    "legend.edgecolor": GRID,
    "grid.color": GRID,
    "font.size": _FONT_PT,
    "axes.titlesize": _FONT_PT,
    "legend.fontsize": _FONT_PT - 1,
    # Names of clip paths and glyphs are otherwise drawn by chance.
    "svg.hashsalt": "lpet",
}


@contextmanager
def chart_style() -> Iterator[None]:
    """Give figures that are made, and written, in the block the style of the charts."""
    with mpl.rc_context(_SETTINGS):
        yield


def blank(height_in: float) -> Figure:
    """Make an empty figure of the common width.

    Args:
        height_in: Height [inch].
    """
    return Figure(figsize=(_WIDTH_IN, height_in), layout="constrained")


def look(place: int) -> tuple[str, str]:
    """Give colour and marker of the variant family at a place in the order."""
    return COLOURS[place % len(COLOURS)], _MARKERS[place % len(_MARKERS)]


def log_error_axis(axes: Axes, finite: Array) -> float:
    """Set a logarithmic error axis around finite values, with room for those that are infinite.

    Args:
        axes: The axes.
        finite: All finite values that are drawn.

    Returns:
        A height above the axis, at which infinite values are drawn.
    """
    values = finite[np.isfinite(finite) & (finite > 0)]
    low, high = (values.min(), values.max()) if len(values) else (0.1, 1.0)
    axes.set_yscale("log")
    axes.set_ylim(low / 1.3, high * 1.5)
    plain_ticks(axes.yaxis)
    axes.grid(alpha=0.6)
    return float(high * 100)


def plain_ticks(axis: Axis) -> None:
    """Label a logarithmic axis with plain numbers at round places, few enough not to touch.

    Args:
        axis: The axis, after all is drawn that sets its limits.
    """
    low, high = axis.get_view_interval()
    decades = np.log10(high / low)
    if decades > _DECADES_ONLY:
        places: tuple[float, ...] = (1,)
    else:
        places = (1, 2, 5) if high / low > _WIDE else (1, 1.5, 2, 3, 5, 7)
    axis.set_major_locator(LogLocator(subs=places))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def swept_axis(axes: Axes, values: Sequence[float], label: str) -> None:
    """Set a logarithmic axis whose ticks are the values that were swept."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(list(values)))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_xlabel(label)


def draw_band(
    axes: Axes, x: Array, mid: Array, low: Array, high: Array, place: int, label: str, top: float
) -> None:
    """Draw a line with its band; what is infinite leaves through the top.

    Args:
        axes: The axes.
        x: Places, Shape (n,).
        mid: The line, Shape (n,).
        low: Lower edge, Shape (n,).
        high: Upper edge, Shape (n,).
        place: Place in the order of families, which sets colour and marker.
        label: Name in the legend.
        top: Height at which infinite values are drawn.
    """
    colour, marker = look(place)
    mid, low, high = (np.where(np.isinf(values), top, values) for values in (mid, low, high))
    axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
    every = marker if len(x) <= 20 else ""
    axes.plot(x, mid, color=colour, marker=every, ms=4.5, lw=1.5, label=label)
