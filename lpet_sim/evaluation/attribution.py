"""Dead reckoning's error split by cause, by asking what it would have been without each cause."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.errors import distance_driven_m
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.streams import WheelStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import Event, Truth, WheelTruth

Triple = tuple[float, float, float]
FORCED_SLIP = "forced_slip"
MODEL = "model"
CAUSES = ("scale", FORCED_SLIP, "slip", "side_slip", MODEL)
"""The causes of dead reckoning's error, in the order in which they are taken away."""

_LEAST_COSINE = 1e-6


@dataclass(frozen=True)
class ErrorAttribution:
    """The endpoint error of dead reckoning as a sum of causes, ``p_est - p_true`` in the world.

    Attributes:
        distance_m: Distance truly driven [m].
        total_m: The whole error [m]: the sum of the contributions.
        contributions_m: Error vector of each cause [m]: ``scale`` (scale and noise of the
            encoders, track width), ``forced_slip`` (turns of the wheels while the rover was held),
            ``slip`` (the wheels' own, along the wheel), ``side_slip`` (their motion across their
            plane) and ``model`` (what remains with every wheel's motion known in its own plane's
            frame: the tilt of the ground, which wheels do not measure and which fills the vertical,
            and the play of the suspension under a body taken as rigid).
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

    Five streams are reckoned: the measured one (error e1), the true wheel angles (e2), those
    without the turns of forced slip (e3), those with each turn shortened by the wheel's slip,
    ``(1 - s) d_angle`` (e4), and these turned into the direction of each wheel's motion, as if it
    were steered there (e5). Then ``scale = e1 - e2``, ``forced_slip = e2 - e3``,
    ``slip = e3 - e4``, ``side_slip = e4 - e5``, ``model = e5``, whose sum is e1.

    Args:
        measured: Encoder readings.
        truth: Truth with wheels and events of the same traverse.
        dead_reckon: Dead reckoning as a function of a wheel stream, from the given start. It must
            take every wheel as steered, for a wheel that is fixed slips sideways too.

    Returns:
        The error and its parts.

    Raises:
        RecordingError: The truth holds no wheels.
    """
    if truth.wheels is None:
        raise RecordingError("the truth holds no wheels: only a simulated drive can be attributed")
    forced = [event for event in truth.events if event.kind == FORCED_SLIP]
    streams = [measured, *counterfactual_streams(truth.wheels, forced)]
    errors = [_endpoint_error(dead_reckon(stream), truth.trajectory) for stream in streams]
    parts = {
        cause: e - e_without
        for cause, (e, e_without) in zip(CAUSES, pairwise(errors), strict=False)
    }
    parts[MODEL] = errors[-1]
    return ErrorAttribution(
        distance_m=float(distance_driven_m(truth.trajectory)[-1]),
        total_m=_triple(errors[0]),
        contributions_m={cause: _triple(vector) for cause, vector in parts.items()},
    )


def counterfactual_streams(
    wheels: WheelTruth, forced: list[Event]
) -> tuple[WheelStream, WheelStream, WheelStream, WheelStream]:
    """Make exact wheel streams: as turned, without forced slip, without slip, and as moved.

    The last has no slip along the wheels and points each along its motion.

    Args:
        wheels: True wheel states; slip and slip angle of a sample are means since the one before.
        forced: The forced slip events.

    Returns:
        Four streams; the first three at the truth's times.
    """
    turns = np.diff(wheels.drive_angle_rad, axis=0)
    free = 1.0 - _share_inside(wheels, forced)[:, None]
    made = (turns, turns * free, turns * free * (1.0 - wheels.slip[1:]))
    as_turned, unforced, gripping = (_stream(wheels, turn) for turn in made)
    return as_turned, unforced, gripping, _as_moved(wheels, made[-1])


def _as_moved(wheels: WheelTruth, turns: Array) -> WheelStream:
    """Steer each wheel into its motion, by turns that are its motion along its plane, (n - 1, w).

    A wheel that goes v along its plane goes ``|v| tan(angle)`` to its left: in all
    ``v / cos(angle)`` at ``steer + sign(v) angle``. That direction holds for one interval, and a
    reader takes the mean of both ends: so a second sample a nanosecond before each next one ends
    the interval with the steering that it began with.
    """
    angle = wheels.slip_angle_rad[1:]
    middle = 0.5 * (wheels.steer_angle_rad[1:] + wheels.steer_angle_rad[:-1])
    heading = middle + np.sign(turns) * angle
    # A wheel that only slides sideways has a right angle here; its turn is then 0 to rounding.
    rolled = np.cumsum(turns / np.maximum(np.cos(angle), _LEAST_COSINE), axis=0)
    begin, end = wheels.t_ns[:-1], wheels.t_ns[1:] - 1
    start = wheels.drive_angle_rad[:1]
    after = start + rolled
    before = np.concatenate([start, after[:-1]])
    return WheelStream(
        np.append(np.stack([begin, end], axis=1).reshape(-1), wheels.t_ns[-1]),
        np.concatenate([_interleaved(before, after), after[-1:]]),
        np.concatenate([_interleaved(heading, heading), heading[-1:]]),
    )


def _interleaved(first: Array, second: Array) -> Array:
    """Put the rows of two arrays in turn, Shape (2 n, w)."""
    return np.stack([first, second], axis=1).reshape(-1, first.shape[1])


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
