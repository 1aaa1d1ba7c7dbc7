"""Tracks that slide: what stands for a landmark walks in the image that showed it first.

What a front end follows is not always a point of the world: the edge of a rock against the ground
behind it, a patch that looks different from a new side. Here the sighting ``z`` that stands for a
landmark walks with the distance driven, in the image that showed the landmark first, and each image
shows the place that it then stands for. The walk goes on while the landmark is not seen.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.sensors.landmark_kernels import normal_pair
from lpet_sim.terrain.hashing import tile_state

_NEAREST_M = 0.05


def slide(
    stereo_px: Array,
    landmark_id: Ints,
    image: Ints,
    T_world_camera: SE3,
    walk: Array,
    camera: StereoCalibration,
) -> tuple[Array, NDArray[np.bool_]]:
    """Show landmarks where they have walked to.

    ``x = z_first + walk`` stands for the point ``P / w``, ``P = b (u_left - cx, v - cy, f)`` and
    ``w = u_left - u_right``; the camera at ``T_first_now = (R, t)`` sees ``R' P - R' t w`` with the
    same w.

    Args:
        stereo_px: True (u_left, u_right, v) of each showing [px], Shape (m, 3).
        landmark_id: Whose showing it is, Shape (m,).
        image: In which image, in order, Shape (m,).
        T_world_camera: True poses of the left eye in the images, Shape (n,).
        walk: How far each has walked in its first image [px], Shape (m, 3).
        camera: The pair as it truly is.

    Returns:
        Where each is seen [px], Shape (m, 3), and which of them is still in both images, (m,).
    """
    first = _first_rows(landmark_id)
    T_first_now = T_world_camera[image[first]].inverse() @ T_world_camera[image]
    x = stereo_px[first] + walk
    P = np.stack([x[:, 0] - camera.cx_px, x[:, 2] - camera.cy_px], axis=1)
    P = camera.baseline_m * np.column_stack([P, np.full(len(x), camera.focal_px)])
    w = x[:, 0] - x[:, 1]
    turned = P - T_first_now.translation * w[:, None]
    X, Y, Z = np.einsum("mij,mi->jm", T_first_now.rotation, turned)
    # The depth is Z / w; beyond infinity, where w is negative, all that is ahead has Z above zero.
    ahead = np.maximum(_NEAREST_M * w, 0.0) < Z
    Z = np.where(ahead, Z, 1.0)
    left = camera.focal_px * X / Z + camera.cx_px
    right = left - camera.focal_px * camera.baseline_m * w / Z
    out = np.stack([left, right, camera.focal_px * Y / Z + camera.cy_px], axis=1)
    limit = np.array([camera.width_px, camera.width_px, camera.height_px]) - 1.0
    return out, np.asarray(ahead & np.all((out >= 0.0) & (out <= limit), axis=1))


def walks(landmark_id: Ints, image: Ints, t_ns: Ints, distance_m: Array, key: int) -> Array:
    """Draw how far landmarks have walked since their first showing, of 1 px in a metre driven.

    Each step belongs to a landmark and an image, whether that shows the landmark or not.

    Args:
        landmark_id: Names, Shape (m,).
        image: In which image each is shown, in order, Shape (m,).
        t_ns: Times of the images, which name them [ns], Shape (n,).
        distance_m: Distance driven up to each image [m], Shape (n,).
        key: What is hashed with the image and the landmark.

    Returns:
        Sums of steps of variance ``distance`` [px], Shape (m, 3); zero where first shown.
    """
    order = np.lexsort((image, landmark_id))
    out = np.empty((len(order), 3))
    step = np.sqrt(np.diff(distance_m, prepend=distance_m[:1]))
    _walk(key, t_ns, step, landmark_id[order], image[order], out)
    walked = np.empty_like(out)
    walked[order] = out
    return walked


def sizes(landmark_id: Ints, spread: float, key: int) -> Array:
    """Draw how much further each landmark slides than the mean: log-normal, of mean square 1.

    Args:
        landmark_id: Names, Shape (m,).
        spread: Standard deviation of the logarithm.
        key: What is hashed with the landmark.

    Returns:
        ``exp(spread n - spread^2)``, n standard normal, Shape (m,).
    """
    out = np.empty(len(landmark_id))
    _draw_normals(key, landmark_id, out)
    return np.asarray(np.exp(spread * out - spread**2))


def _first_rows(landmark_id: Ints) -> Ints:
    """Give the row of each landmark's first showing, Shape (m,)."""
    _, first, which = np.unique(landmark_id, return_index=True, return_inverse=True)
    return np.asarray(first[which])


@njit(cache=True, nogil=True)
def _draw_normals(key, identity, out):  # type: ignore[no-untyped-def]
    for row in range(len(identity)):
        out[row], _ = normal_pair(tile_state(key, 1, 0, identity[row]), 0)


@njit(cache=True, nogil=True)
def _walk(key, t_ns, step, identity, image, out):  # type: ignore[no-untyped-def]
    """Sum the steps of landmarks, rows sorted by landmark and image."""
    total = np.zeros(3)
    for row in range(len(identity)):
        if row == 0 or identity[row] != identity[row - 1]:
            total[:] = 0.0
        else:
            for k in range(image[row - 1] + 1, image[row] + 1):
                state = tile_state(key, 0, t_ns[k], identity[row])
                left, right = normal_pair(state, 0)
                v, _ = normal_pair(state, 2)
                total[0] += step[k] * left
                total[1] += step[k] * right
                total[2] += step[k] * v
        out[row] = total
