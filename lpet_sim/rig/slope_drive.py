"""One drive on the tilt bed: straight ahead until it is steady, and what was measured then."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.truth import Truth, WheelTruth
from lpet_sim.rig.bed import TiltBed
from lpet_sim.rig.slope_point import Ended, Heading, SlopePoint
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.truth_log import TruthLog

_log = logging.getLogger(__name__)

YAW_RAD: Final[dict[Heading, float]] = {"up": 0.0, "down": math.pi, "across": math.pi / 2}
"""Heading of the rover in the world on a bed that rises towards x."""

WINDOW_M: Final = 0.25  # rolled distance over which two means are compared
_WINDOWS: Final = 4, 16  # least and most of them
_SLIP_AGREES: Final = 0.002
_SINKAGE_AGREES_M: Final = 0.0005
_DRIFT_AGREES_RAD: Final = math.radians(0.2)
_SETTLE_S: Final = 3.0
_RAMP_S: Final = 1.0
_SAMPLE_S: Final = 0.05
_PATIENCE: Final = 4.0  # a window may take so many times as long as the wheels are asked to
_RUNAWAY: Final = 4.0  # a body faster than the wheels by this factor slides
_LEAST_LOAD_N: Final = 1.0
_TIPPED_COSINE: Final = math.cos(math.radians(45.0))


@dataclass(frozen=True)
class _Window:
    """Means and samples of one stretch of the drive."""

    slip: Array  # (6,)
    slip_mean: Array  # (n,)
    load_n: Array  # (6,)
    traction: Array  # (6,)
    sinkage_m: Array  # (6,)
    drift_rad: float

    def agrees(self, other: _Window) -> bool:
        """Tell whether two stretches have the same means."""
        return (
            abs(float(self.slip.mean() - other.slip.mean())) < _SLIP_AGREES
            and abs(float((self.sinkage_m - other.sinkage_m).mean())) < _SINKAGE_AGREES_M
            and abs(self.drift_rad - other.drift_rad) < _DRIFT_AGREES_RAD
        )


def drive_on_bed(bed: TiltBed, rover: RoverSpec, heading: Heading, speed_mps: float) -> SlopePoint:
    """Drive straight on a bed that rises towards x, until two stretches in a row agree.

    The wheels point straight ahead and turn at ``speed / r``; nobody steers. The rover settles
    first. How long it drives follows from the distance that the wheels roll.

    Args:
        bed: The bed.
        rover: The rover.
        heading: Up, down or across.
        speed_mps: Speed of the wheels' rims.

    Returns:
        The measured point; a rover that slides, stalls or tips is a result too.
    """
    scene = build_scene(bed, rover, start_yaw_rad=YAW_RAD[heading])
    return _StraightDrive(scene, bed, speed_mps).run(heading)


class _StraightDrive:
    """A drive on its way."""

    def __init__(self, scene: Scene, bed: TiltBed, speed_mps: float) -> None:
        self._scene, self._bed, self._speed_mps = scene, bed, speed_mps
        self._radius_m = scene.frames.wheel_radius_m
        self._count = len(scene.frames.wheel_names)
        self._rate_radps = speed_mps / self._radius_m
        self._log = TruthLog(self._radius_m, len(scene.frames.wheel_names))
        self._dt_s = scene.spec.physics_dt_s
        self._sample_steps = max(1, round(_SAMPLE_S / self._dt_s))
        self._step = 0
        self._windows: list[_Window] = []

    def run(self, heading: Heading) -> SlopePoint:
        """Settle, roll stretch by stretch, and measure the last two."""
        settled = self._settle()
        start = self._pose()
        self._angle_start = self._angle()
        ended = self._roll_until_steady() if settled is None else self._sample_end(settled)
        last = self._windows[-2:]
        slip = np.mean([window.slip for window in last], axis=0)
        if ended == "slides":
            slip = np.full(self._count, self._slip_of_slide())
        if ended == "steady" and slip.mean() >= 1.0:
            ended = "slides back"
        return SlopePoint(
            slope_rad=self._bed.slope_rad,
            heading=heading,
            ended=ended,
            slip=float(slip.mean()),
            slip_std=_spread(last) if ended != "slides" else None,
            drift_rad=float(np.mean([window.drift_rad for window in last])),
            turned_rad=self._turned(start, self._pose()),
            rolled_m=self._rolled_m(),
            wheel_slip=tuple(slip.tolist()),
            wheel_load_n=_mean([window.load_n for window in last]),
            wheel_traction=_mean([window.traction for window in last]),
            wheel_sinkage_m=_mean([window.sinkage_m for window in last]),
        )

    def _settle(self) -> Ended | None:
        """Stand with the brakes on until the suspension rests; tell if they do not hold."""
        for tick in range(round(_SETTLE_S / _SAMPLE_S)):
            self._advance(0.0)
            landed = tick * _SAMPLE_S > _SETTLE_S / 2
            failure = self._runs_away() if landed else None
            if failure is not None:
                return failure
        self._step = 0
        self._log.take()
        return None

    def _sample_end(self, ended: Ended) -> Ended:
        """Keep the last moments of a rover that did not wait for its wheels to turn."""
        self._windows.append(self._take())
        return ended

    def _roll_until_steady(self) -> Ended:
        least, most = _WINDOWS
        for count in range(1, most + 1):
            failure = self._roll(count * WINDOW_M)
            if failure is not None:
                return failure
            if count >= least and self._windows[-1].agrees(self._windows[-2]):
                return "steady"
        return "unsteady"

    def _roll(self, until_m: float) -> Ended | None:
        """Roll to a distance and keep the means of the stretch; tell what ended it early."""
        patience = _PATIENCE * (until_m - self._rolled_m()) / self._speed_mps + _RAMP_S
        last_step = self._step + round(patience / self._dt_s)
        failure: Ended | None = None
        while failure is None and self._rolled_m() < until_m:
            self._advance(self._rate_radps)
            failure = "stalled" if self._step >= last_step else self._runs_away()
        self._windows.append(self._take())
        return failure

    def _advance(self, rate_radps: float) -> None:
        """Sample, command, and step until the next sample is due."""
        self._sample()
        share = min(1.0, self._step * self._dt_s / _RAMP_S)
        self._scene.follow()
        self._scene.refresh_soil()
        still = np.zeros(self._count)
        self._scene.command(still, still + share * rate_radps)
        for _ in range(self._sample_steps):
            self._scene.step()
        self._step += self._sample_steps

    def _sample(self) -> None:
        t_ns = round(self._step * self._dt_s * NS_PER_S)
        self._log.add_body(t_ns, self._scene.body_row())
        self._log.add_wheels(t_ns, self._scene.wheel_row())

    def _runs_away(self) -> Ended | None:
        row = self._scene.body_row()
        if self._scene.data.time < (self._step - 1) * self._dt_s:
            return "physics failed"
        if self._upright(row) < _TIPPED_COSINE:
            return "tipped"
        fastest = _RUNAWAY * self._speed_mps
        return "slides" if float(np.linalg.norm(row[7:10])) > fastest else None

    def _upright(self, row: Array) -> float:
        """Cosine between the body's z and the bed's normal."""
        return float(so3.from_quat_wxyz(row[3:7])[:, 2] @ self._bed.normal_world)

    def _take(self) -> _Window:
        self._sample()
        truth = self._log.take()
        wheels = truth.wheels
        assert wheels is not None
        load_n = wheels.load_n.mean(axis=0)
        return _Window(
            slip=_slip(wheels),
            slip_mean=wheels.slip[1:].mean(axis=1),
            load_n=load_n,
            traction=wheels.traction_n.mean(axis=0) / np.maximum(load_n, _LEAST_LOAD_N),
            sinkage_m=wheels.sinkage_m.mean(axis=0),
            drift_rad=self._drift(truth),
        )

    def _slip_of_slide(self) -> float:
        """Slip of the body now over the rim speed that is asked: the wheels may hardly turn yet."""
        row = self._scene.body_row()
        ahead = self._axes(so3.from_quat_wxyz(row[3:7]))[0]
        return 1.0 - float(row[7:10] @ ahead) / self._speed_mps

    def _drift(self, truth: Truth) -> float:
        """Angle from forward to the motion, towards downhill; 0 where across is level [rad]."""
        moved = truth.body.v_world_body_mps.mean(axis=0)
        ahead, downhill = self._axes(truth.body.T_world_body.rotation[-1])
        return math.atan2(float(moved @ downhill), abs(float(moved @ ahead)))

    def _axes(self, R_world_body: Array) -> tuple[Array, Array]:
        """Give forward in the plane, and across it towards downhill: two unit vectors."""
        normal = self._bed.normal_world
        ahead = R_world_body[:, 0] - normal * (normal @ R_world_body[:, 0])
        ahead /= np.linalg.norm(ahead)
        left = np.cross(normal, ahead)
        return ahead, -left if left @ self._bed.uphill_world > 0 else left

    def _turned(self, start: SE3, end: SE3) -> float:
        ahead, downhill = self._axes(start.rotation)
        now = self._axes(end.rotation)[0]
        return math.atan2(float(now @ downhill), float(now @ ahead))

    def _pose(self) -> SE3:
        row = self._scene.body_row()
        return SE3.from_quat_wxyz(row[3:7], row[:3])

    def _angle(self) -> float:
        return float(self._scene.wheel_row()[: self._count].mean())

    def _rolled_m(self) -> float:
        return self._radius_m * (self._angle() - self._angle_start)


def _slip(wheels: WheelTruth) -> Array:
    """Mean slip of each wheel, weighted by how far it turned, Shape (6,)."""
    turned = np.diff(wheels.drive_angle_rad, axis=0)
    total = turned.sum(axis=0)
    safe = np.where(np.abs(total) < 1e-9, 1.0, total)
    return np.where(total == safe, (wheels.slip[1:] * turned).sum(axis=0) / safe, 0.0)


def _spread(windows: list[_Window]) -> float:
    """Standard deviation over time of the wheels' mean slip."""
    return float(np.concatenate([window.slip_mean for window in windows]).std())


def _mean(rows: list[Array]) -> tuple[float, ...]:
    return tuple(np.mean(rows, axis=0).tolist())
