"""Pictures of a study of reachability: a terrain with its starts and ways, and rate against K."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from matplotlib.ticker import PercentFormatter

from lpet_sim.planning.mobility import kinds_of
from lpet_sim.planning.reach_result import RateResult, ReachabilityReport, TerrainResult
from lpet_sim.planning.reach_spec import Case, ReachSpec
from lpet_sim.terrain.figure_ground import ROCK, lit_colours, sample_ground, save_figure
from lpet_sim.terrain.terrain import Terrain, build_terrain

_NODES = 700
_STRADDLED = "#f5efe6"
_WAY = "#0b4f8a"
_MARKS = {
    "reachable": ("o", "#2c7fb8", "reachable"),
    "undecided": ("s", "#f0c419", "undecided"),
    "unreachable": ("X", "#c0392b", "unreachable"),
}


def draw_reach_map(result: TerrainResult, case: Case, spec: ReachSpec, path: Path) -> None:
    """Draw a terrain with the rocks that are not driven over, the starts, the ways and the goal.

    Args:
        result: What was found on the terrain.
        case: The terrain.
        spec: The study.
        path: The picture to write.

    Raises:
        OutputError: The picture cannot be written.
    """
    figure, axes = _sheet((8.4, 8.8))
    terrain = build_terrain(case.terrain, case.seed)
    ground = sample_ground(terrain, spec.box, _NODES)
    axes.imshow(lit_colours(terrain, ground, 1.5), origin="lower", extent=ground.extent)
    _draw_rocks(axes, terrain, spec)
    ways = [start.path[:, :2] for start in result.starts if start.path_m]
    axes.add_collection(LineCollection(ways, colors=_WAY, linewidths=0.9, alpha=0.85))
    for outcome, (marker, colour, label) in _MARKS.items():
        places = np.array([s.start_m for s in result.starts if s.outcome == outcome])
        if len(places):
            style: dict[str, Any] = {
                "c": colour,
                "edgecolors": "white",
                "linewidths": 0.6,
                "zorder": 4,
                "s": 34,
            }
            axes.scatter(*places.T, marker=marker, label=f"{label}: {len(places)}", **style)
    _draw_goal(axes, spec)
    axes.set(xlim=(spec.box.x_min, spec.box.x_max), ylim=(spec.box.y_min, spec.box.y_max))
    axes.set(xlabel="x, east [m]", ylabel="y, north [m]", aspect="equal")
    axes.set_title(f"{case.terrain.name}: {_rocks_of(case)}, seed {case.seed}", loc="left")
    axes.legend(loc="upper center", ncols=5, bbox_to_anchor=(0.5, -0.07))
    save_figure(figure, path)


def draw_rates(report: ReachabilityReport, path: Path) -> None:
    """Draw the rate against K, one line for each abundance, with its interval.

    Raises:
        OutputError: The picture cannot be written.
    """
    figure, axes = _sheet((7.2, 4.4))
    rates = report.rates
    # Against abundance where that alone is varied.
    by_factor = len({rate.factor for rate in rates}) > 1 or len(rates) == 1
    keys = list(dict.fromkeys(f"{rate.abundance:g}" for rate in rates)) if by_factor else ["all"]
    for number, key in enumerate(keys):
        group = [rate for rate in rates if not by_factor or f"{rate.abundance:g}" == key]
        _draw_line(axes, group, by_factor, f"C{number}", _label(key, by_factor))
    axes.set_xlabel("K, factor on the number of rocks" if by_factor else "rock abundance k")
    axes.set(ylim=(-0.02, 1.02), ylabel="goal reachable from")
    axes.yaxis.set_major_formatter(PercentFormatter(1.0))
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    axes.set_title(f"{report.name}: share of starts, 95 % interval; undecided shaded", loc="left")
    save_figure(figure, path)


def _sheet(size: tuple[float, float]) -> tuple[Figure, Axes]:
    figure = Figure(figsize=size, dpi=150)
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained")
    return figure, figure.add_subplot()


def _draw_rocks(axes: Axes, terrain: Terrain, spec: ReachSpec) -> None:
    rocks = terrain.rocks(spec.box, spec.mobility.climb_height_m)
    obstacles, straddled = kinds_of(rocks, spec.mobility)
    for which, colour, label in (
        (obstacles, ROCK, "obstacle"),
        (straddled, _STRADDLED, "to straddle"),
    ):
        outlines = rocks.select(which).outlines()
        style: dict[str, Any] = {"facecolors": colour, "linewidths": 0.0, "label": label}
        axes.add_collection(PolyCollection(outlines, **style))


def _draw_goal(axes: Axes, spec: ReachSpec) -> None:
    style: dict[str, Any] = {
        "markersize": 15,
        "markeredgecolor": "black",
        "zorder": 5,
        "linestyle": "",
    }
    axes.plot(*spec.goal_m, marker="*", color="#2ecc40", label="goal", **style)
    if spec.goal_radius_m > 0:
        ring: dict[str, Any] = {"fill": False, "edgecolor": "#2ecc40", "zorder": 5}
        axes.add_patch(Circle(spec.goal_m, spec.goal_radius_m, **ring))


def _rocks_of(case: Case) -> str:
    if math.isnan(case.abundance):
        return f"K {case.factor:g}"
    return f"k {case.abundance:.1%}, K {case.factor:g}"


def _label(key: str, by_factor: bool) -> str:
    if not by_factor:
        return "reachable"
    return "reachable" if key == "nan" else f"reachable, k {float(key):.1%}"


def _draw_line(
    axes: Axes, rates: list[RateResult], by_factor: bool, colour: str, label: str
) -> None:
    x = [rate.factor if by_factor else rate.abundance for rate in rates]
    value = np.array([rate.reachable.value for rate in rates])
    low = np.array([rate.reachable.low for rate in rates])
    high = np.array([rate.reachable.high for rate in rates])
    bars = np.clip([value - low, high - value], 0.0, None)
    axes.errorbar(x, value, bars, marker="o", capsize=3, color=colour, label=label)
    open_share = np.array([rate.undecided for rate in rates])
    axes.fill_between(x, value, value + open_share, color=colour, alpha=0.15, linewidth=0)
