"""Path following: from the planned legs and the rover's pose to steering angles and wheel rates.

The follower is a program written as generators: each takes the pose at a control tick and yields
the command for it. Feedback makes the cross-track error e decay as a critically damped spring over
the distance s: ``e'' = -e/L^2 - 2 e'/L`` with ``e' = sin(heading error)`` and ``e'' = k - k_path``.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.rover.frames import RoverFrames
from lpet_sim.rover.path import Leg, plan_legs, wrap_angle
from lpet_sim.rover.spec import DriveSpec, RoverSpec, Stop
from lpet_sim.rover.steering import Steering

FEEDBACK_LENGTH_M = 0.5
_WINDOW_M = 0.5  # how far ahead the nearest point of the path is looked for
_ALIGNED_RAD = math.radians(0.5)
_SKIP_TURN_RAD = math.radians(2.0)
_ARRIVED_M = 0.002
_CREEP = 0.05  # slowest approach to a halt, as a fraction of the speed


@dataclass(frozen=True)
class PlanarPose:
    """Where the rover is in the plane.

    Attributes:
        x_m: World x.
        y_m: World y.
        yaw_rad: Heading.
    """

    x_m: float
    y_m: float
    yaw_rad: float


@dataclass(frozen=True)
class Command:
    """What the wheels are told.

    Attributes:
        steer_rad: Steering angles [rad], Shape (w,).
        rate_radps: Turning rates [rad/s], Shape (w,).
        speed_mps: Forward speed that is asked of the body.
        yaw_rate_radps: Yaw rate that is asked of the body.
    """

    steer_rad: Array
    rate_radps: Array
    speed_mps: float = 0.0
    yaw_rate_radps: float = 0.0


@dataclass(frozen=True)
class Notice:
    """Something the follower did: its kind, how long it will last [s], and a sentence."""

    kind: str
    duration_s: float
    text: str


Program = Generator[Command, PlanarPose, None]


class Follower:
    """Follows legs from start to goal.

    Attributes:
        legs: The planned path.
        finished: Whether the goal is reached and the rover stands.
        cross_track_m: Signed distance from the path, left positive [m].
        progress_m: Distance along the whole path [m].
    """

    def __init__(self, drive: DriveSpec, rover: RoverSpec, frames: RoverFrames) -> None:
        """Plan the legs and stand at the start.

        Raises:
            PlanningError: The rover's steering cannot do what the path asks.
        """
        self.legs = plan_legs(drive.waypoints_m, drive.min_turn_radius_m, drive.corner_cut_m)
        self.finished = False
        self.cross_track_m = 0.0
        self.progress_m = 0.0
        self._drive = drive
        self._steering = Steering(frames)
        self._steering.check(self.legs)
        self._radius_m = frames.wheel_radius_m
        self._dt_s = 1.0 / drive.control_rate_hz
        self._steer_step_rad = rover.steer_rate_radps * self._dt_s
        self._steer_rad = np.zeros(len(frames.wheel_names))
        self._speed_mps = 0.0
        self._curvature = 0.0
        self._stops = list(drive.stops)
        self._notices: list[Notice] = []
        self._pose = PlanarPose(0.0, 0.0, 0.0)
        self._program = self._run()
        next(self._program)

    @property
    def length_m(self) -> float:
        """Length of the whole path [m]."""
        return self.legs[-1].start_m + self.legs[-1].length_m

    @property
    def nominal_s(self) -> float:
        """Rough duration without slip: driving, turning and standing [s]."""
        turns = math.pi * self._steering.lever_m / self._drive.speed_mps * len(self.legs)
        standing = sum(stop.duration_s for stop in self._drive.stops)
        return self.length_m / self._drive.speed_mps + turns + standing + 60.0

    def command(self, pose: PlanarPose) -> Command:
        """Give the command for the pose at this tick."""
        self._pose = pose
        try:
            return self._program.send(pose)
        except StopIteration:
            self.finished = True
            return self._stand()

    def take_notices(self) -> list[Notice]:
        """Give what happened since the last call."""
        notices, self._notices = self._notices, []
        return notices

    def _run(self) -> Program:
        self._pose = yield self._stand()
        for leg in self.legs:
            yield from self._turn_to(float(leg.heading_rad[0]))
            yield from self._steer_to(self._steering.arc(float(leg.curvature[0])))
            yield from self._follow(leg)

    def _stand(self) -> Command:
        return Command(self._steer_rad, np.zeros(len(self._steer_rad)))

    def _steer_to(self, target_rad: Array) -> Program:
        """Turn the wheels at standstill."""
        while np.any(self._steer_rad != target_rad):
            left = target_rad - self._steer_rad
            step = np.clip(left, -self._steer_step_rad, self._steer_step_rad)
            self._steer_rad = np.where(step == left, target_rad, self._steer_rad + step)
            yield self._stand()

    def _turn_to(self, heading_rad: float) -> Program:
        """Turn on the spot until the body faces the heading."""
        angle = wrap_angle(heading_rad - self._pose.yaw_rad)
        if abs(angle) < _SKIP_TURN_RAD or self._steering.why_no_point_turn() is not None:
            return
        yield from self._steer_to(self._steering.point_turn())
        lever = self._steering.lever_m
        top = self._drive.speed_mps / lever
        text = f"turns {math.degrees(angle):.0f} deg on the spot"
        self._notices.append(Notice("point_turn", abs(angle) / top, text))
        rate = 0.0
        while abs(left := wrap_angle(heading_rad - self._pose.yaw_rad)) > _ALIGNED_RAD:
            rate = math.copysign(self._ramp(abs(rate) * lever, abs(left) * lever) / lever, left)
            speeds = self._steering.speeds(0.0, rate)
            yield Command(self._steer_rad, speeds / self._radius_m, 0.0, rate)
        yield self._stand()

    def _follow(self, leg: Leg) -> Program:
        """Drive along a leg, with its stops, to its end."""
        self._speed_mps, self._curvature = 0.0, float(leg.curvature[0])
        index = 0
        while True:
            index = self._locate(leg, index)
            halt = self._next_halt(leg)
            to_halt = halt - self.progress_m
            if to_halt <= _ARRIVED_M:
                yield from self._halt(halt)
                if halt >= leg.start_m + leg.length_m:
                    return
                continue
            self._speed_mps = self._ramp(self._speed_mps, to_halt)
            self._set_curvature(leg, index)
            yield self._arc_command()

    def _locate(self, leg: Leg, index: int) -> int:
        """Find the nearest point of the leg ahead, and the error from it."""
        ahead = slice(index, index + int(_WINDOW_M / max(leg.s_m[1], 1e-9)) + 2)
        offset = np.array([self._pose.x_m, self._pose.y_m]) - leg.xy[ahead]
        index += int(np.argmin(np.einsum("ij,ij->i", offset, offset)))
        dx, dy = self._pose.x_m - leg.xy[index, 0], self._pose.y_m - leg.xy[index, 1]
        c, s = math.cos(leg.heading_rad[index]), math.sin(leg.heading_rad[index])
        self.cross_track_m = float(c * dy - s * dx)
        self.progress_m = float(leg.start_m + leg.s_m[index] + c * dx + s * dy)
        return index

    def _next_halt(self, leg: Leg) -> float:
        end = leg.start_m + leg.length_m
        return min(self._stops[0].at_m, end) if self._stops else end

    def _halt(self, at_m: float) -> Program:
        """Stand still: at a stop for its duration, at a leg's end for one tick."""
        self._speed_mps = 0.0
        yield self._stand()
        if self._stops and self._stops[0].at_m <= at_m:
            stop: Stop = self._stops.pop(0)
            text = f"stands for {stop.duration_s:g} s at {stop.at_m:g} m"
            self._notices.append(Notice("stop", stop.duration_s, text))
            for _ in range(round(stop.duration_s / self._dt_s)):
                yield self._stand()

    def _ramp(self, speed: float, to_halt: float) -> float:
        """Give the next speed towards a halt that lies a distance ahead [m/s]."""
        a, top = self._drive.acceleration_mps2, self._drive.speed_mps
        target = max(min(top, math.sqrt(2 * a * max(to_halt, 0.0))), _CREEP * top)
        return min(target, speed + a * self._dt_s)

    def _set_curvature(self, leg: Leg, index: int) -> None:
        """Steer by the path's curvature and the error, no faster than the wheels can turn."""
        error = wrap_angle(self._pose.yaw_rad - float(leg.heading_rad[index]))
        length = FEEDBACK_LENGTH_M
        back = -self.cross_track_m / length**2 - 2 * math.sin(error) / length
        wanted = float(leg.curvature[index]) + back
        most = self._steering.max_curvature
        wanted = min(max(wanted, -most), most)
        fastest = self._steer_step_rad / self._steering.angle_per_curvature_m
        self._curvature += min(max(wanted - self._curvature, -fastest), fastest)

    def _arc_command(self) -> Command:
        yaw_rate = self._speed_mps * self._curvature
        self._steer_rad = self._steering.arc(self._curvature)
        speeds = self._steering.speeds(self._speed_mps, yaw_rate)
        return Command(self._steer_rad, speeds / self._radius_m, self._speed_mps, yaw_rate)
