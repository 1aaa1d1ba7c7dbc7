"""Landmarks on far relief: crests and the skyline, as seen from anywhere.

Bearings are cut into slots, and distances into rings that double. In each ring a slot has a lattice
of stations of its own, of a cell half as wide as the ring is far. A station's landmark is the
highest point of its slot's bearing in the ring, as its eye sees it. A rover sees the stations of
the cells it is in, and of a slot's rings the landmark that stands highest: near the skyline. So a
landmark is a fixed point of the ground, the far ones last long and the near ones change sooner, all
at different places.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.sensors.landmark_field import Landmarks, field_key, looks
from lpet_sim.sensors.landmark_kernels import FAR
from lpet_sim.sensors.landmark_spec import LandmarkFieldSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.hashing import tile_state, uniform
from lpet_sim.terrain.terrain import Terrain

EYE_M = 1.5
"""Height of a station's eye above the ground [m], about that of a rover's mast. A choice."""

REACH_M = 2000.0
"""How far relief is looked at where a terrain has no hills that say so [m]. A choice."""

_CELL_OVER_RANGE = 0.5  # a rover is at most 0.35 of a ring's inner radius from its station
_SAMPLES = 64  # over a ring: 1.1 % of the distance apart
_REFINED = 17  # over the two gaps beside the highest sample
_LATTICE = 7  # level offset that keeps the stations' numbers apart from the landmarks' kinds


@dataclass(frozen=True, eq=False)
class FarLandmarks:
    """Far landmarks of all stations that some places need.

    Attributes:
        landmarks: All of them, in the order of their stations.
        station: Slot, ring and cell (ix, iy) of each one's station, Shape (n, 4).
        lattice: Offset of the lattices (x, y) over their cell, Shape (slots, rings, 2).
        first_cell_m: Width of the first ring's cells [m]; they double from ring to ring.
    """

    landmarks: Landmarks
    station: Ints
    lattice: Array
    first_cell_m: float


class FarField:
    """Landmarks on the far relief of a terrain."""

    def __init__(self, terrain: Terrain, spec: LandmarkFieldSpec, seed: int) -> None:
        """Prepare the field; no landmark is looked for yet.

        Args:
            terrain: What carries them.
            spec: How many there are, and where the far begins.
            seed: The run's seed.
        """
        self._terrain, self._spec, self._key = terrain, spec, field_key(seed)
        far = terrain.spec.far
        reach_m = far.reach_m if far is not None else REACH_M
        rings = max(1, math.ceil(math.log2(max(reach_m / spec.far_from_m, 1.0))))
        self._slots = round(2.0 * math.pi * spec.far_per_rad)
        self._lattice = np.empty((self._slots, rings, 2))
        _draw_lattice(self._key, self._lattice)
        # A rover may be closer than the station, by the half diagonal of a cell.
        self._first_range_m = spec.far_from_m / (1.0 - _CELL_OVER_RANGE * math.sqrt(0.5))
        self._first_cell_m = _CELL_OVER_RANGE * self._first_range_m

    @property
    def reach_m(self) -> float:
        """Distance from a rover that no landmark exceeds [m]."""
        return self._first_range_m * 2.0 ** self._lattice.shape[1] * (1.0 + _CELL_OVER_RANGE)

    def near(self, box: Box) -> FarLandmarks:
        """Give the landmarks of all stations that any place of a box needs."""
        slots, rings = self._lattice.shape[:2]
        found = [np.empty((0, 4), np.int64)]
        for ring in range(rings):
            width = self._first_cell_m * 2.0**ring
            xy = _spread(box, width)
            at = xy[:, None] / width - self._lattice[:, ring]
            cells = np.floor(at).astype(np.int64).reshape(-1, 2)
            slot = np.tile(np.arange(slots), len(xy))
            rows = np.column_stack([slot, np.full(len(slot), ring), cells])
            found.append(np.unique(rows, axis=0))
        return self._of_stations(np.concatenate(found))

    def _of_stations(self, stations: Ints) -> FarLandmarks:
        """Look for the landmarks of stations, rows (slot, ring, ix, iy)."""
        slot, ring, cell = stations[:, 0], stations[:, 1], stations[:, 2:]
        state = np.empty(len(stations), np.uint64)
        jitter = np.empty(len(stations))
        _draw_stations(self._key, stations, state, jitter)
        width = self._first_cell_m * 2.0 ** ring[:, None]
        centre = (cell + self._lattice[slot, ring] + 0.5) * width
        bearing = 2.0 * math.pi * (slot + jitter) / max(self._slots, 1)
        inner_m = np.asarray(self._first_range_m * 2.0**ring)
        xy = self._highest(centre, bearing, inner_m)
        p_world = np.column_stack([xy, self._terrain.height(xy)])
        landmarks = looks(FAR, p_world, self._terrain.normal(xy), state)
        return FarLandmarks(landmarks, stations, self._lattice, self._first_cell_m)

    def _highest(self, centre: Array, bearing: Array, inner_m: Array) -> Array:
        """Give the points that stand highest over a ring, Shape (n, 2) [m]."""
        towards = np.column_stack([np.cos(bearing), np.sin(bearing)])
        eye = self._terrain.height(centre) + EYE_M
        steps = 2.0 ** np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
        best = self._best(centre, towards, eye, inner_m[:, None] * steps)
        gap = 2.0 ** (np.linspace(-1.0, 1.0, _REFINED) / _SAMPLES)
        best = self._best(centre, towards, eye, np.maximum(best[:, None] * gap, inner_m[:, None]))
        return centre + best[:, None] * towards

    def _best(self, centre: Array, towards: Array, eye: Array, distance: Array) -> Array:
        """Give the distance at which the ground stands highest, Shape (n, k) to (n,)."""
        points = centre[:, None] + distance[..., None] * towards[:, None]
        z = self._terrain.height(points.reshape(-1, 2)).reshape(distance.shape)
        highest = np.argmax((z - eye[:, None]) / distance, axis=1)
        return np.asarray(np.take_along_axis(distance, highest[:, None], axis=1)[:, 0])


def _spread(box: Box, width: float) -> Array:
    """Spread places over a box, corners included, that are closer than a width, Shape (n, 2)."""
    x, y = (
        np.linspace(low, high, max(2, math.ceil((high - low) / width) + 1))
        for low, high in ((box.x_min, box.x_max), (box.y_min, box.y_max))
    )
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


@njit(cache=True, nogil=True)
def _draw_lattice(key, out):  # type: ignore[no-untyped-def]
    """Draw the offset of each slot's lattice in each ring, over the cell."""
    for slot in range(out.shape[0]):
        for ring in range(out.shape[1]):
            state = tile_state(key, _LATTICE, slot, ring)
            out[slot, ring, 0], out[slot, ring, 1] = uniform(state, 0), uniform(state, 1)


