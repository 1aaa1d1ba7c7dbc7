"""A digital elevation model as ground: its own slopes where it resolves them, finer ones added."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numba import njit
from numpy.typing import NDArray
from rasterio.errors import RasterioIOError
from scipy.ndimage import gaussian_filter, spline_filter

from lpet_sim.datasets import data_path
from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.relief import LONGEST, Bands, self_affine_spectrum, synthesise
from lpet_sim.terrain.spec import DemSpec, ReliefSpec
from lpet_sim.terrain.spline import slopes, weights

ORDER = 8.0  # of the crossover between DEM and synthesis, in frequency
SMOOTH = 0.12  # scale of what goes on with its slope beyond the edge, over the blend. A choice.


@dataclass(frozen=True, eq=False)
class DemGround:
    """A DEM, fine roughness over it, and synthesised relief beyond its edge.

    ``z = edge + w (dem - edge) + (1 - w) coarse + fine``: inside the extent w is 1, and it falls
    to 0 over the blend's width outside, where the DEM is continued by mirror images.
    ``fine`` and ``coarse`` are independent and share the relief's spectrum between them, so that
    far outside the sum is the relief asked for.

    Attributes:
        coefficients: B-spline of ``w (dem - edge)`` [m], rows to the north, Shape (ny, nx).
        pixel_m: Size of a pixel (x, y) [m].
        first_node: World position (x, y) of coefficient (0, 0) [m].
        extent: Where the DEM has data.
        blend_m: Width of the fading belt [m].
        edge_m: Height that the DEM fades to [m].
        fine: Roughness that the DEM does not resolve.
        coarse: Relief that takes the DEM's place beyond its edge.
    """

    coefficients: Array
    pixel_m: tuple[float, float]
    first_node: tuple[float, float]
    extent: Box
    blend_m: float
    edge_m: float
    fine: Bands
    coarse: Bands

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Give heights at points [m], Shape (n, 2) -> (n,), without what is finer than detail."""
        total = self.edge_m + self._dem(xy)[:, 0] + self.fine.height(xy, detail_m)
        share, _ = self._share(xy)
        outside = share < 1.0
        beyond = self.coarse.height(xy[outside], detail_m)
        total[outside] += (1.0 - share[outside]) * beyond
        return total

    def gradient(self, xy: Array) -> Array:
        """Give (dz/dx, dz/dy) at points [m], Shape (n, 2) -> (n, 2)."""
        total = self._dem(xy)[:, 1:] + self.fine.gradient(xy)
        share, share_slope = self._share(xy)
        outside = share < 1.0
        at = xy[outside]
        total[outside] += (1.0 - share[outside, None]) * self.coarse.gradient(at)
        total[outside] -= share_slope[outside] * self.coarse.height(at)[:, None]
        return total

    def _dem(self, xy: Array) -> Array:
        out = np.zeros((len(xy), 3))
        first, pixel = np.array(self.first_node), np.array(self.pixel_m)
        _evaluate(xy, self.coefficients, first, pixel, out)
        return out

    def _share(self, xy: Array) -> tuple[Array, Array]:
        """Give the DEM's weight w, Shape (n,), and its gradient, Shape (n, 2)."""
        box = self.extent
        u, du = _fade(xy[:, 0], box.x_min, box.x_max, self.blend_m)
        v, dv = _fade(xy[:, 1], box.y_min, box.y_max, self.blend_m)
        return u * v, np.column_stack([du * v, u * dv])


def build_dem(spec: DemSpec, relief: ReliefSpec, rng: np.random.Generator) -> DemGround:
    """Read a DEM and draw the relief that completes it.

    The relief's spectrum is shared by ``g(f) = 1 / (1 + (f resolved)^-8)``: g of it is added to
    the DEM as fine roughness, and 1 - g stands in for the DEM beyond its edge.

    Args:
        spec: Which DEM, and where the world's origin lies in it.
        relief: Slope and exponent of the self-affine law.
        rng: Where the randomness comes from.

    Raises:
        DataError: The file is missing.
        SpecError: The file is no DEM on a north-up grid in metres, or has voids.
    """
    elevation, pixel = read_dem(spec.path)
    spectrum = self_affine_spectrum(relief)

    def fine_share(f: Array) -> Array:
        return 1.0 / (1.0 + (f * spec.resolved_m) ** -ORDER)

    fine = synthesise(
        lambda f: spectrum(f) * fine_share(f), relief.inner_scale_m, 3.0 * spec.resolved_m, rng
    )
    coarse = synthesise(
        lambda f: spectrum(f) * (1.0 - fine_share(f)),
        spec.resolved_m / 3.0,
        max(LONGEST * relief.outer_scale_m, spec.resolved_m),
        rng,
    )
    return _assemble(spec, elevation, pixel, fine, coarse)


