"""Compiled draws of landmarks: each number is a function of what it belongs to, not of an order."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.hashing import poisson, tile_state, uniform

GROUND, ROCK, FAR = 0, 1, 2
"""Kinds of landmarks."""

TRIES = 10
"""Places tried on a rock until one is above ground; half of a rock is below."""

_ID_SHIFT = np.uint64(11)  # 53 bits are left: an id is exact in a double, too
_LOOK, _PLACE = 8, 16  # first of the numbers that a landmark's look, its place are drawn from


@njit(cache=True, nogil=True, inline="always")
def normal_pair(state, n):  # type: ignore[no-untyped-def]
    """Give two independent standard normal numbers of a state (Box and Muller, 1958)."""
    radius = math.sqrt(-2.0 * math.log(1.0 - uniform(state, n)))
    angle = 2.0 * math.pi * uniform(state, n + 1)
    return radius * math.cos(angle), radius * math.sin(angle)


@njit(cache=True, nogil=True)
def draw_ground(  # type: ignore[no-untyped-def]
    key, mean, corner, shape, xy, state
):
    """Draw the landmarks on the ground of unit cells, and give their number.

    Args:
        key: What is hashed with the place.
        mean: Mean number in a cell of 1 m^2.
        corner: First cell (ix, iy).
        shape: Number of cells (nx, ny).
        xy: Filled with the places [m], Shape (n, 2).
        state: Filled with their states, Shape (n,), uint64.
    """
    count = 0
    for iy in range(corner[1], corner[1] + shape[1]):
        for ix in range(corner[0], corner[0] + shape[0]):
            cell = tile_state(key, GROUND, ix, iy)
            for k in range(min(poisson(uniform(cell, 0), mean), len(xy) - count)):
                state[count] = tile_state(cell, GROUND, k, 0)
                xy[count, 0] = ix + uniform(state[count], _PLACE)
                xy[count, 1] = iy + uniform(state[count], _PLACE + 1)
                count += 1
    return count


@njit(cache=True, nogil=True)
def draw_on_rocks(key, mean, rock_id, rock, state):  # type: ignore[no-untyped-def]
    """Draw how many landmarks are on each rock, and give their number.

    Args:
        key: What is hashed with the rock's identity.
        mean: Mean number on a rock.
        rock_id: Identities of the rocks, Shape (r,).
        rock: Filled with each landmark's rock, Shape (n,).
        state: Filled with their states, Shape (n,), uint64.
    """
    count = 0
    for row in range(len(rock_id)):
        own = tile_state(key, ROCK, rock_id[row], 0)
        for k in range(min(poisson(uniform(own, 0), mean), len(rock) - count)):
            rock[count] = row
            state[count] = tile_state(own, ROCK, k, 0)
            count += 1
    return count


@njit(cache=True, nogil=True)
def draw_places(state, out):  # type: ignore[no-untyped-def]
    """Draw the numbers of the places tried on a rock, Shape (n, TRIES, 3), uniform in [0, 1)."""
    for i in range(len(state)):
        for n in range(3 * TRIES):
            out[i, n // 3, n % 3] = uniform(state[i], _PLACE + n)


@njit(cache=True, nogil=True)
def draw_looks(state, identity, strength, fading, bias):  # type: ignore[no-untyped-def]
    """Draw what belongs to a landmark for good: name, strength, fading and fixed errors.

    Args:
        state: States, Shape (n,), uint64.
        identity: Filled with positive names below 2^53, Shape (n,).
        strength: Filled with numbers uniform in [0, 1), Shape (n,).
        fading: Likewise, Shape (n,).
        bias: Filled with standard normal numbers, Shape (n, 3).
    """
    for i in range(len(state)):
        identity[i] = np.int64(state[i] >> _ID_SHIFT)
        strength[i] = uniform(state[i], _LOOK)
        fading[i] = uniform(state[i], _LOOK + 1)
        bias[i, 0], bias[i, 1] = normal_pair(state[i], _LOOK + 2)
        bias[i, 2], _ = normal_pair(state[i], _LOOK + 4)


@njit(cache=True, nogil=True)
def _draw_sightings(key, t_ns, identity, uniforms, normals):  # type: ignore[no-untyped-def]
    for i in range(len(t_ns)):
        state = tile_state(key, 0, t_ns[i], identity[i])
        for n in range(uniforms.shape[1]):
            uniforms[i, n] = uniform(state, n)
        normals[i, 0], normals[i, 1] = normal_pair(state, 8)
        normals[i, 2], _ = normal_pair(state, 10)


def draw_sightings(key: int, t_ns: Ints, identity: Ints) -> tuple[Array, Array]:
    """Draw what belongs to one landmark in one image.

    Args:
        key: What is hashed with the image and the landmark.
        t_ns: Times of the images, which name them [ns], Shape (n,).
        identity: Names of the landmarks, Shape (n,).

    Returns:
        Numbers uniform in [0, 1) for detection, misclassification, its order and loss, Shape
        (n, 4), and standard normal ones for u_left, u_right and v, Shape (n, 3).
    """
    uniforms, normals = np.empty((len(t_ns), 4)), np.empty((len(t_ns), 3))
    _draw_sightings(key, t_ns, identity, uniforms, normals)
    return uniforms, normals


@njit(cache=True, nogil=True)
def _draw_names(identity, life, out):  # type: ignore[no-untyped-def]
    for i in range(len(identity)):
        if life[i] == 0:
            out[i] = identity[i]
        else:
            out[i] = np.int64(tile_state(0, life[i], identity[i], 0) >> _ID_SHIFT)


def draw_names(identity: Ints, life: Ints) -> Ints:
    """Name landmarks that were lost and found again: each life has a name, the first its own.

    Args:
        identity: Names of the landmarks, Shape (n,).
        life: How often each was lost before, Shape (n,).

    Returns:
        Positive names below 2^53, Shape (n,).
    """
    names = np.empty(len(identity), np.int64)
    _draw_names(identity, life, names)
    return names
