"""Slips found by an estimator's own means held against what truly happened."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lpet_sim.evaluation.attribution import FORCED_SLIP
from lpet_sim.evaluation.slip_onset import SlipFound, SlipReport
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import Event, Truth


@dataclass(frozen=True)
class SlipMatch:
    """A forced slip with what was found of it, or a slip that was found without one.

    Attributes:
        event: What truly happened; None where a slip was found that nothing forced.
        found: What was found; None where the event was missed.
        lost_true_m: Motion by the wheels less true motion, over the event if there is one, else
            over what was found [m].
        interval_s: Time between the images where it began, or their usual one if it was missed [s].
        min_step_m: Least motion by the wheels of which a slip was told [m].
    """

    event: Event | None
    found: SlipFound | None
    lost_true_m: float
    interval_s: float
    min_step_m: float

    @property
    def late_s(self) -> float | None:
        """How much later than the event the found onset is [s]; None where either is missing."""
        if self.event is None or self.found is None:
            return None
        return (self.found.onset_ns - self.event.t_ns) / NS_PER_S

    @property
    def within_one_image(self) -> bool:
        """Whether the onset was found within the time between two images."""
        return self.late_s is not None and abs(self.late_s) <= self.interval_s

    @property
    def harmless(self) -> bool:
        """Whether the event cost less motion than slip can be told of, as in a point turn."""
        return self.event is not None and self.lost_true_m < self.min_step_m

    @property
    def text(self) -> str:
        """One line for a reader."""
        return f"{self.happened} -> {self._told()}"

    @property
    def happened(self) -> str:
        """What truly happened, in a few words."""
        if self.event is None:
            return "no forced slip"
        return f"forced slip at {_clock(self.event.t_ns)} for {self.event.duration_s:.1f} s"

    def _told(self) -> str:
        if self.found is None:
            return f"not found, {self.lost_true_m:.3f} m lost in truth"
        lost = f"{self.found.lost_m:.3f} m lost of {self.lost_true_m:.3f} m true"
        if self.event is None:
            return f"slip of {self.found.slip:.0%} found at {_clock(self.found.onset_ns)}, {lost}"
        word = "within" if self.within_one_image else "NOT within"
        image = f"({word} one image interval {self.interval_s:.1f} s)"
        return f"found at {_clock(self.found.onset_ns)} {image}, {lost}"


def match_slips(report: SlipReport, truth: Truth, wheels: Estimate) -> tuple[SlipMatch, ...]:
    """Hold the found slips against the forced ones.

    A found slip belongs to an event if the two overlap, the event being widened by the time between
    two images on either side; the first such one is taken. True loss is the length of the step
    by the wheels over the time in question, less the true step along it.

    Args:
        report: What was found.
        truth: What happened.
        wheels: The dead reckoning that it was found with.

    Returns:
        One match for each forced slip and each slip found besides, in order of time.
    """
    interval_ns = round(float(np.median(report.series.t_ns - report.series.begin_ns)))
    left, least = list(report.found), report.spec.series.min_step_m
    matches = []
    for event in (e for e in truth.events if e.kind == FORCED_SLIP):
        found = next((f for f in left if _overlap(f, event, interval_ns)), None)
        if found is not None:
            left.remove(found)
        lost = _lost_m(wheels.trajectory, truth.trajectory, event.t_ns, _end_ns(event))
        matches.append(SlipMatch(event, found, lost, _interval_s(found, interval_ns), least))
    for found in left:
        lost = _lost_m(wheels.trajectory, truth.trajectory, found.onset_ns, found.end_ns)
        matches.append(SlipMatch(None, found, lost, _interval_s(found, interval_ns), least))
    return tuple(sorted(matches, key=_time_ns))


def _overlap(found: SlipFound, event: Event, interval_ns: int) -> bool:
    begin, end = event.t_ns - interval_ns, _end_ns(event) + interval_ns
    return found.onset_ns <= end and found.end_ns >= begin


def _lost_m(wheels: Trajectory, truth: Trajectory, begin_ns: int, end_ns: int) -> float:
    latest = min(int(wheels.t_ns[-1]), int(truth.t_ns[-1]))
    span = np.minimum([begin_ns, end_ns], latest)
    by_wheels, truly = (_step(path, span) for path in (wheels, truth))
    distance = float(np.linalg.norm(by_wheels))
    return distance - float(by_wheels @ truly) / distance if distance > 0 else 0.0


def _step(path: Trajectory, span: Ints) -> Array:
    T = path.at(span)
    return (T[0].inverse() @ T[1]).translation


def _interval_s(found: SlipFound | None, usual_ns: int) -> float:
    if found is None:
        return usual_ns / NS_PER_S
    return (found.between_ns[1] - found.between_ns[0]) / NS_PER_S


def _time_ns(match: SlipMatch) -> int:
    first = match.event or match.found
    return first.t_ns if isinstance(first, Event) else first.onset_ns if first else 0


def _end_ns(event: Event) -> int:
    return event.t_ns + round(event.duration_s * NS_PER_S)


def _clock(t_ns: int) -> str:
    return f"{t_ns / NS_PER_S:.1f} s"