def _assemble(
    spec: DemSpec, elevation: Array, pixel: tuple[float, float], fine: Bands, coarse: Bands
) -> DemGround:
    """Place the DEM in the world and let it fade beyond its edge."""
    ny, nx = elevation.shape
    column = 0.5 * (nx - 1) if spec.origin_column_px is None else spec.origin_column_px
    row = 0.5 * (ny - 1) if spec.origin_row_px is None else spec.origin_row_px
    west, south = -column * pixel[0], -(ny - 1 - row) * pixel[1]
    extent = Box(west, south, west + (nx - 1) * pixel[0], south + (ny - 1) * pixel[1])
    z = elevation[::-1] - (elevation.mean() if spec.datum_m is None else spec.datum_m)
    edge = float(np.concatenate([z[0], z[-1], z[:, 0], z[:, -1]]).mean())
    pad = (int(spec.blend_m / pixel[0]) + 5, int(spec.blend_m / pixel[1]) + 5)
    first = (west - pad[0] * pixel[0], south - pad[1] * pixel[1])
    wide = _continued(z - edge, pad)
    x = first[0] + np.arange(wide.shape[1]) * pixel[0]
    y = first[1] + np.arange(wide.shape[0]) * pixel[1]
    wide *= _fade(x, extent.x_min, extent.x_max, spec.blend_m)[0]
    wide *= _fade(y, extent.y_min, extent.y_max, spec.blend_m)[0][:, None]
    coefficients = spline_filter(wide, order=3, mode="mirror")
    return DemGround(coefficients, pixel, first, extent, spec.blend_m, edge, fine, coarse)


def _continued(z: Array, pad: tuple[int, int]) -> Array:
    """Continue a grid beyond its edge by so many pixels in x and y.

    What is smooth goes on with its slope, turned about the edge (an odd mirror image); what is
    fine is mirrored, as turning it would leave streaks across the edge.
    """
    width = ((pad[1], pad[1]), (pad[0], pad[0]))
    smooth = gaussian_filter(np.pad(z, width, "reflect", reflect_type="odd"), SMOOTH * min(pad))
    inside = smooth[pad[1] : -pad[1], pad[0] : -pad[0]]
    return smooth + np.pad(z - inside, width, "reflect")


def find_dem(path: str) -> Path:
    """Find a DEM: where the path says, else inside the data folder.

    Raises:
        DataError: It is in neither place.
    """
    here = Path(path)
    return here if here.is_absolute() and here.exists() else data_path(path)


def read_dem(path: str) -> tuple[Array, tuple[float, float]]:
    """Read a DEM.

    Args:
        path: A GeoTIFF; a relative path is looked for in the data folder.

    Returns:
        Elevation [m], row 0 in the north, Shape (ny, nx); size of a pixel (x, y) [m].

    Raises:
        DataError: The file is missing.
        SpecError: It is no raster, is not north-up, is not in metres, is too small or has voids.
    """
    try:
        with rasterio.open(find_dem(path)) as raster:
            elevation = raster.read(1, masked=True)
            transform, crs = raster.transform, raster.crs
    except RasterioIOError:
        raise SpecError(f"{path} is no raster that can be read: give a GeoTIFF DEM") from None
    problem = _problem(elevation, transform, crs)
    if problem:
        raise SpecError(f"DEM {path} {problem}")
    return np.asarray(elevation.data, dtype=np.float64), (transform.a, -transform.e)


def _problem(elevation: np.ma.MaskedArray[Any, Any], transform: Any, crs: Any) -> str:
    """Say what makes a raster unfit to be ground; empty where nothing does."""
    if transform.b != 0.0 or transform.d != 0.0 or transform.a <= 0.0 or transform.e >= 0.0:
        return "is turned: resample it to a north-up grid"
    if crs is not None and crs.is_geographic:
        return "is in degrees: project it to a grid in metres"
    voids = int(np.ma.getmaskarray(elevation).sum() + np.isnan(elevation.data).sum())
    if voids:
        return f"has {voids} voids among its {elevation.size} pixels: crop or fill them"
    if min(elevation.shape) < 8:
        return "is smaller than 8 x 8 pixels: give a larger one"
    return ""


def _fade(x: NDArray[Any], low: float, high: float, width: float) -> tuple[Array, Array]:
    """Fall from 1 inside an interval to 0 at a distance outside, twice differentiable."""
    outside = np.maximum(low - x, x - high)
    t = np.clip(1.0 - outside / width, 0.0, 1.0)
    sign = np.where(x > high, -1.0, 1.0) / width
    return t**3 * (t * (6.0 * t - 15.0) + 10.0), sign * 30.0 * t**2 * (1.0 - t) ** 2


@njit(cache=True, nogil=True)
def _evaluate(xy, coefficients, first, pixel, out):  # type: ignore[no-untyped-def]
    """Evaluate a bicubic spline and its gradient; zero outside its nodes."""
    ny, nx = coefficients.shape
    for i in range(len(xy)):
        u, v = (xy[i, 0] - first[0]) / pixel[0], (xy[i, 1] - first[1]) / pixel[1]
        if not (1.0 <= u < nx - 2 and 1.0 <= v < ny - 2):
            continue
        iu, iv = int(u), int(v)
        a, b = weights(u - iu), weights(v - iv)
        c, d = slopes(u - iu), slopes(v - iv)
        for row in range(4):
            for col in range(4):
                value = coefficients[iv - 1 + row, iu - 1 + col]
                out[i, 0] += b[row] * a[col] * value
                out[i, 1] += b[row] * c[col] * value / pixel[0]
                out[i, 2] += d[row] * a[col] * value / pixel[1]
