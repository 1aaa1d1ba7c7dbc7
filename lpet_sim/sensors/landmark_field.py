"""Where landmarks are: strewn over ground and rocks, the same ones whichever way a rover comes."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rng import stream
from lpet_sim.sensors.landmark_kernels import (
    FAR,
    GROUND,
    ROCK,
    TRIES,
    draw_ground,
    draw_looks,
    draw_on_rocks,
    draw_places,
)
from lpet_sim.sensors.landmark_spec import LandmarkFieldSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.rocks import Rocks
from lpet_sim.terrain.terrain import Terrain

__all__ = ["FAR", "GROUND", "ROCK", "LandmarkField", "Landmarks", "field_key", "looks"]


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Points of the world that a front end can find again.

    Attributes:
        id: Names, Shape (n,).
        kind: `GROUND`, `ROCK` or `FAR`, Shape (n,), uint8.
        p_world: Places [m], Shape (n, 3).
        normal: Unit normals of the surface, outwards, in the world, Shape (n, 3).
        strength: How readily a front end takes it, uniform in [0, 1), Shape (n,).
        fading: How far it is seen, uniform in [0, 1) and independent of the strength, Shape (n,).
        bias: Its fixed errors of u_left, u_right and v over their 1 sigma, Shape (n, 3).
    """

    id: Ints
    kind: NDArray[np.uint8]
    p_world: Array
    normal: Array
    strength: Array
    fading: Array
    bias: Array

    def __len__(self) -> int:
        return len(self.id)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Give the arrays by name."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def select(self, which: NDArray[Any]) -> Landmarks:
        """Give the landmarks that a mask or an index array picks."""
        return Landmarks(**{name: array[which] for name, array in self.arrays().items()})

    def joined(self, other: Landmarks) -> Landmarks:
        """Give both, one after the other."""
        mine, theirs = self.arrays(), other.arrays()
        return Landmarks(**{name: np.concatenate([mine[name], theirs[name]]) for name in mine})


def field_key(seed: int) -> int:
    """Give the number that all places are hashed with."""
    return int(stream(seed, "landmarks", "field").integers(2**62))


def looks(kind: int, p_world: Array, normal: Array, state: NDArray[np.uint64]) -> Landmarks:
    """Make landmarks of one kind from their places and the states of their generators."""
    n = len(state)
    identity, bias = np.empty(n, np.int64), np.empty((n, 3))
    strength, fading = np.empty(n), np.empty(n)
    draw_looks(state, identity, strength, fading, bias)
    kinds = np.full(n, kind, dtype=np.uint8)
    return Landmarks(identity, kinds, p_world, normal, strength, fading, bias)


class LandmarkField:
    """Landmarks on the ground and the rocks of a terrain of any size.

    Each square metre of ground and each rock has random numbers of its own, hashed from the seed
    and its place or name: which box asks, and in which order, changes nothing.
    """

    def __init__(self, terrain: Terrain, spec: LandmarkFieldSpec, seed: int) -> None:
        """Prepare the field; no landmark is drawn yet.

        Args:
            terrain: What carries them.
            spec: How many there are.
            seed: The run's seed.
        """
        self._terrain, self._spec, self._key = terrain, spec, field_key(seed)

    def near(self, box: Box) -> Landmarks:
        """Give the landmarks on the ground of a box and on the rocks whose centres lie in it.

        Args:
            box: The box in the world [m]; its edges are moved out to whole metres.
        """
        x0, y0, x1, y1 = (
            *(math.floor(low) for low in (box.x_min, box.y_min)),
            *(math.ceil(high) for high in (box.x_max, box.y_max)),
        )
        whole = Box(x0, y0, x1, y1)
        rocks = self._terrain.rocks(whole, self._spec.rock_min_diameter_m)
        return self._on_ground((x0, y0), (x1 - x0, y1 - y0)).joined(self._on_rocks(rocks))

    def _on_ground(self, corner: tuple[int, int], shape: tuple[int, int]) -> Landmarks:
        mean = self._spec.ground_per_m2
        most = _most(mean * shape[0] * shape[1])
        xy, state = np.empty((most, 2)), np.empty(most, np.uint64)
        count = draw_ground(self._key, mean, corner, shape, xy, state)
        xy, state = xy[:count], state[:count]
        p_world = np.column_stack([xy, self._terrain.height(xy)])
        return looks(GROUND, p_world, self._terrain.normal(xy), state)

    def _on_rocks(self, rocks: Rocks) -> Landmarks:
        most = _most(self._spec.per_rock * len(rocks))
        rock, state = np.empty(most, np.int64), np.empty(most, np.uint64)
        count = draw_on_rocks(self._key, self._spec.per_rock, rocks.id, rock, state)
        rock, state = rock[:count], state[:count]
        p_world, normal = _on_surfaces(rocks, rock, state)
        found = looks(ROCK, p_world, normal, state)
        above = p_world[:, 2] > self._terrain.height(p_world[:, :2])
        return found.select(above)


def _most(mean: float) -> int:
    """Give a number that a Poisson count of a mean never reaches (12 sigma)."""
    return math.ceil(mean + 12.0 * math.sqrt(mean) + 24.0)


def _on_surfaces(rocks: Rocks, rock: Ints, state: NDArray[np.uint64]) -> tuple[Array, Array]:
    """Place landmarks on the surfaces of rocks, evenly by area, above the middle of their foot."""
    p_world, normal = np.empty((len(rock), 3)), np.empty((len(rock), 3))
    places = np.empty((len(rock), TRIES, 3))
    draw_places(state, places)
    row_of = np.empty(len(rocks), np.int64)
    shape_of = rocks.shape[rock]
    for rows, corners, faces in rocks.meshes():
        row_of[rows] = np.arange(len(rows))
        mine = np.flatnonzero(shape_of == rocks.shape[rows[0]])
        triangles = corners[row_of[rock[mine]]][:, faces]
        foot = rocks.p_world_rock[rock[mine], 2]
        p_world[mine], normal[mine] = _on_triangles(triangles, places[mine], foot)
    return p_world, normal


def _on_triangles(triangles: Array, places: Array, foot_z: Array) -> tuple[Array, Array]:
    """Take the first place above a height on each mesh.

    Args:
        triangles: Of each mesh [m], Shape (n, f, 3, 3).
        places: Uniform numbers for facet and place, Shape (n, t, 3).
        foot_z: What to be above [m], Shape (n,).

    Returns:
        Points, Shape (n, 3), and the unit normals of their facets, Shape (n, 3).
    """
    a, ab, ac = triangles[:, :, 0], *(triangles[:, :, k] - triangles[:, :, 0] for k in (1, 2))
    twice = np.cross(ab, ac)
    area = np.linalg.norm(twice, axis=-1)
    share = np.cumsum(area, axis=1) / np.sum(area, axis=1, keepdims=True)
    facet = np.sum(share[:, None, :-1] <= places[:, :, :1], axis=-1)
    n = np.arange(len(triangles))[:, None]
    root, along = np.sqrt(places[..., 1:2]), places[..., 2:3]
    points = a[n, facet] + root * (1.0 - along) * ab[n, facet] + root * along * ac[n, facet]
    first = np.argmax(points[..., 2] > foot_z[:, None], axis=1)
    n, taken = n[:, 0], facet[n[:, 0], first]
    return points[n, first], twice[n, taken] / area[n, taken, None]
