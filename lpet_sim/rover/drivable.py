"""Whether a rover has ground under all its wheels."""

from __future__ import annotations

import numpy as np

from lpet_sim.errors import PlanningError
from lpet_sim.recording.arrays import Array
from lpet_sim.rover.frames import RoverFrames
from lpet_sim.rover.ground import Ground

_LEAST_REACH_M, _SPARE_M = 1.25, 0.15


def reach_of(frames: RoverFrames) -> float:
    """Give how far the wheels reach from the body's origin, with room to spare [m]."""
    far = float(np.hypot(*frames.wheel_position_body_m[:, :2].T).max())
    return max(_LEAST_REACH_M, far + frames.wheel_radius_m + _SPARE_M)


def check_drivable(ground: Ground, xy: Array, reach_m: float) -> None:
    """Hold points to lie on drivable ground, with the rover's reach to spare.

    Args:
        ground: The terrain.
        xy: The points [m], Shape (n, 2).
        reach_m: See `reach_of`.

    Raises:
        PlanningError: A point lies outside.
    """
    box = ground.drivable
    if box is None:
        return
    low = np.array([box.x_min, box.y_min]) + reach_m
    high = np.array([box.x_max, box.y_max]) - reach_m
    outside = np.any((xy < low) | (xy > high), axis=1)
    if outside.any():
        x, y = xy[outside][0]
        raise PlanningError(
            f"({x:.1f}, {y:.1f}) m lies outside the drivable ground: x from {low[0]:.1f} to "
            f"{high[0]:.1f}, y from {low[1]:.1f} to {high[1]:.1f} m"
        )
