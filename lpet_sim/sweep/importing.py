"""Data of others as recordings."""

from __future__ import annotations

from pathlib import Path

from lpet_sim.formats.euroc_read import import_euroc as read_euroc
from lpet_sim.formats.kitti import import_kitti as read_kitti
from lpet_sim.formats.mcap_read import import_mcap as read_mcap
from lpet_sim.formats.parquet import import_parquet as read_parquet
from lpet_sim.formats.topics import TopicsSpec
from lpet_sim.formats.tum import import_tum as read_tum
from lpet_sim.outputs import output_folder
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.starry_night import import_starry_night as read_starry_night
from lpet_sim.recording.writer import write_recording


def import_euroc(
    folder: Path, path: Path, declared: Calibration | None = None, progress: Progress = silent
) -> None:
    """Make a recording of an ASL folder.

    Args:
        folder: The folder that ``mav0`` lies in, or ``mav0`` itself.
        path: The recording to write, ending in .rrd.
        declared: A calibration; what it sets stands in place of what the folder declares.
        progress: Called after each pair.

    Raises:
        RecordingError: The folder lacks a file, or a file is not valid.
        OutputError: The file cannot be written.
    """
    _write(read_euroc(folder, declared), path, progress)


def import_kitti(
    folder: Path,
    path: Path,
    progress: Progress = silent,
    declared: Calibration | None = None,
    baseline_m: float | None = None,
) -> None:
    """Make a recording of a KITTI odometry sequence.

    Args:
        folder: The sequence: ``image_0/``, ``image_1/``, ``calib.txt``, ``times.txt`` and, where
            the truth is known, ``poses.txt``; or ``left/``, ``right/``, ``K.txt``, ``times.txt``
            and ``poses.txt``.
        path: The recording to write, ending in .rrd.
        progress: Called after each pair.
        declared: A calibration; what it sets stands in place of what the folder declares.
        baseline_m: Distance between the eyes [m], likewise; ``K.txt`` does not say it.

    Raises:
        RecordingError: The folder is not such a sequence, or nothing says the baseline.
        OutputError: The file cannot be written.
    """
    _write(read_kitti(folder, declared, baseline_m), path, progress)


def import_tum(file: Path, path: Path) -> None:
    """Make a recording of a true trajectory in TUM format, without measurements.

    Args:
        file: The trajectory.
        path: The recording to write, ending in .rrd.

    Raises:
        RecordingError: The file is missing, empty, or not such a file.
        OutputError: The file cannot be written.
    """
    _write(read_tum(file), path, silent)


def import_starry_night(folder: Path, path: Path) -> None:
    """Make a recording of the Starry Night data set.

    Args:
        folder: Where its MATLAB file lies, or the file itself.
        path: The recording to write, ending in .rrd.

    Raises:
        RecordingError: There is no such file, or it does not hold what it should.
        OutputError: The file cannot be written.
    """
    _write(read_starry_night(folder), path, silent)


def import_mcap(
    bag: Path,
    path: Path,
    topics: TopicsSpec | None = None,
    declared: Calibration | None = None,
    progress: Progress = silent,
) -> None:
    """Make a recording of a ROS 2 bag in MCAP.

    Args:
        bag: The file, or the folder of a bag that holds one.
        path: The recording to write, ending in .rrd.
        topics: Where the streams are; as we export them where None.
        declared: A calibration; what it sets stands in place of what the bag says.
        progress: Called with the fraction done: readings first, then images.

    Raises:
        RecordingError: The file cannot be read, or holds none of the topics.
        OutputError: The file cannot be written.
    """
    read = read_mcap(bag, topics, declared, lambda fraction: progress(fraction / 2))
    _write(read, path, lambda fraction: progress(0.5 + fraction / 2))


def import_parquet(folder: Path, path: Path, progress: Progress = silent) -> None:
    """Make a recording of Parquet files that were exported before.

    Args:
        folder: Where they lie.
        path: The recording to write, ending in .rrd.
        progress: Called after each pair.

    Raises:
        RecordingError: The folder lacks a file, or a file is not valid.
        OutputError: The file cannot be written.
    """
    _write(read_parquet(folder), path, progress)


def _write(recording: Recording, path: Path, progress: Progress) -> None:
    """Write a recording whose images are read one pair at a time."""
    output_folder(path.parent)
    write_recording(path, recording, progress=progress)
