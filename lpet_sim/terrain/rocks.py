"""Rocks on a terrain of any size: the same ones, whichever box asks."""

from __future__ import annotations

import logging
import math
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rng import stream
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rock_placement import OVERFLOW, place_discs
from lpet_sim.terrain.rock_set import Rocks
from lpet_sim.terrain.rock_shapes import SHAPE_COUNT, shape_reaches
from lpet_sim.terrain.rock_sizes import SizeLaw, size_law
from lpet_sim.terrain.rock_spec import RockAbundanceSpec, RockTableSpec

__all__ = ["RockField", "Rocks"]

logger = logging.getLogger(__name__)

COVER_MAX = 0.25
"""Largest fraction of the ground that rocks may cover: far beyond, discs find no free place."""

OCTAVE_COVER_MAX = 0.15
"""Largest fraction of the ground that rocks within a factor of two in diameter may cover.

At these limits all rocks found a place in trials, be they of one size, of two, or of all.
"""

WIDTH_RATIO = (0.65, 1.0)
"""Range of a rock's width over its length. A choice; field stones are near 0.8 [recalled]."""

HEIGHT_RATIO = (0.35, 0.65)
"""Range of the height above ground over the diameter: about a half [recalled]."""

BURIED_FRACTION = (0.4, 0.6)
"""Range of the share of a rock's full height that is below ground: about a half [recalled]."""

ALBEDO = (0.10, 0.24)
"""Range of a rock's albedo, from bare basalt to dust-coated [recalled]."""

_ROCKS_KEPT = 100_000
_TILES_KEPT = 20_000
_TILE_MIN_M = 4.0
_REACH_OVER_DIAMETER = 0.85
_UNIFORMS = 7


@dataclass(frozen=True)
class _Tile:
    """Rocks of one octave of size in one tile: (x, y, reach), and all else in columns."""

    id: Ints
    discs: Array
    diameter_m: Array
    uniforms: Array


@dataclass(frozen=True)
class _Octave:
    """Rocks of diameters within a factor of two, and the tiles that they are drawn in.

    Attributes:
        ranks: Rocks per m^2 at least as large as the lower and the upper limit.
        side_m: Side of a tile: over twice any two reaches, and wider than the largest rock, which
            else could fill a tile whose rocks then had no place [m].
        reach_m: Largest reach of a rock [m].
    """

    ranks: tuple[float, float]
    side_m: float
    reach_m: float

    @classmethod
    def of(cls, law: SizeLaw, octave: int, spread: float) -> _Octave:
        """Lay out the octave from 2^octave to 2^(octave + 1) m of a size law."""
        low, high = law.count_above(np.array([2.0**octave, 2.0 ** (octave + 1)]))
        largest_m = min(2.0 ** (octave + 1), law.diameter_max_m)
        side_m = spread * max(_TILE_MIN_M, 4.0 * largest_m, 1.6 * law.diameter_max_m)
        return cls((float(low), float(high)), side_m, _REACH_OVER_DIAMETER * largest_m)

    def places(self, box: Box) -> list[tuple[int, int]]:
        """Name the tiles whose rocks may have their centres in a box."""
        rows = self._range(box.y_min, box.y_max, 0.0)
        return [(i, j) for j in rows for i in self._range(box.x_min, box.x_max, 0.0)]

    def near(self, smaller: _Octave, i: int, j: int) -> list[tuple[int, int]]:
        """Name the tiles whose rocks may touch those of a tile of a smaller octave."""
        margin_m = self.reach_m + smaller.reach_m + OVERFLOW * smaller.side_m
        columns, rows = (
            self._range(n * smaller.side_m, (n + 1) * smaller.side_m, margin_m) for n in (i, j)
        )
        return [(column, row) for row in rows for column in columns]

    def _range(self, low_m: float, high_m: float, margin_m: float) -> range:
        margin_m += OVERFLOW * self.side_m
        first, last = (low_m - margin_m) / self.side_m, (high_m + margin_m) / self.side_m
        return range(math.floor(first), math.floor(last) + 1)


