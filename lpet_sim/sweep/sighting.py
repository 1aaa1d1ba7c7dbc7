"""Run the vision front end over the images of a recording."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.outputs import output_folder
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.overlay import add_sightings
from lpet_sim.recording.reader import read_measurements
from lpet_sim.recording.streams import SightingStream
from lpet_sim.vision.front_end import sight
from lpet_sim.vision.spec import FrontEndSpec


@dataclass(frozen=True)
class SightingSummary:
    """What a front end saw in a recording.

    Attributes:
        images: Image pairs.
        landmarks: Different landmarks.
        sightings_mean: Mean number of sightings of a pair.
        sightings_min: Least number of sightings of a pair.
        track_length_mean: Mean number of sightings of a landmark.
    """

    images: int
    landmarks: int
    sightings_mean: float
    sightings_min: int
    track_length_mean: float

    def __str__(self) -> str:
        return (
            f"{self.images} image pairs, {self.sightings_mean:.0f} sightings a pair "
            f"(at least {self.sightings_min}), {self.landmarks} landmarks seen "
            f"{self.track_length_mean:.1f} times each"
        )


def sight_recording(
    path: Path, path_out: Path, spec: FrontEndSpec, progress: Progress = silent
) -> SightingSummary:
    """Find and track landmarks in a recording's images, and lay the sightings over it.

    Args:
        path: The recording, simulated or imported.
        path_out: Where the result goes; it may be the recording itself.
        spec: Parameters of the front end.
        progress: Called after each pair.

    Raises:
        RecordingError: The recording cannot be read, or holds no images or no stereo calibration.
        OutputError: The result cannot be written.
    """
    output_folder(path_out.parent)
    measurements = read_measurements(path)
    measurements.require("images")
    if measurements.images is None or measurements.calibration.stereo is None:
        raise RecordingError(f"{path} declares no stereo camera; give a recording that does")
    sightings = sight(measurements.images, spec, measurements.calibration.stereo, progress)
    add_sightings(path, sightings, path_out)
    return summarise(sightings)


def summarise(sightings: SightingStream) -> SightingSummary:
    """Count the sightings of a stream."""
    counts = np.diff(sightings.offsets)
    landmarks = len(np.unique(sightings.landmark_id))
    total = len(sightings.landmark_id)
    return SightingSummary(
        images=len(sightings),
        landmarks=landmarks,
        sightings_mean=float(counts.mean()) if len(counts) else 0.0,
        sightings_min=int(counts.min()) if len(counts) else 0,
        track_length_mean=total / landmarks if landmarks else 0.0,
    )
