"""Mutual nearest descriptors among the pairs that geometry allows, compiled.

Candidates are cut by position and size before any descriptor is read: what is left costs less than
a matrix product over all pairs.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Ints = NDArray[np.int64]

_SAME_PLACE_PX = 1.5


@njit(cache=True, nogil=True, fastmath=True)
def _distance2(a: Floats, b: Floats) -> float:
    total = np.float32(0.0)
    for k in range(a.size):
        d = a[k] - b[k]
        total += d * d
    return float(total)


@njit(cache=True, nogil=True)
def mutual_matches(
    uv_a: Floats,
    size_a: Floats,
    descriptor_a: Floats,
    uv_b: Floats,
    size_b: Floats,
    descriptor_b: Floats,
    window: NDArray[np.float64],
    scale_ratio_max: float,
    ratio_max: float,
    distance_max: float,
) -> Ints:
    """Match two sets of features within a window of displacement.

    A pair is a match if each is the other's nearest descriptor among its candidates, and the
    second-best candidate of both (at another place) is further away by the ratio asked for.

    Args:
        uv_a: Positions [px], Shape (n, 2).
        size_a: Keypoint sizes [px], Shape (n,).
        descriptor_a: Shape (n, d).
        uv_b: Positions [px], Shape (m, 2), **sorted by v**.
        size_b: Shape (m,).
        descriptor_b: Shape (m, d).
        window: (u_min, u_max, v_min, v_max) of the displacement ``uv_b - uv_a`` [px].
        scale_ratio_max: Largest ratio of the two sizes.
        ratio_max: Largest ratio of the distances to the best and second-best descriptor.
        distance_max: Largest distance of the two descriptors.

    Returns:
        For each a the row in b, or -1, Shape (n,).
    """
    n, m = len(uv_a), len(uv_b)
    best_a, row_a, second_a = np.full(n, np.inf), np.full(n, -1), np.full(n, np.inf)
    best_b, row_b, second_b = np.full(m, np.inf), np.full(m, -1), np.full(m, np.inf)
    v_b = uv_b[:, 1].copy()
    for i in range(n):
        first = np.searchsorted(v_b, uv_a[i, 1] + window[2])
        for j in range(first, m):
            if v_b[j] - uv_a[i, 1] > window[3]:
                break
            du = uv_b[j, 0] - uv_a[i, 0]
            if du < window[0] or du > window[1]:
                continue
            if size_a[i] > scale_ratio_max * size_b[j] or size_b[j] > scale_ratio_max * size_a[i]:
                continue
            d = _distance2(descriptor_a[i], descriptor_b[j])
            if d < second_a[i]:
                _offer(best_a, row_a, second_a, i, j, d, uv_b)
            if d < second_b[j]:
                _offer(best_b, row_b, second_b, j, i, d, uv_a)
    limits = distance_max**2, ratio_max**2
    return _accept(best_a, row_a, second_a, row_b, second_b, limits)


@njit(cache=True, nogil=True)
def _accept(
    best_a: NDArray[np.float64],
    row_a: Ints,
    second_a: NDArray[np.float64],
    row_b: Ints,
    second_b: NDArray[np.float64],
    limits: tuple[float, float],
) -> Ints:
    """Keep who is near, mutual and distinct: for each a the row in b, or -1."""
    out = np.full(len(row_a), -1)
    for i in range(len(row_a)):
        j = row_a[i]
        if j < 0 or row_b[j] != i or best_a[i] > limits[0]:
            continue
        if best_a[i] < limits[1] * min(second_a[i], second_b[j]):
            out[i] = j
    return out


@njit(cache=True, nogil=True)
def _offer(
    best: NDArray[np.float64],
    row: Ints,
    second: NDArray[np.float64],
    i: int,
    j: int,
    d: float,
    uv: Floats,
) -> None:
    """Enter a candidate into the best and second-best of i; the second must be elsewhere."""
    k = row[i]
    near = k >= 0 and (
        abs(uv[k, 0] - uv[j, 0]) < _SAME_PLACE_PX and abs(uv[k, 1] - uv[j, 1]) < _SAME_PLACE_PX
    )
    if d < best[i]:
        if not near:
            second[i] = best[i]
        best[i], row[i] = d, j
    elif not near:
        second[i] = d
