"""Self-affine relief as a pure function of the plane, at any scale.

A surface is the sum of a few bands. Each band is a periodic tile, synthesised in Fourier space on
one annulus of frequencies and evaluated as a cubic B-spline (twice continuously differentiable);
the tiles are turned and shifted at random, so that their sum does not repeat. The annuli abut, so
the sum has the spectrum asked for from the shortest wavelength to the longest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad_vec
from scipy.special import j0

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.spec import ReliefSpec
from lpet_sim.terrain.spline import TILE, sum_gradients, sum_heights

Spectrum = Callable[[Array], Array]

OVERSAMPLING = 4.0  # cells per shortest wavelength of a band
STEP = 8.0  # ratio of one band's wavelengths to the next
LONGEST = 2.5  # longest wavelength synthesised, in outer scales


@dataclass(frozen=True, eq=False)
class Bands:
    """A band-limited random surface.

    Attributes:
        tiles: B-spline coefficients [m], Shape (b, TILE, TILE), finest band first.
        frames: (cell [m], cos, sin, u offset, v offset) of each tile, Shape (b, 5).
        longest_m: Longest wavelength of each band [m], Shape (b,).
    """

    tiles: Array
    frames: Array
    longest_m: Array

    def first_band(self, detail_m: float) -> int:
        """Find the finest band with wavelengths of at least two details [m]."""
        return int(np.searchsorted(self.longest_m, 2.0 * detail_m))

    def without_finer(self, shortest_m: float) -> Bands:
        """Give the surface without the bands that are wholly finer than a wavelength [m]."""
        keep = self.longest_m > shortest_m
        return Bands(self.tiles[keep], self.frames[keep], self.longest_m[keep])

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Evaluate the surface.

        Args:
            xy: Points in the world [m], Shape (n, 2).
            detail_m: Leave out bands that are wholly finer than twice this [m].

        Returns:
            Heights [m], Shape (n,).
        """
        out = np.zeros(len(xy))
        sum_heights(xy, self.tiles, self.frames, self.first_band(detail_m), out)
        return out

    def gradient(self, xy: Array) -> Array:
        """Evaluate (dz/dx, dz/dy), Shape (n, 2), of the surface at points [m], Shape (n, 2)."""
        out = np.zeros((len(xy), 2))
        sum_gradients(xy, self.tiles, self.frames, out)
        return out


def synthesise(
    spectrum: Spectrum, shortest_m: float, longest_m: float, rng: np.random.Generator
) -> Bands:
    """Draw a surface with a given isotropic power spectrum.

    Args:
        spectrum: Two-dimensional power spectral density over frequency [cycles/m] -> [m^4].
        shortest_m: Shortest wavelength [m].
        longest_m: Longest wavelength [m].
        rng: Where the randomness comes from.
    """
    edges = [shortest_m]
    while edges[-1] < longest_m:
        edges.append(min(edges[-1] * STEP, longest_m))
    cells = np.array(edges[:-1]) / OVERSAMPLING
    tiles = [
        _tile(spectrum, cell, 1.0 / high, 1.0 / low, rng)
        for cell, low, high in zip(cells, edges, edges[1:], strict=False)
    ]
    turn = rng.uniform(0.0, 2.0 * np.pi, len(cells))
    shift = rng.uniform(0.0, TILE, (len(cells), 2))
    frames = np.column_stack([cells, np.cos(turn), np.sin(turn), shift])
    return Bands(np.array(tiles), frames, np.array(edges[1:]))


def _tile(
    spectrum: Spectrum, cell: float, low: float, high: float, rng: np.random.Generator
) -> Array:
    """Draw the spline coefficients of one band: white noise, coloured between two frequencies."""
    fx, fy = np.fft.rfftfreq(TILE, cell), np.fft.fftfreq(TILE, cell)[:, None]
    f = np.hypot(fx, fy)
    inside = (f >= low) & (f < high)
    gain = np.zeros_like(f)
    gain[inside] = np.sqrt(spectrum(f[inside])) / cell
    noise = np.fft.rfft2(rng.standard_normal((TILE, TILE)))
    return np.fft.irfft2(noise * gain / (_response(fx * cell) * _response(fy * cell)))


def _response(frequency: NDArray[Any]) -> NDArray[Any]:
    """Give the spectrum of the sampled cubic B-spline over frequency [cycles/cell]."""
    return (2.0 + np.cos(2.0 * np.pi * frequency)) / 3.0


def self_affine_spectrum(spec: ReliefSpec) -> Spectrum:
    """Make the spectrum ``A f^-(2H+2)`` of a self-affine surface with the slope asked for.

    ``A`` is set so that the structure function at 1 m is ``tan(slope)^2``. The law ends at the
    outer scale, so that heights stay bounded. The mean square slope of all the longer waves,
    ``int_0^f0 f^-(2H+2) f^3 df = f0^(2-2H) / (2-2H)``, is given to the octave or so below f0:
    without it the structure function would fall short of ``r^2H`` by a term in ``r^2``, which for
    H = 0.9 takes the exponent measured at 1-16 m to 0.8.
    """
    exponent, f0 = 2.0 * spec.hurst + 2.0, 1.0 / spec.outer_scale_m
    plateau = 4.0 / ((2.0 - 2.0 * spec.hurst) * (1.0 - LONGEST**-4.0)) * f0**-exponent

    def shape(f: Array) -> Array:
        return np.where(f >= f0, f**-exponent, plateau)

    longest_m = LONGEST * spec.outer_scale_m
    at_1m = structure_function(shape, spec.inner_scale_m, longest_m, np.array([1.0]))[0]
    amplitude = np.tan(spec.rms_slope_rad) ** 2 / at_1m
    return lambda f: amplitude * shape(f)


def structure_function(
    spectrum: Spectrum, shortest_m: float, longest_m: float, lag_m: Array
) -> Array:
    """Give the expected squared height difference over lags.

    ``D(r) = int P(f) (2 - 2 J0(2 pi f r)) 2 pi f df`` between the two wavelengths, for an
    isotropic surface with the two-dimensional spectrum P.

    Args:
        spectrum: Power spectral density over frequency [cycles/m] -> [m^4].
        shortest_m: Shortest wavelength [m].
        longest_m: Longest wavelength [m].
        lag_m: Lags r [m], Shape (n,).

    Returns:
        D [m^2], Shape (n,).
    """

    def integrand(log_f: float) -> Array:
        f = np.exp(log_f)
        density = spectrum(np.array([f]))[0] * 2.0 * np.pi * f**2
        return density * (2.0 - 2.0 * j0(2.0 * np.pi * f * lag_m))

    low, high = -np.log(longest_m), -np.log(shortest_m)
    return quad_vec(integrand, low, high, epsrel=1e-6, limit=2000)[0]


def build_relief(spec: ReliefSpec, rng: np.random.Generator) -> Bands:
    """Draw the self-affine relief of a terrain."""
    return synthesise(
        self_affine_spectrum(spec), spec.inner_scale_m, LONGEST * spec.outer_scale_m, rng
    )
