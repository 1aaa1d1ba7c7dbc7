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
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import quad_vec
from scipy.special import j0

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.spec import ReliefSpec

Spectrum = Callable[[Array], Array]

TILE = 512  # cells along a tile's side, a power of two
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

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Evaluate the surface.

        Args:
            xy: Points in the world [m], Shape (n, 2).
            detail_m: Leave out bands that are wholly finer than twice this [m].

        Returns:
            Heights [m], Shape (n,).
        """
        out = np.zeros(len(xy))
        _sum_heights(xy, self.tiles, self.frames, self.first_band(detail_m), out)
        return out

    def gradient(self, xy: Array) -> Array:
        """Evaluate (dz/dx, dz/dy), Shape (n, 2), of the surface at points [m], Shape (n, 2)."""
        out = np.zeros((len(xy), 2))
        _sum_gradients(xy, self.tiles, self.frames, out)
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
    """Make the von Karman spectrum ``A (f^2 + 1/outer^2)^-(H+1)`` with the slope asked for.

    It goes as ``f^-(2H+2)`` below the outer scale. ``A`` is set so that the structure function at
    1 m is ``tan(slope)^2``; see `structure_function`.
    """

    def shape(f: Array) -> Array:
        return (f**2 + spec.outer_scale_m**-2.0) ** -(spec.hurst + 1.0)

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


@njit(cache=True, inline="always")
def _weights(t):  # type: ignore[no-untyped-def]
    """Give the four cubic B-spline weights at the fraction t of a cell."""
    s = 1.0 - t
    w0 = s * s * s / 6.0
    w3 = t * t * t / 6.0
    w1 = 2.0 / 3.0 - t * t * (1.0 - 0.5 * t)
    return w0, w1, 1.0 - w0 - w1 - w3, w3


@njit(cache=True, inline="always")
def _slopes(t):  # type: ignore[no-untyped-def]
    """Give the derivatives of the four weights with respect to t."""
    s = 1.0 - t
    return -0.5 * s * s, t * (1.5 * t - 2.0), s * (2.0 - 1.5 * s), 0.5 * t * t


@njit(cache=True, inline="always")
def _blend(tile, iu, iv, a0, a1, a2, a3, b0, b1, b2, b3):  # type: ignore[no-untyped-def]
    """Sum sixteen coefficients of a periodic tile, weighted a along u and b along v."""
    m = TILE - 1
    j0_, j1, j2, j3 = (iu - 1) & m, iu & m, (iu + 1) & m, (iu + 2) & m
    r0, r1, r2, r3 = tile[(iv - 1) & m], tile[iv & m], tile[(iv + 1) & m], tile[(iv + 2) & m]
    s0 = a0 * r0[j0_] + a1 * r0[j1] + a2 * r0[j2] + a3 * r0[j3]
    s1 = a0 * r1[j0_] + a1 * r1[j1] + a2 * r1[j2] + a3 * r1[j3]
    s2 = a0 * r2[j0_] + a1 * r2[j1] + a2 * r2[j2] + a3 * r2[j3]
    s3 = a0 * r3[j0_] + a1 * r3[j1] + a2 * r3[j2] + a3 * r3[j3]
    return b0 * s0 + b1 * s1 + b2 * s2 + b3 * s3


@njit(cache=True, inline="always")
def _locate(x, y, frame):  # type: ignore[no-untyped-def]
    """Give a point's coordinates in a tile [cells]."""
    u = (frame[1] * x + frame[2] * y) / frame[0] + frame[3]
    v = (frame[1] * y - frame[2] * x) / frame[0] + frame[4]
    return u, v


@njit(cache=True)
def _sum_heights(xy, tiles, frames, first, out):  # type: ignore[no-untyped-def]
    """Add the height of every band from the first on, Shape (n,)."""
    for i in range(len(xy)):
        z = 0.0
        for b in range(first, len(tiles)):
            u, v = _locate(xy[i, 0], xy[i, 1], frames[b])
            iu, iv = int(np.floor(u)), int(np.floor(v))
            a0, a1, a2, a3 = _weights(u - iu)
            b0, b1, b2, b3 = _weights(v - iv)
            z += _blend(tiles[b], iu, iv, a0, a1, a2, a3, b0, b1, b2, b3)
        out[i] += z


@njit(cache=True)
def _sum_gradients(xy, tiles, frames, out):  # type: ignore[no-untyped-def]
    """Add the gradient of every band, Shape (n, 2)."""
    for i in range(len(xy)):
        for b in range(len(tiles)):
            u, v = _locate(xy[i, 0], xy[i, 1], frames[b])
            iu, iv = int(np.floor(u)), int(np.floor(v))
            a0, a1, a2, a3 = _weights(u - iu)
            b0, b1, b2, b3 = _weights(v - iv)
            c0, c1, c2, c3 = _slopes(u - iu)
            d0, d1, d2, d3 = _slopes(v - iv)
            du = _blend(tiles[b], iu, iv, c0, c1, c2, c3, b0, b1, b2, b3)
            dv = _blend(tiles[b], iu, iv, a0, a1, a2, a3, d0, d1, d2, d3)
            cos, sin = frames[b, 1] / frames[b, 0], frames[b, 2] / frames[b, 0]
            out[i, 0] += cos * du - sin * dv
            out[i, 1] += sin * du + cos * dv
