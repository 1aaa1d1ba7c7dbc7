"""Random places for discs that must not overlap: the hot loop of the rocks."""

from __future__ import annotations

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array, Ints

OVERFLOW = 0.25
"""How far outside its tile a rock may go that finds no place inside, as a fraction of the tile.

A quarter keeps two tiles of one colour apart by half a tile, more than any two reaches."""

_TRIES_INSIDE = 200
_TRIES = 4000


@njit(cache=True)
def _next_state(state: np.uint64) -> np.uint64:
    return state + np.uint64(0x9E3779B97F4A7C15)


@njit(cache=True)
def _uniform(state: np.uint64) -> float:
    """Hash a counter to [0, 1): the finaliser of SplitMix64 (Steele et al., 2014)."""
    z = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) * 2.0**-53


@njit(cache=True)
def _is_free(x: float, y: float, reach: float, discs: Array) -> bool:
    for k in range(len(discs)):
        gap = reach + discs[k, 2]
        dx, dy = x - discs[k, 0], y - discs[k, 1]
        if dx * dx + dy * dy < gap * gap:
            return False
    return True


@njit(cache=True)
def place_discs(reach: Array, keys: Ints, obstacles: Array, corner: Array, side_m: float) -> Array:
    """Give each disc, in turn, a uniform random place in a tile that is clear of all before it.

    Args:
        reach: Radii of the discs [m], Shape (n,).
        keys: A random number for each disc, from which its places are drawn, Shape (n,).
        obstacles: Discs already there, rows of (x, y, radius) [m], Shape (m, 3).
        corner: Lower corner of the tile [m], Shape (2,).
        side_m: Side of the tile [m].

    Returns:
        Centres [m], Shape (n, 2). A disc that finds no place in 200 tries goes up to `OVERFLOW`
        of a side beyond the tile; one that finds none there in 4000 is not a number.
    """
    placed = np.empty((len(reach), 3))
    centres = np.full((len(reach), 2), np.nan)
    count = 0
    for n in range(len(reach)):
        state = np.uint64(keys[n])
        for attempt in range(_TRIES):
            beyond = 0.0 if attempt < _TRIES_INSIDE else OVERFLOW
            state = _next_state(state)
            x = corner[0] + side_m * (_uniform(state) * (1.0 + 2.0 * beyond) - beyond)
            state = _next_state(state)
            y = corner[1] + side_m * (_uniform(state) * (1.0 + 2.0 * beyond) - beyond)
            if _is_free(x, y, reach[n], obstacles) and _is_free(x, y, reach[n], placed[:count]):
                placed[count, 0], placed[count, 1], placed[count, 2] = x, y, reach[n]
                centres[n, 0], centres[n, 1] = x, y
                count += 1
                break
    return centres
