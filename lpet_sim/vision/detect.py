"""SIFT keypoints of an image; the only file that imports OpenCV."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lpet_sim.vision.spec import SiftSpec

Image = NDArray[Any]
Floats = NDArray[np.float32]

DESCRIPTOR_LENGTH = 128
_FIELDS_PER_KEYPOINT = 5


@dataclass(frozen=True)
class Features:
    """Keypoints of one image with their descriptors.

    Attributes:
        uv_px: Positions (u, v), (0, 0) the centre of the first pixel [px], Shape (n, 2), float32.
        size_px: Diameters [px], Shape (n,), float32.
        angle_rad: Orientations [rad], Shape (n,), float32.
        response: Contrasts, Shape (n,), float32.
        octave: Octaves, -1 the doubled image, Shape (n,), int64.
        descriptor: Of unit length, Shape (n, 128), float32.
    """

    uv_px: Floats
    size_px: Floats
    angle_rad: Floats
    response: Floats
    octave: NDArray[np.int64]
    descriptor: Floats

    def __len__(self) -> int:
        return len(self.size_px)

    def take(self, rows: NDArray[Any]) -> Features:
        """Give the features of some rows."""
        return Features(
            self.uv_px[rows],
            self.size_px[rows],
            self.angle_rad[rows],
            self.response[rows],
            self.octave[rows],
            self.descriptor[rows],
        )


class SiftDetector:
    """SIFT on both eyes at once, each in a thread of its own (OpenCV releases the lock)."""

    def __init__(self, spec: SiftSpec) -> None:
        """Make a detector for each eye."""
        self._spec = spec
        self._eyes = [_make_sift(spec) for _ in range(2)]
        self._pool = ThreadPoolExecutor(max_workers=2, thread_name_prefix="sift")

    def detect(self, image: Image) -> Features:
        """Find the keypoints of one grey image.

        Args:
            image: Shape (h, w), uint8 or uint16.
        """
        return self._detect(self._eyes[0], image)

    def detect_pair(self, left: Image, right: Image) -> tuple[Features, Features]:
        """Find the keypoints of both eyes."""
        jobs = self._pool.map(self._detect, self._eyes, (left, right))
        features_left, features_right = jobs
        return features_left, features_right

    def _detect(self, sift: Any, image: Image) -> Features:
        keypoints, descriptor = sift.detectAndCompute(self._to_uint8(image), None)
        if descriptor is None:
            descriptor = np.zeros((0, DESCRIPTOR_LENGTH), np.float32)
        table = np.array(
            [(*k.pt, k.size, k.angle, k.response) for k in keypoints], dtype=np.float32
        ).reshape(-1, _FIELDS_PER_KEYPOINT)
        octave = np.array([k.octave for k in keypoints], dtype=np.int64)
        return Features(
            table[:, :2].copy(),
            table[:, 2],
            np.deg2rad(table[:, 3]),
            table[:, 4],
            _signed_octave(octave),
            _unit_length(descriptor, self._spec.root),
        )

    def _to_uint8(self, image: Image) -> NDArray[np.uint8]:
        if image.dtype == np.uint8:
            return np.ascontiguousarray(image)
        scale = 255.0 / self._spec.white_level_uint16
        return cv2.convertScaleAbs(np.ascontiguousarray(image), alpha=scale)  # type: ignore[return-value]


def _make_sift(spec: SiftSpec) -> Any:
    # Without the precise upscaling keypoints of the doubled image are a quarter pixel off.
    return cv2.SIFT_create(  # type: ignore[attr-defined]
        nfeatures=spec.keypoints_max,
        nOctaveLayers=spec.octave_layers,
        contrastThreshold=spec.contrast_threshold,
        edgeThreshold=spec.edge_threshold,
        sigma=spec.blur_sigma_px,
        enable_precise_upscale=True,
    )


def _signed_octave(packed: NDArray[np.int64]) -> NDArray[np.int64]:
    """Unpack OpenCV's octave, the low byte with sign."""
    low = packed & 255
    return np.where(low < 128, low, low - 256)


def _unit_length(descriptor: Floats, root: bool) -> Floats:
    """Scale descriptors to unit length; the root makes the Hellinger distance a Euclidean one."""
    if root:
        descriptor = np.sqrt(descriptor)
    length = np.linalg.norm(descriptor, axis=1, keepdims=True)
    return np.asarray(descriptor / np.maximum(length, 1e-9), dtype=np.float32)