@njit(cache=True, nogil=True)
def _draw_stations(key, stations, state, jitter):  # type: ignore[no-untyped-def]
    """Draw each station's state, and where in its slot its bearing lies."""
    for i in range(len(stations)):
        slot, ring = stations[i, 0], stations[i, 1]
        own = tile_state(key, FAR, slot, ring)
        state[i] = tile_state(own, FAR, stations[i, 2], stations[i, 3])
        jitter[i] = uniform(state[i], 0)


@njit(cache=True, nogil=True)
def pick_highest(p_world, rows, station, lattice, first_cell, eye, allowed):  # type: ignore[no-untyped-def]
    """Allow, of each slot, the landmark that stands highest over a place.

    Args:
        p_world: Landmarks in the world [m], Shape (n, 3).
        rows: Which of them are the far ones, Shape (f,).
        station: As in `FarLandmarks`, like all up to `first_cell`, Shape (f, 4).
        lattice: Likewise.
        first_cell: Likewise.
        eye: The place [m], Shape (3,).
        allowed: Set for the far ones, Shape (n,).
    """
    highest = np.full(len(lattice), -np.inf)
    best = np.full(len(lattice), -1)
    for f in range(len(rows)):
        allowed[rows[f]] = False
        slot, ring = station[f, 0], station[f, 1]
        width = first_cell * 2.0**ring
        if math.floor(eye[0] / width - lattice[slot, ring, 0]) != station[f, 2]:
            continue
        if math.floor(eye[1] / width - lattice[slot, ring, 1]) != station[f, 3]:
            continue
        p = p_world[rows[f]]
        flat = math.sqrt((p[0] - eye[0]) ** 2 + (p[1] - eye[1]) ** 2)
        if (p[2] - eye[2]) / flat > highest[slot]:
            highest[slot] = (p[2] - eye[2]) / flat
            best[slot] = rows[f]
    for slot in range(len(best)):
        if best[slot] >= 0:
            allowed[best[slot]] = True
