"""Pictures of a terrain: the map from above (paper, figure 2) and the shaded relief (figure 3)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator
from scipy.ndimage import gaussian_filter

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.figure_ground import (
    ROCK,
    Ground,
    colour_scale,
    lit_colours,
    sample_ground,
    save_figure,
)
from lpet_sim.terrain.relief_figure import draw_relief
from lpet_sim.terrain.terrain import Terrain

__all__ = ["draw_map", "draw_relief"]

_HATCHES = ("", "////", "....", "xxxx", "----", "++++")
_MAP_NODES = 700
_PATCHES_MAX = 25.0
_INK = "#2b1a14"
_HATCH = "#4b6a88"


def draw_map(terrain: Terrain, box: Box, path: Path | str) -> None:
    """Draw the terrain from above: shaded elevation, contours, soils, and the rocks to scale.

    Args:
        terrain: The terrain.
        box: What to show [m].
        path: The picture to write; its ending says PNG, PDF or SVG.

    Raises:
        OutputError: The picture cannot be written.

    Reference: Bakambu et al., figure 2.
    """
    ground = sample_ground(terrain, box, _MAP_NODES)
    figure, axes = _sheet(box)
    levels = _contour_levels(ground.z)
    image = _draw_elevation(axes, terrain, ground, levels)
    handles = _draw_soils(axes, terrain, box)
    handles += _draw_rocks(axes, terrain, box)
    _draw_marks(axes, terrain, box)
    bar = figure.colorbar(image, ax=axes, fraction=0.035, pad=0.015)
    bar.set_label("elevation [m]")
    axes.set_title(f"{terrain.spec.name}: contours every {levels[1] - levels[0]:g} m", loc="left")
    axes.set(xlim=(box.x_min, box.x_max), ylim=(box.y_min, box.y_max))
    axes.set(xlabel="x, east [m]", ylabel="y, north [m]", aspect="equal")
    if handles:
        axes.legend(handles=handles, loc="upper center", ncols=4, bbox_to_anchor=(0.5, -0.07))
    save_figure(figure, path)


def _sheet(box: Box) -> tuple[Figure, Axes]:
    ratio = (box.y_max - box.y_min) / (box.x_max - box.x_min)
    figure = Figure(figsize=(9.0, float(np.clip(8.2 * ratio, 3.0, 14.0)) + 0.8), dpi=170)
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained")
    return figure, figure.add_subplot()


def _contour_levels(z: Array) -> Array:
    low, high = float(z.min()), float(z.max())
    return np.asarray(MaxNLocator(12, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high + 1e-6))


def _draw_elevation(axes: Axes, terrain: Terrain, ground: Ground, levels: Array) -> Any:
    shaded = lit_colours(terrain, ground, 1.5)
    axes.imshow(shaded, origin="lower", extent=ground.extent, interpolation="bilinear")
    # Fractal ground has fractal contours: smoothed over a hundredth of the sheet they can be read.
    smooth = gaussian_filter(ground.z, _MAP_NODES / 100.0, mode="nearest")
    lines = axes.contour(
        ground.x, ground.y, smooth, levels=levels, colors=_INK, linestyles="solid", linewidths=0.6
    )
    for text in axes.clabel(lines, levels[::2], fmt="%g m", fontsize=7):
        text.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    return colour_scale(ground)


def _draw_soils(axes: Axes, terrain: Terrain, box: Box) -> list[Any]:
    """Hatch all soils but the first and give their legend."""
    soils = terrain.spec.soils
    if len(soils) < 2:
        return []
    if box.x_max - box.x_min > _PATCHES_MAX * terrain.spec.soil_patch_m:
        label = f"soils in patches of {terrain.spec.soil_patch_m:g} m: too fine to draw"
        return [Patch(facecolor="none", edgecolor=_HATCH, hatch="////", label=label)]
    x, y = np.linspace(box.x_min, box.x_max, 300), np.linspace(box.y_min, box.y_max, 300)
    kind = terrain.soil(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(300, 300)
    hatches = [_HATCHES[i % len(_HATCHES)] for i in range(len(soils))]
    for i in range(1, len(soils)):
        inside = (kind == i).astype(float)
        filled = axes.contourf(x, y, inside, levels=[0.5, 1.5], colors="none", hatches=[hatches[i]])
        filled.set(edgecolor=_HATCH, linewidth=0.0)
        axes.contour(x, y, inside, levels=[0.5], colors=_HATCH, linewidths=0.8)
    return [
        Patch(facecolor="#e0b48a", edgecolor=_HATCH, hatch=hatch, label=soil.name)
        for hatch, soil in zip(hatches, soils, strict=True)
    ]


def _draw_rocks(axes: Axes, terrain: Terrain, box: Box) -> list[Any]:
    """Fill the rocks' outlines; leave out those smaller than half a pixel of the sheet."""
    smallest = (box.x_max - box.x_min) / 2400.0
    rocks = terrain.rocks(box.grown(2.0), smallest)
    if len(rocks) == 0:
        return []
    axes.add_collection(PolyCollection(rocks.outlines(), facecolors=ROCK, linewidths=0.0))
    inside = rocks.diameter_m[box.contains(rocks.p_world_rock[:, :2])]
    label = f"{len(inside):,} rocks from {float(inside.min(initial=1e9)):.2g} m, to scale"
    return [Patch(facecolor=ROCK, label=label)] if len(inside) else []


