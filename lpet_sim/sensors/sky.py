"""The Martian sky: brightest towards the horizon and around the sun."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.spec import SunSpec

HORIZON_RADIANCE = 0.20
"""Radiance of the sky near the horizon, as of bright ground. A choice, after Navcam images."""

ZENITH_SHARE = 0.55
"""Radiance high up over that near the horizon. A choice."""

GLOW = 0.5
"""Brightening close around the sun over the horizon's radiance. A choice; forward scattering by
dust makes it strong on Mars."""


def sky_coefficients(sun: SunSpec) -> Array:
    """Give what `sky_radiance` needs: (sun x, y, z, horizon, zenith share, glow), Shape (6,)."""
    return np.array([*sun.direction, HORIZON_RADIANCE, ZENITH_SHARE, GLOW])


@njit(cache=True, nogil=True)
def sky_radiance(R_world_camera, x, y, sky):  # type: ignore[no-untyped-def]
    """Give the sky's radiance in the direction (x, y, 1) of the camera.

    ``L = L_h (z + (1 - z) exp(-4 sin e) + g exp(-3 a))`` with elevation e, angle a from the sun.
    """
    scale = 1.0 / math.sqrt(x * x + y * y + 1.0)
    east = (R_world_camera[0, 0] * x + R_world_camera[0, 1] * y + R_world_camera[0, 2]) * scale
    north = (R_world_camera[1, 0] * x + R_world_camera[1, 1] * y + R_world_camera[1, 2]) * scale
    up = (R_world_camera[2, 0] * x + R_world_camera[2, 1] * y + R_world_camera[2, 2]) * scale
    cosine = min(max(east * sky[0] + north * sky[1] + up * sky[2], -1.0), 1.0)
    height = sky[4] + (1.0 - sky[4]) * math.exp(-4.0 * max(up, 0.0))
    return sky[3] * (height + sky[5] * math.exp(-3.0 * math.acos(cosine)))
