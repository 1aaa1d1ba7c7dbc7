"""Figures of a run: where the rover went and was thought to be, and how the error grew."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection
from matplotlib.figure import Figure

from lpet_sim.evaluation.requirement import AXES, Requirement
from lpet_sim.evaluation.result import RunResult
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.trajectory import Trajectory

# Okabe and Ito's colours, told apart by the colour-blind too; black is the truth's.
COLOURS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_DPI = 150
_Item = TypeVar("_Item")


def plot_plan_view(
    truth: Trajectory, estimates: Sequence[Estimate], rocks_m: Array | None = None
) -> Figure:
    """Draw truth and estimates from above, as the paper's figure 4 does.

    Args:
        truth: True poses.
        estimates: What estimators made of it.
        rocks_m: Rocks to draw as discs, (x, y, diameter) [m], Shape (n, 3).

    Returns:
        The figure; write it with `save`.
    """
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    axes = figure.subplots()
    _draw_path(axes, truth, "truth", "black", 2.5)
    for estimate, colour in _coloured(estimates):
        _draw_path(axes, estimate.trajectory, estimate.name, colour, 1.3)
    axes.plot(*truth.T_world_body.translation[0, :2], "o", color="black", label="start")
    axes.set(xlabel="x, east [m]", ylabel="y, north [m]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    if rocks_m is not None:
        _draw_rocks(axes, rocks_m)
    axes.grid(alpha=0.3)
    axes.legend(loc="best")
    return figure


def plot_errors(results: Sequence[RunResult], requirement: Requirement | None = None) -> Figure:
    """Draw the errors of runs against the distance driven, with the limits of a requirement.

    Above the position error as a share of the distance so far, from the requirement's first
    metres on; below roll, pitch and yaw.

    Args:
        results: Scores of runs; one without a series is left out.
        requirement: Whose limits to draw; the default one if None.

    Returns:
        The figure; write it with `save`.
    """
    requirement = requirement or Requirement()
    scored = [result for result in results if result.series is not None]
    figure = Figure(figsize=(8.0, 9.0), layout="constrained")
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(2, 1, 1, 1))
    for result, colour in _coloured(scored):
        _draw_errors(rows, result, colour, requirement.start_m)
    _limit(rows[0], 100 * requirement.position_ratio, "limit")
    rows[0].set_ylabel("position error\n[% of distance so far]")
    # Estimators differ by orders of magnitude; below 0.01 % the axis is linear down to zero.
    rows[0].set_yscale("symlog", linthresh=0.01)
    rows[0].yaxis.set_major_formatter("{x:g}")
    rows[0].set_ylim(bottom=0)
    for row, axis, limit in zip(rows[1:], AXES, requirement.attitude_rad, strict=True):
        _limit(row, math.degrees(limit))
        _limit(row, -math.degrees(limit))
        row.set_ylabel(f"{axis} error\n[deg]")
    rows[0].legend(loc="best")
    rows[-1].set_xlabel("distance driven [m]")
    for row in rows:
        row.grid(alpha=0.3)
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write a figure as PNG."""
    figure.savefig(path, dpi=_DPI, format="png")


def _coloured(items: Sequence[_Item]) -> list[tuple[_Item, str]]:
    return [(item, COLOURS[k % len(COLOURS)]) for k, item in enumerate(items)]


def _draw_path(axes: Axes, path: Trajectory, label: str, colour: str, width: float) -> None:
    x, y = path.T_world_body.translation[:, :2].T
    axes.plot(x, y, color=colour, lw=width, label=label)
    axes.plot(x[-1:], y[-1:], "x", color=colour, ms=7, mew=2)


def _draw_rocks(axes: Axes, rocks_m: Array) -> None:
    size = rocks_m[:, 2]
    discs = EllipseCollection(
        size,
        size,
        np.zeros(len(size)),
        units="xy",
        offsets=rocks_m[:, :2],
        offset_transform=axes.transData,
        facecolor="#B0856A",
        edgecolor="none",
        alpha=0.6,
        zorder=0,
    )
    # The paths set the limits of the view; rocks beyond them do not.
    axes.add_collection(discs, autolim=False)


def _draw_errors(rows: Sequence[Axes], result: RunResult, colour: str, start_m: float) -> None:
    series = result.series
    assert series is not None
    late = series.distance_m >= min(start_m, series.distance_m[-1])
    ratio_percent = 100 * series.position_ratio[late]
    rows[0].plot(series.distance_m[late], ratio_percent, color=colour, label=result.name)
    for row, error_rad in zip(rows[1:], series.attitude_error_rad.T, strict=True):
        row.plot(series.distance_m, np.degrees(error_rad), color=colour)


def _limit(axes: Axes, value: float, label: str | None = None) -> None:
    axes.axhline(value, color="black", ls="--", lw=1, label=label)
