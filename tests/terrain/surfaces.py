"""Statistics of height maps, for the tests of the terrain."""

from __future__ import annotations

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.terrain import Terrain


def grid_rms_difference(heights: Array, steps: tuple[int, ...]) -> Array:
    """Give the RMS height difference over lags along both axes of a grid, Shape (len(steps),)."""
    squares = [
        np.mean((heights[:, k:] - heights[:, :-k]) ** 2)
        + np.mean((heights[k:] - heights[:-k]) ** 2)
        for k in steps
    ]
    return np.sqrt(0.5 * np.array(squares))


def point_rms_difference(terrain: Terrain, xy: Array, lag_m: Array) -> Array:
    """Give the RMS height difference over lags along both axes from given points."""
    here = terrain.height(xy)
    squares = [
        np.mean((terrain.height(xy + np.array([lag, 0.0])) - here) ** 2)
        + np.mean((terrain.height(xy + np.array([0.0, lag])) - here) ** 2)
        for lag in lag_m
    ]
    return np.sqrt(0.5 * np.array(squares))


def exponent(lag_m: Array, rms_m: Array) -> float:
    """Fit the Hurst exponent: the slope of log RMS difference over log lag."""
    return float(np.polyfit(np.log(lag_m), np.log(rms_m), 1)[0])
