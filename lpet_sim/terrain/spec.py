"""What a terrain is made of: relief, craters, rocks, soils, sun, albedo, far hills, a DEM.

Numbers marked [recalled] are from the literature without the page at hand: sensible defaults, not
figures to hold a result against.
"""

from __future__ import annotations

import math
from functools import partial
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from lpet_sim.soil.load import NamedSoil, load_soil
from lpet_sim.soil.spec import FirmSoilSpec
from lpet_sim.spec import Spec
from lpet_sim.terrain.rock_spec import (
    Fraction,
    Positive,
    RockAbundanceSpec,
    RockSizeClass,
    RockSpec,
    RockTableSpec,
    check_order,
)

__all__ = [
    "AlbedoSpec",
    "CraterSpec",
    "DemSpec",
    "FarReliefSpec",
    "ReliefSpec",
    "RockAbundanceSpec",
    "RockSizeClass",
    "RockSpec",
    "RockTableSpec",
    "SoilClass",
    "SunSpec",
    "TerrainSpec",
]

Hurst = Annotated[float, Field(gt=0.0, lt=1.0)]
DEFAULT_SOIL: Final = "mars_regolith"


class ReliefSpec(Spec):
    """Self-affine relief: the RMS height difference over a lag r goes as ``tan(slope) r^H``.

    Attributes:
        hurst: Exponent H; 0.7-0.9 on Mars, 0.88 measured on the Gale HiRISE DTM.
        rms_slope_rad: Arc tangent of the RMS height difference over 1 m [rad]; 3-8 deg on Mars,
            6.5 deg measured on the Gale DTM.
        outer_scale_m: Wavelength at which the law ends, so that heights stay bounded [m]. A
            choice.
        inner_scale_m: Shortest wavelength synthesised [m]; finer grain is albedo. A choice.
    """

    hurst: Hurst = 0.8
    rms_slope_rad: Annotated[float, Field(ge=0.0, lt=0.7)] = math.radians(5.0)
    outer_scale_m: Annotated[float, Field(ge=50.0, le=5000.0)] = 500.0
    inner_scale_m: Annotated[float, Field(ge=0.02, le=1.0)] = 0.08


class CraterSpec(Spec):
    """Simple craters, fresh to degraded, with ``N(>D) = density D^-exponent`` per m^2.

    Attributes:
        density_1m_per_m2: Craters of at least 1 m per m^2; about 0.08 where the surface is in
            equilibrium [recalled, Trask 1966].
        exponent: Of the cumulative size distribution; 2 in equilibrium, near 3 in production
            [recalled].
        diameter_min_m: Smallest rim diameter [m].
        diameter_max_m: Largest rim diameter [m].
        depth_ratio_fresh: Depth over diameter of a fresh crater; 0.2 for primaries, 0.1 for the
            secondaries that are most of the small ones [recalled, Pike 1977].
        freshness_min: Depth of the most degraded crater as a fraction of a fresh one's.
    """

    density_1m_per_m2: Annotated[float, Field(ge=0.0, le=0.1)] = 0.004
    exponent: Annotated[float, Field(ge=1.0, le=4.0)] = 2.0
    diameter_min_m: Annotated[float, Field(ge=0.2)] = 0.8
    diameter_max_m: Annotated[float, Field(le=1000.0)] = 50.0
    depth_ratio_fresh: Annotated[float, Field(gt=0.0, le=0.3)] = 0.12
    freshness_min: Annotated[float, Field(gt=0.0, le=1.0)] = 0.15

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        check_order(self.diameter_min_m, self.diameter_max_m)
        return self


class SoilClass(Spec):
    """One kind of ground.

    Attributes:
        name: What it is called.
        area_fraction: Share of the ground; the shares of a terrain sum to 1.
        soil: What it is to a wheel; in a file also the name of a soil of the library, or the path
            of a soil's YAML file.
        tone: Albedo relative to the terrain's mean.
    """

    name: Annotated[str, Field(min_length=1)]
    area_fraction: Fraction = 1.0
    soil: NamedSoil = Field(default_factory=partial(load_soil, DEFAULT_SOIL))
    tone: Annotated[float, Field(gt=0.0, le=3.0)] = 1.0

    @property
    def firm(self) -> bool:
        """Whether it is bedrock or hard crust, not loose soil into which wheels sink."""
        return isinstance(self.soil, FirmSoilSpec)


class SunSpec(Spec):
    """Where the sun stands; it does not move during a traverse.

    Attributes:
        azimuth_rad: Direction to the sun in the plane, from x (east) towards y (north) [rad].
        elevation_rad: Height above the horizon [rad].
    """

    azimuth_rad: float = math.radians(120.0)
    elevation_rad: Annotated[float, Field(gt=0.0, le=math.pi / 2)] = math.radians(40.0)

    @property
    def direction(self) -> tuple[float, float, float]:
        """Unit vector towards the sun in the world, (x, y, z)."""
        flat = math.cos(self.elevation_rad)
        east, north = math.cos(self.azimuth_rad), math.sin(self.azimuth_rad)
        return flat * east, flat * north, math.sin(self.elevation_rad)


