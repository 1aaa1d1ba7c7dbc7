"""Two ways to do one thing, timed in turn so that whatever disturbs one disturbs the other."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, TypeVar

Item = TypeVar("Item")


@dataclass
class Samples:
    """Times of one thing done again and again.

    Attributes:
        wall_s: Time on the clock, one for each time.
        cpu_s: Time of the process on all cores, likewise.
    """

    wall_s: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)

    def time(self, work: Callable[[], Any]) -> Any:
        """Do something once, note how long it took, and give its result."""
        wall, cpu = time.perf_counter(), time.process_time()
        result = work()
        self.wall_s.append(time.perf_counter() - wall)
        self.cpu_s.append(time.process_time() - cpu)
        return result

    def shared_by(self, count: float) -> Samples:
        """Give the share of one of `count` things that were done each time."""
        return Samples([t / count for t in self.wall_s], [t / count for t in self.cpu_s])

    def after(self, warm_up: int) -> Samples:
        """Give all but the first few."""
        return Samples(self.wall_s[warm_up:], self.cpu_s[warm_up:])

    @property
    def median_s(self) -> float:
        """Median time on the clock [s]."""
        return statistics.median(self.wall_s)

    @property
    def mean_s(self) -> float:
        """Mean time on the clock [s]."""
        return statistics.fmean(self.wall_s)

    @property
    def median_cpu_s(self) -> float:
        """Median time of the process [s]."""
        return statistics.median(self.cpu_s)


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        part: What is measured.
        ours: LPET, in `unit`.
        bare: The library alone, in `unit`; None where it has nothing of the kind.
        unit: Unit of both.
        cost: LPET's time over the bare time; None where there is no bare time.
        cpu_cost: Likewise of processor time, which other work on the machine hardly changes.
        aim: What the cost (or the value itself) should be.
        note: What the two sides are, and where LPET does more.
    """

    part: str
    ours: float
    bare: float | None
    unit: str
    cost: float | None
    cpu_cost: float | None = None
    aim: str = "-"
    note: str = ""


def in_turn(
    items: Iterable[Item], *ways: Callable[[Item], Any], warm_up: int = 1
) -> tuple[Samples, ...]:
    """Time several ways to work on each item, one right after the other.

    Args:
        items: What is worked on.
        ways: What is timed, such as LPET's way and the library's.
        warm_up: Items at the beginning whose times are dropped: they compile and fill caches.

    Returns:
        The times of each way.
    """
    times = tuple(Samples() for _ in ways)
    for item in items:
        for samples, way in zip(times, ways, strict=True):
            samples.time(lambda way=way, item=item: way(item))  # type: ignore[misc]
    return tuple(samples.after(warm_up) for samples in times)


def compare_ms(part: str, ours: Samples, bare: Samples, aim: str = "-", note: str = "") -> Row:
    """Make a row of two medians in milliseconds."""
    return Row(
        part=part,
        ours=1e3 * ours.median_s,
        bare=1e3 * bare.median_s,
        unit="ms",
        cost=ours.median_s / bare.median_s,
        cpu_cost=ours.median_cpu_s / bare.median_cpu_s,
        aim=aim,
        note=note,
    )


def compare_steps(
    part: str, ours: Samples, bare: Samples, steps: float, aim: str = "-", note: str = ""
) -> Row:
    """Make a row of two rates, of samples of so many steps each."""
    return Row(
        part=part,
        ours=steps / ours.median_s,
        bare=steps / bare.median_s,
        unit="steps/s",
        cost=ours.median_s / bare.median_s,
        cpu_cost=ours.median_cpu_s / bare.median_cpu_s,
        aim=aim,
        note=note,
    )


def alone_ms(part: str, ours: Samples, note: str = "") -> Row:
    """Make a row of something that has no bare counterpart."""
    return Row(part, 1e3 * ours.median_s, None, "ms", None, note=note)


def tell(text: str) -> None:
    """Say on the error stream how far the benchmarks are."""
    print(text, file=sys.stderr, flush=True)
