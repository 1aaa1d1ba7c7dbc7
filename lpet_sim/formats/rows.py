"""Streams of a recording as plain rows of numbers, with a layout that tells them apart again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import RecordingError, TimesError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, ArrayStruct, Ints
from lpet_sim.recording.columns import Column, put_together, take_apart

Struct = TypeVar("Struct", bound=ArrayStruct)
_ROWS_AT_ONCE = 4096


@dataclass(frozen=True)
class Layout:
    """What the numbers of a row are.

    Attributes:
        names: Names of the columns of a stream, such as ``drive_angle_rad``.
        dtypes: Their types; each must fit into a double.
        shapes: The shape of each in one row.
    """

    names: tuple[str, ...]
    dtypes: tuple[str, ...]
    shapes: tuple[tuple[int, ...], ...]

    @classmethod
    def from_json(cls, rows: Sequence[Sequence[Any]]) -> Self:
        """Read the layout from what `json` gives."""
        names, dtypes, shapes = ([row[k] for row in rows] for k in range(3))
        return cls(tuple(names), tuple(dtypes), tuple(tuple(shape) for shape in shapes))

    def json(self) -> list[list[Any]]:
        """Give name, type and shape of each column."""
        return [list(row) for row in zip(self.names, self.dtypes, self.shapes, strict=True)]

    def sizes(self) -> list[int]:
        """Give how many numbers each column has in a row."""
        return [int(np.prod(shape, dtype=np.int64)) for shape in self.shapes]

    def labels(self) -> list[str]:
        """Name every number of a row."""
        pairs = zip(self.names, self.sizes(), strict=True)
        return [f"{name}_{k}" if size > 1 else name for name, size in pairs for k in range(size)]


def each_row(*arrays: NDArray[Any]) -> Iterator[tuple[Any, ...]]:
    """Give the rows of arrays of equal length as plain values, few of them in memory at once."""
    for start in range(0, len(arrays[0]), _ROWS_AT_ONCE):
        pieces = (array[start : start + _ROWS_AT_ONCE].tolist() for array in arrays)
        yield from zip(*pieces, strict=True)


def in_order(path: Path, stamps: Ints) -> Ints:
    """Give the stamps of a file's rows as they are, if each comes after the one before.

    Args:
        path: The file, for the message.
        stamps: Stamps [ns], Shape (n,).

    Raises:
        TimesError: They do not increase.
    """
    late = np.flatnonzero(np.diff(stamps) <= 0)
    if late.size:
        row = int(late[0]) + 1
        raise TimesError(
            f"{path}, row {row + 1} of numbers: times must increase strictly, and "
            f"{stamps[row]} ns does not come after {stamps[row - 1]} ns"
        )
    return stamps


def poses_of(source: object, q_wxyz: Array, position_m: Array) -> SE3:
    """Make poses of rows.

    Args:
        source: What the rows are from, for the message.
        q_wxyz: Quaternions of any length but zero, Shape (n, 4).
        position_m: Shape (n, 3).

    Raises:
        RecordingError: A quaternion is zero, or a number is not finite.
    """
    sound = np.isfinite(np.concatenate([q_wxyz, position_m], axis=1)).all(axis=1)
    bad = np.flatnonzero(~(sound & (np.linalg.norm(q_wxyz, axis=1) > 0)))
    if bad.size:
        raise RecordingError(
            f"{source}: pose {bad[0] + 1} has a quaternion of zeros, or a number that is not "
            "finite; leave out what is not known"
        )
    return SE3.from_quat_wxyz(q_wxyz, position_m)


def pack(struct: ArrayStruct) -> tuple[Layout, Array]:
    """Lay a stream out as rows of doubles.

    Args:
        struct: A stream that is not ragged.

    Returns:
        The layout, and one row for each time, Shape (n, k).
    """
    columns = dict(take_apart(struct))
    layout = Layout(
        tuple(columns),
        tuple(column.values.dtype.name for column in columns.values()),
        tuple(column.tail for column in columns.values()),
    )
    parts = [column.values.reshape(len(struct), -1) for column in columns.values()]
    return layout, np.concatenate([part.astype(float) for part in parts], axis=1)


def unpack(kind: type[Struct], t_ns: Ints, layout: Layout, rows: Array) -> Struct:
    """Make a stream from rows, the inverse of `pack`.

    Args:
        kind: Type of the stream.
        t_ns: Times since the start [ns], Shape (n,).
        layout: What the numbers are.
        rows: Shape (n, k).
    """
    ends = np.cumsum(layout.sizes())[:-1]
    columns: dict[str, Column] = {}
    for name, dtype, shape, part in zip(
        layout.names, layout.dtypes, layout.shapes, np.split(rows, ends, axis=1), strict=True
    ):
        columns[f"/{name}"] = Column(t_ns, _shaped(part, dtype, shape))
    made = put_together(kind, "", columns)
    assert made is not None
    return made


def _shaped(part: Array, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
    return np.ascontiguousarray(part).reshape(len(part), *shape).astype(dtype)
