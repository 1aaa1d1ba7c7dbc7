"""Where a recording of somebody else's data begins: where its truth tells the pose."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from lpet_sim.errors import RecordingError
from lpet_sim.recording.arrays import ArrayStruct, Ints
from lpet_sim.recording.calibration import PoseSpec
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth

Struct = TypeVar("Struct", bound=ArrayStruct)


class Timed(Protocol):
    """A stream with stamps."""

    @property
    def t_ns(self) -> Ints:
        """Stamps [ns], Shape (n,)."""
        ...


def first_stamp(source: Path, streams: Iterable[Timed | None], body: BodyTruth | None) -> int:
    """Find the stamp at which a recording begins [ns].

    Args:
        source: Whose data it is, for the sentence where there is none.
        streams: Streams; the first that is there begins the recording, such as images.
        body: The truth, before whose beginning nothing is taken over.

    Raises:
        RecordingError: There is no stream, or all of it lies before the truth.
    """
    for stream in (*streams, body):
        if stream is not None:
            after = stream.t_ns if body is None else stream.t_ns[stream.t_ns >= body.t_ns[0]]
            if not len(after):
                raise RecordingError(f"{source}: all measurements lie before the truth begins")
            return int(after[0])
    raise RecordingError(f"{source} holds neither images nor readings nor a truth")


def counted_from(stream: Struct, start_ns: int) -> Struct:
    """Leave out the rows before a stamp, and count from it."""
    rows = stream.t_ns >= start_ns
    kept: dict[str, Any] = {
        field.name: getattr(stream, field.name)[rows]
        for field in fields(stream)  # type: ignore[arg-type]
    }
    kept["t_ns"] = stream.t_ns[rows] - start_ns
    return replace(stream, **kept)  # type: ignore[type-var]


def pose_at(body: BodyTruth | None, stamp_ns: int) -> PoseSpec:
    """Give the true pose at a stamp; where there is no truth, the world is the first body."""
    if body is None:
        return PoseSpec()
    return PoseSpec.from_se3(Trajectory(body.t_ns, body.T_world_body).at([stamp_ns])[0])
