"""What a rover and a drive are: frozen specs with units in their names."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lpet_sim.rover.wheel_soil import WheelSoilSpec
from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
MARS_100_M_PER_H_MPS = 100.0 / 3600.0
Failure = Literal["tipped", "entrapped", "hung_up", "stuck", "sliding"]


class RoverSpec(Spec):
    """Which rover, and how finely the ground under it is resolved.

    Masses, lengths and frames are the model's; ``models/README.md`` has the sources of ours.

    Attributes:
        model: Name of a description in ``models/``, without its ending, or the path of the YAML
            that describes a rover of one's own (``docs/own_rover.md``).
        physics_dt_s: Physics step; 5 ms holds the slip law to 0.3 points (measured).
        patch_m: Side of the square of ground that is loaded around the rover.
        rock_min_diameter_m: Smaller rocks are pressed into the soil and not collided with
            (assumption: half the wheel's width).
        steer_rate_radps: Fastest steering (assumption, 6 deg/s).
        wheel_soil: How its wheels follow the law of the soil under them.
    """

    model: str = "exomars"
    physics_dt_s: Annotated[float, Field(ge=0.001, le=0.01)] = 0.005
    patch_m: Annotated[float, Field(ge=4.0, le=32.0)] = 8.0
    rock_min_diameter_m: Annotated[float, Field(ge=0.02, le=0.5)] = 0.06
    steer_rate_radps: Annotated[float, Field(gt=0.0, le=1.0)] = math.radians(6.0)
    wheel_soil: WheelSoilSpec = Field(default_factory=WheelSoilSpec)


class ForcedSlip(Spec):
    """Wheels that turn while the rover stays where it is, as in the paper's data sets.

    Attributes:
        start_s: When it begins, since the start.
        duration_s: How long it lasts; the paper forces 5 s.
    """

    start_s: NotNegative
    duration_s: Positive = 5.0


class Stop(Spec):
    """A halt on the way.

    Attributes:
        at_m: Distance along the planned path.
        duration_s: How long the rover stands.
    """

    at_m: NotNegative
    duration_s: Positive


class StuckWheel(Spec):
    """A wheel whose drive is locked: it still steers, and is dragged by the others.

    Attributes:
        wheel: Which wheel, by its name in the rover's description.
        start_s: When it begins, since the start.
        duration_s: How long it lasts; None for as long as the drive.
    """

    wheel: str
    start_s: NotNegative
    duration_s: Positive | None = None

    @property
    def end_s(self) -> float:
        """When it is over, since the start [s]."""
        return math.inf if self.duration_s is None else self.start_s + self.duration_s


class FailureSpec(Spec):
    """What counts as a failure, and which kinds of it end a drive; the others are recorded only.

    All numbers but half a wheel radius are assumptions.

    Attributes:
        ends_on: Kinds that end the drive. ``tipped`` always does, listed or not, since the model's
            deck and mast do not collide; so does ``off_ground``, where there is no more ground.
        tip_angle_rad: ``tipped``: the body's tilt is beyond this.
        sinkage_limit_m: ``entrapped``: a wheel stands deeper in the soil; None for half a radius.
        sinkage_hold_s: For at least this long, so that a bump does not count.
        belly_share: ``hung_up``: the belly carries more than this share of the weight, on average
            over the window, and the rover is stuck meanwhile.
        hung_up_window_s: Window of commanded motion for ``hung_up``.
        stuck_share: ``stuck``: the body moves by less than this share of what it is commanded to.
        stuck_window_s: Window of commanded motion for ``stuck``.
        sliding_share: ``sliding``: driven forwards, the body moves backwards, by more than this
            share of what it is commanded to.
        sliding_window_s: Window of commanded motion for ``sliding``.
    """

    ends_on: tuple[Failure, ...] = ("tipped", "entrapped", "hung_up", "stuck")
    tip_angle_rad: Annotated[float, Field(gt=0.0, le=math.pi / 2)] = math.radians(45.0)
    sinkage_limit_m: Positive | None = None
    sinkage_hold_s: NotNegative = 2.0
    belly_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    hung_up_window_s: Positive = 10.0
    stuck_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.1
    stuck_window_s: Positive = 120.0
    sliding_share: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.05
    sliding_window_s: Positive = 10.0


class DriveSpec(Spec):
    """A drive along waypoints.

    Attributes:
        waypoints_m: Corners of the path in the world, (x, y); the first one is the start.
        speed_mps: Speed of the body, and the most that any wheel's ground speed is asked to be in
            a point turn; 100 m/h by default (the paper).
        min_turn_radius_m: Tightest arc of the body's origin; sharper corners are turned on the
            spot.
        corner_cut_m: How far a rounded corner may pass from its waypoint.
        acceleration_mps2: Ramp of the speed (assumption).
        stops: Halts, in order of distance.
        forced_slips: Forced slip events, in order of time and apart from each other.
        stuck_wheels: Wheels whose drive is locked for a while, or for good; those of one wheel in
            order of time and apart from each other.
        failures: What counts as a failure, and which kinds end the drive.
        settle_s: Standstill before time 0, in which the suspension comes to rest.
        imu_rate_hz: Rate of the body's truth; must divide the physics rate.
        wheel_rate_hz: Rate of the wheels' truth; must divide the physics rate.
        control_rate_hz: Rate of the path follower; must divide the physics rate.
        time_limit_s: When to give up; None for three times the planned duration.
    """

    waypoints_m: Annotated[tuple[tuple[float, float], ...], Field(min_length=2)]
    speed_mps: Annotated[float, Field(gt=0.0, le=0.5)] = MARS_100_M_PER_H_MPS
    min_turn_radius_m: Annotated[float, Field(ge=1.0)] = 1.5
    corner_cut_m: Positive = 0.3
    acceleration_mps2: Positive = 0.02
    stops: tuple[Stop, ...] = ()
    forced_slips: tuple[ForcedSlip, ...] = ()
    stuck_wheels: tuple[StuckWheel, ...] = ()
    failures: FailureSpec = FailureSpec()
    settle_s: NotNegative = 5.0
    imu_rate_hz: Positive = 100.0
    wheel_rate_hz: Positive = 20.0
    control_rate_hz: Positive = 10.0
    time_limit_s: Positive | None = None

    @model_validator(mode="after")
    def _order(self) -> Self:
        """Hold waypoints, stops and slips to be distinct and in order."""
        for i, (a, b) in enumerate(pairwise(self.waypoints_m)):
            if math.dist(a, b) < 1e-3:
                raise ValueError(
                    f"waypoints {i} and {i + 1} coincide; they must be at least 1 mm apart"
                )
        at = [stop.at_m for stop in self.stops]
        if sorted(at) != at:
            raise ValueError(f"stops at {at} m are out of order; sort them by at_m")
        for first, then in pairwise(self.forced_slips):
            if then.start_s < first.start_s + first.duration_s:
                raise ValueError(
                    f"forced slip at {then.start_s} s begins before the one at {first.start_s} s "
                    "has ended; they must follow each other"
                )
        return self

    @model_validator(mode="after")
    def _one_lock_at_a_time(self) -> Self:
        """Hold the times in which one wheel is stuck to be apart."""
        of_wheel: dict[str, StuckWheel] = {}
        for stuck in self.stuck_wheels:
            before = of_wheel.get(stuck.wheel)
            if before is not None and stuck.start_s < before.end_s:
                raise ValueError(
                    f"stuck wheel {stuck.wheel} at {stuck.start_s} s begins before the one at "
                    f"{before.start_s} s has ended; they must follow each other"
                )
            of_wheel[stuck.wheel] = stuck
        return self
