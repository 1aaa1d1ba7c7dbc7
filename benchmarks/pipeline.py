"""A whole traverse, from the first step to the closed file, against the sum of its bare parts."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.case import PERIOD_S, SEED
from benchmarks.timing import Row, Samples
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec

PIECE_S = 10.0
"""How often `simulate` tells how far it is, on Mars."""

_WHOLE = (
    "simulate(), on two threads; bare: as many steps and pairs, one after the other, and the file; "
    "LPET also builds, senses, adds noise, aligns patches and draws"
)
_ON_WAY = "as above without the first and last seconds: no building, first view, drawn ground"
_FACTOR = "seconds on Mars in one here: 100 m/h, a pair of 640 x 480 px every 2 cm, all kept"


@dataclass(frozen=True)
class Spent:
    """Time that went by.

    Attributes:
        wall_s: On the clock.
        cpu_s: Of the process on all cores.
        mars_s: In the simulation.
    """

    wall_s: float
    cpu_s: float
    mars_s: float


@dataclass
class Run:
    """Times of one traverse.

    Attributes:
        times: The whole of it.
        marks: Clock and processor when each piece of 10 s on Mars was done [s].
    """

    times: Samples = field(default_factory=Samples)
    marks: list[tuple[float, float]] = field(default_factory=list)

    def mark(self, _: float) -> None:
        """Note that a piece is done."""
        self.marks.append((time.perf_counter(), time.process_time()))

    def whole(self, mars_s: float) -> Spent:
        """Give what the whole traverse took."""
        return Spent(self.times.median_s, self.times.median_cpu_s, mars_s)

    def on_way(self) -> Spent:
        """Give what the pieces between the first and the last took."""
        (wall, cpu), (wall_end, cpu_end) = self.marks[0], self.marks[-2]
        return Spent(wall_end - wall, cpu_end - cpu, PIECE_S * (len(self.marks) - 2))


@dataclass(frozen=True)
class BareParts:
    """Bare times that add up to a traverse.

    Attributes:
        step: One physics step.
        pair: Rendering, detecting and matching, writing of one pair.
        physics_hz: Steps in a second on Mars.
    """

    step: Samples
    pair: tuple[Samples, ...]
    physics_hz: float

    def sum(self, mars_s: float) -> Spent:
        """Add the medians up for some time on Mars."""
        wall, cpu = (
            mars_s * (self.physics_hz * step + sum(pair) / PERIOD_S)
            for step, pair in (
                (self.step.median_s, [part.median_s for part in self.pair]),
                (self.step.median_cpu_s, [part.median_cpu_s for part in self.pair]),
            )
        )
        return Spent(wall, cpu, mars_s)


def run(spec: TraverseSpec, path: Path) -> Run:
    """Simulate a traverse and note when its pieces were done."""
    done = Run()
    done.times.time(lambda: simulate(spec, SEED, path, done.mark))
    return done


def rows(done: Run, bare: BareParts, mars_s: float) -> list[Row]:
    """Compare a traverse with its bare parts, and with time on Mars.

    Args:
        done: The traverse.
        bare: Its parts.
        mars_s: How long it lasts on Mars.
    """
    whole, way = done.whole(mars_s), done.on_way()
    return [
        _row("pipeline, on the way", way, bare.sum(way.mars_s), _ON_WAY),
        _row("pipeline, whole traverse", whole, bare.sum(mars_s), _WHOLE),
        _factor("real-time factor, on the way", way, bare.sum(way.mars_s)),
        _factor("real-time factor, whole traverse", whole, bare.sum(mars_s)),
    ]


def _row(part: str, ours: Spent, bare: Spent, note: str) -> Row:
    cost, cpu_cost = ours.wall_s / bare.wall_s, ours.cpu_s / bare.cpu_s
    return Row(part, ours.wall_s, bare.wall_s, "s", cost, cpu_cost, "<= 1.15", note)


def _factor(part: str, ours: Spent, bare: Spent) -> Row:
    factors = [spent.mars_s / spent.wall_s for spent in (ours, bare)]
    return Row(part, *factors, "x", None, aim=">= 5", note=_FACTOR)
