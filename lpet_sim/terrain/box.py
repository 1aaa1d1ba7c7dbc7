"""A box in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array


@dataclass(frozen=True)
class Box:
    """An axis-aligned box in the world's plane, closed below and open above [m]."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    def __post_init__(self) -> None:
        """Refuse a box that is empty or inside out.

        Raises:
            SpecError: A maximum is not above its minimum.
        """
        if not (self.x_max > self.x_min and self.y_max > self.y_min):
            raise SpecError(f"box {self}: x_max must exceed x_min, and y_max y_min")

    @classmethod
    def around(cls, x: float, y: float, half_m: float) -> Box:
        """Make the square with the given centre and half-width [m]."""
        return cls(x - half_m, y - half_m, x + half_m, y + half_m)

    @property
    def area_m2(self) -> float:
        """Area [m^2]."""
        return (self.x_max - self.x_min) * (self.y_max - self.y_min)

    def contains(self, xy: Array) -> NDArray[np.bool_]:
        """Tell which points lie inside.

        Args:
            xy: Points in the world [m], Shape (n, 2).

        Returns:
            Shape (n,); the lower edges belong to the box, the upper ones do not.
        """
        x, y = xy[:, 0], xy[:, 1]
        return (x >= self.x_min) & (x < self.x_max) & (y >= self.y_min) & (y < self.y_max)

    def grown(self, margin_m: float) -> Box:
        """Make the box that reaches further by a margin on every side [m]."""
        return Box(
            self.x_min - margin_m,
            self.y_min - margin_m,
            self.x_max + margin_m,
            self.y_max + margin_m,
        )
