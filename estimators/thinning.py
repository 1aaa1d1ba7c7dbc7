"""Fewer sightings of an image, spread over it, for a filter whose cost grows with their square."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array, Ints

_CELLS = 10
_COPRIME = 37


def spread_over_image(
    stereo_px: Array, known: NDArray[np.bool_], size_px: tuple[int, int], count: int
) -> Ints:
    """Choose sightings that cover the image evenly.

    The cells of a grid take turns; each gives its landmarks in the map first, as they are listed.

    Args:
        stereo_px: (u_left, u_right, v) [px], Shape (n, 3).
        known: Whether the landmark is in the map, Shape (n,).
        size_px: Width and height of the image.
        count: How many are wanted at most.

    Returns:
        Their rows in increasing order, Shape (min(n, count),).
    """
    n = len(stereo_px)
    if n <= count:
        return np.arange(n)
    cell = np.clip((stereo_px[:, [0, 2]] * _CELLS / size_px).astype(np.int64), 0, _CELLS - 1)
    key = cell[:, 1] * _CELLS + cell[:, 0]
    by_cell = np.lexsort((np.arange(n), ~known, key))
    rank = np.empty(n, dtype=np.int64)
    rank[by_cell] = np.arange(n) - np.searchsorted(key[by_cell], key[by_cell])
    # Neighbouring cells are far apart in the order of turns, for counts below that of the cells.
    turn = key * _COPRIME % _CELLS**2
    return np.sort(np.lexsort((turn, rank))[:count])
