"""What a rover's steering can do, and how: every wheel steered, some, or none.

Wheels that steer roll along their own circle about the common centre (`kinematics`). Those that do
not turn at the speed of their own forward motion: beside steered ones they stand on one axle that
passes under the body's origin, and roll too. Where no wheel steers all skid: the yaw rate is less
than that of wheels that roll, by the share ``sum y_i^2 / sum (x_i^2 + y_i^2)`` if creep along and
across is alike, which is also what the least squares of wheel odometry reads. On an arc their
speeds are set apart by that much more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from lpet_sim.errors import PlanningError
from lpet_sim.recording.arrays import Array
from lpet_sim.rover.frames import RoverFrames
from lpet_sim.rover.kinematics import (
    max_curvature,
    steering_of_arc,
    steering_of_point_turn,
    wheel_motion,
)
from lpet_sim.rover.path import Leg

_ROUNDING = 1e-6
_SLOW_STEER_PER_CURVATURE_M = 1.0


class Steering:
    """The steering of a rover.

    Attributes:
        steered: Which wheels steer, Shape (w,).
        max_curvature: Largest curvature of the body's origin [1/m]; a rover that skids keeps its
            inner wheels from turning back.
    """

    def __init__(self, frames: RoverFrames) -> None:
        """Take the wheels' places and limits."""
        self._xy = frames.wheel_position_body_m[:, :2]
        self._names, self._limit_rad = frames.wheel_names, frames.steer_limit_rad
        self.steered = self._limit_rad > 0
        squares = np.square(self._xy).sum(axis=0)
        self._yaw_share = float(squares[1] / squares.sum()) if self.skids else 1.0
        if self.skids:
            self.max_curvature = self._yaw_share / float(np.abs(self._xy[:, 1]).max())
        else:
            limit = float(self._limit_rad[self.steered].min())
            self.max_curvature = max_curvature(self._xy[self.steered], limit)

    @property
    def skids(self) -> bool:
        """Whether no wheel steers, so that it turns by driving its sides apart."""
        return not bool(self.steered.any())

    @property
    def angle_per_curvature_m(self) -> float:
        """About how far the fastest wheel steers for each 1/m of curvature [rad m]."""
        return max(_SLOW_STEER_PER_CURVATURE_M, float(np.abs(self._xy[:, 0]).max()))

    @property
    def lever_m(self) -> float:
        """Farthest wheel from the body's origin [m]."""
        return float(np.hypot(*self._xy.T).max())

    def arc(self, curvature: float) -> Array:
        """Give the steering angles of an arc of the body's origin [rad], Shape (w,)."""
        return np.where(self.steered, steering_of_arc(self._xy, curvature), 0.0)

    def point_turn(self) -> Array:
        """Give the steering angles of a turn about the body's origin [rad], Shape (w,)."""
        return np.where(self.steered, steering_of_point_turn(self._xy), 0.0)

    def speeds(self, speed_mps: float, yaw_rate_radps: float) -> Array:
        """Give the ground speeds of the wheels for a motion of the body [m/s], Shape (w,).

        A rover that skids is asked for no more speed in a turn on the spot than one that rolls,
        and turns more slowly.
        """
        share = self._yaw_share if speed_mps else 1.0
        ahead = speed_mps - yaw_rate_radps / share * self._xy[:, 1]
        rolling = wheel_motion(self._xy, speed_mps, yaw_rate_radps)[1]
        return np.where(self.steered, rolling, ahead)

    def why_no_point_turn(self) -> str | None:
        """Say what keeps it from turning on the spot; None where nothing does."""
        over = np.abs(self.point_turn()) - self._limit_rad
        worst = int(over.argmax())
        if over[worst] <= _ROUNDING or self.skids:
            return None
        needs, can = np.degrees([abs(self.point_turn()[worst]), self._limit_rad[worst]])
        return (
            f"wheel {self._names[worst]} would have to steer by {needs:.0f} deg and steers by "
            f"{can:.0f} deg"
        )

    def check(self, legs: Sequence[Leg]) -> None:
        """Hold a path to what the steering can do.

        Raises:
            PlanningError: It turns on the spot, or too sharply.
        """
        why = self.why_no_point_turn()
        if len(legs) > 1 and why is not None:
            x, y = legs[1].xy[0]
            raise PlanningError(
                f"this rover cannot turn on the spot, as the path does at ({x:.1f}, {y:.1f}) m: "
                f"{why}; round the corner with more waypoints, or a larger corner_cut_m"
            )
        sharpest = max(float(np.abs(leg.curvature).max()) for leg in legs)
        if sharpest > self.max_curvature + _ROUNDING:
            least = math.ceil(100.0 / self.max_curvature) / 100.0
            raise PlanningError(
                f"the path has an arc of {1 / sharpest:.2f} m and this rover's tightest is "
                f"{least:.2f} m: give min_turn_radius_m of at least that"
            )
