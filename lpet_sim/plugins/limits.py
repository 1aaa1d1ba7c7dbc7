"""What a program that is not ours may use of the machine."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator

from lpet_sim.spec import Spec

MIB = 1 << 20


class LimitSpec(Spec):
    """Limits of one run. All are choices.

    Attributes:
        time_limit_s: A run that takes longer ends as ``timeout`` [s].
        memory_limit_mib: One whose processes hold more memory ends as ``memory_limit`` [MiB].
        output_limit_mib: One that writes a larger file, or more in all, ends as ``output_limit``
            [MiB].
        readable: Files and folders that it may read beside its measurements, its own code and the
            system's libraries: model weights, for example. They are looked for from the folder
            where LPET is started.
        readable_state: Digest of their sizes and times, filled in: rows of a sweep hang on it.
    """

    time_limit_s: Annotated[float, Field(gt=0.0)] = 3600.0
    memory_limit_mib: Annotated[int, Field(gt=0)] = 4096
    output_limit_mib: Annotated[int, Field(gt=0)] = 256
    readable: tuple[str, ...] = ()
    readable_state: str = ""

    @field_validator("readable")
    @classmethod
    def _are_there(cls, readable: tuple[str, ...]) -> tuple[str, ...]:
        """Write the paths out in full; a program runs in a folder of its own."""
        paths = [Path(path).expanduser().absolute() for path in readable]
        for path in paths:
            if not path.exists():
                raise ValueError(f"there is no {path}; give files and folders that are there")
        return tuple(map(str, paths))

    @model_validator(mode="after")
    def _name_state(self) -> Self:
        """Fill in the digest; a frozen spec is made once."""
        if self.readable and not self.readable_state:
            object.__setattr__(self, "readable_state", _state_of(map(Path, self.readable)))
        return self


def _state_of(places: Iterable[Path]) -> str:
    """Name files, and all in folders, by path, size and time."""
    files = [file for place in places for file in (sorted(place.rglob("*")) or [place])]
    stamps = [(str(file), file.stat().st_size, file.stat().st_mtime_ns) for file in files]
    return hashlib.sha256(repr(stamps).encode()).hexdigest()[:16]
