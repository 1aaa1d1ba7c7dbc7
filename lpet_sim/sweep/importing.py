"""Real data sets as recordings."""

from __future__ import annotations

from pathlib import Path

from lpet_sim.outputs import output_folder
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.kitti import import_kitti as read_kitti
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.starry_night import import_starry_night as read_starry_night
from lpet_sim.recording.writer import RecordingWriter, write_recording


def import_kitti(folder: Path, path: Path, progress: Progress = silent) -> None:
    """Make a recording of a KITTI odometry sequence.

    Args:
        folder: The sequence: ``left/``, ``right/``, ``K.txt``, ``times.txt``, ``poses.txt``.
        path: The recording to write, ending in .rrd.
        progress: Called after each pair.

    Raises:
        RecordingError: The folder is not such a sequence.
        OutputError: The file cannot be written.
    """
    _write(read_kitti(folder), path, progress)


def import_starry_night(folder: Path, path: Path) -> None:
    """Make a recording of the Starry Night data set.

    Args:
        folder: Where its MATLAB file lies, or the file itself.
        path: The recording to write, ending in .rrd.

    Raises:
        RecordingError: There is no such file, or it does not hold what it should.
        OutputError: The file cannot be written.
    """
    recording = read_starry_night(folder)
    output_folder(path.parent)
    write_recording(path, recording)


def _write(recording: Recording, path: Path, progress: Progress) -> None:
    """Write a recording whose images are read one pair at a time."""
    measurements, images = recording.measurements, recording.measurements.images
    assert images is not None
    output_folder(path.parent)
    with RecordingWriter(path, recording.manifest, measurements.calibration) as writer:
        if recording.truth is not None:
            writer.log_truth(recording.truth)
        for index in track(range(len(images)), len(images), progress):
            writer.log_images(int(images.t_ns[index]), *images.pair(index))
