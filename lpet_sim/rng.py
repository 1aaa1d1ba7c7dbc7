"""Random generators by name: adding a sensor never shifts another's noise."""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, *names: str | int) -> np.random.Generator:
    """Make the generator that belongs to a seed and a path of names.

    The 128-bit key is the head of SHA-256 over the seed and the names, so streams are independent
    of each other, of the order in which they are made and of the number of workers.

    Args:
        seed: The run's seed, any integer.
        *names: What the numbers are for, as in ``stream(7, "traverse", 3, "imu")``.

    Returns:
        A PCG64 generator; equal arguments give equal sequences.
    """
    key = "\x1f".join([str(int(seed)), *(str(name) for name in names)]).encode()
    digest = hashlib.sha256(key).digest()
    return np.random.Generator(np.random.PCG64(int.from_bytes(digest[:16], "little")))
