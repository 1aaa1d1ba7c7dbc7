"""Figures of a trade-off: Pareto fronts, sensitivity, and static against simulated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lpet_sim.evaluation.charts.style import plain_ticks
from lpet_sim.evaluation.figures import COLOURS, save
from lpet_sim.recording.arrays import Array
from lpet_sim.tradeoff.recommend import cost_table
from lpet_sim.tradeoff.sensitivity import Sensitivity

if TYPE_CHECKING:
    from lpet_sim.tradeoff.run import TradeoffResult

__all__ = ["plot_agreement", "plot_pareto", "plot_sensitivity", "save"]

_PROXIES: Final = (
    ("image data [Mbit/m]", 1e-6),
    ("computing [core s/m]", 1.0),
    ("mass [kg]", 1.0),
)
_LABELS: Final = {
    "field_of_view_rad": "field of view [deg]",
    "resolution_px": "image width [px]",
    "baseline_m": "baseline [m]",
    "mast_height_m": "mast height [m]",
    "depression_rad": "depression angle [deg]",
    "image_interval_m": "image interval [m]",
    "matching_sigma_px": "matching accuracy, 1 sigma [px]",
    "imu": "inertial unit",
}


def plot_pareto(result: TradeoffResult) -> Figure:
    """Draw the predicted error against data volume, computing and mass.

    Args:
        result: The trade-off.
    """
    table = cost_table(result.predictions)
    figure = Figure(figsize=(12.0, 4.4), layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    picked = result.recommendation.judged.index
    for k, (axes, (label, scale)) in enumerate(zip(panels, _PROXIES, strict=True), start=1):
        x, y = scale * table[:, k], 100.0 * table[:, 0]
        axes.plot(x, y, "o", ms=3, color="0.75", label="candidate")
        held = result.allowed
        axes.plot(x[held], y[held], "o", ms=3, color=COLOURS[5], label="keeps to the constraints")
        front = result.front
        axes.plot(x[front], y[front], "o", ms=4, color=COLOURS[1], label="Pareto set")
        star = {"marker": "*", "ms": 15, "ls": "none", "mec": "white"}
        axes.plot(x[picked], y[picked], color=COLOURS[0], label="recommended", **star)
        axes.set(xlabel=label, xscale="linear" if k == len(_PROXIES) else "log", yscale="log")
        _limit(axes, result)
        axes.grid(alpha=0.3, which="both")
        if k < len(_PROXIES):
            plain_ticks(axes.xaxis)
    plain_ticks(panels[0].yaxis)
    panels[0].set_ylabel(f"predicted error after {result.spec.site.distance_m:g} m [%]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    return figure


def _limit(axes: Axes, result: TradeoffResult) -> None:
    """Draw where a prediction would just meet the position requirement with its margin."""
    spec = result.spec
    room = (1.0 - spec.rule.margin) * spec.requirement.position_ratio
    at = 100.0 * room / (spec.rule.spread * spec.rule.efficiency)
    axes.axhline(at, color="black", lw=1, ls="--", label="limit less margin and spread")


def plot_sensitivity(found: Sequence[Sensitivity]) -> Figure:
    """Draw rank correlations, shares of variance, and one-at-a-time curves."""
    count = max(1, len(found))
    rows = 1 + -(-count // 4)
    figure = Figure(figsize=(12.0, 3.1 * rows), layout="constrained")
    grid = figure.add_gridspec(rows, 4)
    _bars(figure.add_subplot(grid[0, :]), found)
    first: Axes | None = None
    for k, one in enumerate(found):
        axes = figure.add_subplot(grid[1 + k // 4, k % 4], sharey=first)
        first = first or axes
        _curve(axes, one)
        if k % 4 == 0:
            axes.set_ylabel("predicted error [%]")
    return figure


def _bars(axes: Axes, found: Sequence[Sensitivity]) -> None:
    at = np.arange(len(found))
    correlation = [one.rank_correlation for one in found]
    axes.barh(at + 0.2, correlation, 0.38, color=COLOURS[1], label="rank correlation with error")
    share = [one.first_order for one in found]
    axes.barh(at - 0.2, share, 0.38, color=COLOURS[4], label="share of variance alone")
    axes.set_yticks(at, [_LABELS[one.parameter].split(" [")[0] for one in found])
    axes.axvline(0.0, color="black", lw=0.8)
    axes.set_xlim(-1.0, 1.0)
    axes.invert_yaxis()
    axes.grid(alpha=0.3, axis="x")
    axes.legend(loc="best", fontsize="small")


def _curve(axes: Axes, one: Sensitivity) -> None:
    error = 100.0 * one.error_ratio
    if one.parameter == "imu":
        axes.plot(range(len(error)), error, "o-", color=COLOURS[1])
        axes.set_xticks(range(len(error)), one.values, rotation=20, fontsize="small")
    else:
        values = np.asarray(one.values, dtype=float)
        shown = np.degrees(values) if one.parameter.endswith("_rad") else values
        axes.plot(shown, error, "o-", color=COLOURS[1])
    axes.set(xlabel=_LABELS[one.parameter], yscale="log")
    axes.grid(alpha=0.3, which="both")
    plain_ticks(axes.yaxis)


def plot_agreement(predicted: Sequence[float], simulated: Mapping[str, Sequence[float]]) -> Figure:
    """Draw simulated errors against predicted ones, both as shares of the distance.

    Args:
        predicted: Of each setting.
        simulated: Of each setting, by the name of the estimator.
    """
    figure = Figure(figsize=(6.4, 5.6), layout="constrained")
    axes = figure.subplots()
    x: Array = 100.0 * np.asarray(predicted, dtype=float)
    for (name, values), colour in zip(simulated.items(), COLOURS[1:], strict=False):
        axes.plot(x, 100.0 * np.asarray(values, dtype=float), "o", ms=5, color=colour, label=name)
    ends = np.array([x.min(), x.max()])
    axes.plot(ends, ends, color="black", lw=1, label="equal to the prediction")
    axes.set(xlabel="predicted RMS error [% of the distance]", xscale="log", yscale="log")
    axes.set_ylabel("simulated RMS error [% of the distance]")
    plain_ticks(axes.xaxis)
    plain_ticks(axes.yaxis)
    axes.grid(alpha=0.3, which="both")
    axes.legend(loc="upper left")
    return figure
