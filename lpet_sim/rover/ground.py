"""The patch of ground that the rover touches, cut so that every cut has the same surface.

Nodes lie on multiples of 3/64 m in the world and heights are rounded to 2^-20 m (about 1e-6 m)
above a whole metre, so that positions and heights are exact in MuJoCo's floats. Two patches that
overlap are then equal to the bit where they overlap, and moving the patch moves nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import PlanningError
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.spec import TerrainSpec

CELL_M = 3 / 64  # 47 mm: of the 2-5 cm that MuJoCo takes well, the coarse and fast end
RANGE_M = 16.0
_HEIGHT_STEPS_PER_M = 2**20


class RocksLike(Protocol):
    """Rocks as the scene needs them."""

    @property
    def id(self) -> Ints:
        """Stable identities, Shape (n,)."""
        ...

    @property
    def p_world_rock(self) -> Array:
        """Origins of the meshes in the world [m], Shape (n, 3)."""
        ...

    def mesh(self, k: int) -> tuple[Array, NDArray[np.integer]]:
        """Give vertices about the origin, in world axes [m], and faces of rock k."""
        ...


class Ground(Protocol):
    """A terrain as the rover needs it."""

    @property
    def spec(self) -> TerrainSpec:
        """What the terrain was built from."""
        ...

    @property
    def drivable(self) -> Box | None:
        """Where it may be driven on; None for everywhere."""
        ...

    def height(self, xy: Array) -> Array:
        """Give heights of the ground without rocks [m], Shape (n,), at xy, Shape (n, 2)."""
        ...

    def soil(self, xy: Array) -> Ints:
        """Give indices of soil classes, Shape (n,)."""
        ...

    def patch(self, x0: int, y0: int, shape: tuple[int, int], cell_m: float) -> Array:
        """Give heights at the nodes ``((x0 + j) cell_m, (y0 + i) cell_m)`` [m], Shape (ny, nx)."""
        ...

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> RocksLike:
        """Give the rocks in a box."""
        ...


@dataclass(frozen=True)
class GroundPatch:
    """A square of ground as MuJoCo takes it.

    Attributes:
        centre_xy: Its centre in the world, on a node [m].
        half_m: Half its side [m].
        base_m: Height of its floor, a whole metre [m].
        data: Heights above the floor over `RANGE_M`, Shape (n, n), rows along y.
    """

    centre_xy: tuple[float, float]
    half_m: float
    base_m: float
    data: NDArray[np.float32]

    @property
    def height_m(self) -> Array:
        """Heights in the world [m], Shape (n, n)."""
        return self.base_m + RANGE_M * self.data.astype(float)

    def box(self, margin_m: float = 0.0) -> Box:
        """Give its extent, grown by a margin [m]."""
        return Box.around(*self.centre_xy, self.half_m + margin_m)


def cut_patch(ground: Ground, xy: Array, side_m: float) -> GroundPatch:
    """Cut the square of ground around a point.

    Args:
        ground: The terrain.
        xy: Where, in the world [m], Shape (2,); the patch is centred on the nearest node.
        side_m: Length of its side [m].

    Returns:
        The patch.

    Raises:
        PlanningError: The ground rises by more than `RANGE_M` within the patch.
    """
    half_nodes = round(side_m / 2 / CELL_M)
    column, row = (int(n) for n in np.rint(np.asarray(xy) / CELL_M))
    nodes = 2 * half_nodes + 1
    height = ground.patch(column - half_nodes, row - half_nodes, (nodes, nodes), CELL_M)
    base = float(np.floor(height.min()))
    steps = np.rint(height * _HEIGHT_STEPS_PER_M) - base * _HEIGHT_STEPS_PER_M
    data = steps / (_HEIGHT_STEPS_PER_M * RANGE_M)
    if data.max() >= 1.0:
        raise PlanningError(
            f"the ground rises by {np.ptp(height):.1f} m within {side_m:g} m around "
            f"({xy[0]:.1f}, {xy[1]:.1f}); a rover's patch may rise by less than {RANGE_M:g} m"
        )
    centre = (column * CELL_M, row * CELL_M)
    return GroundPatch(centre, half_nodes * CELL_M, base, data.astype(np.float32))
