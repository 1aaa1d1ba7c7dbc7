"""The slope rig's figure: slip, sinkage and drift over the slope, with published points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lpet_sim.rig.slope import SlopeReport
from lpet_sim.rig.slope_point import Heading, SlopePoint
from lpet_sim.soil.published import PublishedCurve

# Okabe and Ito's colours, told apart by the colour-blind too.
COLOURS: Final[dict[Heading, str]] = {"up": "#D55E00", "down": "#0072B2", "across": "#009E73"}
_MARKERS: Final[dict[Heading, str]] = {"up": "o", "down": "s", "across": "D"}
_PUBLISHED_MARKERS: Final = ("^", "v", "P", "X")
_LEAST_PERCENT: Final = -120.0
_MOST_PERCENT: Final = 140.0
_ARROW_PERCENT: Final = 4.0  # length of the arrow down from an upper bound


def plot_slope(report: SlopeReport, published: Sequence[PublishedCurve] = ()) -> Figure:
    """Draw a slope rig: slip for each heading above, drift across and sinkage below.

    The band is one standard deviation over time, of the runs that were steady.

    Args:
        report: What was measured.
        published: What others measured on the same soil going up.

    Returns:
        The figure; `results` writes it.
    """
    figure = Figure(figsize=(8.0, 9.0), layout="constrained")
    rows = figure.subplots(3, 1, sharex=True, height_ratios=(3, 1, 1))
    _draw(
        rows[0],
        report,
        report.spec.headings,
        lambda p: 100 * p.slip,
        lambda p: 100 * (p.slip_std or 0.0),
    )
    _draw_published(rows[0], published)
    rows[0].axhline(100.0, color="black", lw=1, ls=":")
    rows[0].set_ylabel("slip [%]")
    low, high = rows[0].get_ylim()
    rows[0].set_ylim(max(low, _LEAST_PERCENT), min(high, _MOST_PERCENT))
    _draw(rows[1], report, ("across",), lambda p: float(np.degrees(p.drift_rad)))
    rows[1].set_ylabel("downhill drift\nacross [deg]")
    _draw(rows[2], report, report.spec.headings, lambda p: 1e3 * p.sinkage_m)
    rows[2].set_ylabel("sinkage [mm]")
    _finish_sinkage(rows[2], report)
    rows[2].set_xlabel("slope of the bed [deg]")
    for row in rows:
        row.grid(alpha=0.3)
    if not all(point.held for point in report.points):
        words = "not steady: slides, stalls, tips"
        rows[0].plot([], [], "o", color="gray", mfc="white", label=words)
    # Above the axes: within them there is no place that every soil's curves leave free.
    rows[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize="small")
    figure.suptitle(_title(report), fontsize="medium")
    return figure


def published_label(curve: PublishedCurve) -> str:
    """Give a published curve's name, marked where it is quoted from memory."""
    return f"{curve.label} [recalled]" if "[recalled]" in curve.source else curve.label


def _finish_sinkage(axes: Axes, report: SlopeReport) -> None:
    deepest_mm = max(1e3 * point.sinkage_m for point in report.points)
    axes.set_ylim(0.0, max(1.15 * deepest_mm, 1.0))
    if deepest_mm == 0:
        text = axes.text(0.5, 0.5, "this soil's law knows no sinkage", color="gray", ha="center")
        text.set_transform(axes.transAxes)


def _title(report: SlopeReport) -> str:
    spec = report.spec
    wheel = f", law of the wheel {spec.wheel.name}" if spec.wheel else ""
    return (
        f"{spec.rover.model} on {spec.soil.name}{wheel}\n"
        f"{100 * spec.speed_mps:g} cm/s, physics step {1e3 * spec.rover.physics_dt_s:g} ms"
    )


def _draw(
    axes: Axes,
    report: SlopeReport,
    headings: Sequence[Heading],
    value: Callable[[SlopePoint], float],
    band: Callable[[SlopePoint], float] | None = None,
) -> None:
    for heading in headings:
        points = report.along(heading)
        colour, marker = COLOURS[heading], _MARKERS[heading]
        slope = np.array([np.degrees(point.slope_rad) for point in points])
        y = np.array([value(point) for point in points])
        held = np.array([point.held for point in points])
        axes.plot(slope, y, color=colour, lw=1.5, label=f"simulated, {heading}")
        if band is not None:
            half = np.where(held, [band(point) for point in points], 0.0)
            axes.fill_between(slope, y - half, y + half, color=colour, alpha=0.2, lw=0)
        axes.plot(slope[held], y[held], marker, color=colour, ms=5)
        axes.plot(slope[~held], y[~held], marker, color=colour, ms=6, mfc="white")


def _draw_published(axes: Axes, published: Sequence[PublishedCurve]) -> None:
    longest_first = sorted(published, key=lambda curve: -len(curve.slip))
    for k, curve in enumerate(longest_first):
        slope = np.degrees(curve.slope_rad)
        slip = 100 * np.array(curve.slip)
        error = 100 * np.array(curve.slip_tolerance or (0.0,) * len(slope))
        error = np.full(len(slope), _ARROW_PERCENT) if curve.upper_bound else error
        axes.errorbar(
            slope,
            slip,
            yerr=error,
            uplims=curve.upper_bound,
            fmt=_PUBLISHED_MARKERS[k % len(_PUBLISHED_MARKERS)],
            color="black" if k % 2 == 0 else "#777777",
            mfc="none",
            ms=7,
            capsize=3,
            lw=1,
            label=published_label(curve),
            zorder=3,
        )
