"""One line for each variant: its pass rate, and how its errors fit its covariance."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy.stats import chi2

from lpet_sim.errors import RowsError
from lpet_sim.evaluation.charts.style import INK, blank, look
from lpet_sim.evaluation.consistency import chi_square_band
from lpet_sim.evaluation.families import Variant, manners, variants_of
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.statistics import pass_rate
from lpet_sim.evaluation.summary import NEES_DOF

_ROW_IN, _MARGIN_IN = 0.19, 1.0
_LABEL_PT = 7.0


def plot_pass_rates(rows: Rows, share: float = 0.95) -> Figure:
    """Draw the pass rate of every variant with its 95 % Clopper-Pearson interval.

    Args:
        rows: Rows of one arm.
        share: Share of runs that is to pass, drawn as a line.
    """
    variants, places = _in_order(rows)
    figure, axes = _lines(variants)
    for row, (variant, place) in enumerate(zip(variants, places, strict=True)):
        passed = rows.select(variant=variant.label)["passed"].astype(bool)
        rate = pass_rate(int(passed.sum()), len(passed))
        ends = 100 * np.array([[rate.value - rate.low], [rate.high - rate.value]])
        axes.barh(row, 100 * rate.value, height=0.72, color=look(place)[0], alpha=0.75)
        axes.errorbar(
            100 * rate.value,
            row,
            xerr=np.maximum(ends, 0),
            fmt="none",
            ecolor=INK,
            elinewidth=1.1,
            capsize=2,
        )
        axes.text(104, row, f"{int(passed.sum())}/{len(passed)}", fontsize=_LABEL_PT, va="center")
    axes.axvline(100 * share, color=INK, ls="--", lw=1)
    axes.set_xlim(0, 116)
    axes.set_xticks([0, 20, 40, 60, 80, 100 * share])
    axes.set_xlabel("runs that pass the requirement as a whole [%]")
    return figure


def has_nees(rows: Rows, block: str = "pose") -> bool:
    """Tell whether any run has a NEES."""
    return bool(np.isfinite(rows.numbers(f"nees_{block}")).any())


def plot_nees(rows: Rows, block: str = "pose") -> Figure:
    """Draw the NEES at the end of every run as boxes, its mean, and the bands of both.

    The wide band holds 95 % of single runs of a consistent filter, the narrow one the mean over
    as many runs as most variants have.

    Args:
        rows: Rows of one arm.
        block: ``position``, ``attitude`` or ``pose``.

    Raises:
        RowsError: No run has a NEES.
    """
    if not has_nees(rows, block):
        raise RowsError(f"no run has a 'nees_{block}': there is no consistency to draw")
    known = rows.where(np.isfinite(rows.numbers(f"nees_{block}")))
    variants, places = _in_order(known)
    groups = [known.select(variant=v.label).numbers(f"nees_{block}") for v in variants]
    figure, axes = _lines(variants)
    _draw_bands(axes, NEES_DOF[block], round(float(np.median([len(g) for g in groups]))))
    for row, (values, place) in enumerate(zip(groups, places, strict=True)):
        _draw_box(axes, row, np.maximum(values, 1e-3), look(place)[0])
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel(f"NEES of the {block} at the end ({NEES_DOF[block]} dof)")
    figure.legend(loc="outside upper center", ncols=3, frameon=False)
    return figure


def _draw_bands(axes: Axes, dof: int, runs: int) -> None:
    low, high = chi2.ppf([0.025, 0.975], dof)
    axes.axvspan(low, high, color="#56B4E9", alpha=0.18, lw=0, label="95 % of runs")
    low, high = chi_square_band(runs, dof)
    axes.axvspan(low, high, color="#009E73", alpha=0.45, lw=0, label=f"95 % of means of {runs}")
    axes.plot([], [], "D", color=INK, ms=4, label="mean")


def _draw_box(axes: Axes, row: int, values: np.ndarray, colour: str) -> None:
    axes.boxplot(
        [values],
        positions=[row],
        widths=0.6,
        orientation="horizontal",
        manage_ticks=False,
        patch_artist=True,
        boxprops={"facecolor": colour, "alpha": 0.6, "edgecolor": INK},
        medianprops={"color": INK},
        whiskerprops={"color": INK},
        capprops={"color": INK},
        flierprops={"marker": ".", "ms": 3, "markeredgecolor": colour},
    )
    axes.plot(values.mean(), row, "D", color=INK, ms=4)


def _in_order(rows: Rows) -> tuple[list[Variant], list[int]]:
    """Give all variants by manner, with the place of the manner, which is its colour."""
    known = variants_of(rows)
    families: Sequence[Sequence[Variant]] = list(manners(known).values())
    ordered = [(v, place) for place, of in enumerate(families) for v in of]
    ordered += [(v, len(families)) for v in known if not v.retention]
    return [v for v, _ in ordered], [place for _, place in ordered]


def _lines(variants: Sequence[Variant]) -> tuple[Figure, Axes]:
    """Make a figure with one line for each variant, the first on top."""
    figure = blank(_MARGIN_IN + _ROW_IN * len(variants))
    axes = figure.subplots()
    axes.set_yticks(range(len(variants)), [v.label for v in variants], fontsize=_LABEL_PT)
    axes.set_ylim(len(variants) - 0.4, -0.6)
    axes.grid(axis="x", alpha=0.6)
    return figure, axes
