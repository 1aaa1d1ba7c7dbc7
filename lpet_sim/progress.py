"""How long work tells how far it is, without knowing who listens."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Progress = Callable[[float], None]
"""Called with the fraction done, from 0 to 1."""

Count = Callable[[int, int, int], None]
"""Called with the things done, all things, and how many of those done failed."""

T = TypeVar("T")


def silent(fraction: float) -> None:
    """Listen to nothing."""
    del fraction


def uncounted(done: int, total: int, failed: int) -> None:
    """Count nothing."""
    del done, total, failed


def track(items: Iterable[T], total: int, progress: Progress) -> Iterator[T]:
    """Yield the items and report the fraction of `total` after each.

    Args:
        items: What to go through.
        total: How many items there are.
        progress: Called with the fraction done.
    """
    for count, item in enumerate(items, start=1):
        yield item
        progress(count / total)
