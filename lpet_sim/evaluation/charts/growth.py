"""How the error grows along the traverse, as the paper's figure 7 shows it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from lpet_sim.errors import RowsError
from lpet_sim.evaluation.charts.style import blank, draw_band
from lpet_sim.evaluation.families import KEEP_ALL, Variant, manners, variants_of
from lpet_sim.evaluation.rows import CURVE, Rows
from lpet_sim.evaluation.statistics import quantile
from lpet_sim.recording.arrays import Array


def has_growth(rows: Rows) -> bool:
    """Tell whether the rows hold error curves."""
    return CURVE in rows and rows[CURVE].ndim == 2 and bool(np.isfinite(rows[CURVE]).any())


def plot_error_growth(rows: Rows, variants: Sequence[str] | None = None) -> Figure:
    """Draw the position error against the distance driven: median and middle half of the runs.

    Where a failed run gave no more poses its error is infinite.

    Args:
        rows: Rows of one arm.
        variants: Labels of the variants; if None, of each manner the one that remembers most, and
            all variants where none has a memory.

    Raises:
        RowsError: The rows hold no error curves.
    """
    if not has_growth(rows):
        raise RowsError(f"the rows hold no '{CURVE}': there is no growth to draw")
    chosen = _named(rows, variants)
    figure = blank(3.6)
    axes = figure.subplots()
    path_m = float(np.nanmedian(rows.numbers("path_m"))) if "path_m" in rows else 1.0
    highest = 0.0
    for place, (name, label) in enumerate(chosen):
        low, middle, high = curve_quartiles(rows.select(variant=label))
        finite = high[np.isfinite(high)]
        highest = max(highest, float(finite.max(initial=0.0)))
        x = np.linspace(0, path_m, len(middle))
        draw_band(axes, x, middle, low, high, place, name, top=1e6)
    axes.set_ylim(0, 1.05 * highest or 1.0)
    axes.set_xlim(0, path_m)
    axes.set(xlabel="distance driven [m]", ylabel="position error [m]")
    axes.grid(alpha=0.6)
    axes.legend(loc="upper left")
    return figure


def curve_quartiles(rows: Rows) -> tuple[Array, Array, Array]:
    """Give lower quartile, median and upper quartile of the error curves, Shape (k,) each.

    Where a failed run's curve ends its error is infinite. A run that did not fail may still end a
    little before the traverse does: its last error stands for the rest.
    """
    curve = rows[CURVE]
    reached = np.maximum.accumulate(np.where(np.isnan(curve), 0, np.arange(curve.shape[1])), axis=1)
    held = np.take_along_axis(curve, reached, axis=1)
    held = np.where(rows.failed[:, None], curve, held)
    curves = np.where(np.isnan(held), np.inf, held).T
    low, middle, high = (quantile(curves, share) for share in (0.25, 0.5, 0.75))
    return low, middle, high


def _named(rows: Rows, labels: Sequence[str] | None) -> list[tuple[str, str]]:
    if labels is not None:
        return [(label, label) for label in labels]
    known = variants_of(rows)
    chosen = [(name, _most(of)) for name, of in manners(known).items()]
    named = [(f"{name} ({_word(variant)})", variant.label) for name, variant in chosen]
    return named or [(v.label, v.label) for v in known]


def _most(variants: Sequence[Variant]) -> Variant:
    """Give the variant that remembers most: full SLAM, else the largest M, else the largest N."""
    return max(variants, key=lambda v: (v.retention == KEEP_ALL, min(v.m, v.n)))


def _word(variant: Variant) -> str:
    if variant.retention == KEEP_ALL:
        return "full SLAM"
    return f"M {variant.m:g}" if variant.m < variant.n else f"N {variant.n:g}"
