"""A table apart from its medium: on a terminal, on a page, and as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Literal

from rich.table import Table
from rich.text import Text

from lpet_sim.evaluation.statistics import Interval

Tone = Literal["", "good", "bad", "warn"]
_RICH: dict[Tone, str] = {"": "", "good": "green", "bad": "red", "warn": "yellow"}
_NONE = "–"
ENDS = ("", "low", "high")
"""Parts of a column of values with their intervals."""


@dataclass(frozen=True)
class Heading:
    """A column's heading.

    Attributes:
        text: What stands above the column, with its unit.
        parts: Names of the values in each cell, of which CSV makes a column each.
        words: Whether the cells hold words, which stand on the left.
        page_only: Whether a terminal, which is narrow, leaves the column out.
    """

    text: str
    parts: tuple[str, ...] = ("",)
    words: bool = False
    page_only: bool = False


@dataclass(frozen=True)
class Cell:
    """What stands in a cell.

    Attributes:
        text: As it is read.
        values: The same in full precision, one for each part; the first one sorts.
        tone: Whether it is good or bad news.
    """

    text: str
    values: tuple[float | str, ...]
    tone: Tone = ""


@dataclass(frozen=True)
class Sheet:
    """A table.

    Attributes:
        key: Name for files and links.
        title: Title.
        note: What the columns mean, in a sentence or two.
        headings: One for each column.
        rows: Cells, one for each heading.
    """

    key: str
    title: str
    note: str
    headings: tuple[Heading, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def to_csv(self) -> str:
        """Write the table as CSV in full precision, with a column for each part."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        names = [f"{h.text} {part}".strip() for h in self.headings for part in h.parts]
        writer.writerow(names)
        for row in self.rows:
            writer.writerow([value for cell in row for value in cell.values])
        return out.getvalue()

    def to_table(self) -> Table:
        """Make the table for a terminal."""
        caption = Text(self.note, justify="left") if self.note else None
        table = Table(title=Text(self.title), caption=caption)
        on_terminal = [not heading.page_only for heading in self.headings]
        for heading in compress(self.headings, on_terminal):
            justify: Literal["left", "right"] = "left" if heading.words else "right"
            # A label that is cut off names no variant.
            table.add_column(Text(heading.text), justify=justify, no_wrap=heading.words)
        for row in self.rows:
            cells = compress(row, on_terminal)
            table.add_row(*(Text(cell.text, style=_RICH[cell.tone]) for cell in cells))
        return table


def words(text: str, tone: Tone = "") -> Cell:
    """Make a cell of words."""
    return Cell(text, (text,), tone)


def number(value: float, form: str = "#.3g", tone: Tone = "") -> Cell:
    """Make a cell of a number; a dash where there is none."""
    return Cell(shown(value, form), (value,), tone)


def interval(given: Interval, form: str = "#.3g", tone: Tone = "", scale: float = 1.0) -> Cell:
    """Make a cell of a value with its interval where it has one, both times a scale."""
    values = (scale * given.value, scale * given.low, scale * given.high)
    value, low, high = (shown(x, form) for x in values)
    if math.isnan(given.value):
        return Cell(_NONE, values, tone)
    if math.isnan(given.low):
        return Cell(value, values, tone)
    # A narrow table breaks the line before the interval, not within.
    return Cell(f"{value} [{low},\u00a0{high}]", values, tone)


def no_value(parts: int = 1) -> Cell:
    """Make a cell where nothing is known."""
    return Cell(_NONE, (math.nan,) * parts)


def shown(value: float, form: str) -> str:
    """Write a number; a dash for none, and the sign of infinity."""
    if math.isnan(value):
        return _NONE
    if math.isinf(value):
        return "∞" if value > 0 else "-∞"
    return format(value, form).rstrip(".")


def heads(
    *texts: str, words_first: int = 0, parts: Sequence[str] = ("",), page_only: bool = False
) -> tuple[Heading, ...]:
    """Make headings of one kind, of which the first hold words."""
    return tuple(
        Heading(text, ("",) if k < words_first else tuple(parts), k < words_first, page_only)
        for k, text in enumerate(texts)
    )
