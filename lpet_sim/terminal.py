"""What commands show on a terminal: a progress bar, tables, and the files that they wrote."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import (
    BarColumn,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.progress import Progress as ProgressBar
from rich.table import Table

from lpet_sim.progress import Count, Progress

_FILE_WIDTH = 140


@contextmanager
def bar(title: str) -> Iterator[Progress]:
    """Show a progress bar on stderr while the block runs; none where stderr is no terminal."""
    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with ProgressBar(*columns, TimeElapsedColumn(), console=console, disable=hidden) as shown:
        task = shown.add_task(title, total=1.0)
        yield lambda fraction: shown.update(task, completed=fraction)


@contextmanager
def two_bars(first: str, second: str) -> Iterator[tuple[Progress, Count]]:
    """Show two bars on stderr while the block runs: a share, and things that are counted.

    Gives what is to be called with the fraction done of the first, and what is to be called with
    the things done, all things, and the failures among those done.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[said]}"))
    console = Console(stderr=True)
    hidden, times = not console.is_terminal, (TimeElapsedColumn(), TimeRemainingColumn())
    with ProgressBar(*columns, *times, console=console, disable=hidden) as shown:
        share = shown.add_task(first, total=1.0, said="")
        counted = shown.add_task(second, total=None, said="")

        def count(done: int, total: int, failed: int) -> None:
            said = f"{done}/{total}, {failed} failed"
            shown.update(counted, completed=done, total=total, said=said)

        yield lambda fraction: shown.update(share, completed=fraction), count


@contextmanager
def either_bar(title: str) -> Iterator[tuple[Progress, Count]]:
    """Show one bar on stderr while the block runs, for work that tells a share and then counts.

    Gives the same two as `two_bars`.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[said]}"))
    console = Console(stderr=True)
    hidden = not console.is_terminal
    with ProgressBar(*columns, TimeElapsedColumn(), console=console, disable=hidden) as shown:
        task = shown.add_task(title, total=1.0, said="")

        def share(fraction: float) -> None:
            shown.update(task, completed=fraction, total=1.0, said=f"{fraction:.0%}")

        def count(done: int, total: int, failed: int) -> None:
            said = f"{done}/{total}, {failed} failed"
            shown.update(task, completed=done, total=total, said=said)

        yield share, count


def show_prints() -> None:
    """Show on stderr what estimators that are not ours print, once each has ended."""
    logging.getLogger("lpet_sim.plugins").setLevel(logging.INFO)


def print_tables(tables: Iterable[Table]) -> None:
    """Print tables, wide enough to be whole where no terminal sets the width."""
    console = Console()
    if not console.is_terminal:
        console.width = _FILE_WIDTH
    for table in tables:
        console.print(table)


def say(text: str) -> None:
    """Print one line of plain text, however long."""
    Console(soft_wrap=True, highlight=False).print(text, markup=False)


def wrote(*paths: Path) -> None:
    """Name the files that were written."""
    for path in paths:
        say(f"wrote {path}")
