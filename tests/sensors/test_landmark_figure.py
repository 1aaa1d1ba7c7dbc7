"""The picture of a traverse's landmarks is drawn, with and without far ones and a picture."""

from pathlib import Path

import numpy as np
import pytest

from lpet_sim.errors import OutputError
from lpet_sim.sensors.landmark_figure import landmark_map
from lpet_sim.sensors.landmark_sensor import show_landmarks
from lpet_sim.sensors.landmark_spec import LandmarkFieldSpec, LandmarkSensorSpec
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.terrain import build_terrain
from tests.sensors.landmark_worlds import CAMERA, straight_drive


def test_the_landmarks_of_a_traverse_are_drawn(tmp_path: Path) -> None:
    """A picture of some size; an ending that is none is refused."""
    terrain = build_terrain(load_terrain_spec("exomars"), 1)
    drive = straight_drive(0.3, terrain)
    for far_per_rad, picture in ((12.0, None), (0.0, np.zeros((1024, 1024)))):
        field = LandmarkFieldSpec(far_per_rad=far_per_rad)
        spec = LandmarkSensorSpec(period_s=1.0, field=field)
        shown = show_landmarks(drive, terrain, CAMERA, spec, 1)
        path = tmp_path / f"{far_per_rad:g}.png"
        landmark_map(shown, drive, terrain, CAMERA, path, 1, picture)
        assert path.stat().st_size > 50_000
    with pytest.raises(OutputError, match="png"):
        landmark_map(shown, drive, terrain, CAMERA, tmp_path / "map.txt")
