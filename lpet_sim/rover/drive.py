"""Drive a rover along its waypoints, and give the truth of it in chunks."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lpet_sim.errors import PlanningError, SpecError
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.truth import Event, Truth, in_order
from lpet_sim.rover.drivable import check_drivable, reach_of
from lpet_sim.rover.episodes import Watch
from lpet_sim.rover.faults import Faults
from lpet_sim.rover.follower import Follower
from lpet_sim.rover.hazards import ends_drive, hazards_of
from lpet_sim.rover.observer import Observer, Tick
from lpet_sim.rover.scene import Scene
from lpet_sim.rover.spec import DriveSpec
from lpet_sim.rover.truth_log import TruthLog

_log = logging.getLogger(__name__)

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
    Exactly one event ends the drive (`Event.ends`): ``goal``, ``time_limit``, ``off_ground``,
    ``unstable`` (the physics), or a failure of a kind that ``spec.failures`` names. Failures of
    other kinds are recorded, and it goes on. What lasts (faults and failures) is one event each
    time, in the chunk in which it is over, with the time at which it began.

    Args:
        scene: A rover that stands at the first waypoint, from `build_scene`.
        spec: The drive.
        chunk_s: Length of the chunks, rounded to whole samples of the body [s].

    Yields:
        The truth, piece by piece: each piece continues the last, and the first begins at time 0.

    Raises:
        SpecError: A rate does not divide the physics rate.
        PlanningError: The path leaves the drivable ground, the rover is not at its start, or its
            steering cannot do what the path asks.
        UnknownNameError: A wheel that is to be stuck is none of the rover's.
    """
    ticks = _ticks(spec, scene.spec.physics_dt_s, chunk_s)
    follower = Follower(spec, scene.spec, scene.frames)
    _check_path(scene, spec, follower)
    return _Drive(scene, spec, follower, ticks).chunks()


def _ticks(spec: DriveSpec, dt_s: float, chunk_s: float) -> _Ticks:
    body = _steps_per(spec.imu_rate_hz, dt_s, "imu_rate_hz")
    wheels = _steps_per(spec.wheel_rate_hz, dt_s, "wheel_rate_hz")
    control = _steps_per(spec.control_rate_hz, dt_s, "control_rate_hz")
    chunk = body * max(1, round(chunk_s / dt_s / body))
    return _Ticks(body, wheels, control, chunk)


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
    path = np.concatenate([leg.xy for leg in follower.legs])
    check_drivable(scene.ground, path, reach_of(scene.frames))


class _Drive:
    """One drive on its way; `chunks` runs it."""

    def __init__(self, scene: Scene, spec: DriveSpec, follower: Follower, ticks: _Ticks) -> None:
        self._scene, self._spec, self._follower, self._ticks = scene, spec, follower, ticks
        self._log = TruthLog(scene.frames.wheel_radius_m, len(scene.frames.wheel_names))
        self._dt_ns = round(scene.spec.physics_dt_s * NS_PER_S)
        self._step = 0
        self._ended = False
        self._limit_s = spec.time_limit_s or 3.0 * follower.nominal_s
        self._faults = Faults(spec, scene.frames.wheel_names)
        self._observer = Observer(ticks.control * scene.spec.physics_dt_s)
        hazards = hazards_of(spec.failures, scene.frames, scene.ground.drivable)
        self._watches = [Watch(fault) for fault in self._faults.all]
        self._watches += [Watch(h, ends_drive(spec.failures, h.kind)) for h in hazards]

    @property
    def _t_s(self) -> float:
        return self._step * self._dt_ns / NS_PER_S

    def chunks(self) -> Iterator[Truth]:
        """Settle, then step until the drive ends; every chunk begins with a row of the body."""
        self._note("start", 0.0, f"sets out on {self._follower.length_m:.1f} m")
        self._settle()
        while True:
            if self._step and self._step % self._ticks.chunk == 0:
                yield self._take()
            self._sample()
            if not self._ended and self._step % self._ticks.control == 0:
                self._control()
            if not self._ended:
                self._advance()
            if self._ended:
                yield self._take()
                return

    def _advance(self) -> None:
        if self._has_stepped():
            self._step += 1
        else:
            self._end("unstable", f"the physics became unstable {self._place}")

    def _has_stepped(self) -> bool:
        """Step; tell whether MuJoCo did not give up and reset, which turns back its clock."""
        before_s = self._scene.data.time
        self._scene.step()
        return bool(self._scene.data.time > before_s)

    def _take(self) -> Truth:
        self._log.events = list(in_order(self._log.events))
        return self._log.take()

    def _settle(self) -> None:
        still = np.zeros(len(self._scene.frames.wheel_names))
        self._scene.command(still, still)
        for _ in range(round(self._spec.settle_s / self._scene.spec.physics_dt_s)):
            if not self._has_stepped():
                self._end("unstable", "the physics became unstable before the drive")
                return

    def _sample(self) -> None:
        t_ns = self._step * self._dt_ns
        if self._step % self._ticks.body == 0:
            self._log.add_body(t_ns, self._scene.body_row())
        if self._step % self._ticks.wheels == 0:
            self._log.add_wheels(t_ns, self._scene.wheel_row())

    def _control(self) -> None:
        """Look what has happened, keep ground under the rover, command it, or end the drive."""
        tick = self._observer.look(self._scene, self._t_s, self._place)
        for watch in self._watches:
            over = watch.look(tick)
            if over is not None:
                self._log.events.append(over)
        try:
            self._scene.follow()
            self._scene.refresh_soil()
        except PlanningError as error:  # it has slid to where no ground can be laid
            self._end("off_ground", str(error))
            return
        self._command(tick)
        self._end_if_due()

    def _command(self, tick: Tick) -> None:
        command = self._follower.command(tick.pose)
        slipping = self._faults.slipping(tick.t_s)
        self._scene.command(command.steer_rad, self._faults.lock(tick.t_s, command.rate_radps))
        self._scene.hold(slipping)
        self._observer.expect(None if slipping else command)
        for notice in self._follower.take_notices():
            self._note(notice.kind, notice.duration_s, notice.text)

    def _end_if_due(self) -> None:
        failed = next((w for w in self._watches if w.ends and w.episode is not None), None)
        if self._follower.finished:
            self._end("goal", f"stands at the goal after {self._follower.length_m:.1f} m")
        elif failed is not None and failed.episode is not None:
            self._end(failed.kind, failed.episode.text, failed)
        elif self._t_s >= self._limit_s:
            self._end("time_limit", f"out of time {self._place}")

    def _end(self, kind: str, text: str, failed: Watch | None = None) -> None:
        """End the drive, and with it every episode; a failure's own is the event of the end."""
        self._ended = True
        closed = [watch.close(self._t_s, watch is failed) for watch in self._watches]
        self._log.events.extend(event for event in closed if event is not None)
        if failed is None:
            self._note(kind, 0.0, text, ends=True)
        level = logging.INFO if kind == "goal" else logging.WARNING
        _log.log(level, "%s after %.1f s: %s", kind, self._t_s, text)

    @property
    def _place(self) -> str:
        return f"after {self._follower.progress_m:.1f} of {self._follower.length_m:.1f} m"

    def _note(self, kind: str, duration_s: float, text: str, ends: bool = False) -> None:
        self._log.events.append(Event(self._step * self._dt_ns, kind, duration_s, text, ends))
