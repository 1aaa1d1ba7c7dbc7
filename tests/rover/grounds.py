"""Analytic grounds with the interface of a terrain: flat, tilted, wavy, with rocks where asked."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.spec import SoilClass, TerrainSpec


@dataclass(frozen=True)
class Boulders:
    """Octahedral rocks with their lower half in the ground."""

    id: Ints
    p_world_rock: Array
    diameter_m: Array

    def mesh(self, k: int) -> tuple[Array, NDArray[np.int64]]:
        """Give a regular octahedron, Shape (6, 3) and (8, 3)."""
        tips = np.concatenate([np.eye(3), -np.eye(3)]) * self.diameter_m[k] / 2
        signs = [(a, b, c) for a in (0, 3) for b in (1, 4) for c in (2, 5)]
        faces = [f if sum(i > 2 for i in f) % 2 == 0 else (f[1], f[0], f[2]) for f in signs]
        return tips, np.array(faces)


@dataclass(frozen=True)
class Waves:
    """Ground ``z = level + slope . xy + amplitude sin(2 pi x/length) cos(2 pi y/length)``."""

    slope_x: float = 0.0
    slope_y: float = 0.0
    amplitude_m: float = 0.0
    length_m: float = 3.0
    level_m: float = 0.0
    drivable: Box | None = None
    boulders: tuple[tuple[float, float, float], ...] = ()  # x, y, diameter [m]
    spec: TerrainSpec = field(default_factory=TerrainSpec)

    def height(self, xy: Array) -> Array:
        """Give heights [m], Shape (n,)."""
        x, y = np.asarray(xy)[..., 0], np.asarray(xy)[..., 1]
        k = 2 * np.pi / self.length_m
        wave = self.amplitude_m * np.sin(k * x) * np.cos(k * y)
        return self.level_m + self.slope_x * x + self.slope_y * y + wave

    def soil(self, xy: Array) -> Ints:
        """Give soil indices, Shape (n,)."""
        return np.zeros(len(xy), dtype=np.int64)

    def patch(self, x0: int, y0: int, shape: tuple[int, int], cell_m: float) -> Array:
        """Give heights at integer nodes, Shape (ny, nx)."""
        x, y = np.meshgrid(x0 + np.arange(shape[1]), y0 + np.arange(shape[0]))
        return self.height(np.stack([x, y], axis=-1) * cell_m)

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> Boulders:
        """Give the boulders whose centre lies in the box."""
        rows = np.array(self.boulders, dtype=float).reshape(-1, 3)
        x, y, diameter = rows.T
        inside = (x >= box.x_min) & (x < box.x_max) & (y >= box.y_min) & (y < box.y_max)
        keep = inside & (diameter >= min_diameter_m)
        p = np.column_stack([rows[keep, :2], self.height(rows[keep, :2])])
        return Boulders(np.flatnonzero(keep), p, diameter[keep])


def of_soil(name: str) -> TerrainSpec:
    """Give a terrain of one soil of the library."""
    return TerrainSpec(soils=(SoilClass.model_validate({"name": "soil", "soil": name}),))


def tilted(slope_x: float, slope_y: float = 0.0, soil: str = "grc1_loose") -> Waves:
    """Give an even slope of one soil, by default the one whose slip is a measured table."""
    return Waves(slope_x=slope_x, slope_y=slope_y, spec=of_soil(soil))
