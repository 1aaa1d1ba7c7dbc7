"""What ground is to a rover: where it may stand, drive over a rock, or straddle one."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lpet_sim.recording.arrays import Array
from lpet_sim.rover.frames import RoverFrames
from lpet_sim.rover.steering import Steering
from lpet_sim.spec import Spec
from lpet_sim.terrain.rock_set import Rocks

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Angle = Annotated[float, Field(gt=0.0, lt=1.5)]
Turning = Literal["point_turn", "reeds_shepp", "dubins"]

_COVER_ROWS = 4


class MobilitySpec(Spec):
    """What a rock and a slope are to the rover, how large it is, and how it turns.

    A rock is *driven over* where it is no higher than ``climb_height_m``; else it may pass *between
    the wheels* of a rover that drives straight on, where it is no higher than ``belly_height_m``
    and no wider than ``straddle_width_m``; else it is an *obstacle*, which the whole body keeps
    clear of. Straddling is held to the whole pass: no wheel track comes near the rock, and the
    rover does not turn on the spot over it. The body is the rectangle about all wheels; lengths
    are of the model ``models/exomars.xml``, seen from the origin of its body, unless said
    otherwise.

    Attributes:
        climb_height_m: Highest rock that is driven over [m]; about a wheel's radius (assumption,
            the same as `RouteSpec.obstacle_height_m`).
        belly_height_m: Highest rock that fits under the belly [m]: 0.38 m of the model less 0.08 m
            for uneven ground and sinkage (assumption).
        straddle_width_m: Widest rock that is taken between the wheels [m], as the diameter of the
            circle that no corner leaves: 1.08 m between the wheels of the model less 0.18 m
            (assumption). 0: none is.
        max_slope_rad: Steepest ground under the rover's origin [rad]; 20 deg, where MER's wheels
            slip by more than 90 % on loose sand [recalled].
        max_roll_rad: Steepest ground across the heading [rad]; 15 deg (assumption).
        slope_scale_m: Length over which slopes are measured [m]; about the rover's.
        turning: How it changes its heading: on the spot between straights; by arcs forwards and
            backwards (Reeds and Shepp); by arcs forwards only (Dubins).
        turn_radius_m: Tightest arc [m]; 1.5 m as `DriveSpec.min_turn_radius_m`. Not used by a
            rover that turns on the spot.
        front_m: From the origin to the front of the front wheels [m]: 0.70 + 0.1425.
        rear_m: From the origin to the rear of the rear wheels [m]: 0.50 + 0.1425.
        half_width_m: From the middle to the outer side of the wheels [m]: 0.60 + 0.06.
        wheel_width_m: Width of a wheel [m] [recalled].
        margin_m: What the path follower may be off by [m]; the body is grown by it all round. 0.09
            m: what `RouteSpec.clearance_m` leaves beside half the width.
    """

    climb_height_m: NotNegative = 0.15
    belly_height_m: NotNegative = 0.30
    straddle_width_m: NotNegative = 0.90
    max_slope_rad: Angle = math.radians(20.0)
    max_roll_rad: Angle = math.radians(15.0)
    slope_scale_m: Positive = 1.2
    turning: Turning = "point_turn"
    turn_radius_m: Positive = 1.5
    front_m: Positive = 0.8425
    rear_m: Positive = 0.6425
    half_width_m: Positive = 0.66
    wheel_width_m: Positive = 0.12
    margin_m: NotNegative = 0.09

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.wheel_width_m >= self.half_width_m:
            raise ValueError(
                f"a wheel_width_m of {self.wheel_width_m:g} leaves no room between the wheels; it "
                f"must be below half_width_m, {self.half_width_m:g}"
            )
        if self.straddle_width_m > 2 * self.inner_half_m:
            raise ValueError(
                f"straddle_width_m may be at most {max(2 * self.inner_half_m, 0):.3g}, the room "
                "between the wheels less the margin"
            )
        return self

    @classmethod
    def of_rover(cls, frames: RoverFrames, belly_height_m: float) -> Self:
        """Make the spec of any rover: its footprint from the model, the rest as for our own.

        Rocks are climbed up to a wheel's radius; the belly keeps 0.08 m for uneven ground and
        sinkage, and rocks between the wheels 0.09 m to each side (assumptions, as above). A rover
        whose steering does not let it turn on the spot drives arcs forwards and backwards.

        Args:
            frames: The rover's frames.
            belly_height_m: Height of its belly above flat ground.
        """
        x, y = frames.wheel_position_body_m[:, 0], frames.wheel_position_body_m[:, 1]
        radius, width = frames.wheel_radius_m, frames.wheel_width_m
        steering, margin = Steering(frames), cls.model_fields["margin_m"].default
        half_width = float(np.abs(y).max()) + width / 2
        turns = steering.why_no_point_turn() is None
        return cls(
            climb_height_m=radius,
            belly_height_m=max(belly_height_m - 0.08, 0.0),
            straddle_width_m=max(2 * (half_width - width - margin), 0.0),
            slope_scale_m=float(np.ptp(x)),
            turning="point_turn" if turns else "reeds_shepp",
            turn_radius_m=max(1.5, 1.0 / steering.max_curvature),
            front_m=float(x.max()) + radius,
            rear_m=radius - float(x.min()),
            half_width_m=half_width,
            wheel_width_m=width,
        )

    @property
    def front_kept_m(self) -> float:
        """Front of the body with its margin [m]."""
        return self.front_m + self.margin_m

    @property
    def rear_kept_m(self) -> float:
        """Rear of the body with its margin [m]."""
        return self.rear_m + self.margin_m

    @property
    def half_kept_m(self) -> float:
        """Half the width of the body with its margin [m]."""
        return self.half_width_m + self.margin_m

    @property
    def inner_half_m(self) -> float:
        """Half of what is kept free between the wheels: less the margin on each side [m]."""
        return self.half_width_m - self.wheel_width_m - self.margin_m

    @property
    def inscribed_m(self) -> float:
        """Radius of the disc about the origin that the body covers at any heading [m]."""
        return min(self.front_kept_m, self.rear_kept_m, self.half_kept_m)

    @property
    def circumscribed_m(self) -> float:
        """Radius of the disc about the origin that the body stays in while it turns [m]."""
        return math.hypot(max(self.front_kept_m, self.rear_kept_m), self.half_kept_m)

    @property
    def track_m(self) -> float:
        """Middle of a wheel's track from the middle of the rover [m]."""
        return self.half_width_m - self.wheel_width_m / 2

    @property
    def track_half_m(self) -> float:
        """Half the width of a wheel's track with the margin on each side [m]."""
        return self.wheel_width_m / 2 + self.margin_m

    def needs(self) -> Array:
        """Give what the compiled checks need.

        Returns:
            Half width, track, half track, circumscribed radius [m], the tangents of the largest
            slope and roll, front and rear [m], Shape (8,).
        """
        return np.array(
            [
                self.half_kept_m,
                self.track_m,
                self.track_half_m,
                self.circumscribed_m,
                math.tan(self.max_slope_rad),
                math.tan(self.max_roll_rad),
                self.front_kept_m,
                self.rear_kept_m,
            ]
        )

    def body_discs(self) -> Array:
        """Give discs that cover the body: (x, y) in the body and radius [m], Shape (n, 3)."""
        return _cover(-self.rear_kept_m, self.front_kept_m, -self.half_kept_m, self.half_kept_m)

    def track_discs(self) -> Array:
        """Give discs that cover what the wheels of both sides cover [m], Shape (n, 3)."""
        sides = [
            _cover(
                -self.rear_kept_m, self.front_kept_m, y - self.track_half_m, y + self.track_half_m
            )
            for y in (-self.track_m, self.track_m)
        ]
        return np.concatenate(sides)


