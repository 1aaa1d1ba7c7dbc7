"""The shaded relief of a terrain in 3D."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from mpl_toolkits.mplot3d.axes3d import Axes3D  # type: ignore[import-untyped]
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

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
from lpet_sim.terrain.rock_sizes import size_law
from lpet_sim.terrain.terrain import Terrain

_NODES = 260
_DOTS = 1500
_RAY_STEPS = 160
_ELEVATION_DEG, _AZIMUTH_DEG = 38.0, -60.0


def draw_relief(terrain: Terrain, box: Box, path: Path | str) -> None:
    """Draw the relief in 3D, coloured by elevation and lit by the sun, with the rocks as dots.

    Args:
        terrain: The terrain.
        box: What to show [m].
        path: The picture to write; its ending says PNG, PDF or SVG.

    Raises:
        OutputError: The picture cannot be written.

    Reference: Bakambu et al., figure 3.
    """
    ground = sample_ground(terrain, box, _NODES)
    figure = Figure(figsize=(9.0, 6.0), dpi=170)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.02, 0.9, 0.98), projection="3d", computed_zorder=False)
    stretch = _vertical_stretch(ground)
    _draw_block(axes, ground, lit_colours(terrain, ground, stretch))
    count = _draw_dots(axes, terrain, box, ground, stretch)
    _dress_relief(axes, ground, stretch)
    figure.text(0.04, 0.95, f"{terrain.spec.name}: {count}; heights times {stretch:g}", size=11)
    bar = figure.colorbar(colour_scale(ground), cax=figure.add_axes((0.895, 0.25, 0.018, 0.5)))
    bar.set_label("elevation [m]")
    save_figure(figure, path)


def _vertical_stretch(ground: Ground) -> float:
    """Stretch heights so that the relief is at least a sixth of the width, by 1, 2 or more."""
    width = max(np.ptp(ground.x), np.ptp(ground.y))
    wanted = width / 6.0 / max(float(np.ptp(ground.z)), 1e-3 * width)
    return float(max(1, round(wanted)))


def _draw_block(axes: Axes3D, ground: Ground, colours: NDArray[np.float64]) -> None:
    """Draw the surface, and below it the two sides that the viewer sees."""
    x, y = np.meshgrid(ground.x, ground.y)
    axes.plot_surface(
        x, y, ground.z, facecolors=colours, rstride=1, cstride=1, shade=False, antialiased=False
    )
    foot = float(ground.z.min() - 0.08 * np.ptp(ground.z))
    for edge, colour in ((np.s_[0, :], "#7a4a35"), (np.s_[:, -1], "#5d3627")):
        top = np.column_stack([x[edge], y[edge], ground.z[edge]])
        base = top[[-1, 0]] * [1.0, 1.0, 0.0] + [0.0, 0.0, foot]
        axes.add_collection3d(Poly3DCollection([np.vstack([top, base])], facecolor=colour))


def _draw_dots(axes: Axes3D, terrain: Terrain, box: Box, ground: Ground, stretch: float) -> str:
    """Draw the largest rocks as dots, but for those behind a rise, and say how many."""
    law = size_law(terrain.spec.rocks)
    rocks = terrain.rocks(box, float(law.diameter_at(np.array([_DOTS / box.area_m2]))[0]))
    if len(rocks) == 0:
        return "no rocks"
    top = rocks.p_world_rock + np.outer(rocks.height_m, [0.0, 0.0, 1.0])
    seen = _is_seen(ground, top, stretch)
    size = np.clip(1.0 + 900.0 * (rocks.diameter_m / (box.x_max - box.x_min)), 1.0, 40.0)
    axes.scatter(*top[seen].T, s=size[seen], c=ROCK, depthshade=False, linewidths=0.0, zorder=5)
    return f"{len(rocks):,} rocks from {float(rocks.diameter_m.min()):.2g} m as dots"


def _is_seen(ground: Ground, points: Array, stretch: float) -> NDArray[np.bool_]:
    """March from each point towards the viewer and see whether the ground comes between."""
    elevation, azimuth = np.radians(_ELEVATION_DEG), np.radians(_AZIMUTH_DEG)
    towards = np.array([np.cos(azimuth), np.sin(azimuth), np.tan(elevation) / stretch])
    height = RegularGridInterpolator(
        (ground.y, ground.x), ground.z, bounds_error=False, fill_value=-np.inf
    )
    seen = np.ones(len(points), dtype=bool)
    reach = np.hypot(np.ptp(ground.x), np.ptp(ground.y))
    for step in np.linspace(0.0, reach, _RAY_STEPS)[1:]:
        here = points + step * towards
        seen &= height(here[:, [1, 0]]) <= here[:, 2]
    return seen


def _dress_relief(axes: Axes3D, ground: Ground, stretch: float) -> None:
    spans = np.array([np.ptp(ground.x), np.ptp(ground.y), np.ptp(ground.z) * stretch])
    axes.set_box_aspect(spans / spans.max(), zoom=1.12)
    axes.view_init(_ELEVATION_DEG, _AZIMUTH_DEG)
    axes.set(xlabel="x, east [m]", ylabel="y, north [m]")
    axes.zaxis.set_major_locator(MaxNLocator(3))
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_pane_color((1.0, 1.0, 1.0, 0.0))
    axes.grid(False)
