"""The landmarks of the static analysis: one even sample of the field's densities on flat ground.

The sensor's landmarks are counted by the same densities and seen by the same laws; relief and rocks
come in only by how the rover tilts and by how likely they hide what is behind them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc
from scipy.stats import qmc

from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.sensors.landmark_far import EYE_M, REACH_M
from lpet_sim.sensors.landmark_spec import LandmarkFieldSpec
from lpet_sim.terrain.rock_sizes import size_law
from lpet_sim.terrain.spec import TerrainSpec
from lpet_sim.tradeoff.spec import SiteSpec

_SLOPES = np.geomspace(1e-3, 1e2, 400)


@dataclass(frozen=True, eq=False)
class StaticWorld:
    """Landmarks along a straight path over the x axis, the strongest first.

    Attributes:
        p_world: Places [m], Shape (n, 3).
        normal: Unit normals of the surface, Shape (n, 3).
        fading: How far each is seen, uniform in [0, 1), Shape (n,).
        slope_min: A landmark is hidden where the line of sight falls less than this for a metre,
            Shape (n,).
        is_far: Which are on far relief, Shape (n,).
    """

    p_world: Array
    normal: Array
    fading: Array
    slope_min: Array
    is_far: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.fading)

    def select(self, kept: NDArray[np.bool_]) -> StaticWorld:
        """Give the landmarks that a mask keeps, in their order."""
        places = self.p_world[kept], self.normal[kept]
        return StaticWorld(*places, self.fading[kept], self.slope_min[kept], self.is_far[kept])


def draw_world(site: SiteSpec, path_m: float, seed: int) -> StaticWorld:
    """Draw the landmarks along a path, evenly by a scrambled Halton sequence.

    Args:
        site: Densities and terrain.
        path_m: Length of the path, from the origin along x.
        seed: Of the scrambling.
    """
    wide = site.landmarks.visibility.range_max_m
    area = (path_m + wide) * 2.0 * wide
    ground = _ground(site, area, seed)
    rocks = _rocks(site, area, seed)
    near = np.concatenate([ground, rocks])
    p, normal = near[:, :3], near[:, 3:6]
    p[:, 0] *= path_m + wide
    p[:, 1] = wide * (2.0 * p[:, 1] - 1.0)
    sphere = near[:, 9:10] * normal
    slope = slope_that_sees(near[:, 8], site.terrain)
    far = _far(site.terrain, site.landmarks.field, 0.5 * path_m, seed)
    order = np.argsort(-np.concatenate([near[:, 7], far[:, 3]]), kind="stable")
    count = len(far)
    return StaticWorld(
        np.concatenate([p + sphere, far[:, :3]])[order],
        np.concatenate([normal, np.tile([0.0, 0.0, 1.0], (count, 1))])[order],
        np.concatenate([near[:, 6], np.zeros(count)])[order],
        np.concatenate([slope, np.full(count, -np.inf)])[order],
        (np.arange(len(near) + count) >= len(near))[order],
    )


def _even(count: int, dimensions: int, name: str, seed: int) -> Array:
    rng = stream(seed, "tradeoff", "world", name)
    return np.asarray(qmc.Halton(dimensions, rng=rng).random(count), dtype=float)


def _ground(site: SiteSpec, area_m2: float, seed: int) -> Array:
    """Give (x, y, z, normal, fading, strength, shade, radius) on ground that no rock covers."""
    covered = _cover(site.terrain, site.landmarks.field.rock_min_diameter_m)
    count = round(area_m2 * site.landmarks.field.ground_per_m2 * (1.0 - covered))
    u = _even(count, 5, "ground", seed)
    flat = np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))
    return np.column_stack([u[:, :2], flat, u[:, 2:], np.zeros(count)])


def _rocks(site: SiteSpec, area_m2: float, seed: int) -> Array:
    """Give the same on rocks, which are half spheres."""
    field, law = site.landmarks.field, size_law(site.terrain.rocks)
    rocks_per_m2 = float(law.count_above(np.array([field.rock_min_diameter_m]))[0])
    count = round(area_m2 * rocks_per_m2 * field.per_rock)
    u = _even(count, 8, "rocks", seed)
    z, around = u[:, 5], 2.0 * math.pi * u[:, 6]
    flat = np.sqrt(1.0 - z**2)
    normal = np.column_stack([flat * np.cos(around), flat * np.sin(around), z])
    radius = 0.5 * law.diameter_at(u[:, 7] * rocks_per_m2) if count else np.zeros(0)
    return np.column_stack([u[:, :2], np.zeros(count), normal, u[:, 2:5], radius])


def _cover(terrain: TerrainSpec, diameter_m: float) -> float:
    return float(size_law(terrain.rocks).area_above(np.array([diameter_m]))[0])


def _far(terrain: TerrainSpec, field: LandmarkFieldSpec, middle_m: float, seed: int) -> Array:
    """Give (x, y, z, strength) around the middle of the path, at the height of the eye.

    One landmark for each slot of bearing, evenly over the rings of distance, which double.
    """
    count = round(2.0 * math.pi * field.far_per_rad)
    u = _even(count, 3, "far", seed)
    bearing = 2.0 * math.pi * (np.arange(count) + u[:, 0]) / max(count, 1)
    reach_m = REACH_M if terrain.far is None else terrain.far.reach_m
    distance = field.far_from_m * max(reach_m / field.far_from_m, 1.0) ** u[:, 1]
    x, y = middle_m + distance * np.cos(bearing), distance * np.sin(bearing)
    return np.column_stack([x, y, np.full(count, EYE_M), u[:, 2]])


def seen_share(slope: Array, terrain: TerrainSpec) -> Array:
    """Give the share of ground that is not hidden under a line of sight of a slope.

    ``S(mu) exp(-c / (2 mu))``: Smith's shadowing function of Gaussian relief with RMS slope s,
    ``S = (1 - erfc(mu / (sqrt(2) s)) / 2) / (1 + L)``, ``L = (sqrt(2 / pi) s / mu exp(-mu^2 / (2
    s^2)) - erfc(mu / (sqrt(2) s))) / 2``, and rocks at random, half as high as wide, that cover a
    share c of the ground: a line that falls by mu passes below the top of a rock of diameter D for
    ``pi/4 D / (2 mu)`` on average, over a width of D.

    Args:
        slope: Fall mu of the line of sight for a metre, above 0, Shape (n,).
        terrain: Relief and rocks.

    Reference: Smith (1967), eq. 24 [recalled].
    """
    s, covered = terrain.relief.rms_slope_rad, _cover(terrain, 0.0)
    ratio = slope / (math.sqrt(2.0) * max(s, 1e-9))
    lam = 0.5 * (np.exp(-(ratio**2)) / (math.sqrt(math.pi) * ratio) - erfc(ratio))
    return (1.0 - 0.5 * erfc(ratio)) / (1.0 + lam) * np.exp(-0.5 * covered / slope)


def slope_that_sees(shade: Array, terrain: TerrainSpec) -> Array:
    """Invert `seen_share`: give the least slope at which each share is reached, Shape (n,)."""
    return np.interp(shade, seen_share(_SLOPES, terrain), _SLOPES)