def _draw_marks(axes: Axes, terrain: Terrain, box: Box) -> None:
    """Draw the scale bar, north, and where the sun stands."""
    width, height = box.x_max - box.x_min, box.y_max - box.y_min
    unit = min(width, height)
    length = _round_length(width / 5.0)
    x, y = box.x_min + 0.04 * unit, box.y_min + 0.045 * unit
    sheet = Rectangle((x - 0.02 * unit, y - 0.025 * unit), length + 0.04 * unit, 0.075 * unit)
    sheet.set(facecolor="white", alpha=0.8, linewidth=0.0, zorder=5)
    axes.add_patch(sheet)
    for part, colour in ((0.0, _INK), (0.5, "white")):
        bar = Rectangle((x + part * length, y - 0.01 * unit), 0.5 * length, 0.012 * unit)
        bar.set(facecolor=colour, edgecolor=_INK, linewidth=0.8, zorder=6)
        axes.add_patch(bar)
    axes.text(x + 0.5 * length, y + 0.008 * unit, f"{length:g} m", ha="center", zorder=6)
    _draw_compass(axes, terrain, (box.x_max - 0.085 * unit, box.y_max - 0.085 * unit), 0.055 * unit)


def _draw_compass(axes: Axes, terrain: Terrain, at: tuple[float, float], size: float) -> None:
    sun = terrain.spec.sun
    disc = Rectangle((at[0] - 1.4 * size, at[1] - 1.4 * size), 2.8 * size, 2.8 * size)
    disc.set(facecolor="white", alpha=0.8, linewidth=0.0, zorder=5)
    axes.add_patch(disc)
    arrow = {"arrowstyle": "-|>", "color": _INK, "linewidth": 1.2}
    axes.annotate("", (at[0], at[1] + size), (at[0], at[1] - size), arrowprops=arrow, zorder=6)
    axes.text(at[0], at[1] + 1.02 * size, "N", ha="center", va="bottom", size=7, zorder=6)
    east, north = math.cos(sun.azimuth_rad) * size, math.sin(sun.azimuth_rad) * size
    ray = {"arrowstyle": "-|>", "color": "#d98a00", "linewidth": 1.4}
    axes.annotate("", at, (at[0] + east, at[1] + north), arrowprops=ray, zorder=6)
    axes.plot(at[0] + east, at[1] + north, "o", color="#f2b01e", markersize=7, zorder=7)
    label = f"sun {math.degrees(sun.elevation_rad):.0f}\N{DEGREE SIGN} up"
    axes.text(at[0], at[1] - 1.02 * size, label, ha="center", va="top", size=6, zorder=6)


def _round_length(length_m: float) -> float:
    """Round down to 1, 2 or 5 times a power of ten."""
    scale = 10.0 ** math.floor(math.log10(length_m))
    return scale * max(step for step in (1.0, 2.0, 5.0) if step * scale <= length_m)
