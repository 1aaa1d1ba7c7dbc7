"""What the decoupled forms of the SLAM filter forget, and what they keep."""

from __future__ import annotations

import numpy as np
import pytest

from estimators.slam_map import POSE, VEHICLE
from tests.estimators.slam_worlds import on_its_way


@pytest.mark.parametrize("keep_pose", [False, True])
def test_a_decoupled_filter_keeps_the_vehicle_whole(keep_pose: bool) -> None:
    """Pose and odometry's lasting errors stay correlated, and each landmark within itself."""
    state = on_its_way("standard")
    before = state.P.copy()
    state.decouple(keep_pose)
    kept = np.zeros(before.shape, dtype=bool)
    kept[:VEHICLE, :VEHICLE] = True
    for row in range(VEHICLE, len(before), 3):
        kept[row : row + 3, row : row + 3] = True
    if keep_pose:
        kept[:VEHICLE] = kept[:, :VEHICLE] = True
    assert np.abs(before[:POSE, POSE:VEHICLE]).max() > 0
    np.testing.assert_array_equal(state.P, np.where(kept, before, 0.0))
