"""Dead reckoning's error split by cause, by asking what it would have been without each cause."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.errors import distance_driven_m
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.streams import WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import Event, Truth, WheelTruth

Triple = tuple[float, float, float]
FORCED_SLIP = "forced_slip"


@dataclass(frozen=True)
class ErrorAttribution:
    """The endpoint error of dead reckoning as a sum of causes, ``p_est - p_true`` in the world.

    Attributes:
        distance_m: Distance truly driven [m].
        total_m: The whole error [m]: the sum of the contributions.
        contributions_m: Error vector of each cause [m]: ``scale`` (scale and noise of the
            encoders, track width), ``forced_slip``, ``slip`` (the wheels' own, along the wheel)
            and ``model`` (what remains with exact angles and no slip: sliding sideways, and the
            tilt of the ground, which wheels do not measure; it fills the vertical).
    """

    distance_m: float
    total_m: Triple
    contributions_m: dict[str, Triple]

    @property
    def ratios(self) -> dict[str, float]:
        """Length of each cause's error over the distance; lengths do not add up, vectors do."""
        return {
            cause: float(np.linalg.norm(vector)) / self.distance_m
            for cause, vector in self.contributions_m.items()
        }


def attribute_error(
    measured: WheelStream, truth: Truth, dead_reckon: Callable[[WheelStream], Trajectory]
) -> ErrorAttribution:
    """Split the endpoint error of dead reckoning by cause.

    Four streams are reckoned: the measured one (error e1), the true wheel angles (e2), those
    without the turns of forced slip (e3), and those with each turn shortened by the wheel's slip,
    ``(1 - s) d_angle`` (e4). Then ``scale = e1 - e2``, ``forced_slip = e2 - e3``,
    ``slip = e3 - e4``, ``model = e4``, whose sum is e1.

    Args:
        measured: Encoder readings.
        truth: Truth with wheels and events of the same traverse.
        dead_reckon: Dead reckoning as a function of a wheel stream, from the given start.

    Returns:
        The error and its parts.

    Raises:
        RecordingError: The truth holds no wheels.
    """
    if truth.wheels is None:
        raise RecordingError("the truth holds no wheels: only a simulated drive can be attributed")
    forced = [event for event in truth.events if event.kind == FORCED_SLIP]
    streams = [measured, *counterfactual_streams(truth.wheels, forced)]
    e1, e2, e3, e4 = (_endpoint_error(dead_reckon(stream), truth.trajectory) for stream in streams)
    parts = {"scale": e1 - e2, FORCED_SLIP: e2 - e3, "slip": e3 - e4, "model": e4}
    return ErrorAttribution(
        distance_m=float(distance_driven_m(truth.trajectory)[-1]),
        total_m=_triple(e1),
        contributions_m={cause: _triple(vector) for cause, vector in parts.items()},
    )


def counterfactual_streams(
    wheels: WheelTruth, forced: list[Event]
) -> tuple[WheelStream, WheelStream, WheelStream]:
    """Make exact wheel streams: as turned, without forced slip, and without any slip.

    Args:
        wheels: True wheel states; the slip of a sample is the mean since the sample before.
        forced: The forced slip events.

    Returns:
        Three streams at the truth's times.
    """
    turns = np.diff(wheels.drive_angle_rad, axis=0)
    free = 1.0 - _share_inside(wheels, forced)[:, None]
    made = (turns, turns * free, turns * free * (1.0 - wheels.slip[1:]))
    as_turned, unforced, gripping = (_stream(wheels, turn) for turn in made)
    return as_turned, unforced, gripping


def _share_inside(wheels: WheelTruth, events: list[Event]) -> Array:
    """Give the share of each interval between samples that lies inside an event, Shape (n - 1,)."""
    begin, end = wheels.t_ns[:-1], wheels.t_ns[1:]
    share = np.zeros(len(begin))
    for event in events:
        last_ns = event.t_ns + round(event.duration_s * NS_PER_S)
        overlap = np.minimum(end, last_ns) - np.maximum(begin, event.t_ns)
        share += np.maximum(overlap, 0) / (end - begin)
    return np.minimum(share, 1.0)


def _stream(wheels: WheelTruth, turns: Array) -> WheelStream:
    start = wheels.drive_angle_rad[:1]
    angle = np.concatenate([start, start + np.cumsum(turns, axis=0)])
    return WheelStream(wheels.t_ns, angle, wheels.steer_angle_rad)


def _endpoint_error(estimate: Trajectory, truth: Trajectory) -> Array:
    last = min(int(estimate.t_ns[-1]), int(truth.t_ns[-1]))
    return estimate.at([last]).translation[0] - truth.at([last]).translation[0]


def _triple(vector: Array) -> Triple:
    x, y, z = map(float, vector)
    return x, y, z