class RockField:
    """Rocks drawn tile by tile, and octave by octave from the largest down.

    Each tile of each octave of diameter has a random stream of its own. The count in a tile is a
    Poisson number; positions are uniform, by decreasing size, and drawn again until a rock is
    clear of all larger octaves here and in the eight tiles around, and of its own octave in those
    of the eight that come earlier in a colouring of the tiles by four. So the order of questions
    does not matter, counts are kept, and nothing overlaps across a border.
    """

    def __init__(
        self,
        spec: RockAbundanceSpec | RockTableSpec | None,
        seed: int,
        height: Callable[[Array], Array],
    ) -> None:
        """Prepare the field; no rock is drawn yet.

        Args:
            spec: Abundance or table; None: no rocks.
            seed: The run's seed.
            height: Ground height at points of Shape (n, 2) [m], to Shape (n,) [m].

        Raises:
            SpecError: The rocks would cover too much of the ground to be placed.
        """
        self._seed, self._height = seed, height
        self._law = size_law(spec)
        self._tiles: OrderedDict[tuple[int, int, int], _Tile] = OrderedDict()
        _check_cover(spec, self._law)
        self._rocks_kept = 0
        self._top = math.ceil(math.log2(self._law.diameter_max_m)) - 1
        octaves = range(_octave(self._law.diameter_min_m), self._top + 1)
        # A table's sizes may be alike, and then crowd where a small tile drew too many by chance.
        spread = 2.0 if isinstance(spec, RockTableSpec) else 1.0
        self._octaves = {octave: _Octave.of(self._law, octave, spread) for octave in octaves}

    def query(self, box: Box, min_diameter_m: float = 0.0) -> Rocks:
        """Give the rocks whose centre lies in a box; one outside may still reach into it.

        Args:
            box: The box in the world [m].
            min_diameter_m: Smaller rocks are left out, which is faster where they are many [m].

        Returns:
            The rocks, by tile; the same ids and bits whichever box holds them.
        """
        bottom = _octave(max(min_diameter_m, self._law.diameter_min_m))
        tiles = [
            self._tile(octave, *place)
            for octave in range(self._top, bottom - 1, -1)
            for place in self._octaves[octave].places(box)
        ]
        self._forget()
        return self._built([_cropped(tile, box, min_diameter_m) for tile in tiles])

    def _forget(self) -> None:
        """Drop the tiles asked for longest ago, so that memory stays flat over a long drive."""
        while self._rocks_kept > _ROCKS_KEPT or len(self._tiles) > _TILES_KEPT:
            self._rocks_kept -= len(self._tiles.popitem(last=False)[1].id)

    def _tile(self, octave: int, i: int, j: int) -> _Tile:
        key = (octave, i, j)
        if key in self._tiles:
            self._tiles.move_to_end(key)
        else:
            self._tiles[key] = self._grown(octave, i, j)
            self._rocks_kept += len(self._tiles[key].id)
        return self._tiles[key]

    def _grown(self, octave: int, i: int, j: int) -> _Tile:
        """Draw the rocks of one octave in one tile."""
        rng = stream(self._seed, "terrain", "rocks", octave, i, j)
        rank_max, rank_min = self._octaves[octave].ranks
        count = int(rng.poisson((rank_max - rank_min) * self._octaves[octave].side_m ** 2))
        if count == 0:
            return _EMPTY
        uniforms = rng.random((count, _UNIFORMS))
        keys = rng.integers(0, 2**63, count)
        diameter_m = self._law.diameter_at(rank_max - uniforms[:, 0] * (rank_max - rank_min))
        order = np.argsort(-diameter_m, kind="stable")
        tile = _Tile(
            _identities(octave, i, j, count),
            np.empty((count, 3)),
            diameter_m[order],
            uniforms[order],
        )
        return self._placed(tile, keys[order], octave, i, j)

    def _placed(self, tile: _Tile, keys: Ints, octave: int, i: int, j: int) -> _Tile:
        """Find a free place for each rock of a tile, the largest first."""
        reach = shape_reaches()[_shape_of(tile)] * tile.diameter_m / np.sqrt(_width_of(tile))
        side_m = self._octaves[octave].side_m
        corner = np.array([i, j]) * side_m
        xy = place_discs(reach, keys, self._obstacles(octave, i, j), corner, side_m)
        placed = np.isfinite(xy[:, 0])
        if not placed.all():
            logger.warning("no free place for %d rocks in tile (%d, %d)", np.sum(~placed), i, j)
        return _taken(replace(tile, discs=np.column_stack([xy, reach])), placed)

    def _obstacles(self, octave: int, i: int, j: int) -> Array:
        """Discs that a tile's rocks must keep clear of, Shape (m, 3)."""
        tiles = [
            self._tile(octave, *place)
            for place in [(i + di, j + dj) for dj in (-1, 0, 1) for di in (-1, 0, 1)]
            if _colour(*place) < _colour(i, j)
        ]
        for above in range(self._top, octave, -1):
            near = self._octaves[above].near(self._octaves[octave], i, j)
            tiles += [self._tile(above, *place) for place in near]
        return np.concatenate([_EMPTY.discs, *(tile.discs for tile in tiles)])

    def _built(self, tiles: list[_Tile]) -> Rocks:
        """Work out shape, pose and look of the rocks of some tiles."""
        tile = _joined([_EMPTY, *tiles])
        xy = tile.discs[:, :2]
        z = self._height(xy) if len(xy) else np.empty(0)
        return Rocks(
            id=tile.id,
            p_world_rock=np.column_stack([xy, z]),
            diameter_m=tile.diameter_m,
            height_m=tile.diameter_m * _between(HEIGHT_RATIO, tile.uniforms[:, 4]),
            buried_fraction=_between(BURIED_FRACTION, tile.uniforms[:, 5]),
            width_ratio=_width_of(tile),
            yaw_rad=2.0 * math.pi * tile.uniforms[:, 2],
            shape=_shape_of(tile),
            albedo=_between(ALBEDO, tile.uniforms[:, 6]),
        )


