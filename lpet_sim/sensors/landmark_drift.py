"""Tracks that slide: what stands for a landmark walks in the images with the distance driven.

What a front end follows is not always a point of the world: the edge of a rock against the ground
behind it, a patch that looks different from a new side. Here each image sees what stands for a
landmark a step away from where the image before saw it. A step on a far rock is a long way in the
world; steps are alike in the images that show them, as those of rendered images are, however far
off the landmark was when it was first seen.
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

    From one showing to the next a sighting x goes where the point stands that it stands for, and
    then on by the step of its walk. That point is ``P / w``, ``P = b (u_left - cx, v - cy, f)`` and
    ``w = u_left - u_right``; a camera at ``T_before_now = (R, t)`` sees ``R' P - R' t w`` with the
    same w, so that points beyond infinity, where w is negative, are as good as others.

    Args:
        stereo_px: True (u_left, u_right, v) of each showing [px], Shape (m, 3).
        landmark_id: Whose showing it is, Shape (m,).
        image: In which image, in order, Shape (m,).
        T_world_camera: True poses of the left eye in the images, Shape (n,).
        walk: Sum of each landmark's steps so far [px], Shape (m, 3).
        camera: The pair as it truly is.

    Returns:
        Where each is seen [px], Shape (m, 3), and which of them is still in both images, (m,).
    """
    order = np.lexsort((image, landmark_id))
    pinhole = np.array([camera.focal_px, camera.cx_px, camera.cy_px, camera.baseline_m])
    rows, ahead = np.empty_like(stereo_px), np.empty(len(order), np.bool_)
    R, p = np.array(T_world_camera.rotation), np.array(T_world_camera.translation)
    sorted_by_name = landmark_id[order], image[order], stereo_px[order], walk[order]
    _slide(*sorted_by_name, R, p, pinhole, rows, ahead)
    out, seen = np.empty_like(rows), np.empty_like(ahead)
    out[order], seen[order] = rows, ahead
    limit = np.array([camera.width_px, camera.width_px, camera.height_px]) - 1.0
    return out, np.asarray(seen & np.all((out >= 0.0) & (out <= limit), axis=1))


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


@njit(cache=True, nogil=True)
def _transfer(x, R_a, p_a, R_b, p_b, camera):  # type: ignore[no-untyped-def]
    """Move a sighting from camera a to b, and tell whether its point is ahead of b."""
    f, cx, cy, b = camera
    w = x[0] - x[1]
    seen, P = (b * (x[0] - cx), b * (x[2] - cy), b * f), (p_a - p_b) * w
    for i in range(3):
        for j in range(3):
            P[i] += R_a[i, j] * seen[j]
    X = R_b[0, 0] * P[0] + R_b[1, 0] * P[1] + R_b[2, 0] * P[2]
    Y = R_b[0, 1] * P[0] + R_b[1, 1] * P[1] + R_b[2, 1] * P[2]
    Z = R_b[0, 2] * P[0] + R_b[1, 2] * P[1] + R_b[2, 2] * P[2]
    if max(_NEAREST_M * w, 0.0) >= Z:
        return False
    x[0] = f * X / Z + cx
    x[1] = x[0] - f * b * w / Z
    x[2] = f * Y / Z + cy
    return True


@njit(cache=True, nogil=True)
def _slide(identity, image, stereo_px, walk, R, p, camera, out, ahead):  # type: ignore[no-untyped-def]
    """Slide landmarks, rows sorted by landmark and image; one behind the camera is lost."""
    x, lives = np.empty(3), True
    for row in range(len(identity)):
        before, now = image[row - 1], image[row]
        if row == 0 or identity[row] != identity[row - 1]:
            x[:], lives = stereo_px[row], True
        elif lives:
            lives = _transfer(x, R[before], p[before], R[now], p[now], camera)
            x += walk[row] - walk[row - 1]
        out[row], ahead[row] = x, lives


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