def _cover(x_min: float, x_max: float, y_min: float, y_max: float) -> Array:
    """Cover a rectangle by equal discs about the cells of a lattice over it."""
    rows = _COVER_ROWS if y_max - y_min > 0.5 * (x_max - x_min) else 1
    columns = max(_COVER_ROWS, math.ceil(rows * (x_max - x_min) / (y_max - y_min)))
    dx, dy = (x_max - x_min) / columns, (y_max - y_min) / rows
    x, y = np.meshgrid(
        x_min + dx * (np.arange(columns) + 0.5), y_min + dy * (np.arange(rows) + 0.5)
    )
    radius = np.full(x.size, math.hypot(dx, dy) / 2)
    return np.column_stack([x.ravel(), y.ravel(), radius])


def kinds_of(rocks: Rocks, mobility: MobilitySpec) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tell which rocks are obstacles, and which may only be straddled.

    Args:
        rocks: The rocks.
        mobility: What a rock is to the rover.

    Returns:
        Obstacles and rocks to straddle, each Shape (n,); what is neither is driven over.
    """
    high = rocks.height_m > mobility.climb_height_m
    under = rocks.height_m <= mobility.belly_height_m
    narrow = 2.0 * rocks.reach_m <= mobility.straddle_width_m
    return high & ~(under & narrow), high & under & narrow
