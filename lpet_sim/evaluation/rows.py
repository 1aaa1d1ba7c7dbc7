"""Rows of a sweep: one for each run of an estimator on a recording, read from a Parquet file."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from lpet_sim.errors import RowsError
from lpet_sim.recording.arrays import Array

Column = NDArray[Any]
REQUIRED = ("run", "data_set", "arm", "variant", "failure", "end_percent", "passed")
"""Columns without which a table says nothing about runs."""
CURVE = "error_curve"
ORDER = "variant_order"
"""Column of the place of a variant in the spec of its sweep."""
IDEAL = "ideal"
"""The arm that tables and figures show first."""
_ARROW_KEYS = ("ARROW:schema", "pandas")


@dataclass(frozen=True, eq=False)
class Rows:
    """A table of runs, by column.

    Attributes:
        columns: Arrays of one length by name: text, flags, numbers (NaN where none is known), and
            lists of numbers of one length, Shape (runs, k).
        metadata: What the file says about itself: how the rows were made.
    """

    columns: Mapping[str, Column]
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> Column:
        if name not in self.columns:
            raise RowsError(
                f"the rows have no column '{name}'; they have {', '.join(self.columns)}"
            )
        return self.columns[name]

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Which runs failed, of whatever kind, Shape (runs,)."""
        return np.asarray(self["failure"] != "")

    def numbers(self, name: str) -> Array:
        """Give a column of numbers; NaN throughout where the rows lack it, Shape (runs,)."""
        return self.columns[name] if name in self else np.full(len(self), np.nan)

    def texts(self, name: str) -> Column:
        """Give a column of text; empty throughout where the rows lack it, Shape (runs,)."""
        return self.columns[name] if name in self else np.full(len(self), "", dtype=object)

    def errors(self, name: str) -> Array:
        """Give the size of an error, infinite where the run failed or has none, Shape (runs,)."""
        size = np.abs(self.numbers(name))
        return np.where(self.failed | np.isnan(size), np.inf, size)

    def times(self, name: str) -> Array:
        """Give a column of times, NaN for the cold runs unless all are cold, Shape (runs,).

        A cold run is the first of its estimator in a process, which also compiles and loads.
        """
        cold = self["cold"] if "cold" in self else np.zeros(len(self), dtype=bool)
        return np.where(cold & ~cold.all(), np.nan, self.numbers(name))

    def where(self, mask: Column) -> Rows:
        """Give the rows that a mask or indices choose."""
        chosen = {name: column[mask] for name, column in self.columns.items()}
        return replace(self, columns=chosen)

    def select(self, **equal: object) -> Rows:
        """Give the rows whose columns equal the values named, such as ``arm="ideal"``."""
        mask = np.ones(len(self), dtype=bool)
        for name, value in equal.items():
            mask &= self[name] == value
        return self.where(mask)

    def with_columns(self, **columns: Column) -> Rows:
        """Give the rows with columns added or replaced."""
        return replace(self, columns={**self.columns, **columns})

    def groups(self, *names: str) -> Iterator[tuple[tuple[Any, ...], Rows]]:
        """Give the rows of each combination of values, by the values, in order as `values`."""
        keys = list(zip(*(self[name].tolist() for name in names), strict=True))
        places = [{value: k for k, value in enumerate(self.values(name))} for name in names]
        ordered = sorted(
            set(keys), key=lambda key: [place[v] for place, v in zip(places, key, strict=True)]
        )
        for key in ordered:
            yield key, self.where(np.array([other == key for other in keys], dtype=bool))

    def values(self, name: str) -> list[Any]:
        """Give the different values of a column in natural order: m2 comes before m10.

        The ideal arm comes first, and variants in the order in which their sweep names them.
        """
        found = sorted(set(self[name].tolist()), key=_natural)
        if name != "variant" or ORDER not in self:
            return found
        place = dict(zip(self[name].tolist(), self[ORDER].tolist(), strict=True))
        return sorted(found, key=lambda value: place[value])


def read_rows(path: Path) -> Rows:
    """Read the rows of a sweep.

    Args:
        path: The Parquet file.

    Raises:
        RowsError: The file is missing, is no Parquet file, or holds no rows of runs.
    """
    if not Path(path).exists():
        raise RowsError(f"there is no {path}; give the Parquet file that lpet sweep wrote")
    try:
        table = pq.read_table(path)
    except (OSError, pa.ArrowInvalid) as error:
        reason = str(error).splitlines()[0]
        raise RowsError(
            f"cannot read {path}: {reason}; give the Parquet file that lpet sweep wrote"
        ) from None
    return rows_of(table, str(path))


def rows_of(table: pa.Table, source: str = "the table") -> Rows:
    """Check a table and take its columns over.

    Args:
        table: One row for each run, with at least the columns of `REQUIRED`.
        source: What to call it in an error.

    Raises:
        RowsError: A required column is missing, there is no row, or a run stands there twice.
    """
    missing = [name for name in REQUIRED if name not in table.column_names]
    if missing:
        raise RowsError(
            f"{source} holds no rows of runs: it lacks the columns {', '.join(missing)}; "
            "give the Parquet file that lpet sweep wrote"
        )
    if not table.num_rows:
        raise RowsError(f"{source} holds no run; let lpet sweep finish at least one")
    metadata = table.schema.metadata or {}
    known = {key.decode(): value.decode(errors="replace") for key, value in metadata.items()}
    columns = {name: _column(table[name]) for name in table.column_names}
    rows = Rows(columns, {key: text for key, text in known.items() if key not in _ARROW_KEYS})
    _refuse_twins(rows, source)
    return rows


def _refuse_twins(rows: Rows, source: str) -> None:
    """Refuse a run that is told twice: it would count twice."""
    keys = zip(*(rows.texts(name).tolist() for name in ("arm", "variant", "run")), strict=True)
    twice = [run for (_, _, run), count in Counter(keys).items() if count > 1]
    if twice:
        raise RowsError(f"{source} holds the run {twice[0]} twice; every run must stand there once")


def _column(column: pa.ChunkedArray) -> Column:
    kind = column.type
    if pa.types.is_boolean(kind):
        return np.array([bool(flag) for flag in column.to_pylist()], dtype=bool)
    if pa.types.is_integer(kind) or pa.types.is_floating(kind):
        return np.asarray(column.cast(pa.float64()).to_numpy(), dtype=float)
    if pa.types.is_list(kind) or pa.types.is_large_list(kind) or pa.types.is_fixed_size_list(kind):
        return _matrix(column.to_pylist())
    texts = ["" if value is None else str(value) for value in column.to_pylist()]
    return np.array(texts, dtype=object)


def _matrix(lists: Sequence[Sequence[float] | None]) -> Array:
    """Stack lists of numbers, filled up with NaN where one is shorter or missing."""
    out = np.full((len(lists), max((len(x) for x in lists if x), default=0)), np.nan)
    for row, numbers in zip(out, lists, strict=True):
        known = [np.nan if x is None else x for x in numbers or ()]
        row[: len(known)] = known
    return out


def _natural(value: object) -> list[tuple[int, float, str]]:
    """Make a key that sorts the numbers within text by their value, and the ideal arm first."""
    if value == IDEAL:
        return [(-1, 0.0, "")]
    parts = re.split(r"(\d+)", str(value))
    return [(0, float(p), "") if p.isdigit() else (1, 0.0, p) for p in parts]
