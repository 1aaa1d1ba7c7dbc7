"""A DEM keeps its own slopes, and has finer ones synthesised below its resolution."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine

from lpet_sim.datasets import DataError, data_path
from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.dem import read_dem
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.spec import DemSpec, ReliefSpec, TerrainSpec
from lpet_sim.terrain.terrain import Terrain, build_terrain
from tests.terrain.surfaces import exponent, grid_rms_difference, point_rms_difference

GALE = "mars_dem/mmgis_gale/missionDEM.tif"


@pytest.fixture(scope="module")
def gale() -> Terrain:
    """Give the preset ``gale``, or skip where its DEM is absent."""
    try:
        data_path(GALE)
    except DataError as error:
        pytest.skip(str(error))
    return build_terrain(load_terrain_spec("gale"), 1)


def write_dem(path: Path, z: Array, **options: object) -> None:
    """Write a one-band GeoTIFF with 2 m pixels."""
    profile = {"driver": "GTiff", "width": z.shape[1], "height": z.shape[0], "count": 1}
    profile |= {"dtype": "float32", "crs": "EPSG:32631", "transform": Affine(2, 0, 5e5, 0, -2, 1e6)}
    with rasterio.open(path, "w", **(profile | options)) as raster:
        raster.write(z.astype(np.float32), 1)


def smooth(path: Path, **dem: float) -> Terrain:
    """Build a DEM terrain without roughness."""
    relief = ReliefSpec(rms_slope_rad=0.0)
    return build_terrain(
        TerrainSpec(relief=relief, far=None, dem=DemSpec(path=str(path), **dem)), 1
    )


def test_gale_has_the_slopes_of_its_dem_at_8_to_64_m(gale: Terrain) -> None:
    """RMS slopes of the terrain at the DEM's own nodes equal the DEM's within 3 %."""
    elevation, _ = read_dem(GALE)
    box = gale.drivable
    assert box is not None
    x = np.linspace(box.x_min, box.x_max, elevation.shape[1])
    y = np.linspace(box.y_min, box.y_max, elevation.shape[0])
    xy = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    built = gale.height(xy).reshape(elevation.shape)
    steps = (8, 16, 32, 64)
    ratio = grid_rms_difference(built, steps) / grid_rms_difference(elevation, steps)
    assert ratio == pytest.approx(1.0, abs=0.03)


def test_gale_has_the_slope_and_exponent_asked_for_at_centimetres_to_metres(gale: Terrain) -> None:
    """Over lags of 0.1-4 m, slope at 1 m and exponent are within 10 % of the spec's."""
    relief = gale.spec.relief
    lag = np.array([0.1, 0.2, 0.5, 1.0, 2.0, 4.0])
    xy = stream(2, "test").uniform(-155.0, 155.0, (60_000, 2))
    rms = point_rms_difference(gale, xy, lag)
    assert exponent(lag, rms) == pytest.approx(relief.hurst, rel=0.1)
    assert math.atan(rms[3]) == pytest.approx(relief.rms_slope_rad, rel=0.1)


@pytest.mark.parametrize(("hurst", "slope_rad"), [(0.7, 0.05), (0.8, 0.14)])
def test_roughness_added_to_a_flat_dem_has_the_spectrum_asked_for(
    tmp_path: Path, hurst: float, slope_rad: float
) -> None:
    """Waves of 0.2-4 m have density ``A f^-(2H+2)``: exponent to 0.1 and level to 15 %."""
    write_dem(tmp_path / "flat.tif", np.zeros((40, 40)))
    relief = ReliefSpec(hurst=hurst, rms_slope_rad=slope_rad)
    dem = DemSpec(path=str(tmp_path / "flat.tif"))
    n, cell = 1024, 0.05
    rough = build_terrain(TerrainSpec(relief=relief, far=None, dem=dem), 3)
    free = build_terrain(TerrainSpec(relief=relief, far=None), 4)
    f, density = radial_spectrum(rough.patch(-512, -512, (n, n), cell), cell)
    _, wanted = radial_spectrum(free.patch(-512, -512, (n, n), cell), cell)
    assert -np.polyfit(np.log(f), np.log(density), 1)[0] == pytest.approx(2 * hurst + 2, abs=0.1)
    assert np.exp(np.mean(np.log(density / wanted))) == pytest.approx(1.0, abs=0.15)


