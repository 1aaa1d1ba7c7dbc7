"""What both pictures of a terrain share: sampled heights, their colours and their light."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LightSource, LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lpet_sim.errors import OutputError
from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.terrain import Terrain

MARS = LinearSegmentedColormap.from_list(
    "mars", ["#6b3a2a", "#a5603f", "#cd8f62", "#e6bf94", "#f7ead3"]
)
"""Colours of elevation, from low (dark) to high (light); lightness rises steadily."""

ROCK = "#33211c"
"""Colour of rocks."""


@dataclass(frozen=True)
class Ground:
    """Heights of a box on a grid of nodes.

    Attributes:
        x: Of the columns [m], Shape (nx,).
        y: Of the rows [m], Shape (ny,).
        z: Heights [m], Shape (ny, nx).
        cell_m: Distance of the nodes [m].
    """

    x: Array
    y: Array
    z: Array
    cell_m: float

    @property
    def norm(self) -> Normalize:
        """Scale of the colours, from the lowest to the highest node."""
        return Normalize(float(self.z.min()), float(self.z.max()))

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Outer edges of the grid's cells, as `imshow` wants them [m]."""
        half = 0.5 * self.cell_m
        return self.x[0] - half, self.x[-1] + half, self.y[0] - half, self.y[-1] + half


def sample_ground(terrain: Terrain, box: Box, nodes: int) -> Ground:
    """Sample a box on a grid of about so many nodes along its longer side."""
    cell = max(box.x_max - box.x_min, box.y_max - box.y_min) / nodes
    x0, x1 = math.floor(box.x_min / cell), math.ceil(box.x_max / cell)
    y0, y1 = math.floor(box.y_min / cell), math.ceil(box.y_max / cell)
    z = terrain.patch(x0, y0, (y1 - y0 + 1, x1 - x0 + 1), cell)
    x, y = (np.arange(a, b + 1, dtype=np.float64) * cell for a, b in ((x0, x1), (y0, y1)))
    return Ground(x, y, z, cell)


def _sunlight(terrain: Terrain) -> LightSource:
    """Turn the sun's direction (from east towards north) into a compass bearing."""
    sun = terrain.spec.sun
    return LightSource(90.0 - math.degrees(sun.azimuth_rad), math.degrees(sun.elevation_rad))


def lit_colours(terrain: Terrain, ground: Ground, stretch: float) -> NDArray[Any]:
    """Colour by elevation and shade by the sun over heights stretched so much, (ny, nx, 4)."""
    return _sunlight(terrain).shade(
        ground.z[::-1],
        cmap=MARS,
        norm=ground.norm,
        blend_mode="soft",
        vert_exag=stretch,
        dx=ground.cell_m,
        dy=ground.cell_m,
    )[::-1]


def colour_scale(ground: Ground) -> Any:
    """Give what a colour bar is drawn from."""
    return ScalarMappable(ground.norm, MARS)


def save_figure(figure: Figure, path: Path | str) -> None:
    """Write a figure.

    Raises:
        OutputError: The folder cannot be written, or the ending is not PNG, PDF or SVG.
    """
    try:
        figure.savefig(path)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise OutputError(
            f"cannot write {path}: {reason}; name a .png, .pdf or .svg file"
        ) from None
