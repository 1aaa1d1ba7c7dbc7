"""Import of rectified grey stereo sequences in the layout of the KITTI odometry benchmark.

The folder holds ``left/`` and ``right/`` (PNG, one per time), ``K.txt`` (3x3 camera matrix),
``times.txt`` [s] and ``poses.txt`` (3x4 poses of the left camera in the first one, row-major, z
forward). The body here is the left camera's place with axes x forward, y left, z up.

Reference:
    Geiger, Lenz, Stiller, Urtasun, Vision meets robotics: the KITTI dataset (2013).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from pydantic import Field

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.png import decode_png, is_moved_up
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.truth import BodyTruth, Truth
from lpet_sim.spec import Spec

BASELINE_M = 0.53716571886
"""Distance between the grey cameras of sequence 00, from its calibration file [m]."""

GRAVITY_MPS2 = 9.81

R_BODY_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Optical axes (x right, y down, z forward) in a body with x forward, y left, z up."""

_FILES = ("left", "right", "K.txt", "times.txt", "poses.txt")


@dataclass(frozen=True, eq=False)
class StereoFolder:
    """Image pairs of a folder, read when asked for.

    Attributes:
        t_ns: Times since the first pair [ns], Shape (n,).
        left: Files of the left images.
        right: Files of the right images.
    """

    t_ns: Ints
    left: tuple[Path, ...]
    right: tuple[Path, ...]

    def __len__(self) -> int:
        return len(self.left)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Read the left and right grey image of a pair, Shape (h, w), uint8 or uint16."""
        return read_grey(self.left[index]), read_grey(self.right[index])


class KittiSpec(Spec):
    """What the folder does not say.

    Attributes:
        baseline_m: Distance between the eyes [m].
        sigma_px: Declared noise of one image coordinate [px].
    """

    baseline_m: float = Field(default=BASELINE_M, gt=0)
    sigma_px: float = Field(default=0.5, gt=0)


def import_kitti(folder: Path | str, spec: KittiSpec | None = None) -> Recording:
    """Read a sequence; images stay on disk until they are asked for.

    Args:
        folder: Where the sequence lies.
        spec: What the folder does not say; that of sequence 00 where None.

    Raises:
        RecordingError: The folder lacks a file, or its files do not fit together.
    """
    spec, root = spec or KittiSpec(), Path(folder)
    _check_layout(root)
    images = _images(root)
    T_world_body = body_poses(_numbers(root / "poses.txt", 12))
    _check_count(root, len(images), times=len(images.t_ns), poses=len(T_world_body))
    calibration = Calibration(
        stereo=_stereo(root, images, spec),
        T_world_body_start=PoseSpec.from_se3(T_world_body[0]),
        gravity_mps2=GRAVITY_MPS2,
    )
    manifest = Manifest(f"kitti {root.name}", None, {"import": spec.to_mapping()})
    truth = Truth(BodyTruth.from_poses(images.t_ns, T_world_body))
    return Recording(manifest, Measurements(calibration, images=images), truth)


def body_poses(rows: Array) -> SE3:
    """Turn camera poses, Shape (n, 12), into ``T_world_body``, the world being the first body."""
    T_body_camera = SE3(R_BODY_CAMERA, np.zeros(3))
    T_first_camera = SE3.from_matrix(rows.reshape(-1, 3, 4))
    return (
        T_body_camera
        @ SE3(_orthonormal(T_first_camera.rotation), T_first_camera.translation)
        @ (T_body_camera.inverse())
    )


def read_grey(path: Path) -> NDArray[Any]:
    """Read a grey image, Shape (h, w), uint8 or uint16.

    Raises:
        RecordingError: The file is no image, or it is in colour.
    """
    try:
        data = path.read_bytes()
        if is_moved_up(data):
            with suppress(RecordingError):
                return decode_png(data)
        with Image.open(BytesIO(data)) as image:
            pixels = np.asarray(image)
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error}; a grey PNG is expected") from None
    if pixels.ndim != 2:
        raise RecordingError(f"{path} has {pixels.ndim} axes; a grey PNG with 2 is expected")
    return pixels if pixels.dtype == np.uint8 else pixels.astype(np.uint16)


def _check_layout(root: Path) -> None:
    missing = [name for name in _FILES if not (root / name).exists()]
    if missing:
        raise RecordingError(
            f"{root} is no KITTI sequence, it lacks {', '.join(missing)}; expected are left/, "
            "right/ (PNG), K.txt, times.txt and poses.txt"
        )


def _check_count(root: Path, images: int, **others: int) -> None:
    for name, count in others.items():
        if count != images:
            raise RecordingError(
                f"{root} has {images} image pairs but {count} {name}: there must be one for each"
            )


def _images(root: Path) -> StereoFolder:
    left, right = (tuple(sorted((root / eye).glob("*.png"))) for eye in ("left", "right"))
    if [path.name for path in left] != [path.name for path in right]:
        raise RecordingError(f"{root}: left/ and right/ must hold PNG files of the same names")
    if not left:
        raise RecordingError(f"{root} has 0 image pairs: left/ and right/ must hold PNG files")
    t_s = _numbers(root / "times.txt", 1)[:, 0]
    t_ns = np.rint((t_s - t_s[:1]) * NS_PER_S).astype(np.int64)
    return StereoFolder(t_ns, left, right)


def _numbers(path: Path, columns: int) -> Array:
    try:
        return np.array(path.read_text().split(), dtype=float).reshape(-1, columns)
    except (ValueError, OSError) as error:
        raise RecordingError(
            f"cannot read {path}: {error}; {columns} numbers a row are expected"
        ) from None


def _stereo(root: Path, images: StereoFolder, spec: KittiSpec) -> StereoCalibration:
    K = _numbers(root / "K.txt", 3)
    height_px, width_px = read_grey(images.left[0]).shape
    return StereoCalibration(
        width_px=width_px,
        height_px=height_px,
        focal_px=K[0, 0],
        cx_px=K[0, 2],
        cy_px=K[1, 2],
        baseline_m=spec.baseline_m,
        T_body_camera=PoseSpec.from_se3(SE3(R_BODY_CAMERA, np.zeros(3))),
        sigma_px=spec.sigma_px,
    )


def _orthonormal(rotation: Array) -> Array:
    """Give the nearest rotations: text files round to seven digits."""
    u, _, vt = np.linalg.svd(rotation)
    return np.asarray(u @ vt)