def radial_spectrum(z: Array, cell: float) -> tuple[Array, Array]:
    """Give frequency and mean power of waves of 0.2-4 m, in rings of equal ratio."""
    window = np.hanning(len(z))
    power = np.abs(np.fft.fft2((z - z.mean()) * np.outer(window, window))) ** 2
    axis = np.fft.fftfreq(len(z), cell)
    radius = np.hypot(axis, axis[:, None])
    edges = np.geomspace(1 / 4.0, 1 / 0.2, 9)
    rings = [power[(radius >= a) & (radius < b)].mean() for a, b in pairwise(edges)]
    return np.sqrt(edges[1:] * edges[:-1]), np.array(rings)


def test_rows_run_south_and_columns_east(tmp_path: Path) -> None:
    """The DEM's centre is the world's origin, and each pixel's value stands at its place."""
    z = stream(5, "test").normal(100.0, 5.0, (21, 31))
    write_dem(tmp_path / "dem.tif", z)
    terrain = smooth(tmp_path / "dem.tif", datum_m=100.0)
    place = np.array([[0.0, 0.0], [2.0 * 10, 2.0 * 4], [-2.0 * 15, -2.0 * 10]])
    expected = np.array([z[10, 15], z[6, 25], z[20, 0]]) - 100.0
    assert terrain.height(place) == pytest.approx(expected, abs=1e-5)
    assert terrain.drivable is not None
    assert (terrain.drivable.x_min, terrain.drivable.y_max) == (-30.0, 20.0)


def test_origin_can_be_any_pixel(tmp_path: Path) -> None:
    """With the origin in the north-west pixel, the world's origin has that pixel's height."""
    z = stream(6, "test").normal(0.0, 1.0, (12, 16))
    write_dem(tmp_path / "dem.tif", z)
    terrain = smooth(tmp_path / "dem.tif", origin_column_px=0, origin_row_px=0, datum_m=0.0)
    assert terrain.height(np.zeros((1, 2)))[0] == pytest.approx(z[0, 0], abs=1e-6)


def test_dem_goes_over_into_relief_without_a_step(tmp_path: Path) -> None:
    """Heights along a line out of the DEM have no jump, and end at those of the edge's mean."""
    y, x = np.mgrid[:60, :60]
    write_dem(tmp_path / "tilt.tif", 0.05 * x + 0.02 * y)
    terrain = smooth(tmp_path / "tilt.tif")
    line = np.column_stack([np.arange(0.0, 400.0, 0.1), np.full(4000, 7.0)])
    z = terrain.height(line)
    assert np.abs(np.diff(z)).max() < 0.02
    assert z[-1] == pytest.approx(0.0, abs=1e-6)
    normal = terrain.normal(line)
    slope = np.gradient(z, 0.1)
    assert -normal[1:-1, 0] / normal[1:-1, 2] == pytest.approx(slope[1:-1], abs=2e-3)


def test_a_dem_is_found_beside_the_yaml_of_a_terrain_and_of_a_traverse(tmp_path: Path) -> None:
    """Whether the terrain has a file of its own or stands within another."""
    (tmp_path / "site.tif").touch()
    (tmp_path / "terrain.yaml").write_text("dem: {path: site.tif}\n")
    inline = "terrain: {dem: {path: site.tif}}\ndrive: {waypoints_m: [[0, 0], [1, 0]]}\n"
    (tmp_path / "traverse.yaml").write_text(inline)
    own = load_terrain_spec(tmp_path / "terrain.yaml")
    within = TraverseSpec.from_yaml(tmp_path / "traverse.yaml").terrain
    for spec in (own, within):
        assert spec.dem is not None and spec.dem.path == str(tmp_path / "site.tif")


def test_a_missing_dem_is_named() -> None:
    """A DEM that is nowhere is a data error with its path."""
    spec = TerrainSpec(dem=DemSpec(path="no/such/dem.tif"))
    with pytest.raises(DataError, match="LPET_DATA"):
        build_terrain(spec, 1)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"nodata": 7.0}, "has 1 voids"),
        ({"crs": "EPSG:4326"}, "is in degrees"),
    ],
)
def test_an_unfit_dem_is_refused(tmp_path: Path, options: dict[str, object], sentence: str) -> None:
    """Voids and a grid in degrees are refused with one sentence."""
    z = np.zeros((10, 10))
    z[3, 4] = 7.0
    write_dem(tmp_path / "dem.tif", z, **options)
    with pytest.raises(SpecError, match=sentence):
        smooth(tmp_path / "dem.tif")


def test_a_file_that_is_no_raster_is_refused(tmp_path: Path) -> None:
    """A text file in place of a DEM gives one clear sentence."""
    (tmp_path / "dem.tif").write_text("not a raster")
    with pytest.raises(SpecError, match="no raster"):
        smooth(tmp_path / "dem.tif")
