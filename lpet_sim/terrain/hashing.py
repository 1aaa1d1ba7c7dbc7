"""Randomness as a function of place: the same numbers for a tile whoever asks, in any order."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

MAX_COUNT = 24  # things on one tile; expected counts stay below 4

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_TO_UNIT = 2.0**-53


@njit(cache=True, inline="always")
def mixed(state):  # type: ignore[no-untyped-def]
    """Scramble 64 bits (the finaliser of SplitMix64, Steele et al. 2014)."""
    z = (state ^ (state >> np.uint64(30))) * _MIX_1
    z = (z ^ (z >> np.uint64(27))) * _MIX_2
    return z ^ (z >> np.uint64(31))


@njit(cache=True, inline="always")
def tile_state(key, level, ix, iy):  # type: ignore[no-untyped-def]
    """Give the state of the generator that belongs to one tile of one level."""
    z = mixed(np.uint64(key) + np.uint64(level + 1) * _GOLDEN)
    z = mixed(z + np.uint64(ix + (1 << 40)) * _GOLDEN)
    return mixed(z + np.uint64(iy + (1 << 40)) * _MIX_1)


@njit(cache=True, inline="always")
def uniform(state, n):  # type: ignore[no-untyped-def]
    """Give the n-th number of a state, uniform in [0, 1)."""
    return (mixed(state + np.uint64(n + 1) * _GOLDEN) >> np.uint64(11)) * _TO_UNIT


@njit(cache=True, inline="always")
def poisson(u, mean):  # type: ignore[no-untyped-def]
    """Turn a uniform number into a Poisson count by the inverse of its distribution."""
    p = math.exp(-mean)
    total, count = p, 0
    while u > total and count < MAX_COUNT:
        count += 1
        p *= mean / count
        total += p
    return count
