"""Episodes: of a condition's yes and no at each tick, one event for each time that it lasts."""

from __future__ import annotations

from dataclasses import dataclass

from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.truth import Event
from lpet_sim.rover.hazards import Hazard
from lpet_sim.rover.observer import Tick


@dataclass(frozen=True)
class Episode:
    """A condition that holds.

    Attributes:
        begin_s: Since when.
        text: One sentence on it.
    """

    begin_s: float
    text: str


class Watch:
    """Watches for one condition.

    It begins when it has held for the hazard's ``hold_s``, and is over when it has been gone for as
    long, so that neither a bump nor a flicker makes events.

    Attributes:
        kind: Kind of the events.
        ends: Whether an episode ends the drive.
        episode: The one that lasts, None where there is none.
    """

    def __init__(self, hazard: Hazard, ends: bool = False) -> None:
        """Watch for a hazard."""
        self.kind = hazard.kind
        self.ends = ends
        self.episode: Episode | None = None
        self._hazard = hazard
        self._begin_s: float | None = None
        self._gone_s: float | None = None

    def look(self, tick: Tick) -> Event | None:
        """Take in a tick; give the event of an episode that turns out to be over."""
        since_s = self._hazard.since(tick)
        if since_s is None:
            return self._gone(tick.t_s)
        self._gone_s = None
        self._begin_s = since_s if self._begin_s is None else self._begin_s
        if self.episode is None and tick.t_s - self._begin_s >= self._hazard.hold_s:
            self.episode = Episode(self._begin_s, self._hazard.describe(tick))
        return None

    def _gone(self, t_s: float) -> Event | None:
        if self.episode is None:
            self._begin_s = None
            return None
        self._gone_s = t_s if self._gone_s is None else self._gone_s
        return self.close(self._gone_s) if t_s - self._gone_s >= self._hazard.hold_s else None

    def close(self, t_s: float, ends: bool = False) -> Event | None:
        """End the episode that lasts at a time [s]; give its event, None where there is none."""
        episode, self.episode = self.episode, None
        self._begin_s = self._gone_s = None
        if episode is None:
            return None
        t_ns = round(episode.begin_s * NS_PER_S)
        duration_s = (round(t_s * NS_PER_S) - t_ns) / NS_PER_S
        return Event(t_ns, self.kind, duration_s, episode.text, ends)
