"""What a program that is not ours may use of the machine."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

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
            system's libraries: model weights, for example.
    """

    time_limit_s: Annotated[float, Field(gt=0.0)] = 3600.0
    memory_limit_mib: Annotated[int, Field(gt=0)] = 4096
    output_limit_mib: Annotated[int, Field(gt=0)] = 256
    readable: tuple[str, ...] = ()
