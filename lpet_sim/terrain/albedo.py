"""How bright the ground is: soil tone, dust and grain, and pebbles with their own light and shade.

Seen from a rover's mast, texture between a few millimetres and a few decimetres is what a feature
detector lives on. All of it is a function of the place, at any sampling without aliasing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.terrain.pebbles import PebbleField, build_pebbles
from lpet_sim.terrain.relief import Bands, synthesise
from lpet_sim.terrain.soil import SoilMap
from lpet_sim.terrain.spec import AlbedoSpec, TerrainSpec

DARKEST, BRIGHTEST = 0.02, 0.95  # albedo of any natural ground lies well inside


@dataclass(frozen=True, eq=False)
class AlbedoMap:
    """The albedo of a terrain.

    Attributes:
        spec: What it was built from.
        seed: The terrain's seed.
        soils: Tone of the soils.
        pebbles: What is too small to be a rock.
        tones: Dust and grain, for each octave of texel that was asked for.
    """

    spec: AlbedoSpec
    seed: int
    soils: SoilMap
    pebbles: PebbleField
    tones: dict[int, Bands | None] = field(default_factory=dict)

    def albedo(self, xy: Array, texel_m: float, pebbles: bool = True) -> Array:
        """Give the albedo at points [m], Shape (n, 2) -> (n,), without detail finer than texels."""
        relative = self.soils.tone(xy, texel_m)
        bands = self._bands(texel_m)
        if bands is not None:
            relative *= 1.0 + bands.height(xy)
        if pebbles:
            self.pebbles.apply(xy, texel_m, relative)
        relative *= self.spec.mean
        return np.clip(relative, DARKEST, BRIGHTEST, out=relative)

    def _bands(self, texel_m: float) -> Bands | None:
        """Give the tone whose shortest wave is two texels, rounded up to octaves."""
        octaves = max(int(np.ceil(np.log2(2.0 * texel_m / self.spec.grain_scale_m) - 1e-9)), 0)
        if octaves not in self.tones:
            self.tones[octaves] = draw_tone(self.spec, self.seed, 2.0**octaves)
        return self.tones[octaves]


def tone_spectrum(spec: AlbedoSpec) -> Callable[[Array], Array]:
    """Make the spectrum ``A f^-2`` (amplitude 1/f, as in natural images) with the contrast asked.

    The variance is ``int A f^-2 2 pi f df = 2 pi A ln(longest / shortest)``.
    """
    octaves = 2.0 * np.pi * np.log(spec.tone_scale_m / spec.grain_scale_m)
    return lambda f: spec.tone_contrast**2 / octaves * f**-2.0


def draw_tone(spec: AlbedoSpec, seed: int, coarser: float) -> Bands | None:
    """Draw dust and grain without waves shorter than a multiple of the grain's scale.

    The noise is the same for every multiple, so that only detail is lost.

    Args:
        spec: Contrast and scales.
        seed: The terrain's seed.
        coarser: Shortest wave kept, over the grain's scale.

    Returns:
        The tone; None where nothing is left of it.
    """
    shortest_m = coarser * spec.grain_scale_m
    if shortest_m >= spec.tone_scale_m:
        return None
    spectrum = tone_spectrum(spec)
    bands = synthesise(
        lambda f: np.where(f <= 1.0 / shortest_m, spectrum(f), 0.0),
        spec.grain_scale_m,
        spec.tone_scale_m,
        stream(seed, "terrain", "albedo", "tone"),
    )
    return bands.without_finer(shortest_m)


def build_albedo(spec: TerrainSpec, seed: int, soils: SoilMap) -> AlbedoMap:
    """Lay out the albedo of a terrain."""
    pebbles = build_pebbles(spec.albedo, spec.sun, stream(seed, "terrain", "albedo", "pebbles"))
    return AlbedoMap(spec.albedo, seed, soils, pebbles)
