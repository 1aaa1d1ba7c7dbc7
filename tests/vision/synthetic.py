"""Pictures whose sub-pixel geometry is known exactly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import PoseSpec, StereoCalibration
from lpet_sim.rng import stream

Array = NDArray[np.float64]
Image = NDArray[np.uint8]

R_BODY_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def camera(width_px: int = 320, height_px: int = 240) -> StereoCalibration:
    """Make a small stereo pair that looks along the body's x axis."""
    return StereoCalibration(
        width_px=width_px,
        height_px=height_px,
        focal_px=250.0,
        cx_px=(width_px - 1) / 2,
        cy_px=(height_px - 1) / 2,
        baseline_m=0.15,
        T_body_camera=PoseSpec.from_se3(SE3(R_BODY_CAMERA, np.zeros(3))),
    )


class Texture:
    """A periodic, band-limited texture that can be shifted by any fraction of a pixel exactly."""

    def __init__(self, seed: int, height_px: int = 240, width_px: int = 320) -> None:
        """Draw a 1/f texture without detail near the Nyquist limit."""
        self._fv = np.fft.fftfreq(height_px)[:, None]
        self._fu = np.fft.fftfreq(width_px)[None, :]
        f = np.hypot(self._fu, self._fv)
        white = np.fft.fft2(stream(seed, "texture").standard_normal((height_px, width_px)))
        self._spectrum = white / np.maximum(f, 0.02) * np.exp(-((f / 0.22) ** 2))
        self._spectrum[0, 0] = 0.0

    def shifted(self, du: float, dv: float = 0.0) -> Array:
        """Move the texture right by ``du`` and down by ``dv`` [px], at mean 128 and sigma 40."""
        phase = np.exp(-2j * np.pi * (self._fu * du + self._fv * dv))
        picture = np.fft.ifft2(self._spectrum * phase).real
        return np.asarray(128.0 + 40.0 * picture / picture.std())


def to_uint8(picture: Array) -> Image:
    """Round to grey values."""
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)
