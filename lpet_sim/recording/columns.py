"""Streams taken apart into columns, and put together again to the bit.

A column is what one entity of the store holds over time: a flat array of values with offsets, row i
being ``values[offsets[i]:offsets[i + 1]]`` of Shape (k, *tail), where k is 1 in a regular column
and any number in a ragged one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import ArrayStruct, Ints

Struct = TypeVar("Struct", bound=ArrayStruct)


@dataclass(frozen=True, eq=False)
class Column:
    """Values over time.

    Attributes:
        t_ns: Times since the start [ns], Shape (n,).
        values: All values, Shape (m, *tail); m is n in a regular column.
        offsets: Row offsets into ``values``, Shape (n + 1,), None in a regular column.
    """

    t_ns: Ints
    values: NDArray[Any]
    offsets: Ints | None = None

    @property
    def tail(self) -> tuple[int, ...]:
        """The shape of one value."""
        return self.values.shape[1:]

    def row_offsets(self) -> Ints:
        """Give offsets into the flattened values, Shape (n + 1,)."""
        size = int(np.prod(self.tail, dtype=np.int64))
        rows = np.arange(len(self.t_ns) + 1) if self.offsets is None else self.offsets
        return np.asarray(rows * size, dtype=np.int64)


def take_apart(struct: ArrayStruct) -> Iterator[tuple[str, Column]]:
    """Give the columns of a stream with their names, such as ``T_world_body/rotation``."""
    ragged = struct.ragged_fields()
    offsets = getattr(struct, "offsets", None)
    for field in fields(struct):  # type: ignore[arg-type]
        value = getattr(struct, field.name)
        if isinstance(value, SE3):
            yield f"{field.name}/rotation", Column(struct.t_ns, value.rotation)
            yield f"{field.name}/translation", Column(struct.t_ns, value.translation)
        elif isinstance(value, np.ndarray) and field.name not in ("t_ns", "offsets"):
            rows = offsets if field.name in ragged else None
            yield field.name, Column(struct.t_ns, value, rows)


def put_together(kind: type[Struct], prefix: str, columns: Mapping[str, Column]) -> Struct | None:
    """Make a stream from the columns under a prefix; those with a default may be absent.

    Returns:
        The stream, None where there is none.
    """
    held = {
        name[len(prefix) + 1 :]: column
        for name, column in columns.items()
        if name.startswith(f"{prefix}/")
    }
    if not held:
        return None
    needed = [
        field.name
        for field in fields(kind)  # type: ignore[arg-type]
        if field.default_factory is MISSING or field.name in held
    ]
    return kind(**{name: _field(name, held) for name in needed})


def _field(name: str, held: Mapping[str, Column]) -> NDArray[Any] | SE3:
    first = next(iter(held.values()))
    if name == "t_ns":
        return first.t_ns
    if name == "offsets":
        return next(c.offsets for c in held.values() if c.offsets is not None)
    if f"{name}/rotation" in held:
        return SE3(held[f"{name}/rotation"].values, held[f"{name}/translation"].values)
    return held[name].values
