from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread

from lpet_sim.errors import OutputError
from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.figures import draw_map, draw_relief
from lpet_sim.terrain.rock_spec import RockAbundanceSpec
from lpet_sim.terrain.spec import SoilClass, TerrainSpec
from lpet_sim.terrain.summary import describe_terrain
from lpet_sim.terrain.terrain import Terrain, build_terrain

SOILS = (SoilClass(name="sand", area_fraction=0.7), SoilClass(name="bedrock", area_fraction=0.3))


class Plane(Terrain):
    """A tilted plane in place of the ground, with the rocks of the spec."""

    def height(self, xy: Array, detail_m: float = 0.0) -> Array:
        """Rise by 0.1 to the east and 0.2 to the north."""
        return 0.1 * xy[:, 0] + 0.2 * xy[:, 1]


def rocky(k: float = 0.07) -> Terrain:
    """A terrain with rocks and two soils."""
    spec = TerrainSpec(name="rocky", rocks=RockAbundanceSpec(k=k), soils=SOILS, far=None)
    return build_terrain(spec, 0)


def test_the_summary_of_a_plane_is_its_closed_form() -> None:
    """Slope and relief of a plane; rocks against their expectation within 4 sigma."""
    spec = TerrainSpec(name="plane", rocks=RockAbundanceSpec(k=0.07), soils=SOILS, far=None)
    summary = describe_terrain(Plane(spec, 1), Box(0, 0, 50, 40))
    assert summary.relief_m == pytest.approx(0.1 * 50 + 0.2 * 40)
    # Both axes are pooled: 41 rows of 50 steps to the east, 51 columns of 40 steps to the north.
    mean_square = (41 * 50 * 0.1**2 + 51 * 40 * 0.2**2) / (41 * 50 + 51 * 40)
    assert summary.rms_slope_1m_rad == pytest.approx(math.atan(math.sqrt(mean_square)))
    assert summary.area_m2 == 2000.0
    assert sum(share for _, share in summary.soil_shares) == pytest.approx(1.0)
    assert [name for name, _ in summary.soil_shares] == ["sand", "bedrock"]
    for one in summary.rock_bins:
        assert abs(one.count - one.expected) < 4.0 * math.sqrt(one.expected) + 1.0
    assert summary.rock_cover == pytest.approx(summary.rock_cover_expected, rel=0.2)


def test_the_summary_of_bare_ground_has_no_rocks() -> None:
    """Without rocks the table of bins is empty and nothing is covered."""
    summary = describe_terrain(build_terrain(TerrainSpec(far=None), 0), Box(0, 0, 20, 20))
    assert summary.rock_bins == () and summary.rock_cover == summary.rock_cover_expected == 0.0


def test_a_large_box_counts_only_rocks_large_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where more rocks than the limit are expected, the bins start at a larger diameter."""
    monkeypatch.setattr("lpet_sim.terrain.summary._ROCKS_MAX", 2000)
    spec = TerrainSpec(rocks=RockAbundanceSpec(k=0.19), far=None)
    summary = describe_terrain(Plane(spec, 0), Box(0, 0, 40, 40))
    assert summary.rock_bins[0].diameter_min_m > 0.05
    assert sum(one.expected for one in summary.rock_bins) == pytest.approx(2000.0, rel=1e-3)
    assert sum(one.count for one in summary.rock_bins) == pytest.approx(2000.0, abs=180.0)


def test_the_map_shows_the_rocks(tmp_path: Path) -> None:
    """About the covered share of the map's pixels turns dark when rocks are there."""
    box, dark = Box(0, 0, 12, 12), []
    for name, rocks in (("bare", None), ("rocky", RockAbundanceSpec(k=0.19))):
        spec = TerrainSpec(rocks=rocks, far=None)
        draw_map(build_terrain(spec, 0), box, tmp_path / f"{name}.png")
        picture = imread(tmp_path / f"{name}.png")
        middle = picture[300:-300, 300:-400, :3]
        dark.append(float(np.mean(np.all(middle < 0.25, axis=-1))))
    assert 0.08 < dark[1] - dark[0] < 0.25


def test_the_relief_is_drawn_with_rocks_as_dots(tmp_path: Path) -> None:
    """The picture exists, has the ground's colours and dark dots."""
    draw_relief(rocky(), Box(-30, -30, 30, 30), tmp_path / "relief.png")
    picture = imread(tmp_path / "relief.png")[:, :, :3]
    assert np.mean(np.any(picture < 0.95, axis=-1)) > 0.25
    assert np.mean(np.all(picture[300:600, 500:900] < 0.25, axis=-1)) > 0.005


@pytest.mark.parametrize("name", ["no/such/folder/map.png", "map.nonsense"])
def test_a_picture_that_cannot_be_written_is_one_clear_sentence(tmp_path: Path, name: str) -> None:
    """A missing folder or an unknown ending is refused, and names what is valid."""
    with pytest.raises(OutputError, match=r"name a \.png, \.pdf or \.svg file"):
        draw_map(rocky(), Box(0, 0, 5, 5), tmp_path / name)
