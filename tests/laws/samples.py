"""Samples for the laws: uniform, near the identity and near a half turn."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lpet_sim.rng import stream

Array = NDArray[np.float64]

ANGLES_RAD = (0.0, 1e-12, 1e-9, 1e-7, 1e-5, 0.99e-4, 1.01e-4, 1e-3, 0.1, 1.0, 2.0, 3.0)
NEAR_PI_RAD = tuple(np.pi - d for d in (1e-2, 1e-4, 1e-6, 1e-8))


def rotation_vectors(*names: str, half_turns: bool = True, count: int = 8) -> Array:
    """Give rotation vectors in random directions for every angle, Shape (n, 3)."""
    rng = stream(11, "laws", *names)
    angles = np.repeat(ANGLES_RAD + (NEAR_PI_RAD if half_turns else ()), count)
    axes = rng.normal(size=(len(angles), 3))
    axes[::count] = np.eye(3)[np.arange(len(axes[::count])) % 3]
    return angles[:, None] * axes / np.linalg.norm(axes, axis=1, keepdims=True)


def twists(*names: str, half_turns: bool = True) -> Array:
    """Give twists (translation, rotation) over the same angles, Shape (n, 6)."""
    phi = rotation_vectors(*names, half_turns=half_turns)
    rho = stream(12, "laws", *names).normal(0, 3, phi.shape)
    return np.concatenate([rho, phi], axis=1)


def numerical_jacobian(f, x: Array, step: float = 1e-6) -> Array:  # type: ignore[no-untyped-def]
    """Differentiate f: R^n -> R^m at one x by central differences, Shape (m, n)."""
    columns = [(f(x + d) - f(x - d)) / (2 * step) for d in step * np.eye(len(x))]
    return np.stack(columns, axis=-1)
