"""A flat terrain with rocks where a test wants them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks


class FlatTerrain:
    """Level ground (or a slope in x beyond some line) and given rocks (x, y, diameter [m])."""

    def __init__(
        self,
        rocks: Sequence[tuple[float, float, float]] = (),
        drivable: Box | None = None,
        ridge_x: float = math.inf,
        ridge_slope: float = 0.0,
    ) -> None:
        self.drivable = drivable
        self._ridge = (ridge_x, ridge_slope)
        self._rocks = np.array(rocks, dtype=float).reshape(-1, 3)

    def patch(self, x0: int, y0: int, shape: tuple[int, int], cell_m: float) -> Array:
        """Give heights on a grid of nodes."""
        x = (x0 + np.arange(shape[1])) * cell_m
        height = self._ridge[1] * np.clip(x - self._ridge[0], 0, 4.0) if self._ridge[1] else 0 * x
        return np.tile(height, (shape[0], 1))

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> Rocks:
        """Give the rocks of a box."""
        x, y, diameter = self._rocks.T
        n = len(diameter)
        rocks = Rocks(
            id=np.arange(n),
            p_world_rock=np.stack([x, y, 0 * x], axis=1),
            diameter_m=diameter,
            height_m=0.5 * diameter,
            buried_fraction=np.full(n, 0.5),
            width_ratio=np.ones(n),
            yaw_rad=np.zeros(n),
            shape=np.zeros(n, dtype=np.int64),
            albedo=np.full(n, 0.2),
        )
        return rocks.select(box.contains(self._rocks[:, :2]) & (diameter >= min_diameter_m))
