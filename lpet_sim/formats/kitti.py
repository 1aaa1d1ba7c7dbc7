"""Stereo sequences in the layout of the KITTI odometry benchmark, out and in.

A folder holds ``image_0/`` and ``image_1/`` (PNG), ``calib.txt`` (3x4 projections P0 and P1),
``times.txt`` [s] and, where the truth is known, ``poses.txt`` (3x4 poses of the left camera in the
first one). Where the camera sits in the body has no place in it, and neither has the world.

Reference:
    Geiger, Lenz, Urtasun, Are we ready for autonomous driving? (2012), and its development kit.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats.clock import seconds_text, stamp_of_text
from lpet_sim.formats.overrides import overridden
from lpet_sim.formats.rectify import hold_equal
from lpet_sim.geometry import SE3
from lpet_sim.outputs import whole_folder
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.kitti import BASELINE_M as SEQUENCE_00_BASELINE_M
from lpet_sim.recording.kitti import (
    GRAVITY_MPS2,
    R_BODY_CAMERA,
    StereoFolder,
    body_poses,
    read_grey,
)
from lpet_sim.recording.kitti import import_kitti as import_plain
from lpet_sim.recording.png import encode_png
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements, StereoImages
from lpet_sim.recording.truth import BodyTruth, Truth

EYES = ("image_0", "image_1")
CALIBRATION, TIMES, POSES = "calib.txt", "times.txt", "poses.txt"
PLAIN_CALIBRATION = "K.txt"


def export_kitti(recording: Recording, folder: Path, progress: Progress = silent) -> None:
    """Write the images of a recording, and the camera's true poses, as a sequence.

    Args:
        recording: What to write.
        folder: A folder that is made.
        progress: Called after each pair.

    Raises:
        RecordingError: There are no images, or no stereo camera is declared.
        OutputError: The folder is there already, or cannot be written.
    """
    measurements = recording.measurements
    measurements.require("images")
    images, stereo = measurements.images, measurements.calibration.stereo
    if images is None or stereo is None:
        raise RecordingError("the recording declares no stereo camera; KITTI is made of its images")
    with whole_folder(folder) as out:
        _write_text(out / CALIBRATION, _projections(stereo))
        since = images.t_ns - images.t_ns[:1]
        _write_text(out / TIMES, [seconds_text(int(t)) for t in since])
        if recording.truth is not None:
            T_world_camera = recording.truth.trajectory.at(images.t_ns) @ stereo.T_body_camera.se3()
            _write_text(out / POSES, _rows(T_world_camera))
        _write_images(images, out, progress)


def import_kitti(
    folder: Path, declared: Calibration | None = None, baseline_m: float | None = None
) -> Recording:
    """Read a sequence; images stay on disk until they are asked for.

    The body is the left camera's place with axes x forward, y left, z up, unless the camera is
    declared to sit elsewhere in it; the world is the first body.

    Args:
        folder: The sequence, in the benchmark's layout or the plainer one of
            `lpet_sim.recording.kitti`.
        declared: A calibration; what it sets stands in place of what the folder declares.
        baseline_m: Distance between the eyes [m], likewise; the plainer layout does not say it.

    Raises:
        RecordingError: The folder lacks a file, its files do not fit together, or nothing says how
            far apart the eyes are.
    """
    read = _plain(folder, declared, baseline_m) if _is_plain(folder) else _benchmark(folder)
    calibration = read.measurements.calibration
    if baseline_m is not None and calibration.stereo is not None:
        stereo = calibration.stereo.model_copy(update={"baseline_m": baseline_m})
        calibration = calibration.model_copy(update={"stereo": stereo})
    calibration = overridden(calibration, declared)
    measurements = Measurements(calibration, images=read.measurements.images)
    truth = None if read.truth is None else _mounted(read.truth, calibration.stereo)
    return Recording(read.manifest, measurements, truth)


def _is_plain(folder: Path) -> bool:
    return (folder / PLAIN_CALIBRATION).exists()


def _plain(folder: Path, declared: Calibration | None, baseline_m: float | None) -> Recording:
    if baseline_m is None and (declared is None or declared.stereo is None):
        raise RecordingError(
            f"{folder / PLAIN_CALIBRATION} does not say how far apart the eyes are: give the "
            f"baseline in metres ({SEQUENCE_00_BASELINE_M:.4f} for KITTI's sequence 00)"
        )
    return import_plain(folder)


def _benchmark(folder: Path) -> Recording:
    _check(folder)
    images = _images(folder)
    stated = Calibration(stereo=_stereo(folder, images), gravity_mps2=GRAVITY_MPS2)
    truth = _truth(folder, images.t_ns)
    return Recording(Manifest(f"kitti {folder.name}"), Measurements(stated, images=images), truth)


def _mounted(truth: Truth, stereo: StereoCalibration | None) -> Truth:
    """Give the truth of the body that the camera is declared to sit in."""
    if stereo is None:
        return truth
    T_body_place = stereo.T_body_camera.se3() @ SE3(R_BODY_CAMERA, np.zeros(3)).inverse()
    poses = T_body_place @ truth.body.T_world_body @ T_body_place.inverse()
    return Truth(BodyTruth.from_poses(truth.body.t_ns, poses))


def _write_text(path: Path, lines: Sequence[str]) -> None:
    path.write_text("".join(f"{line}\n" for line in lines))


def _write_images(images: StereoImages, out: Path, progress: Progress) -> None:
    for eye in EYES:
        (out / eye).mkdir()
    for index in track(range(len(images)), len(images), progress):
        for eye, image in zip(EYES, images.pair(index), strict=True):
            (out / eye / f"{index:06d}.png").write_bytes(encode_png(image))


def _projections(stereo: StereoCalibration) -> list[str]:
    f, cx, cy = stereo.focal_px, stereo.cx_px, stereo.cy_px
    offsets = (0.0, -f * stereo.baseline_m)
    rows = ([f, 0.0, cx, offset, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0] for offset in offsets)
    return [f"P{eye}: {' '.join(map(repr, row))}" for eye, row in enumerate(rows)]


def _rows(T_world_camera: SE3) -> list[str]:
    """Give poses in the first camera as 12 numbers each."""
    T_first_camera = T_world_camera[0].inverse() @ T_world_camera
    rows = T_first_camera.matrix()[:, :3].reshape(-1, 12).tolist()
    return [" ".join(map(repr, row)) for row in rows]


def _check(folder: Path) -> None:
    missing = [name for name in (*EYES, CALIBRATION, TIMES) if not (folder / name).exists()]
    if missing:
        raise RecordingError(
            f"{folder} is no KITTI sequence, it lacks {', '.join(missing)}; expected are image_0/, "
            "image_1/ (PNG), calib.txt, times.txt and, where the truth is known, poses.txt; or "
            "left/, right/, K.txt, times.txt and poses.txt"
        )


def _images(folder: Path) -> StereoFolder:
    left, right = (tuple(sorted((folder / eye).glob("*.png"))) for eye in EYES)
    if not left or [path.name for path in left] != [path.name for path in right]:
        raise RecordingError(f"{folder}: image_0/ and image_1/ must hold PNG files of equal names")
    stamps = [stamp_of_text(text) for text in _words(folder / TIMES)]
    if len(stamps) != len(left):
        raise RecordingError(
            f"{folder} has {len(left)} image pairs but {len(stamps)} times: there must be one for "
            "each"
        )
    return StereoFolder(np.array(stamps, dtype=np.int64) - stamps[0], left, right)


def _stereo(folder: Path, images: StereoFolder) -> StereoCalibration:
    left, right = (_projection(folder / CALIBRATION, f"P{eye}") for eye in (0, 1))
    if not right[3] < left[3]:
        raise RecordingError(f"{folder / CALIBRATION}: P1 must be that of the right eye")
    hold_equal(str(folder / CALIBRATION), left.tolist(), right.tolist())
    height_px, width_px = read_grey(images.left[0]).shape
    return StereoCalibration(
        width_px=width_px,
        height_px=height_px,
        focal_px=left[0],
        cx_px=left[2],
        cy_px=left[6],
        baseline_m=(left[3] - right[3]) / left[0],
        T_body_camera=PoseSpec.from_se3(SE3(R_BODY_CAMERA, np.zeros(3))),
    )


def _projection(path: Path, name: str) -> Array:
    for line in path.read_text().splitlines():
        key, _, text = line.partition(":")
        if key.strip() == name:
            return _numbers(path, text.split(), 12)[0]
    raise RecordingError(f"{path} lacks {name}; a projection of 12 numbers is expected")


def _truth(folder: Path, t_ns: Ints) -> Truth | None:
    path = folder / POSES
    if not path.exists():
        return None
    rows = _numbers(path, _words(path), 12)
    if len(rows) != len(t_ns):
        raise RecordingError(
            f"{folder} has {len(t_ns)} image pairs but {len(rows)} poses: there must be one for "
            "each"
        )
    return Truth(BodyTruth.from_poses(t_ns, body_poses(rows)))


def _words(path: Path) -> list[str]:
    try:
        return path.read_text().split()
    except (OSError, UnicodeDecodeError) as error:
        raise RecordingError(f"cannot read {path}: {error}; a text file is expected") from None


def _numbers(path: Path, words: Sequence[str], columns: int) -> Array:
    try:
        return np.array(words, dtype=float).reshape(-1, columns)
    except ValueError as error:
        raise RecordingError(
            f"cannot read {path}: {error}; {columns} numbers a row are expected"
        ) from None
