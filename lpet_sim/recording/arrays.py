"""Base of the struct-of-arrays streams: read-only arrays, checked once when they are made."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import LengthsError, TimesError
from lpet_sim.geometry import SE3

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

NS_PER_S = 1_000_000_000


class ArrayStruct:
    """A frozen dataclass whose arrays (and `SE3` stacks) share their first axis with ``t_ns``."""

    t_ns: Ints

    def __post_init__(self) -> None:
        """Make every array read-only and hold them all to the length of ``t_ns``.

        Raises:
            LengthsError: Lengths differ.
            TimesError: The times do not increase.
        """
        for field in fields(self):  # type: ignore[arg-type]
            value = getattr(self, field.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            if isinstance(value, np.ndarray | SE3) and field.name not in self.ragged_fields():
                self._check_length(field.name, len(value))
        if np.any(np.diff(self.t_ns) <= 0):
            raise TimesError(f"{type(self).__name__}: times must increase strictly")

    @classmethod
    def ragged_fields(cls) -> frozenset[str]:
        """Name the arrays whose length is not that of ``t_ns``."""
        return frozenset()

    def _check_length(self, name: str, length: int) -> None:
        if length != len(self.t_ns):
            raise LengthsError(
                f"{type(self).__name__}.{name} has {length} rows but t_ns has {len(self.t_ns)}: "
                "they must be equal"
            )

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def t_s(self) -> Array:
        """Times since the start [s], Shape (n,)."""
        return np.asarray(self.t_ns) / NS_PER_S

    def equals(self, other: Self) -> bool:
        """Tell whether both hold the same arrays to the bit."""
        mine, theirs = _leaves(self), _leaves(other)
        return mine.keys() == theirs.keys() and all(
            a.dtype == theirs[k].dtype
            and a.shape == theirs[k].shape
            and a.tobytes() == theirs[k].tobytes()
            for k, a in mine.items()
        )


def _leaves(struct: Any) -> dict[str, NDArray[Any]]:
    out: dict[str, NDArray[Any]] = {}
    for field in fields(struct):
        value = getattr(struct, field.name)
        if isinstance(value, SE3):
            out[f"{field.name}.rotation"] = value.rotation
            out[f"{field.name}.translation"] = value.translation
        elif isinstance(value, np.ndarray):
            out[field.name] = value
    return out
