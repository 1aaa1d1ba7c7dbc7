"""Rendering of the two eyes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.sensors.camera_spec import StereoCameraSpec
from lpet_sim.terrain.terrain import Terrain

Floats = NDArray[np.float32]


class StereoRenderer:
    """Render what the two eyes see, without noise."""

    def __init__(self, terrain: Terrain, spec: StereoCameraSpec, T_body_camera: SE3) -> None:
        raise NotImplementedError

    def render(self, T_world_body: SE3) -> tuple[Floats, Floats]:
        """Render both eyes: radiance, Shape (h, w) each."""
        raise NotImplementedError

    def depth(self, T_world_body: SE3) -> Floats:
        """Render the depth z in the left eye [m], Shape (h, w)."""
        raise NotImplementedError

    def close(self) -> None:
        """Free the context."""
