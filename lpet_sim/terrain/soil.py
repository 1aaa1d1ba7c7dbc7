"""Which soil lies where: a smooth random field, cut at the levels that give each its share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.terrain.relief import Bands, synthesise
from lpet_sim.terrain.spec import TerrainSpec
from lpet_sim.terrain.spline import TILE

SAMPLES = 60_000  # points from which the levels are read: shares to about 0.2 %
FINEST = 16.0  # patch size over the shortest wavelength of an outline
SOFTNESS = 0.15  # half-width of a border's change of tone, in standard deviations of the field


@dataclass(frozen=True, eq=False)
class SoilMap:
    """The soils of a terrain.

    Attributes:
        field: The smooth field; None where there is one soil.
        levels: Values of the field at which one soil gives way to the next, Shape (s - 1,).
        tones: Albedo of each soil over the terrain's mean, Shape (s,).
        softness: Half-width of the change of tone at a border, in the field's values.
    """

    field: Bands | None
    levels: Array
    tones: Array
    softness: float

    def soil(self, xy: Array) -> Ints:
        """Give the index of the soil at points [m], Shape (n, 2) -> (n,)."""
        if self.field is None:
            return np.zeros(len(xy), dtype=np.int64)
        value = self.field.height(xy)
        return np.searchsorted(self.levels, value, side="right").astype(np.int64)

    def tone(self, xy: Array, texel_m: float) -> Array:
        """Give the soil's albedo over the terrain's mean at points [m], Shape (n, 2) -> (n,).

        The tone changes gradually over a border. Detail finer than a texel is left out.
        """
        if self.field is None:
            return np.full(len(xy), self.tones[0])
        value = self.field.height(xy, texel_m)
        knots = (self.levels[:, None] + self.softness * np.array([-1.0, 1.0])).ravel()
        return np.interp(value, np.maximum.accumulate(knots), np.repeat(self.tones, 2)[1:-1])


def build_soil(spec: TerrainSpec, rng: np.random.Generator) -> SoilMap:
    """Draw the soil map of a terrain.

    The field's spectrum is flat down to waves of two patches and falls as ``f^-4`` below: blobs of
    the patch's size with ragged outlines. Soils border on each other in the order of the spec.
    """
    shares = np.array([soil.area_fraction for soil in spec.soils])
    tones = np.array([soil.tone for soil in spec.soils])
    if len(spec.soils) == 1:
        return SoilMap(None, np.empty(0), tones, 1.0)
    knee = 0.5 / spec.soil_patch_m
    field = synthesise(
        lambda f: np.maximum(f, knee) ** -4.0,
        spec.soil_patch_m / FINEST,
        4.0 * spec.soil_patch_m,
        rng,
    )
    reach_m = TILE * field.frames[:, 0].max()
    values = field.height(rng.uniform(-reach_m, reach_m, (SAMPLES, 2)))
    levels = np.quantile(values, np.minimum(np.cumsum(shares)[:-1], 1.0))
    return SoilMap(field, levels, tones, SOFTNESS * float(values.std()))
