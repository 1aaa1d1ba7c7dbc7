"""Watches: one event for each time that a condition lasts, whatever its flicker."""

import numpy as np

from lpet_sim.recording.truth import Event
from lpet_sim.rover.episodes import Watch
from lpet_sim.rover.follower import PlanarPose
from lpet_sim.rover.observer import Tick


class Flag:
    """A hazard that holds where a string has an X, one tick a second."""

    kind = "flag"

    def __init__(self, pattern: str, hold_s: float) -> None:
        """Take the pattern."""
        self.pattern, self.hold_s = pattern, hold_s

    def since(self, tick: Tick) -> float | None:
        """Take in a tick."""
        return tick.t_s if self.pattern[round(tick.t_s)] == "X" else None

    def describe(self, tick: Tick) -> str:
        """Say when."""
        return f"seen at {tick.t_s:g} s"


def _watched(pattern: str, hold_s: float) -> list[Event]:
    watch = Watch(Flag(pattern, hold_s))
    ticks = [Tick(float(k), PlanarPose(0, 0, 0), 1.0, np.zeros(6), "") for k in range(99)]
    found = [watch.look(tick) for tick in ticks[: len(pattern)]]
    return [event for event in [*found, watch.close(len(pattern))] if event is not None]


def _spans(events: list[Event]) -> list[tuple[float, float]]:
    return [(event.t_ns / 1e9, event.duration_s) for event in events]


def test_each_time_that_a_condition_lasts_is_one_event() -> None:
    """With its beginning and its duration, not one at every tick; what lasts at the end too."""
    assert _spans(_watched("..XXX...XX", 0.0)) == [(2, 3), (8, 2)]
    assert _spans(_watched("...", 0.0)) == []


def test_a_bump_does_not_count_and_a_flicker_does_not_part() -> None:
    """Shorter than the hold: neither begins nor ends an episode."""
    assert _spans(_watched(".X.XX.X.....", 2.0)) == []
    assert _spans(_watched("..XXX.XX.X....", 2.0)) == [(2, 8)]
    assert _spans(_watched("XXX...XXX...", 2.0)) == [(0, 3), (6, 3)]


def test_the_sentence_is_that_of_the_moment_of_recognition() -> None:
    """It begins when the condition did, and speaks when the hold is over."""
    (event,) = _watched(".XXXX...", 2.0)
    assert (event.t_ns, event.kind, event.text) == (1_000_000_000, "flag", "seen at 3 s")
    assert not event.ends
