"""Hills and mesas from the edge of the clear circle up to the skyline."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.spec import FarReliefSpec

WAVES = np.array([2.0, 3.0, 5.0, 8.0])  # lobes of an outline: spurs and gullies
WAVE_SIZE = np.array([0.12, 0.08, 0.05, 0.03])  # each lobe's size over the radius. A choice.
WIDEST = 1.0 + 0.28  # the sum of the lobes


@dataclass(frozen=True, eq=False)
class Hills:
    """All hills of a terrain.

    Attributes:
        rows: (x, y, height, radius of the foot, 1 for a mesa, four phases), Shape (h, 9) [m, rad].
        clear_radius_m: Nothing reaches inside this circle around the origin [m].
    """

    rows: Array
    clear_radius_m: float

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:  # noqa: ARG002 - hills are coarse
        """Give the height of the hills at points [m], Shape (n, 2) -> (n,)."""
        return self._evaluate(xy)[:, 0]

    def gradient(self, xy: Array) -> Array:
        """Give (dz/dx, dz/dy) at points [m], Shape (n, 2) -> (n, 2)."""
        return self._evaluate(xy)[:, 1:]

    def _evaluate(self, xy: Array) -> Array:
        out = np.zeros((len(xy), 3))
        _sum_hills(xy, self.rows, self.clear_radius_m, out)
        return out


def build_hills(spec: FarReliefSpec, rng: np.random.Generator) -> Hills:
    """Scatter hills over the ring between the clear circle and the farthest reach.

    A hill's foot is 3 to 6 heights from its centre, so that its flanks lie near the angle of
    rest at the steepest; a mesa's is 4 to 8. A hill that would reach the clear circle is left out.
    """
    area_km2 = math.pi * (spec.reach_m**2 - spec.clear_radius_m**2) * 1e-6
    n = int(rng.poisson(spec.hills_per_km2 * area_km2))
    distance = np.sqrt(rng.uniform(spec.clear_radius_m**2, spec.reach_m**2, n))
    bearing = rng.uniform(0.0, 2.0 * np.pi, n)
    height = np.exp(rng.uniform(np.log(spec.height_min_m), np.log(spec.height_max_m), n))
    mesa = rng.random(n) < spec.mesa_fraction
    radius = height * np.where(mesa, rng.uniform(4.0, 8.0, n), rng.uniform(3.0, 6.0, n))
    phases = rng.uniform(0.0, 2.0 * np.pi, (n, len(WAVES)))
    x, y = distance * np.cos(bearing), distance * np.sin(bearing)
    rows = np.column_stack([x, y, height, radius, mesa, phases])
    return Hills(rows[distance > spec.clear_radius_m + WIDEST * radius], spec.clear_radius_m)


@njit(cache=True, nogil=True)
def _outline(angle, row):  # type: ignore[no-untyped-def]
    """Give the foot's distance over the radius in a direction, and its derivative."""
    size, slope = 1.0, 0.0
    for k in range(len(WAVES)):
        phase = WAVES[k] * angle + row[5 + k]
        size += WAVE_SIZE[k] * math.cos(phase)
        slope -= WAVE_SIZE[k] * WAVES[k] * math.sin(phase)
    return size, slope


@njit(cache=True, nogil=True)
def _profile(t, mesa):  # type: ignore[no-untyped-def]
    """Give the height over the hill's height and its slope at t, 0 at the centre, 1 at the foot."""
    if mesa:
        s = min(max((1.0 - t) / 0.55, 0.0), 1.0)
        return s * s * (3.0 - 2.0 * s), -6.0 * s * (1.0 - s) / 0.55
    return (1.0 - t * t) ** 2, -4.0 * t * (1.0 - t * t)


@njit(cache=True, nogil=True)
def _add_hill(dx, dy, row, out):  # type: ignore[no-untyped-def]
    """Add one hill at an offset from its centre: with t = d / (radius outline(angle))."""
    d = math.sqrt(dx * dx + dy * dy)
    if d >= WIDEST * row[3] or d == 0.0:
        out[0] += row[2] if d == 0.0 else 0.0
        return
    size, size_slope = _outline(math.atan2(dy, dx), row)
    t = d / (row[3] * size)
    if t >= 1.0:
        return
    z, slope = _profile(t, row[4] > 0.5)
    along, across = row[2] * slope * t / d, -row[2] * slope * t * size_slope / (size * d)
    out[0] += row[2] * z
    out[1] += (along * dx - across * dy) / d
    out[2] += (along * dy + across * dx) / d


@njit(cache=True, nogil=True)
def _sum_hills(xy, rows, clear_radius, out):  # type: ignore[no-untyped-def]
    """Add every hill: (z, dz/dx, dz/dy), Shape (n, 3)."""
    for i in range(len(xy)):
        x, y = xy[i, 0], xy[i, 1]
        if x * x + y * y < clear_radius * clear_radius:
            continue
        for k in range(len(rows)):
            dx, dy = x - rows[k, 0], y - rows[k, 1]
            reach = WIDEST * rows[k, 3]
            if abs(dx) < reach and abs(dy) < reach:
                _add_hill(dx, dy, rows[k], out[i])
