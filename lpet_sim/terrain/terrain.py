"""The terrain: ground that answers for any patch at any resolution, the same answer each time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rng import stream
from lpet_sim.terrain.albedo import build_albedo
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.craters import build_craters
from lpet_sim.terrain.dem import DemGround, build_dem
from lpet_sim.terrain.far import build_hills
from lpet_sim.terrain.relief import Bands, build_relief
from lpet_sim.terrain.rocks import RockField, Rocks
from lpet_sim.terrain.soil import build_soil
from lpet_sim.terrain.spec import TerrainSpec


class Layer(Protocol):
    """Something that adds to the height of the ground."""

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Give heights at points [m], Shape (n, 2) -> (n,)."""
        ...

    def gradient(self, xy: Array) -> Array:
        """Give (dz/dx, dz/dy) at points [m], Shape (n, 2) -> (n, 2)."""
        ...


@dataclass(frozen=True, eq=False)
class Ground:
    """The sum of the layers.

    Attributes:
        layers: What adds to the height, in the order of the sum.
    """

    layers: tuple[Layer, ...]

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Give heights at points [m], Shape (n, 2) -> (n,), without what is finer than detail."""
        total = np.zeros(len(xy))
        for layer in self.layers:
            total += layer.height(xy, detail_m)
        return total

    def gradient(self, xy: Array) -> Array:
        """Give (dz/dx, dz/dy) at points [m], Shape (n, 2) -> (n, 2)."""
        total = np.zeros((len(xy), 2))
        for layer in self.layers:
            total += layer.gradient(xy)
        return total


class Terrain:
    """Ground, soils, albedo and rocks as pure functions of the plane.

    Attributes:
        spec: What it was built from.
        drivable: Where a rover may drive; None: everywhere. A DEM is drivable in its extent only.
    """

    spec: TerrainSpec
    drivable: Box | None

    def __init__(self, spec: TerrainSpec, seed: int) -> None:
        self.spec = spec
        base = _build_base(spec, seed)
        self.drivable = base.extent if isinstance(base, DemGround) else None
        self._ground = Ground((base, *_build_features(spec, seed)))
        self._soils = build_soil(spec, stream(seed, "terrain", "soil"))
        self._albedo = build_albedo(spec, seed, self._soils)
        self._rocks = RockField(spec.rocks, seed, self._ground.height)

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Give the height of the ground without rocks.

        Args:
            xy: Points in the world [m], Shape (n, 2).
            detail_m: Leave out what is finer than about twice this [m]; 0 leaves out nothing.

        Returns:
            Heights [m], Shape (n,); each depends on its own point alone.
        """
        return self._ground.height(_points(xy), detail_m)

    def normal(self, xy: Array) -> Array:
        """Give the unit normals of the ground, upwards, from the analytic gradient.

        Args:
            xy: Points in the world [m], Shape (n, 2).

        Returns:
            ``(-dz/dx, -dz/dy, 1)`` scaled to length 1, Shape (n, 3).
        """
        slopes = self._ground.gradient(_points(xy))
        normal = np.column_stack([-slopes, np.ones(len(slopes))])
        return normal / np.linalg.norm(normal, axis=1, keepdims=True)

    def patch(
        self, x0: int, y0: int, shape: tuple[int, int], cell_m: float, detail_m: float = 0.0
    ) -> Array:
        """Give the heights on a grid of nodes; overlapping patches are equal to the bit.

        Args:
            x0: Index of the first column: node (i, j) is at ``((x0 + j), (y0 + i)) * cell_m``.
            y0: Index of the first row.
            shape: Rows and columns, (ny, nx).
            cell_m: Distance of the nodes [m].
            detail_m: Leave out what is finer than about twice this [m].

        Returns:
            Heights [m], Shape (ny, nx); with ``detail_m`` 0 what `height` gives at the nodes.
        """
        x = (x0 + np.arange(shape[1])) * cell_m
        y = (y0 + np.arange(shape[0])) * cell_m
        nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return self.height(nodes, detail_m).reshape(shape)

    def soil(self, xy: Array) -> Ints:
        """Give the index into ``spec.soils`` at points [m], Shape (n, 2) -> (n,)."""
        return self._soils.soil(_points(xy))

    def albedo(self, xy: Array, texel_m: float, pebbles: bool = True) -> Array:
        """Give the albedo in 0..1 without detail finer than a texel.

        Args:
            xy: Points in the world [m], Shape (n, 2).
            texel_m: Distance of the samples [m]; finer detail would alias and is left out.
            pebbles: Whether pebbles are drawn in, with their light and shade.

        Returns:
            Shape (n,).
        """
        return self._albedo.albedo(_points(xy), texel_m, pebbles)

    def rocks(self, box: Box, min_diameter_m: float = 0.0) -> Rocks:
        """Give the rocks whose centres lie in a box, of at least a diameter [m]."""
        return self._rocks.query(box, min_diameter_m)


def build_terrain(spec: TerrainSpec, seed: int) -> Terrain:
    """Build the terrain that belongs to a spec and a seed.

    Args:
        spec: What it is made of.
        seed: Any integer; equal seeds give terrains that are equal to the bit.
    """
    return Terrain(spec, seed)


def _build_base(spec: TerrainSpec, seed: int) -> Bands | DemGround:
    rng = stream(seed, "terrain", "relief")
    return build_dem(spec.dem, spec.relief, rng) if spec.dem else build_relief(spec.relief, rng)


def _build_features(spec: TerrainSpec, seed: int) -> list[Layer]:
    features: list[Layer] = []
    if spec.craters:
        features.append(build_craters(spec.craters, stream(seed, "terrain", "craters")))
    if spec.far:
        features.append(build_hills(spec.far, stream(seed, "terrain", "hills")))
    return features


def _points(xy: Array) -> NDArray[np.float64]:
    return np.ascontiguousarray(xy, dtype=np.float64).reshape(-1, 2)
