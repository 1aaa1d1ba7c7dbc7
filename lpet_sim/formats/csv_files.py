"""CSV files of a stamp and numbers in each row, exact to the bit and the nanosecond."""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats.rows import Layout, each_row, in_order, pack, unpack
from lpet_sim.recording.arrays import Array, ArrayStruct, Ints

Struct = TypeVar("Struct", bound=ArrayStruct)
_OWN = "lpet "
_LAYOUT = f"#{_OWN}"


def write_csv(path: Path, header: Sequence[str], stamps: Ints, values: Array) -> None:
    """Write a stamp and numbers in each row; numbers have as many digits as they need.

    Args:
        path: The file.
        header: Names of the columns, the stamp first; they follow a ``#``.
        stamps: Stamps [ns], Shape (n,).
        values: Shape (n, k).
    """
    _write_lines(path, [",".join(header)], _texts(stamps, values))


def read_csv(path: Path, columns: int, repeats: bool = False) -> tuple[Ints, Array]:
    """Read stamps, Shape (n,), and the first numbers of each row, Shape (n, columns).

    Args:
        path: The file.
        columns: How many numbers follow the stamp.
        repeats: Whether stamps may come again, so that their order is left to the caller.

    Raises:
        RecordingError: The file is missing, a row has too few numbers or no numbers, or times do
            not increase.
    """
    stamps, values = array("q"), array("d")
    for number, line in enumerate(_lines(path), start=1):
        if not line.startswith("#") and line.strip():
            stamp, row = _row(path, number, line, columns)
            stamps.append(stamp)
            values.extend(row)
    times = np.array(stamps, dtype=np.int64)
    return times if repeats else in_order(path, times), np.array(values).reshape(-1, columns)


def write_stream(path: Path, epoch_ns: int, struct: ArrayStruct) -> None:
    """Write a stream that has no format of others, with its layout in a second line."""
    layout, rows = pack(struct)
    header = [f"timestamp [ns],{','.join(layout.labels())}", _OWN + json.dumps(layout.json())]
    _write_lines(path, header, _texts(struct.t_ns + epoch_ns, rows))


def read_stream(path: Path, epoch_ns: int, kind: type[Struct]) -> Struct:
    """Read a stream written by `write_stream`.

    Raises:
        RecordingError: The file is missing, or not such a file.
    """
    head = next((line for line in _lines(path) if line.startswith(_LAYOUT)), None)
    if head is None:
        raise RecordingError(f"{path} has no line '{_LAYOUT}...'; give a file that LPET wrote")
    try:
        layout = Layout.from_json(json.loads(head.removeprefix(_LAYOUT)))
        stamps, rows = read_csv(path, sum(layout.sizes()))
        return unpack(kind, stamps - epoch_ns, layout, rows)
    except (ValueError, TypeError, KeyError, IndexError, AssertionError) as error:
        raise RecordingError(f"{path} has a layout that LPET does not know: {error}") from None


def write_names(path: Path, header: Sequence[str], stamps: Ints, names: Sequence[str]) -> None:
    """Write a stamp and a file's name in each row."""
    rows = zip(stamps.tolist(), names, strict=True)
    _write_lines(path, [",".join(header)], (f"{t},{name}" for t, name in rows))


def read_names(path: Path) -> dict[int, str]:
    """Read the names of files by their stamps.

    Raises:
        RecordingError: The file is missing, or a row is no stamp with a name.
    """
    found: dict[int, str] = {}
    for number, line in enumerate(_lines(path), start=1):
        if line.startswith("#") or not line.strip():
            continue
        stamp, _, name = line.strip().partition(",")
        if not stamp.strip().isdigit() or not name:
            raise RecordingError(f"{path}, line {number}: a stamp and a file's name are expected")
        found[int(stamp)] = name.strip()
    return found


def _texts(stamps: Ints, values: Array) -> Iterator[str]:
    return (f"{t},{','.join(map(repr, row))}" for t, row in each_row(stamps, values))


def _write_lines(path: Path, header: Sequence[str], rows: Iterable[str]) -> None:
    with path.open("w") as file:
        file.writelines(f"#{line}\n" for line in header)
        file.writelines(f"{row}\n" for row in rows)


def _lines(path: Path) -> Iterable[str]:
    try:
        with path.open() as file:
            yield from file
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"cannot read {path}: {error}; a CSV file is expected") from None


def _row(path: Path, number: int, line: str, columns: int) -> tuple[int, list[float]]:
    first, *rest = line.split(",")
    try:
        row = [float(text) for text in rest[:columns]]
        stamp = int(first)
    except ValueError as error:
        raise RecordingError(f"{path}, line {number}: {error}; numbers are expected") from None
    if len(row) < columns:
        raise RecordingError(
            f"{path}, line {number}: a stamp and {columns} numbers are expected, got {len(row)}"
        )
    return stamp, row