class AlbedoSpec(Spec):
    """How bright the ground is, down to the scale that SIFT sees.

    Attributes:
        mean: Mean albedo; bright Martian dust 0.25-0.3, dark sand 0.1-0.15 [recalled].
        tone_contrast: RMS of the smooth tone over its mean. A choice.
        tone_scale_m: Longest wavelength of the tone (dust patches) [m]. A choice.
        grain_scale_m: Shortest wavelength of the tone [m]. A choice.
        pebble_cover: Fraction of the ground under pebbles of each octave of size. A choice.
        pebble_min_m: Smallest pebble [m].
        pebble_max_m: Largest pebble [m]; larger ones are rocks.
        pebble_contrast: RMS of a pebble's own tone over the mean. A choice.
    """

    mean: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.25
    tone_contrast: Annotated[float, Field(ge=0.0, le=0.5)] = 0.12
    tone_scale_m: Positive = 20.0
    grain_scale_m: Annotated[float, Field(ge=0.002)] = 0.008
    pebble_cover: Annotated[float, Field(ge=0.0, le=0.2)] = 0.04
    pebble_min_m: Annotated[float, Field(ge=0.002)] = 0.008
    pebble_max_m: Annotated[float, Field(le=0.2)] = 0.064
    pebble_contrast: Annotated[float, Field(ge=0.0, le=0.5)] = 0.2

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        check_order(self.pebble_min_m, self.pebble_max_m)
        check_order(self.grain_scale_m, self.tone_scale_m)
        return self


class FarReliefSpec(Spec):
    """Hills and mesas up to the skyline, none of which reaches into the clear circle.

    Attributes:
        clear_radius_m: Radius around the world's origin that no hill's foot enters [m].
        reach_m: Distance of the farthest hill's centre from the origin [m].
        hills_per_km2: How many there are. A choice.
        height_min_m: Lowest hill [m]; the Twin Peaks at Pathfinder are 30-35 m high [recalled].
        height_max_m: Highest hill [m].
        mesa_fraction: Share of hills with a flat top.
    """

    clear_radius_m: Annotated[float, Field(ge=100.0)] = 400.0
    reach_m: Annotated[float, Field(le=30000.0)] = 6000.0
    hills_per_km2: Annotated[float, Field(ge=0.0, le=10.0)] = 0.8
    height_min_m: Positive = 15.0
    height_max_m: Positive = 120.0
    mesa_fraction: Fraction = 0.35

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        check_order(self.height_min_m, self.height_max_m)
        check_order(self.clear_radius_m, self.reach_m)
        return self


class DemSpec(Spec):
    """A digital elevation model (GeoTIFF) in place of the coarse part of the relief.

    Column grows to the east (x), row to the south (-y). The relief's spectrum fills in what the
    DEM does not resolve, and takes over beyond its edge.

    Attributes:
        path: The file; a relative one is looked for beside the YAML, then in the data folder.
        origin_column_px: Column (from the centre of pixel 0) of the world's origin; None: centre.
        origin_row_px: Row of the world's origin; None: the DEM's centre.
        datum_m: Elevation that becomes z = 0 [m]; None: the DEM's mean.
        resolved_m: Shortest wavelength that the DEM resolves [m]; see the preset ``gale``.
        blend_m: Width of the belt beyond the edge in which the DEM fades out [m].
    """

    path: str
    origin_column_px: float | None = None
    origin_row_px: float | None = None
    datum_m: float | None = None
    resolved_m: Annotated[float, Field(gt=0.2)] = 6.0
    blend_m: Annotated[float, Field(ge=5.0)] = 150.0


class TerrainSpec(Spec):
    """Everything that a terrain is built from, but for the seed.

    Attributes:
        name: What the terrain is called.
        relief: Self-affine relief; with a DEM, its spectrum below the DEM's resolution.
        craters: Craters; None: none.
        rocks: Rocks by abundance or by table; None: none.
        soils: Kinds of ground; `Terrain.soil` gives indices into them.
        soil_patch_m: Typical size of a patch of one soil [m]. A choice.
        sun: Where the sun stands.
        albedo: How bright the ground is.
        far: Hills up to the skyline; None: none.
        dem: A digital elevation model; None: relief is all synthesised.
    """

    name: str = "terrain"
    relief: ReliefSpec = ReliefSpec()
    craters: CraterSpec | None = None
    rocks: RockSpec | None = None
    soils: Annotated[tuple[SoilClass, ...], Field(min_length=1)] = (SoilClass(name="soil"),)
    soil_patch_m: Annotated[float, Field(ge=0.5, le=500.0)] = 8.0
    sun: SunSpec = SunSpec()
    albedo: AlbedoSpec = AlbedoSpec()
    far: FarReliefSpec | None = FarReliefSpec()
    dem: DemSpec | None = None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        total = sum(soil.area_fraction for soil in self.soils)
        if abs(total - 1.0) > 1e-6:
            raise ValueError(f"the area_fraction of the soils must sum to 1, not {total:g}")
        if len({soil.name for soil in self.soils}) < len(self.soils):
            raise ValueError("the soils must have different names")
        return self
