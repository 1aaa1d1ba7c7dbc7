"""The rover as its control sees it: where it is, and what it was commanded to do until then."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lpet_sim.recording.arrays import Array
from lpet_sim.rover.follower import Command, PlanarPose
from lpet_sim.rover.scene import Scene

TURN_LEVER_M = 0.8
"""Makes a distance of a turn on the spot: about a wheel's lever."""


@dataclass(frozen=True)
class Tick:
    """The rover at one tick of the control. Sums are over the time commanded to move.

    Attributes:
        t_s: Time since the start.
        pose: Where it is.
        up: Cosine of the body's tilt.
        sinkage_m: Depth of each wheel in the soil, Shape (6,).
        place: How far along the path it is, in words.
        moving_s: Time for which it was commanded to move, forced slips left out.
        asked_m: Distance that it was commanded to move in that time, turns included.
        asked_ahead_m: Distance that it was commanded to drive forwards.
        ahead_m: Distance that it made good along its heading, signed.
        belly_ns: Integral of the belly's load [N s].
    """

    t_s: float
    pose: PlanarPose
    up: float
    sinkage_m: Array
    place: str
    moving_s: float = 0.0
    asked_m: float = 0.0
    asked_ahead_m: float = 0.0
    ahead_m: float = 0.0
    belly_ns: float = 0.0


class Observer:
    """Reads the scene at every tick and keeps the sums."""

    def __init__(self, dt_s: float) -> None:
        """Start with nothing commanded.

        Args:
            dt_s: Time from tick to tick [s].
        """
        self._dt_s = dt_s
        self._speed_mps = self._effort_mps = 0.0
        self._moving_s = self._asked_m = self._asked_ahead_m = 0.0
        self._ahead_m = self._belly_ns = 0.0
        self._pose = PlanarPose(0.0, 0.0, 0.0)

    def expect(self, command: Command | None) -> None:
        """Note what is asked of the body until the next tick; None for nothing."""
        speed, yaw_rate = (command.speed_mps, command.yaw_rate_radps) if command else (0.0, 0.0)
        self._speed_mps = speed
        self._effort_mps = abs(speed) + TURN_LEVER_M * abs(yaw_rate)

    def look(self, scene: Scene, t_s: float, place: str) -> Tick:
        """Read the scene, before its ground is cut anew.

        Args:
            scene: The scene.
            t_s: Time since the start [s].
            place: How far along the path it is, in words.
        """
        pose = PlanarPose(float(scene.xy[0]), float(scene.xy[1]), scene.yaw_rad)
        if self._effort_mps > 0:
            self._add(pose, scene.belly_load_n)
        self._pose = pose
        return Tick(
            t_s,
            pose,
            scene.up,
            scene.sinkage_m,
            place,
            self._moving_s,
            self._asked_m,
            self._asked_ahead_m,
            self._ahead_m,
            self._belly_ns,
        )

    def _add(self, pose: PlanarPose, belly_n: float) -> None:
        c, s = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        self._moving_s += self._dt_s
        self._asked_m += self._effort_mps * self._dt_s
        self._asked_ahead_m += self._speed_mps * self._dt_s
        self._ahead_m += c * (pose.x_m - self._pose.x_m) + s * (pose.y_m - self._pose.y_m)
        self._belly_ns += belly_n * self._dt_s
