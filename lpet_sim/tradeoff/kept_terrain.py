"""A terrain that keeps the patches it was asked for: every candidate asks for about the same."""

from __future__ import annotations

from dataclasses import dataclass

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.spec import TerrainSpec
from lpet_sim.terrain.terrain import Terrain

_MARGIN_CELLS = 40


@dataclass(frozen=True, eq=False)
class _Kept:
    """A patch with the place of its first node."""

    x0: int
    y0: int
    z: Array

    def part(self, x0: int, y0: int, shape: tuple[int, int]) -> Array | None:
        """Give a part of it, or None if it does not cover that."""
        row, column = y0 - self.y0, x0 - self.x0
        covers = row >= 0 and column >= 0
        covers = covers and row + shape[0] <= self.z.shape[0]
        covers = covers and column + shape[1] <= self.z.shape[1]
        return self.z[row : row + shape[0], column : column + shape[1]] if covers else None


class KeptTerrain(Terrain):
    """A terrain whose patches are taken out of a larger one, if that is there already.

    Patches that overlap are equal to the bit, so nothing changes but the time.
    """

    def __init__(self, spec: TerrainSpec, seed: int) -> None:
        """Build the terrain; see `build_terrain`."""
        super().__init__(spec, seed)
        self._patches: dict[tuple[float, float], _Kept] = {}

    def patch(
        self, x0: int, y0: int, shape: tuple[int, int], cell_m: float, detail_m: float = 0.0
    ) -> Array:
        """Give the heights on a grid of nodes; see `Terrain.patch`."""
        kept = self._patches.get((cell_m, detail_m))
        part = None if kept is None else kept.part(x0, y0, shape)
        if part is not None:
            return part
        more = _MARGIN_CELLS
        wide = (shape[0] + 2 * more, shape[1] + 2 * more)
        z = super().patch(x0 - more, y0 - more, wide, cell_m, detail_m)
        self._patches[cell_m, detail_m] = _Kept(x0 - more, y0 - more, z)
        return z[more : more + shape[0], more : more + shape[1]]
