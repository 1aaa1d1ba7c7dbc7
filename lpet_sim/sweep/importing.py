"""Real data sets as recordings."""

from __future__ import annotations

from pathlib import Path

from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.kitti import read_kitti
from lpet_sim.recording.writer import RecordingWriter


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
    manifest, calibration, images, truth = read_kitti(folder)
    with RecordingWriter(path, manifest, calibration) as writer:
        writer.log_truth(truth)
        for index in track(range(len(images)), len(images), progress):
            writer.log_images(int(images.t_ns[index]), *images.pair(index))