_EMPTY = _Tile(np.empty(0, np.int64), np.empty((0, 3)), np.empty(0), np.empty((0, _UNIFORMS)))


def _shape_of(tile: _Tile) -> Ints:
    return (tile.uniforms[:, 1] * SHAPE_COUNT).astype(np.int64)


def _width_of(tile: _Tile) -> Array:
    return _between(WIDTH_RATIO, tile.uniforms[:, 3])


def _between(limits: tuple[float, float], uniform: Array) -> Array:
    return limits[0] + (limits[1] - limits[0]) * uniform


def _octave(diameter_m: float) -> int:
    return math.floor(math.log2(diameter_m))


def _colour(i: int, j: int) -> int:
    """Colour a tile by its parities: tiles of one colour never touch."""
    return (i & 1) + 2 * (j & 1)


def _identities(octave: int, i: int, j: int, count: int) -> Ints:
    """Pack octave (5 bits), tile (2 x 18 bits) and rank (22 bits) into one positive integer."""
    tile = ((octave + 16) << 36) | ((i + (1 << 17)) << 18) | (j + (1 << 17))
    return (tile << 22) + np.arange(count, dtype=np.int64)


def _taken(tile: _Tile, which: NDArray[np.bool_]) -> _Tile:
    return _Tile(tile.id[which], tile.discs[which], tile.diameter_m[which], tile.uniforms[which])


def _cropped(tile: _Tile, box: Box, min_diameter_m: float) -> _Tile:
    if len(tile.id) == 0:
        return tile
    return _taken(tile, box.contains(tile.discs[:, :2]) & (tile.diameter_m >= min_diameter_m))


def _joined(tiles: list[_Tile]) -> _Tile:
    return _Tile(
        np.concatenate([tile.id for tile in tiles]),
        np.concatenate([tile.discs for tile in tiles]),
        np.concatenate([tile.diameter_m for tile in tiles]),
        np.concatenate([tile.uniforms for tile in tiles]),
    )


def _check_cover(spec: RockAbundanceSpec | RockTableSpec | None, law: SizeLaw) -> None:
    sizes = np.geomspace(law.diameter_min_m, law.diameter_max_m, 200)
    cover, above = law.area_above(sizes), law.area_above(2.0 * sizes)
    total, octave = float(cover[0]), float(np.max(cover - above))
    excess = max(total / COVER_MAX, octave / OCTAVE_COVER_MAX)
    if spec is not None and excess > 1.0:
        raise SpecError(
            f"rocks would cover {total:.0%} of the ground, and those of one octave of size "
            f"{octave:.0%}: up to {COVER_MAX:.0%} and {OCTAVE_COVER_MAX:.0%} find room, so "
            f"number_multiplier must be at most {spec.number_multiplier / excess:.3g} here"
        )
