"""What a terrain turned out to be: measured figures beside those that were asked for."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rock_sizes import SizeLaw, size_law
from lpet_sim.terrain.terrain import Terrain

_BIN_EDGES_M = (0.05, 0.1, 0.2, 0.3, 0.5, 1.0)
_NODES_MAX = 512
_ROCKS_MAX = 300_000


@dataclass(frozen=True)
class RockBin:
    """Rocks of one range of diameters in a box.

    Attributes:
        diameter_min_m: Lower limit, inside the range [m].
        diameter_max_m: Upper limit, outside the range but for the last one [m].
        count: Rocks found.
        expected: Rocks that the size law gives on average.
    """

    diameter_min_m: float
    diameter_max_m: float
    count: int
    expected: float


@dataclass(frozen=True)
class TerrainSummary:
    """Measured figures of a terrain in a box.

    Attributes:
        name: The terrain's name.
        area_m2: Area of the box [m^2].
        relief_m: Highest less lowest point on the sampled grid [m].
        rms_slope_1m_rad: Arc tangent of the RMS height difference over 1 m, both axes pooled [rad].
        soil_shares: Name and share of the area for each soil.
        rock_bins: Rocks by diameter.
        rock_cover: Fraction of the box covered by the rocks counted.
        rock_cover_expected: What the size law gives for it on average.
    """

    name: str
    area_m2: float
    relief_m: float
    rms_slope_1m_rad: float
    soil_shares: tuple[tuple[str, float], ...]
    rock_bins: tuple[RockBin, ...]
    rock_cover: float
    rock_cover_expected: float


def describe_terrain(terrain: Terrain, box: Box) -> TerrainSummary:
    """Measure slope, relief, soils and rocks of a terrain in a box.

    Relief and slope are taken on the 1 m grid of the box, or of its middle 512 m if it is larger.
    Rocks so small that over 300,000 of them are expected are left out of the bins.
    """
    heights = _metre_grid(terrain, box)
    law = size_law(terrain.spec.rocks)
    edges = _bin_edges(law, box.area_m2)
    diameter_m = terrain.rocks(box, edges[0]).diameter_m
    expected = float(law.area_above(np.array([edges[0]]))[0])
    return TerrainSummary(
        name=terrain.spec.name,
        area_m2=box.area_m2,
        relief_m=float(np.ptp(heights)),
        rms_slope_1m_rad=_rms_slope(heights),
        soil_shares=_soil_shares(terrain, box),
        rock_bins=rock_bins(law, diameter_m, edges, box.area_m2),
        rock_cover=float(np.sum(math.pi / 4.0 * diameter_m**2)) / box.area_m2,
        rock_cover_expected=expected,
    )


def rock_bins(
    law: SizeLaw, diameter_m: Array, edges_m: Array, area_m2: float
) -> tuple[RockBin, ...]:
    """Count rocks by diameter beside what a size law expects.

    Args:
        law: The size law.
        diameter_m: Diameters of the rocks found [m], Shape (n,).
        edges_m: Limits of the bins, increasing [m], Shape (b + 1,).
        area_m2: Area that was searched [m^2].
    """
    counts = np.histogram(diameter_m, edges_m)[0]
    expected = -np.diff(law.count_above(edges_m)) * area_m2
    return tuple(
        RockBin(float(low), float(high), int(count), float(mean))
        for low, high, count, mean in zip(edges_m, edges_m[1:], counts, expected, strict=False)
        if mean > 0.0
    )


def _bin_edges(law: SizeLaw, area_m2: float) -> Array:
    """Round diameters between the law's limits, from where the rocks are few enough to count."""
    most = np.array([_ROCKS_MAX / area_m2])
    low = max(law.diameter_min_m, float(law.diameter_at(most)[0]))
    inner = [edge for edge in _BIN_EDGES_M if low < edge < law.diameter_max_m]
    return np.array([low, *inner, law.diameter_max_m])


def _metre_grid(terrain: Terrain, box: Box) -> Array:
    columns, x0 = _metres(box.x_min, box.x_max)
    rows, y0 = _metres(box.y_min, box.y_max)
    return terrain.patch(x0, y0, (rows, columns), 1.0)


def _metres(low_m: float, high_m: float) -> tuple[int, int]:
    """Count of whole-metre nodes and the first of them, around the middle."""
    count = min(max(int(high_m - low_m) + 1, 2), _NODES_MAX)
    return count, round(0.5 * (low_m + high_m) - 0.5 * (count - 1))


def _rms_slope(heights: Array) -> float:
    steps = np.concatenate([np.diff(heights, axis=axis).ravel() for axis in (0, 1)])
    return math.atan(math.sqrt(float(np.mean(steps**2))))


def _soil_shares(terrain: Terrain, box: Box) -> tuple[tuple[str, float], ...]:
    x = np.linspace(box.x_min, box.x_max, 128, endpoint=False)
    y = np.linspace(box.y_min, box.y_max, 128, endpoint=False)
    soil = terrain.soil(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    shares = np.bincount(soil, minlength=len(terrain.spec.soils)) / len(soil)
    names = [one.name for one in terrain.spec.soils]
    return tuple((name, float(share)) for name, share in zip(names, shares, strict=True))
