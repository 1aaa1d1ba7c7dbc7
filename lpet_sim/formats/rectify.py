"""Rectification of a stereo pair: images as two equal pinhole cameras side by side would see them.

The rectified cameras stand where the real ones stand. Their x axis runs along the baseline, their z
axis as close to the mean of both optical axes as that allows; focal length and principal point are
the means of those declared. Pixels are interpolated linearly, and black outside the real image.

Reference:
    Fusiello, Trucco, Verri, A compact algorithm for rectification of stereo pairs (2000).
    Distortion: Brown, Close-range camera calibration (1971); Kannala and Brandt, A generic camera
    model (2006), which ASL files call equidistant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import PoseSpec, StereoCalibration
from lpet_sim.recording.streams import StereoImages

_SAME, _SAME_TEXT = 1e-9, 1e-6
DISTORTIONS = ("radial-tangential", "radtan", "plumb_bob", "equidistant", "none")


@dataclass(frozen=True, eq=False)
class Eye:
    """A camera as it is.

    Attributes:
        T_body_eye: Its pose, optical frame.
        intrinsics_px: Focal lengths and principal point (fu, fv, cu, cv) [px].
        distortion: One of `DISTORTIONS`.
        coefficients: Of the distortion: (k1, k2, p1, p2) or (k1, k2, k3, k4).
        size_px: Width and height [px].
    """

    T_body_eye: SE3
    intrinsics_px: tuple[float, float, float, float]
    distortion: str
    coefficients: tuple[float, ...]
    size_px: tuple[int, int]

    def pixels(self, p_eye: Array) -> Array:
        """Project points with z > 0, Shape (..., 3), to (u, v) [px], Shape (..., 2)."""
        xy = self._distorted(p_eye[..., :2] / p_eye[..., 2:])
        fu, fv, cu, cv = self.intrinsics_px
        return np.asarray(xy * (fu, fv) + (cu, cv))

    def _distorted(self, xy: Array) -> Array:
        x, y = xy[..., 0], xy[..., 1]
        if not np.any(self.coefficients):
            return xy
        if self.distortion == "equidistant":
            return xy * _equidistant(np.hypot(x, y), self.coefficients)[..., None]
        k1, k2, p1, p2, *more = self.coefficients
        r2 = x**2 + y**2
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * (more[0] if more else 0.0)))
        u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x**2)
        v = y * radial + p1 * (r2 + 2 * y**2) + 2 * p2 * x * y
        return np.stack([u, v], axis=-1)


@dataclass(frozen=True, eq=False)
class RectifiedImages:
    """Image pairs that are rectified when they are asked for.

    Attributes:
        raw: The pairs as they were taken.
        maps_px: Where each rectified pixel lies in the real image (v, u) [px], for each eye,
            Shape (2, h, w).
    """

    raw: StereoImages
    maps_px: tuple[Array, Array]

    @property
    def t_ns(self) -> Ints:
        """Times of the pairs since the start [ns], Shape (n,)."""
        return self.raw.t_ns

    def __len__(self) -> int:
        return len(self.raw)

    def pair(self, index: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """Give the left and right rectified image of a pair, Shape (h, w)."""
        left, right = self.raw.pair(index)
        return _seen_through(left, self.maps_px[0]), _seen_through(right, self.maps_px[1])


def are_rectified(left: Eye, right: Eye) -> bool:
    """Tell whether two cameras are equal pinholes side by side, the right one at +x."""
    T_left_right = left.T_body_eye.inverse() @ right.T_body_eye
    aside = T_left_right.translation
    square = np.isclose(*left.intrinsics_px[:2], rtol=_SAME, atol=0.0)
    equal = np.allclose(left.intrinsics_px, right.intrinsics_px, rtol=_SAME, atol=0.0)
    straight = np.any(left.coefficients) or np.any(right.coefficients)
    parallel = np.allclose(T_left_right.rotation, np.eye(3), atol=_SAME)
    level = aside[0] > 0 and np.all(np.abs(aside[1:]) < _SAME)
    return bool(square and equal and not straight and parallel and level)


def hold_equal(source: str, left: Sequence[float], right: Sequence[float]) -> None:
    """Hold two 3x4 projections, row by row, to be square and to differ by the baseline alone.

    Args:
        source: What they are from, for the message.
        left: Projection of the left eye, Shape (12,).
        right: That of the right one.

    Raises:
        RecordingError: Focal lengths or centres differ, so that disparities would be off.
    """
    pinholes = np.array([left, right], dtype=float)[:, [0, 5, 2, 6]]
    wanted = pinholes[0, [0, 0, 2, 3]]
    if not np.allclose(pinholes, wanted, rtol=_SAME_TEXT, atol=0.0):
        said = " and ".join(" ".join(f"{number:g}" for number in eye) for eye in pinholes)
        raise RecordingError(
            f"{source}: fx fy cx cy of the eyes are {said} px; rectify both to one focal length "
            "and one centre"
        )


def plain_stereo(left: Eye, right: Eye) -> StereoCalibration:
    """Declare a pair that is rectified already."""
    aside = (left.T_body_eye.inverse() @ right.T_body_eye).translation
    return _declared(left.intrinsics_px, left.size_px, float(aside[0]), left.T_body_eye)


def rectified(left: Eye, right: Eye) -> tuple[StereoCalibration, tuple[Array, Array]]:
    """Find the rectified pair, and where its pixels lie in the real images.

    Returns:
        What is to be declared, and the maps of `RectifiedImages`.

    Raises:
        RecordingError: The eyes stand at one place, or the right one is not to the right.
    """
    T_left_right = left.T_body_eye.inverse() @ right.T_body_eye
    R_left_rect = _rectified_axes(T_left_right)
    intrinsics = np.mean([left.intrinsics_px, right.intrinsics_px], axis=0)
    focal_px = float(intrinsics[:2].mean())
    pinhole = (focal_px, focal_px, float(intrinsics[2]), float(intrinsics[3]))
    T_body_rect = left.T_body_eye @ SE3(R_left_rect, np.zeros(3))
    stereo = _declared(
        pinhole, left.size_px, float(np.linalg.norm(T_left_right.translation)), T_body_rect
    )
    R_right_rect = T_left_right.rotation.T @ R_left_rect
    return stereo, (_map(left, R_left_rect, stereo), _map(right, R_right_rect, stereo))


def _rectified_axes(T_left_right: SE3) -> Array:
    """Give the rectified axes in the left eye as columns."""
    aside = T_left_right.translation
    if not aside[0] > 0:
        raise RecordingError(
            f"the right eye stands at {np.round(aside, 4).tolist()} m of the left one; it must "
            "stand to its right, at positive x"
        )
    x = aside / np.linalg.norm(aside)
    ahead = np.array([0.0, 0.0, 1.0]) + T_left_right.rotation[:, 2]
    y = np.cross(ahead, x)
    y /= np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])


def _declared(
    intrinsics: tuple[float, float, float, float],
    size_px: tuple[int, int],
    baseline_m: float,
    T_body_camera: SE3,
) -> StereoCalibration:
    return StereoCalibration(
        width_px=size_px[0],
        height_px=size_px[1],
        focal_px=intrinsics[0],
        cx_px=intrinsics[2],
        cy_px=intrinsics[3],
        baseline_m=baseline_m,
        T_body_camera=PoseSpec.from_se3(T_body_camera),
    )


def _map(eye: Eye, R_eye_rect: Array, stereo: StereoCalibration) -> Array:
    v, u = np.mgrid[: stereo.height_px, : stereo.width_px].astype(float)
    rays = np.stack(
        [
            (u - stereo.cx_px) / stereo.focal_px,
            (v - stereo.cy_px) / stereo.focal_px,
            np.ones_like(u),
        ],
        axis=-1,
    )
    pixels = eye.pixels(rays @ R_eye_rect.T)
    return np.stack([pixels[..., 1], pixels[..., 0]])


def _equidistant(r: Array, coefficients: tuple[float, ...]) -> Array:
    """Give the factor ``theta_d / r`` with ``theta = atan r``, which tends to 1 at the centre."""
    k1, k2, k3, k4 = coefficients
    theta = np.arctan(r)
    t2 = theta**2
    bent = theta * (1 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    return np.where(r > _SAME, bent / np.where(r > _SAME, r, 1.0), 1.0)


def _seen_through(image: NDArray[Any], map_px: Array) -> NDArray[Any]:
    values = map_coordinates(image.astype(np.float32), map_px, order=1, mode="constant", cval=0.0)
    return np.rint(values).astype(image.dtype)
