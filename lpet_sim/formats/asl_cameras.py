"""The cameras of an ASL folder: calibration and images, rectified where they are not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats import asl
from lpet_sim.formats.csv_files import read_names
from lpet_sim.formats.rectify import (
    DISTORTIONS,
    Eye,
    RectifiedImages,
    are_rectified,
    plain_stereo,
    rectified,
)
from lpet_sim.formats.sensor_yaml import (
    camera_mappings,
    hold_to,
    numbers_in,
    numbers_of,
    own_part,
    pose_of,
    read_mapping,
)
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.kitti import StereoFolder, read_grey
from lpet_sim.recording.streams import StereoImages


def read_cameras(root: Path) -> tuple[StereoCalibration | None, StereoImages | None]:
    """Read what is declared of the pair, and its images with the stamps of the folder.

    Args:
        root: The folder ``mav0``.

    Raises:
        RecordingError: A file is missing or not valid, or there is one camera only.
    """
    present = [eye for eye in asl.EYES if (root / eye).is_dir()]
    if not present:
        return None, None
    if len(present) == 1:
        raise RecordingError(
            f"{root} has {present[0]} only; a stereo pair, {' and '.join(asl.EYES)}, is expected"
        )
    paths = [root / eye / asl.SENSOR for eye in asl.EYES]
    mappings = [read_mapping(path) for path in paths]
    images = _images(root)
    own = own_part(paths[0], mappings[0], StereoCalibration)
    if own is not None:
        _hold_size(images, (own.width_px, own.height_px))
        for path, said, declared in zip(paths, mappings, camera_mappings(own, 0.0), strict=True):
            hold_to(path, said, declared)
        return own, images
    left, right = map(_eye, paths, mappings)
    _hold_size(images, left.size_px)
    if are_rectified(left, right):
        return plain_stereo(left, right), images
    stereo, maps = rectified(left, right)
    return stereo, None if images is None else RectifiedImages(images, maps)


def _hold_size(images: StereoFolder | None, size_px: tuple[int, int]) -> None:
    """Hold the first pair to the size that is declared.

    Raises:
        RecordingError: It has another.
    """
    for path in () if images is None else (images.left[0], images.right[0]):
        height, width = read_grey(path).shape
        if (width, height) != size_px:
            raise RecordingError(
                f"{path} is {width} x {height} px, but {asl.SENSOR} declares a resolution of "
                f"{size_px[0]} x {size_px[1]}"
            )


def from_stamp(images: StereoImages, start_ns: int) -> StereoImages:
    """Leave out the pairs before a stamp, and count from it."""
    if isinstance(images, RectifiedImages):
        return replace(images, raw=from_stamp(images.raw, start_ns))
    assert isinstance(images, StereoFolder)
    first = int(np.searchsorted(images.t_ns, start_ns))
    times = images.t_ns[first:] - start_ns
    return StereoFolder(times, images.left[first:], images.right[first:])


def _images(root: Path) -> StereoFolder | None:
    """Pair the images by their stamps; one without its other eye is left out."""
    tables = [root / eye / asl.DATA for eye in asl.EYES]
    if not any(table.exists() for table in tables):
        return None
    left, right = map(read_names, tables)
    stamps = sorted(left.keys() & right.keys())
    if not stamps:
        raise RecordingError(f"{root}: no stamp of {asl.EYES[0]} is one of {asl.EYES[1]}")
    files = [
        tuple(root / eye / "data" / names[stamp] for stamp in stamps)
        for eye, names in zip(asl.EYES, (left, right), strict=True)
    ]
    return StereoFolder(np.array(stamps, dtype=np.int64), files[0], files[1])


def _eye(path: Path, mapping: Mapping[str, Any]) -> Eye:
    model = str(mapping.get("distortion_model", "none"))
    if mapping.get("camera_model", "pinhole") != "pinhole" or model not in DISTORTIONS:
        raise RecordingError(
            f"{path}: camera_model must be pinhole, and distortion_model one of "
            f"{', '.join(DISTORTIONS)}"
        )
    fu, fv, cu, cv = numbers_of(path, mapping, "intrinsics", 4).tolist()
    width, height = numbers_of(path, mapping, "resolution", 2).astype(int).tolist()
    bent = numbers_in(mapping.get("distortion_coefficients") or [0.0] * 4).ravel()
    if len(bent) not in ((4,) if model == "equidistant" else (4, 5)):
        raise RecordingError(f"{path}: 'distortion_coefficients' must hold 4 numbers")
    coefficients = tuple(bent.tolist())
    return Eye(pose_of(path, mapping), (fu, fv, cu, cv), model, coefficients, (width, height))
