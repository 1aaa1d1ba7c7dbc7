"""A tilt bed: a plane of one soil, without rocks, tilted as far as one likes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.spec import TerrainSpec


@dataclass(frozen=True)
class NoRocks:
    """The rocks of a bed: none."""

    id: Ints
    p_world_rock: Array

    def mesh(self, k: int) -> tuple[Array, NDArray[np.integer]]:
        """Refuse: there is no rock ``k``."""
        raise IndexError(f"a tilt bed has no rock {k}")


@dataclass(frozen=True)
class TiltBed:
    """A plane through the world's origin, ``z = tan(slope) (x cos(azimuth) + y sin(azimuth))``.

    It has the interface of a terrain that the rover's scene asks for, and no edge.

    Attributes:
        spec: Its terrain spec; the first soil covers the bed.
        slope_rad: Tilt of the plane [rad], 0 or more and below 90 deg.
        azimuth_rad: Direction in which it rises, from x towards y [rad].
    """

    spec: TerrainSpec
    slope_rad: float
    azimuth_rad: float = 0.0

    @property
    def drivable(self) -> Box | None:
        """Everywhere."""
        return None

    @cached_property
    def uphill_world(self) -> Array:
        """Unit vector up the slope, in the plane, Shape (3,)."""
        flat = math.cos(self.slope_rad)
        ahead = flat * math.cos(self.azimuth_rad), flat * math.sin(self.azimuth_rad)
        return np.array([*ahead, math.sin(self.slope_rad)])

    @cached_property
    def normal_world(self) -> Array:
        """Unit normal of the plane, Shape (3,)."""
        down = -math.sin(self.slope_rad)
        tilt = down * math.cos(self.azimuth_rad), down * math.sin(self.azimuth_rad)
        return np.array([*tilt, math.cos(self.slope_rad)])

    def height(self, xy: Array) -> Array:
        """Give heights [m], Shape (n,), at xy, Shape (n, 2)."""
        return np.asarray(xy, dtype=float) @ self._gradient

    def soil(self, xy: Array) -> Ints:
        """Give index 0 everywhere, Shape (n,)."""
        return np.zeros(len(xy), dtype=np.int64)

    def patch(self, x0: int, y0: int, shape: tuple[int, int], cell_m: float) -> Array:
        """Give heights at integer nodes [m], Shape (ny, nx)."""
        x, y = (x0 + np.arange(shape[1])) * cell_m, (y0 + np.arange(shape[0])) * cell_m
        return self._gradient[0] * x[None, :] + self._gradient[1] * y[:, None]

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> NoRocks:
        """Give none."""
        del box, min_diameter_m
        return NoRocks(np.empty(0, dtype=np.int64), np.empty((0, 3)))

    @cached_property
    def _gradient(self) -> Array:
        toward = np.array([math.cos(self.azimuth_rad), math.sin(self.azimuth_rad)])
        return math.tan(self.slope_rad) * toward
