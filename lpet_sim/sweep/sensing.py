"""Sense the landmarks of a recorded traverse: sightings in seconds, without images."""

from __future__ import annotations

from pathlib import Path

from lpet_sim.errors import RecordingError
from lpet_sim.outputs import output_folder
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.overlay import add_sightings
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.truth import Truth
from lpet_sim.sensors.landmark_sensor import sense_landmarks
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sweep.sighting import SightingSummary, summarise
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.terrain import Terrain, build_terrain


def sense_recording(
    recording: Recording,
    spec: LandmarkSensorSpec,
    seed: int | None = None,
    progress: Progress = silent,
) -> SightingStream:
    """Sense the landmarks along a simulated traverse, on the very terrain that it was driven on.

    Args:
        recording: A simulated traverse that declares a stereo camera.
        spec: The sensor.
        seed: Seed of landmarks and noise; None: that of the traverse. The terrain keeps its own.
        progress: Called after each image.

    Returns:
        The sightings; the recording stays as it is.

    Raises:
        RecordingError: The recording is not simulated, or has no truth or no stereo calibration.
    """
    truth, calibration = _sensed(recording)
    manifest = recording.manifest
    own = seed if seed is not None else (manifest.seed or 0)
    return sense_landmarks(truth.body, terrain_of(manifest), calibration, spec, own, progress)


def terrain_of(manifest: Manifest) -> Terrain:
    """Build the terrain that a simulated traverse was driven on.

    Raises:
        RecordingError: The recording does not come from a simulation.
    """
    if manifest.seed is None or "traverse" not in manifest.specs:
        raise RecordingError(
            f"the recording comes from '{manifest.source}', which names no terrain: landmarks are "
            "sensed along a simulated traverse"
        )
    traverse = TraverseSpec.from_mapping(manifest.specs["traverse"], source="the manifest")
    return build_terrain(traverse.terrain, manifest.seed)


def sense_file(
    path: Path,
    path_out: Path,
    spec: LandmarkSensorSpec,
    seed: int | None = None,
    progress: Progress = silent,
) -> SightingSummary:
    """Sense the landmarks of a recording's traverse, and lay the sightings over it.

    Args:
        path: The recording of a simulated traverse.
        path_out: Where the result goes; it may be the recording itself.
        spec: The sensor.
        seed: As in `sense_recording`.
        progress: Called after each image.

    Raises:
        RecordingError: The recording cannot be read, or no landmarks can be sensed along it.
        OutputError: The result cannot be written.
    """
    output_folder(path_out.parent)
    sightings = sense_recording(read_recording(path), spec, seed, progress)
    add_sightings(path, sightings, path_out)
    return summarise(sightings)


def _sensed(recording: Recording) -> tuple[Truth, StereoCalibration]:
    """Give what is needed of a recording, or say what is missing."""
    calibration = recording.measurements.calibration.stereo
    if calibration is None:
        raise RecordingError("the recording declares no stereo camera; give one that does")
    if recording.truth is None:
        raise RecordingError("the recording holds no truth; give a simulated traverse")
    return recording.truth, calibration
