"""The rows of a sweep on disk: added as runs end, read back after a kill, put into one table.

Every attempt at a job writes a file of its own, one line of JSON for each event: a run starts, a
run's row, a bound. A line is flushed to the disk before the next run starts, and what a kill leaves
of a line is passed over, so that nothing but the run under way is lost.
"""

from __future__ import annotations

import json
import os
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import pyarrow as pa
import pyarrow.parquet as pq

from lpet_sim.failures import EXCEPTION, FAULTS, TIMEOUT
from lpet_sim.outputs import whole_file

TIMING: Final = ("time_total_s", "time_per_image_ms", "cold", "worker", "started_at")
"""Columns in which two runs of the same sweep may differ."""

Row = dict[str, Any]


@dataclass(frozen=True)
class Redo:
    """Which runs are run again although there is a row of them.

    Attributes:
        time_limit_s: A timeout counts only under the limit that now holds [s].
        failed_before: Runs that ended in an exception or a timeout and were started before this
            time are run again (ISO format); empty: none.
    """

    time_limit_s: float | None = None
    failed_before: str = ""

    def __contains__(self, row: Row) -> bool:
        """Tell whether a row's run is run again."""
        if row["failure"] == TIMEOUT and row["time_limit_s"] != self.time_limit_s:
            return True
        again = row["failure"] in {TIMEOUT, EXCEPTION, *FAULTS}
        return bool(again and row["started_at"] < self.failed_before)


class Journal:
    """The file of one attempt at a job, as a context manager."""

    def __init__(self, folder: Path, job: str) -> None:
        """Name the file; it is made with its first line.

        Args:
            folder: Where the rows of the sweep are kept.
            job: The job's key.
        """
        self._path = folder / f"{job}-{uuid.uuid4().hex[:12]}.jsonl"
        self._descriptor: int | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._descriptor is not None:
            os.close(self._descriptor)

    def start(self, key: str, driver: str) -> None:
        """Note that a run starts, on behalf of one call of the sweep."""
        self._write({"start": key, "driver": driver})

    def row(self, row: Row) -> None:
        """Add the row of a run."""
        self._write({"row": row})

    def bound(self, key: str, bound: Mapping[str, Any]) -> None:
        """Add the bound of a job."""
        self._write({"bound": key, **bound})

    def _write(self, event: Mapping[str, Any]) -> None:
        if self._descriptor is None:
            flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND
            self._descriptor = os.open(self._path, flags, 0o644)
        os.write(self._descriptor, json.dumps(event).encode() + b"\n")
        os.fsync(self._descriptor)


@dataclass
class RowStore:
    """What the journals of a sweep hold; `refresh` reads what was added since.

    Attributes:
        folder: Where the journals are.
        rows: Rows by the key of their run; of two rows of one run the one started last.
        bounds: Bounds by the key of their job.
        starts: How often each run was started, by (driver, key of the run).
    """

    folder: Path
    rows: dict[str, Row] = field(default_factory=dict)
    bounds: dict[str, dict[str, Any]] = field(default_factory=dict)
    starts: dict[tuple[str, str], int] = field(default_factory=dict)
    _read: dict[str, int] = field(default_factory=dict)

    def refresh(self, job: str = "") -> Self:
        """Read what was added to the journals, or to those of one job."""
        for path in sorted(self.folder.glob(f"{job}*.jsonl")):
            for event in self._events(path):
                self._take(event)
        return self

    def missing(self, keys: Sequence[str], redo: Redo) -> list[str]:
        """Give those keys of which there is no row, or one of a run to be run again; each once."""
        absent = (k for k in keys if k not in self.rows or self.rows[k] in redo)
        return list(dict.fromkeys(absent))

    def _events(self, path: Path) -> Iterator[dict[str, Any]]:
        """Give the whole lines that were added to a file; the last one may be torn."""
        begin = self._read.get(path.name, 0)
        if path.stat().st_size <= begin:
            return
        with path.open("rb") as file:
            file.seek(begin)
            whole = file.read().rpartition(b"\n")
        self._read[path.name] = begin + len(whole[0]) + len(whole[1])
        yield from (json.loads(line) for line in whole[0].splitlines())

    def _take(self, event: dict[str, Any]) -> None:
        if "start" in event:
            mark = event["driver"], event["start"]
            self.starts[mark] = self.starts.get(mark, 0) + 1
        elif "bound" in event:
            self.bounds[event["bound"]] = event
        else:
            row = event["row"]
            held = self.rows.get(row["key"])
            if held is None or held["started_at"] <= row["started_at"]:
                self.rows[row["key"]] = row


def write_table(path: Path, rows: Sequence[Row], about: Mapping[str, Any]) -> None:
    """Write rows as one Parquet file, whole or not at all.

    Args:
        path: The file.
        rows: Rows in their order, all of the same columns.
        about: What the file says of itself; each value becomes JSON under its name.

    Raises:
        OutputError: The file cannot be written.
    """
    table = pa.table({name: _column(name, rows) for name in (rows[0] if rows else {})})
    said = {f"lpet.{name}": json.dumps(value) for name, value in about.items()}
    with whole_file(path) as temporary:
        pq.write_table(table.replace_schema_metadata(said), temporary)


def read_table(path: Path) -> tuple[list[Row], dict[str, Any]]:
    """Read the rows of a sweep, and what the file says of itself."""
    table = pq.read_table(path)
    said = table.schema.metadata or {}
    about = {k.decode().removeprefix("lpet."): json.loads(v) for k, v in said.items()}
    return table.to_pylist(), about


def _column(name: str, rows: Sequence[Row]) -> pa.Array:
    """Make a column; lists and whole numbers keep their kind even where a value is missing."""
    values = [row[name] for row in rows]
    known = next((value for value in values if value is not None), None)
    kinds = {bool: pa.bool_(), int: pa.int64(), float: pa.float64(), list: pa.list_(pa.float64())}
    kind = kinds.get(type(known), pa.string())
    if known is None or any(isinstance(value, float) for value in values):
        kind = pa.float64()
    return pa.array(values, type=kind)
