"""A whole recording: manifest, measurements and truth."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.truth import Truth

SCHEMA_VERSION = 2


@dataclass(frozen=True)
class Manifest:
    """Where a recording comes from; the same manifest gives the same arrays to the bit.

    Attributes:
        source: ``simulation``, or the data set that was imported.
        seed: The run's seed, None for real data.
        specs: Every spec by name, as plain YAML-ready values.
        versions: Package versions by name.
        schema: Version of the recording's layout.
    """

    source: str
    seed: int | None = None
    specs: dict[str, Any] = field(default_factory=dict)
    versions: dict[str, str] = field(default_factory=dict)
    schema: int = SCHEMA_VERSION


@dataclass(frozen=True)
class Recording:
    """A recording as read back.

    Attributes:
        manifest: Where it comes from.
        measurements: What an estimator may know.
        truth: What really happened, None where nobody knows.
    """

    manifest: Manifest
    measurements: Measurements
    truth: Truth | None = None
