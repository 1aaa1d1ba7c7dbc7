"""Sub-pixel alignment of small patches, compiled.

A patch of image a is compared with image b under ``b(x + p) = gain a(x) + offset``; gain and offset
are removed by normalising both, which leaves two (or one) unknown shifts for Gauss-Newton.

Reference:
    Lucas and Kanade (1981); Baker and Matthews (2004) for the inverse compositional form.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Array = NDArray[np.float64]

_MOVED_PX = 0.003
_NOISE_FLOOR = 1e-6


@njit(cache=True, nogil=True, inline="always")
def _bilinear(image: Floats, u: float, v: float) -> float:
    i, j = int(v), int(u)
    dv, du = v - i, u - j
    top = image[i, j] + du * (image[i, j + 1] - image[i, j])
    bottom = image[i + 1, j] + du * (image[i + 1, j + 1] - image[i + 1, j])
    return top + dv * (bottom - top)


@njit(cache=True, nogil=True)
def inside(image: Floats, u: float, v: float, reach: float) -> bool:
    """Tell whether a square patch of that reach [px] lies in the image with a pixel to spare."""
    h, w = image.shape
    return reach + 1 <= u < w - reach - 2 and reach + 1 <= v < h - reach - 2


@njit(cache=True, nogil=True)
def sample(image: Floats, u: float, v: float, half: int, warp: Array) -> Floats:
    """Sample a patch around (u, v) with a linear warp, Shape (2 half + 1, 2 half + 1).

    Args:
        image: Shape (h, w).
        u: Centre along the row [px].
        v: Centre along the column [px].
        half: Half width [px].
        warp: Offset in the patch to offset in the image, Shape (2, 2).
    """
    out = np.empty((2 * half + 1, 2 * half + 1), np.float32)
    for y in range(-half, half + 1):
        for x in range(-half, half + 1):
            out[y + half, x + half] = _bilinear(
                image, u + warp[0, 0] * x + warp[0, 1] * y, v + warp[1, 0] * x + warp[1, 1] * y
            )
    return out


@njit(cache=True, nogil=True)
def steepest_descent(template: Floats, active: NDArray[np.int64]) -> tuple[Array, Array, Array]:
    """Linearise a template in the active affine parameters, gain and offset projected out.

    Parameters 0 to 5 are (du, du/dx, du/dy, dv, dv/dx, dv/dy).

    Args:
        template: Patch with a margin of one pixel, Shape (n + 2, n + 2).
        active: Which parameters move, Shape (k,).

    Returns:
        Normalised template, Shape (n * n,); images of the parameters, Shape (k, n * n); their
        normal matrix, Shape (k, k).
    """
    n = template.shape[0] - 2
    half = n // 2
    flat = np.empty(n * n)
    images = np.empty((len(active), n * n))
    for y in range(n):
        for x in range(n):
            i = y * n + x
            flat[i] = template[y + 1, x + 1]
            gradient_u = 0.5 * (template[y + 1, x + 2] - template[y + 1, x])
            gradient_v = 0.5 * (template[y + 2, x + 1] - template[y, x + 1])
            for k in range(len(active)):
                order = active[k] % 3
                lever = 1.0 if order == 0 else (x - half if order == 1 else y - half)
                images[k, i] = lever * (gradient_u if active[k] < 3 else gradient_v)
    normalise(flat, images)
    return flat, images, images @ images.T


@njit(cache=True, nogil=True)
def normalise(flat: Array, images: Array) -> None:
    """Bring a patch to zero mean and unit length, and its derivatives with it, in place."""
    flat -= flat.mean()
    length = np.sqrt(flat @ flat) + _NOISE_FLOOR
    flat /= length
    for k in range(len(images)):
        images[k] -= images[k].mean()
        images[k] -= (images[k] @ flat) * flat
        images[k] /= length


@njit(cache=True, nogil=True)
def align(
    template: Floats,
    image: Floats,
    u: float,
    v: float,
    warp: Array,
    active: NDArray[np.int64],
    iterations_max: int,
    shift_max_px: float,
) -> tuple[float, float, float, float]:
    """Find where a template lies in an image, near a first guess.

    Inverse compositional Gauss-Newton over the active affine parameters.

    Args:
        template: Patch with a margin of one pixel, Shape (n + 2, n + 2).
        image: Shape (h, w).
        u: First guess of the centre along the row [px].
        v: Likewise along the column [px].
        warp: First guess of the linear part, Shape (2, 2).
        active: Parameters that move, see `steepest_descent`.
        iterations_max: Most iterations.
        shift_max_px: Largest distance from the first guess.

    Returns:
        Centre (u, v) [px], normalised correlation (-1 where it failed), and the standard deviation
        of the centre that the remaining difference of the patches explains [px].
    """
    n = template.shape[0] - 2
    half = n // 2
    flat, images, H = steepest_descent(template, active)
    damping = 1e-9 * np.trace(H) / len(active) + 1e-15
    H_inv = np.linalg.inv(H + damping * np.eye(len(active)))
    W = np.eye(3)
    W[:2, :2] = warp
    error, no_images = flat, np.empty((0, 0))
    for _ in range(iterations_max):
        reach = half * (np.abs(W[:2, :2]).sum() / 2 + 0.5)
        moved = abs(W[0, 2]) > shift_max_px or abs(W[1, 2]) > shift_max_px
        if moved or not inside(image, u + W[0, 2], v + W[1, 2], reach):
            return u, v, -1.0, np.inf
        patch = sample(image, u + W[0, 2], v + W[1, 2], half, W[:2, :2]).ravel().astype(np.float64)
        normalise(patch, no_images)
        error = patch - flat
        step = H_inv @ (images @ error)
        D = np.eye(3)
        for k in range(len(active)):
            D[active[k] // 3, (2, 0, 1)[active[k] % 3]] += step[k]
        W = W @ np.linalg.inv(D)
        if np.abs(step).max() < _MOVED_PX:
            break
    correlation = 1 - 0.5 * (error @ error)
    spread = (error @ error) / (n * n - len(active) - 2)
    worst = 0.0
    for k in range(len(active)):
        if active[k] % 3 == 0:
            worst = max(worst, H_inv[k, k])
    centre_u, centre_v = float(u + W[0, 2]), float(v + W[1, 2])
    return centre_u, centre_v, float(correlation), float(np.sqrt(spread * worst))
