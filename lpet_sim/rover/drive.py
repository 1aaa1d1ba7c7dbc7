"""Drive a rover along its waypoints, and give the truth of it in chunks."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lpet_sim.errors import PlanningError, SpecError
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.truth import Event, Truth
from lpet_sim.rover.follower import Command, Follower, PlanarPose
from lpet_sim.rover.scene import Scene, check_drivable
from lpet_sim.rover.spec import DriveSpec
from lpet_sim.rover.truth_log import TruthLog

_log = logging.getLogger(__name__)

_TIPPED_COSINE = math.cos(math.radians(45.0))
_STUCK_WINDOW_S = 120.0
_STUCK_SHARE = 0.1
_TURN_LEVER_M = 0.8  # makes a distance of a turn on the spot: about a wheel's lever
_START_TOLERANCE_M = 0.5


@dataclass(frozen=True)
class _Ticks:
    """Physics steps from one sample, control or chunk to the next."""

    body: int
    wheels: int
    control: int
    chunk: int


def start_of(spec: DriveSpec) -> tuple[tuple[float, float], float]:
    """Give where a drive starts [m] and which way its path leads from there [rad]."""
    (x, y), (ahead_x, ahead_y) = spec.waypoints_m[:2]
    return (x, y), math.atan2(ahead_y - y, ahead_x - x)


def drive(scene: Scene, spec: DriveSpec, chunk_s: float = 10.0) -> Iterator[Truth]:
    """Drive from the first waypoint to the last.

    The rover settles first; time 0 is after that. Every time is a whole number of physics steps.
    A drive ends with an event: ``goal``, ``tipped``, ``stuck`` or ``time_limit``.

    Args:
        scene: A rover that stands at the first waypoint, from `build_scene`.
        spec: The drive.
        chunk_s: Length of the chunks [s].

    Yields:
        The truth, piece by piece: each piece continues the last, and the first begins at time 0.

    Raises:
        SpecError: A rate does not divide the physics rate.
        PlanningError: The path leaves the drivable ground, or the rover is not at its start.
    """
    ticks = _ticks(spec, scene.spec.physics_dt_s, chunk_s)
    follower = Follower(spec, scene.spec, scene.frames)
    _check_path(scene, spec, follower)
    return _Drive(scene, spec, follower, ticks).chunks()


def _ticks(spec: DriveSpec, dt_s: float, chunk_s: float) -> _Ticks:
    return _Ticks(
        body=_steps_per(spec.imu_rate_hz, dt_s, "imu_rate_hz"),
        wheels=_steps_per(spec.wheel_rate_hz, dt_s, "wheel_rate_hz"),
        control=_steps_per(spec.control_rate_hz, dt_s, "control_rate_hz"),
        chunk=max(1, round(chunk_s / dt_s)),
    )


def _steps_per(rate_hz: float, dt_s: float, name: str) -> int:
    physics_hz = 1.0 / dt_s
    steps = round(physics_hz / rate_hz)
    if steps < 1 or abs(steps * rate_hz - physics_hz) > 1e-6 * physics_hz:
        valid = ", ".join(f"{physics_hz / k:g}" for k in (1, 2, 4, 5, 10, 20))
        raise SpecError(f"{name} {rate_hz:g} must divide the physics rate: {valid}, ... Hz")
    return steps


def _check_path(scene: Scene, spec: DriveSpec, follower: Follower) -> None:
    away = math.dist(scene.xy, spec.waypoints_m[0])
    if away > _START_TOLERANCE_M:
        raise PlanningError(
            f"the rover stands {away:.1f} m from the first waypoint; build the scene at "
            f"{spec.waypoints_m[0]}, or within {_START_TOLERANCE_M} m"
        )
    check_drivable(scene.ground, np.concatenate([leg.xy for leg in follower.legs]))


class _Drive:
    """One drive on its way; `chunks` runs it."""

    def __init__(self, scene: Scene, spec: DriveSpec, follower: Follower, ticks: _Ticks) -> None:
        self._scene, self._spec, self._follower, self._ticks = scene, spec, follower, ticks
        self._log = TruthLog(scene.frames.wheel_radius_m)
        self._dt_ns = round(scene.spec.physics_dt_s * NS_PER_S)
        self._step = 0
        self._slips = list(spec.forced_slips)
        self._slip_end_s = -1.0
        self._limit_s = spec.time_limit_s or 3.0 * follower.nominal_s
        self._window = _Progress()

    @property
    def _t_s(self) -> float:
        return self._step * self._dt_ns / NS_PER_S

    def chunks(self) -> Iterator[Truth]:
        """Settle, then step until the drive ends."""
        self._settle()
        self._note("start", 0.0, f"sets out on {self._follower.length_m:.1f} m")
        self._sample()
        ended = False
        while not ended:
            if self._step % self._ticks.control == 0:
                ended = self._control()
            if not ended:
                self._scene.step()
                self._step += 1
                self._sample()
            if (ended or self._step % self._ticks.chunk == 0) and not self._log.empty:
                yield self._log.take()

    def _settle(self) -> None:
        self._scene.command(np.zeros(6), np.zeros(6))
        for _ in range(round(self._spec.settle_s / self._scene.spec.physics_dt_s)):
            self._scene.step()

    def _sample(self) -> None:
        t_ns = self._step * self._dt_ns
        if self._step % self._ticks.body == 0:
            self._log.add_body(t_ns, self._scene.body_row())
        if self._step % self._ticks.wheels == 0:
            self._log.add_wheels(t_ns, self._scene.wheel_row())

    def _control(self) -> bool:
        """Give the next command; tell whether the drive has ended."""
        scene = self._scene
        scene.follow()
        scene.refresh_soil()
        pose = PlanarPose(float(scene.xy[0]), float(scene.xy[1]), scene.yaw_rad)
        command = self._follower.command(pose)
        scene.command(command.steer_rad, command.rate_radps)
        for notice in self._follower.take_notices():
            self._note(notice.kind, notice.duration_s, notice.text)
        self._force_slip()
        return self._has_ended(pose, command)

    def _force_slip(self) -> None:
        if self._slips and self._t_s >= self._slips[0].start_s:
            slip = self._slips.pop(0)
            self._slip_end_s = slip.start_s + slip.duration_s
            text = f"the wheels turn for {slip.duration_s:g} s and the rover does not move"
            self._note("forced_slip", slip.duration_s, text)
        self._scene.hold(self._t_s < self._slip_end_s)

    def _has_ended(self, pose: PlanarPose, command: Command) -> bool:
        reason = self._reason_to_end(pose, command)
        if reason is not None:
            kind, text = reason
            self._note(kind, 0.0, text)
            level = logging.INFO if kind == "goal" else logging.WARNING
            _log.log(level, "%s after %.1f s: %s", kind, self._t_s, text)
        return reason is not None

    def _reason_to_end(self, pose: PlanarPose, command: Command) -> tuple[str, str] | None:
        done, length = self._follower.progress_m, self._follower.length_m
        if self._follower.finished:
            return "goal", f"stands at the goal after {length:.1f} m"
        if self._scene.up < _TIPPED_COSINE:
            return "tipped", f"tipped over after {done:.1f} of {length:.1f} m"
        if self._t_s >= self._limit_s:
            return "time_limit", f"out of time after {done:.1f} of {length:.1f} m"
        slipping = self._t_s < self._slip_end_s
        dt_s = self._ticks.control * self._scene.spec.physics_dt_s
        if self._window.is_stuck(pose, command, 0.0 if slipping else dt_s):
            return "stuck", f"stuck after {done:.1f} of {length:.1f} m"
        return None

    def _note(self, kind: str, duration_s: float, text: str) -> None:
        self._log.events.append(Event(self._step * self._dt_ns, kind, duration_s, text))


class _Progress:
    """Compares what was asked of the body with what it did, one window of time after another."""

    def __init__(self) -> None:
        self._from: PlanarPose | None = None
        self._asked_m = 0.0
        self._moving_s = 0.0

    def is_stuck(self, pose: PlanarPose, command: Command, dt_s: float) -> bool:
        """Count a tick; tell whether a window has passed with hardly any motion."""
        start = self._from = self._from or pose
        effort = abs(command.speed_mps) + _TURN_LEVER_M * abs(command.yaw_rate_radps)
        self._asked_m += effort * dt_s
        self._moving_s += dt_s if effort > 0 else 0.0
        if self._moving_s < _STUCK_WINDOW_S:
            return False
        turned = abs(math.remainder(pose.yaw_rad - start.yaw_rad, 2 * math.pi))
        moved = math.hypot(pose.x_m - start.x_m, pose.y_m - start.y_m) + _TURN_LEVER_M * turned
        asked = self._asked_m
        self._from, self._asked_m, self._moving_s = pose, 0.0, 0.0
        return moved < _STUCK_SHARE * asked
