"""Parts of the rover that move, thinned and gathered while a recording grows."""

from __future__ import annotations

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Ints
from lpet_sim.recording.visuals import Pen

MOTION_PERIOD_NS = NS_PER_S // 5
_ROWS_AT_ONCE = 512


class Thinner:
    """Keeps the first row of each period, over any number of pieces."""

    def __init__(self, period_ns: int = MOTION_PERIOD_NS) -> None:
        """Start without a past."""
        self._period_ns = period_ns
        self._last = -(2**62)

    def keep(self, t_ns: Ints) -> Ints:
        """Give the indices of the rows to keep."""
        periods = np.asarray(t_ns) // self._period_ns
        kept = np.flatnonzero(np.diff(periods, prepend=self._last) > 0)
        if len(periods):
            self._last = int(periods[-1])
        return kept


class MovingEntity:
    """The motion of one entity in its parent."""

    def __init__(self, pen: Pen, entity: str) -> None:
        """Start without a past.

        Args:
            pen: What draws.
            entity: What moves.
        """
        self._pen, self._entity = pen, entity
        self._thinner = Thinner()
        self._gathered: list[tuple[Ints, SE3]] = []
        self._rows = 0

    def add(self, t_ns: Ints, poses: SE3) -> None:
        """Add poses, and draw when there are enough of them."""
        kept = self._thinner.keep(t_ns)
        if len(kept):
            self._gathered.append((t_ns[kept], poses[kept]))
            self._rows += len(kept)
        if self._rows >= _ROWS_AT_ONCE:
            self.flush()

    def flush(self) -> None:
        """Draw what is left."""
        if self._gathered:
            t_ns = np.concatenate([t for t, _ in self._gathered])
            rotation = np.concatenate([poses.rotation for _, poses in self._gathered])
            translation = np.concatenate([poses.translation for _, poses in self._gathered])
            self._pen.poses(self._entity, t_ns, SE3(rotation, translation))
            self._gathered, self._rows = [], 0
