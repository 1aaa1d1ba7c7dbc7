"""From the radiance on the detector to the numbers of an image."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from lpet_sim.sensors.camera_spec import ImageChainSpec

Floats = NDArray[np.float32]
Image = NDArray[np.uint8] | NDArray[np.uint16]


def expose(
    radiance: Floats, spec: ImageChainSpec, focal_px: float, rng: np.random.Generator
) -> Image:
    """Turn clean radiance into an image.

    ``electrons = full_well / white * vignetting * blur(radiance)``; photon noise is Poisson, of
    variance ``electrons`` (drawn as a Gaussian, true to 1 % above 100 electrons); read noise adds
    its variance; the sum is clipped, encoded and rounded.

    Args:
        radiance: Relative to a white Lambert surface that faces the sun, Shape (h, w).
        spec: The chain.
        focal_px: True focal length, for the vignetting [px].
        rng: The image's own noise.

    Returns:
        Shape (h, w), uint8 for 8 bit and uint16 for 12 bit.
    """
    image = np.asarray(radiance, dtype=np.float32)
    if spec.blur_sigma_px > 0:
        image = gaussian_filter(image, spec.blur_sigma_px, mode="nearest", truncate=4.0)
    gain = vignetting(image.shape[0], image.shape[1], focal_px, spec.vignetting)
    noisy = spec.photon_noise or spec.read_noise_e > 0
    shape = image.shape if noisy else (1, 1)
    normal = rng.standard_normal(shape, dtype=np.float32) if noisy else np.zeros((1, 1), np.float32)
    top = (1 << spec.bits) - 1
    out = np.empty(image.shape, np.uint16 if spec.bits > 8 else np.uint8)
    scale = spec.full_well_e / spec.white_radiance
    root = spec.encoding == "square_root"
    photons = 1.0 if spec.photon_noise else 0.0
    noise = (photons, spec.read_noise_e**2)
    _digitise(image, gain, normal, scale, spec.full_well_e, noise, root, top, out)
    return out


@lru_cache(maxsize=4)
def vignetting(height_px: int, width_px: int, focal_px: float, strength: float) -> Floats:
    """Give the gain ``1 - strength (1 - cos^4 a)``, a the angle off the axis, Shape (h, w).

    Reference:
        The natural illumination law of a thin lens; the axis is taken through the middle.
    """
    v = np.arange(height_px)[:, None] - (height_px - 1) / 2
    u = np.arange(width_px)[None, :] - (width_px - 1) / 2
    cos2 = focal_px**2 / (focal_px**2 + u**2 + v**2)
    out = (1 - strength * (1 - cos2**2)).astype(np.float32)
    out.flags.writeable = False
    return out


@njit(cache=True, nogil=True, fastmath=False)
def _digitise(  # type: ignore[no-untyped-def]
    image, gain, normal, scale, full_well, noise, root, top, out
):
    """Scale to electrons, add noise, encode and round, pixel by pixel."""
    noisy = normal.shape[0] > 1
    for i in range(image.shape[0]):
        for j in range(image.shape[1]):
            electrons = max(scale * gain[i, j] * image[i, j], 0.0)
            if noisy:
                variance = noise[1] + noise[0] * electrons
                electrons += np.sqrt(variance) * normal[i, j]
            level = min(max(electrons / full_well, 0.0), 1.0)
            if root:
                level = np.sqrt(level)
            out[i, j] = int(level * top + 0.5)
