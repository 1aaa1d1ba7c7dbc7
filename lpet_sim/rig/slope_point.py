"""What one drive on the tilt bed measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Heading = Literal["up", "down", "across"]
Ended = Literal[
    "steady", "unsteady", "slides back", "slides", "stalled", "tipped", "physics failed"
]


@dataclass(frozen=True)
class SlopePoint:
    """What one drive on the bed measured in its steady part.

    Attributes:
        slope_rad: Tilt of the bed.
        heading: Which way the rover drove: up or down the slope, or across it.
        ended: ``steady``; ``unsteady`` (it never came to rest about a mean); ``slides back`` (slip
            of 100 % or more, steadily); ``slides`` (away, faster than its wheels turn);
            ``stalled`` (the wheels did not turn); ``tipped``; ``physics failed`` (the simulation
            gave up and began anew, so that the point says nothing).
        slip: ``1 - v / (r omega)``, mean over the wheels and the time; v is that of the wheels'
            centres along their planes, omega the true rate. Of a rover that slides it is that of
            the body in the end, over the rim speed that was asked for.
        slip_std: Standard deviation over time of the wheels' mean; None of a rover that slides.
        drift_rad: Angle from the rover's forward axis to its motion, towards downhill.
        turned_rad: How far the rover has turned since it was set down, towards downhill.
        rolled_m: Distance rolled in all.
        wheel_slip: Slip of each wheel.
        wheel_load_n: Load of each wheel [N].
        wheel_traction: Traction over load of each wheel.
        wheel_sinkage_m: Sinkage of each wheel [m].
    """

    slope_rad: float
    heading: Heading
    ended: Ended
    slip: float
    slip_std: float | None
    drift_rad: float
    turned_rad: float
    rolled_m: float
    wheel_slip: tuple[float, ...]
    wheel_load_n: tuple[float, ...]
    wheel_traction: tuple[float, ...]
    wheel_sinkage_m: tuple[float, ...]

    @property
    def held(self) -> bool:
        """Whether the drive came to a steady motion, be it backwards."""
        return self.ended in ("steady", "slides back")

    @property
    def sinkage_m(self) -> float:
        """Mean sinkage of the wheels [m]."""
        return float(np.mean(self.wheel_sinkage_m))
