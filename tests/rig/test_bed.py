"""The tilt bed: a plane of one soil, tilted in any direction, that the rover's scene can use."""

import math

import numpy as np
import pytest

from lpet_sim.rig.bed import TiltBed
from lpet_sim.rover.ground import CELL_M, cut_patch
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.spec import TerrainSpec

XY = np.random.default_rng(0).uniform(-50, 50, (200, 2))


@pytest.mark.parametrize("azimuth_deg", [0.0, 37.0, 90.0, 200.0])
@pytest.mark.parametrize("slope_deg", [0.0, 12.0, 30.0])
def test_a_bed_is_the_plane_of_its_normal(slope_deg: float, azimuth_deg: float) -> None:
    """Every point is at right angles to the normal, and the normal is tilted by the slope."""
    bed = TiltBed(TerrainSpec(), math.radians(slope_deg), math.radians(azimuth_deg))
    points = np.column_stack([XY, bed.height(XY)])
    np.testing.assert_allclose(points @ bed.normal_world, 0.0, atol=1e-12)
    assert math.degrees(math.acos(bed.normal_world[2])) == pytest.approx(slope_deg)
    assert np.linalg.norm(bed.normal_world) == pytest.approx(1.0)


def test_a_bed_rises_towards_its_azimuth() -> None:
    """A step along the uphill vector rises by the sine of the slope and stays on the plane."""
    bed = TiltBed(TerrainSpec(), math.radians(20), math.radians(60))
    step = bed.uphill_world
    assert step[2] == pytest.approx(math.sin(math.radians(20)))
    assert math.degrees(math.atan2(step[1], step[0])) == pytest.approx(60)
    assert bed.height(step[None, :2])[0] == pytest.approx(step[2])


def test_the_patch_under_a_rover_is_the_plane_to_a_micrometre() -> None:
    """Nodes of the patch that the physics takes against the plane, far from the origin."""
    bed = TiltBed(TerrainSpec(), math.radians(25), math.radians(110))
    patch = cut_patch(bed, np.array([31.0, -17.0]), 8.0)
    index = (len(patch.data) - 1) // 2
    offset = CELL_M * np.arange(-index, index + 1)
    x, y = np.meshgrid(patch.centre_xy[0] + offset, patch.centre_xy[1] + offset)
    plane = bed.height(np.stack([x.ravel(), y.ravel()], axis=1)).reshape(x.shape)
    np.testing.assert_allclose(patch.height_m, plane, atol=1e-6)


def test_a_bed_has_one_soil_no_rocks_and_no_edge() -> None:
    """What else a scene asks of its ground."""
    bed = TiltBed(TerrainSpec(), math.radians(5))
    assert (bed.soil(XY) == 0).all()
    assert len(bed.rocks(Box.around(0, 0, 10)).id) == 0
    assert bed.drivable is None
