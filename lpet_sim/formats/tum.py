"""Trajectories as TUM text: ``time x y z qx qy qz qw`` in each row, in seconds and metres.

Reference:
    Sturm et al., A benchmark for the evaluation of RGB-D SLAM systems (2012).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats.clock import EPOCH_NS, seconds_text, stamp_of_text
from lpet_sim.formats.rows import each_row, in_order
from lpet_sim.geometry import SE3
from lpet_sim.outputs import whole_folder
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording import layout
from lpet_sim.recording.calibration import Calibration, PoseSpec
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Truth

TRUTH_FILE = "truth.txt"
_STAMP_MAX = 1 << 62
_START = re.compile(r"#.*\blpet_start_s=([0-9.]+)")
_WXYZ_TO_XYZW = [1, 2, 3, 0]
_XYZW_TO_WXYZ = [3, 0, 1, 2]


def export_tum(
    recording: Recording,
    estimates: Mapping[str, Estimate],
    folder: Path,
    progress: Progress = silent,
) -> None:
    """Write the truth and every estimate of a recording, one file for each.

    Args:
        recording: Whose truth is written, as ``truth.txt``.
        estimates: Estimates by name; the name is the file's.
        folder: A folder that is made.
        progress: Called after each file.

    Raises:
        RecordingError: There is neither truth nor an estimate.
        OutputError: The folder is there already, or cannot be written.
    """
    held = {layout.slug(name): estimate.trajectory for name, estimate in estimates.items()}
    if recording.truth is not None:
        held[Path(TRUTH_FILE).stem] = recording.truth.trajectory
    if not held:
        raise RecordingError(
            "the recording has no truth and no estimate; run 'lpet estimate' before this export"
        )
    with whole_folder(folder) as out:
        for name, trajectory in track(held.items(), len(held), progress):
            write_tum(out / f"{name}.txt", trajectory)


def write_tum(path: Path, trajectory: Trajectory, epoch_ns: int = EPOCH_NS) -> None:
    """Write a trajectory ``T_world_body``.

    Args:
        path: The file.
        trajectory: What to write.
        epoch_ns: The stamp of the recording's start [ns].
    """
    poses = trajectory.T_world_body
    quaternion = poses.quat_wxyz()[:, _WXYZ_TO_XYZW]
    rows = np.concatenate([poses.translation, quaternion], axis=1)
    with path.open("w") as file:
        file.write("# timestamp[s] x[m] y[m] z[m] qx qy qz qw\n")
        file.write(f"# lpet_start_s={seconds_text(epoch_ns)}\n")
        for stamp, row in each_row(trajectory.t_ns + epoch_ns, rows):
            file.write(f"{seconds_text(stamp)} {' '.join(map(repr, row))}\n")


def read_tum(path: Path, epoch_ns: int | None = None) -> Trajectory:
    """Read a trajectory.

    Args:
        path: The file.
        epoch_ns: The stamp of the recording's start [ns]; None takes the one that LPET wrote into
            a comment, else the first row's.

    Raises:
        RecordingError: The file is missing, empty, or not such a file, or its times do not
            increase.
    """
    start, stamps, rows = epoch_ns, list[int](), list[list[float]]()
    for number, line in enumerate(_text(path).splitlines(), start=1):
        said = _START.match(line)
        if said and start is None:
            start = stamp_of_text(said[1])
        if line.strip() and not line.startswith("#"):
            stamp, row = _pose(path, number, line)
            stamps.append(stamp)
            rows.append(row)
    if not rows:
        raise RecordingError(f"{path} holds no pose; rows 'time x y z qx qy qz qw' are expected")
    times = in_order(path, np.array(stamps, dtype=np.int64))
    values = np.array(rows)
    poses = SE3.from_quat_wxyz(values[:, 3:][:, _XYZW_TO_WXYZ], values[:, :3])
    return Trajectory(times - (stamps[0] if start is None else start), poses)


def import_tum(path: Path) -> Recording:
    """Make a recording of a true trajectory, without measurements.

    Raises:
        RecordingError: The file is missing, empty, or not such a file.
    """
    read = read_tum(path)
    start = PoseSpec.from_se3(read.T_world_body[0])
    return Recording(
        Manifest(f"tum {path.stem}"),
        Measurements(Calibration(T_world_body_start=start)),
        Truth(BodyTruth.from_poses(read.t_ns, read.T_world_body)),
    )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"cannot read {path}: {error}; give a file in TUM format") from None


def _pose(path: Path, number: int, line: str) -> tuple[int, list[float]]:
    first, *rest = line.replace(",", " ").split()
    try:
        stamp, row = stamp_of_text(first), [float(text) for text in rest]
    except (ValueError, RecordingError) as error:
        raise RecordingError(f"{path}, line {number}: {error}; numbers are expected") from None
    if abs(stamp) > _STAMP_MAX:
        raise RecordingError(
            f"{path}, line {number}: {first} s is too large; times are in seconds, and these look "
            "like nanoseconds"
        )
    if len(row) != 7 or not np.all(np.isfinite(row)) or not np.linalg.norm(row[3:]) > 0:
        raise RecordingError(
            f"{path}, line {number}: 'time x y z qx qy qz qw' is expected, all finite, and a "
            "quaternion that is not zero"
        )
    return stamp, row
