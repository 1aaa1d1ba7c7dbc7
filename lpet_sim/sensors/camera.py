"""The two eyes: what they see of a terrain, without noise."""

from __future__ import annotations

import math
from typing import Self

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.sensors.camera_spec import StereoCameraSpec
from lpet_sim.sensors.ground_view import GroundView
from lpet_sim.sensors.render_layout import Eye
from lpet_sim.sensors.sky import sky_coefficients, sky_radiance
from lpet_sim.terrain.terrain import Terrain

Floats = NDArray[np.float32]


def make_eyes(spec: StereoCameraSpec) -> tuple[Eye, Eye]:
    """Make the left and the right pinhole camera as they truly are.

    A disparity bias of the declared calibration is a shift of the right eye's true principal
    point, ``u_right = declared - bias``, as a small turn of that eye would make it.
    """
    cx, cy = spec.principal_px
    size = (spec.width_px, spec.height_px, spec.focal_px)
    return Eye(*size, cx, cy), Eye(*size, cx - spec.declared_error.disparity_bias_px, cy)


def place_eyes(spec: StereoCameraSpec, T_body_camera: SE3) -> tuple[SE3, SE3]:
    """Give the poses of both eyes in the body; the spec's mount, if any, wins."""
    left = T_body_camera if spec.mount is None else spec.mount.se3()
    return left, left @ SE3(np.eye(3), np.array([spec.baseline_m, 0.0, 0.0]))


class StereoRenderer:
    """Renders radiance for a pair of exact pinhole cameras; keep one for a whole traverse.

    What is around the rover is made when it first comes into view, so the first pair takes
    seconds. Close it, or use it in a ``with`` statement.
    """

    def __init__(self, terrain: Terrain, spec: StereoCameraSpec, T_body_camera: SE3) -> None:
        """Open an OpenGL context for a terrain.

        Args:
            terrain: The ground, its rocks and its sun.
            spec: The cameras as they truly are.
            T_body_camera: Pose of the left eye in the body; the spec's mount, if any, wins.
        """
        self._spec = spec
        self._T_body_eyes = place_eyes(spec, T_body_camera)
        self._eyes = make_eyes(spec)
        self._view = GroundView(terrain, spec.ground, self._eyes)
        self._sky = sky_coefficients(terrain.spec.sun)

    def render(self, T_world_body: SE3) -> tuple[Floats, Floats]:
        """Render both eyes.

        Args:
            T_world_body: Pose of the body.

        Returns:
            Left and right radiance, relative to a white Lambert surface that faces the sun,
            Shape (h, w) each; row 0 is the top.
        """
        left, right = (self._render_eye(T_world_body, eye) for eye in (0, 1))
        return left, right

    def _render_eye(self, T_world_body: SE3, eye: int) -> Floats:
        T_world_camera = T_world_body @ self._T_body_eyes[eye]
        samples = self._view.draw(eye, T_world_camera)
        return self._to_radiance(samples, eye, T_world_camera)

    def _to_radiance(self, samples: NDArray[np.uint16], eye: int, T_world_camera: SE3) -> Floats:
        pinhole, step = self._eyes[eye], self._spec.ground.supersampling
        out = np.empty((self._spec.height_px, self._spec.width_px), np.float32)
        intrinsics = np.array([pinhole.focal_px, pinhole.cx_px, pinhole.cy_px])
        _average(samples, step, T_world_camera.rotation, intrinsics, self._sky, out)
        return out

    def depth(self, T_world_body: SE3) -> Floats:
        """Render the depth z of the ground in the left eye.

        Returns:
            Depth at the pixels' centres [m], infinite in the sky, Shape (h, w).
        """
        inverse = self._view.draw_depth(0, T_world_body @ self._T_body_eyes[0])
        step = self._spec.ground.supersampling
        h, w = self._spec.height_px, self._spec.width_px
        # The inverse of the depth is linear on a plane, so its mean is that of the centre.
        mean = inverse[::-1].reshape(h, step, w, step).mean(axis=(1, 3))
        with np.errstate(divide="ignore"):
            return np.where(mean > 1e-7, 1.0 / mean, math.inf).astype(np.float32)

    def close(self) -> None:
        """Free the context."""
        self._view.close()

    def __enter__(self) -> Self:
        """Give the renderer itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Free the context."""
        self.close()


@njit(cache=True, nogil=True)
def _average(samples, step, R_world_camera, intrinsics, sky, out):  # type: ignore[no-untyped-def]
    """Average the samples of each pixel, the sky put in where nothing was drawn."""
    rows, columns = out.shape
    focal, cx, cy = intrinsics
    weight = 1.0 / (step * step)
    for i in range(rows):
        for j in range(columns):
            total, empty = 0.0, 0
            for a in range(step):
                row = rows * step - 1 - (i * step + a)
                for b in range(step):
                    value = samples[row, j * step + b]
                    total += value
                    empty += value == 0
            total /= 65535.0
            if empty > 0:
                total += empty * sky_radiance(
                    R_world_camera, (j - cx) / focal, (i - cy) / focal, sky
                )
            out[i, j] = total * weight
