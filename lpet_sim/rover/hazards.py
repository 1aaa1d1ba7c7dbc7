"""What can go wrong on a drive: small detectors, each fed with the rover's state at every control.

A detector says since when its condition holds; what makes an event of it is in `episodes`.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Protocol

from lpet_sim.rover.frames import RoverFrames
from lpet_sim.rover.observer import TURN_LEVER_M, Tick
from lpet_sim.rover.spec import FailureSpec
from lpet_sim.terrain.box import Box

MUST_END = ("tipped", "off_ground")
"""What follows these is no physics: deck and mast do not collide, and there is no ground."""
_ROUNDING_S = 1e-6


class Hazard(Protocol):
    """A condition that is watched for.

    Attributes:
        kind: Kind of its event.
        hold_s: How long the condition must hold, and must be over, to count.
    """

    kind: str
    hold_s: float

    def since(self, tick: Tick) -> float | None:
        """Take in a tick; give since when the condition holds [s], None where it does not."""
        ...

    def describe(self, tick: Tick) -> str:
        """Give a sentence for its event."""
        ...


class Stretch:
    """The last ticks, as far back as a window of commanded motion."""

    def __init__(self, window_s: float) -> None:
        """Start with nothing."""
        self._window_s = window_s - _ROUNDING_S
        self._ticks: deque[Tick] = deque()

    def begin(self, tick: Tick) -> Tick | None:
        """Take in a tick; give the one a window before it, None where there is none yet."""
        ticks = self._ticks
        if not ticks or tick.moving_s > ticks[-1].moving_s:
            ticks.append(tick)
        latest = tick.moving_s - self._window_s
        while len(ticks) > 1 and ticks[1].moving_s <= latest:
            ticks.popleft()
        return ticks[0] if ticks[0].moving_s <= latest else None


def _hardly_moved(begin: Tick, end: Tick, share: float) -> bool:
    turned = abs(math.remainder(end.pose.yaw_rad - begin.pose.yaw_rad, 2 * math.pi))
    moved = math.hypot(end.pose.x_m - begin.pose.x_m, end.pose.y_m - begin.pose.y_m)
    return moved + TURN_LEVER_M * turned < share * (end.asked_m - begin.asked_m)


class Tipped:
    """The body tilts beyond an angle."""

    kind = "tipped"
    hold_s = 0.0

    def __init__(self, spec: FailureSpec) -> None:
        """Take the angle from the spec."""
        self._cosine = math.cos(spec.tip_angle_rad)

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        return tick.t_s if tick.up < self._cosine else None

    def describe(self, tick: Tick) -> str:
        """Say it."""
        tilt = math.degrees(math.acos(min(1.0, max(-1.0, tick.up))))
        return f"tipped over, by {tilt:.0f} deg, {tick.place}"


class Entrapped:
    """A wheel stands deeper in the soil than a limit, half its radius unless the spec says."""

    kind = "entrapped"

    def __init__(self, spec: FailureSpec, frames: RoverFrames) -> None:
        """Take the limit from the spec, or from the wheel."""
        self.hold_s = spec.sinkage_hold_s
        self._limit_m = spec.sinkage_limit_m or frames.wheel_radius_m / 2
        self._names = frames.wheel_names

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        return tick.t_s if tick.sinkage_m.max() > self._limit_m else None

    def describe(self, tick: Tick) -> str:
        """Say which wheel."""
        deepest = int(tick.sinkage_m.argmax())
        wheel = self._names[deepest].replace("_", " ")
        return (
            f"the {wheel} wheel stands {100 * tick.sinkage_m[deepest]:.1f} cm deep in the soil, "
            f"over the limit of {100 * self._limit_m:.1f} cm, {tick.place}"
        )


class HungUp:
    """The belly rests on the ground or a rock, and the rover makes no progress."""

    kind = "hung_up"
    hold_s = 0.0

    def __init__(self, spec: FailureSpec, frames: RoverFrames) -> None:
        """Take window and shares from the spec."""
        self._stretch = Stretch(spec.hung_up_window_s)
        self._share, self._belly_share = spec.stuck_share, spec.belly_share
        self._weight_n = frames.mass_kg * frames.gravity_mps2
        self._carried = 0.0

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        begin = self._stretch.begin(tick)
        if begin is None:
            return None
        mean_n = (tick.belly_ns - begin.belly_ns) / (tick.moving_s - begin.moving_s)
        self._carried = mean_n / self._weight_n
        hung_up = self._carried > self._belly_share and _hardly_moved(begin, tick, self._share)
        return begin.t_s if hung_up else None

    def describe(self, tick: Tick) -> str:
        """Say what the belly carries."""
        return f"hangs up: the belly carries {self._carried:.0%} of the weight, {tick.place}"


class Stuck:
    """Commanded to move for a window of time, the body hardly does."""

    kind = "stuck"
    hold_s = 0.0

    def __init__(self, spec: FailureSpec) -> None:
        """Take window and share from the spec."""
        self._stretch = Stretch(spec.stuck_window_s)
        self._share = spec.stuck_share

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        begin = self._stretch.begin(tick)
        stuck = begin is not None and _hardly_moved(begin, tick, self._share)
        return begin.t_s if begin is not None and stuck else None

    def describe(self, tick: Tick) -> str:
        """Say where."""
        return f"stuck, {tick.place}"


class Sliding:
    """Driven forwards, the body moves backwards."""

    kind = "sliding"
    hold_s = 0.0

    def __init__(self, spec: FailureSpec) -> None:
        """Take window and share from the spec."""
        self._stretch = Stretch(spec.sliding_window_s)
        self._share = spec.sliding_share

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        begin = self._stretch.begin(tick)
        if begin is None:
            return None
        asked = tick.asked_ahead_m - begin.asked_ahead_m
        back = begin.ahead_m - tick.ahead_m
        return begin.t_s if asked > 0 and back > self._share * asked else None

    def describe(self, tick: Tick) -> str:
        """Say where."""
        return f"slides back while it drives forwards, {tick.place}"


class OffGround:
    """The body's origin leaves the ground that may be driven on."""

    kind = "off_ground"
    hold_s = 0.0

    def __init__(self, drivable: Box | None) -> None:
        """Take the drivable ground; None is everywhere."""
        self._box = drivable

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        box, pose = self._box, tick.pose
        if box is None:
            return None
        inside = box.x_min <= pose.x_m <= box.x_max and box.y_min <= pose.y_m <= box.y_max
        return None if inside else tick.t_s

    def describe(self, tick: Tick) -> str:
        """Say where."""
        return f"left the drivable ground at ({tick.pose.x_m:.1f}, {tick.pose.y_m:.1f}) m"


def hazards_of(
    spec: FailureSpec, frames: RoverFrames, drivable: Box | None = None
) -> tuple[Hazard, ...]:
    """Make every detector, in the order in which they are asked."""
    return (
        Tipped(spec),
        OffGround(drivable),
        Entrapped(spec, frames),
        HungUp(spec, frames),
        Stuck(spec),
        Sliding(spec),
    )


def ends_drive(spec: FailureSpec, kind: str) -> bool:
    """Tell whether a kind of failure ends the drive: as the spec says, or because it must."""
    return kind in spec.ends_on or kind in MUST_END
