"""Time stamps outside a recording: nanoseconds and seconds that convert into each other exactly.

A recording counts nanoseconds from its start; what is exported counts from `EPOCH_NS` before it.
"""

from __future__ import annotations

import re

from lpet_sim.errors import RecordingError
from lpet_sim.recording.arrays import NS_PER_S

EPOCH_NS = 1_000_000 * NS_PER_S
"""The stamp of a recording's start in every export [ns].

It is not zero, which ROS reads as *no time*; all stamps of the first 104 days have 16 digits, so
that file names sort; and seconds in a double keep the nanosecond, which they lose at today's date.
"""

_SECONDS = re.compile(r"([+-]?)(\d*)(?:\.(\d*))?(?:[eE]([+-]?\d+))?")
_DIGITS = 9


def seconds_text(stamp_ns: int) -> str:
    """Write a stamp that is not negative in seconds with nine decimals, without rounding."""
    return f"{stamp_ns // NS_PER_S}.{stamp_ns % NS_PER_S:0{_DIGITS}d}"


def stamp_of_text(text: str) -> int:
    """Read seconds to the nearest nanosecond, however many digits they have.

    Raises:
        RecordingError: The text is no number.
    """
    found = _SECONDS.fullmatch(text.strip())
    if found is None or not (found[2] or found[3]):
        raise RecordingError(
            f"'{text}' is no time; seconds are expected, as in 1403636579.763555584"
        )
    sign, whole, part, power = found[1], found[2] or "", found[3] or "", int(found[4] or 0)
    shift = _DIGITS + power - len(part)
    digits = int(whole + part or "0")
    stamp = digits * 10**shift if shift >= 0 else (2 * digits + 10**-shift) // (2 * 10**-shift)
    return -stamp if sign == "-" else stamp
