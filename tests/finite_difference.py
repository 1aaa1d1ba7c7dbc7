"""The one checker of Jacobians: central differences."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def numerical_jacobian(f: Callable[[Array], ArrayLike], x: ArrayLike, step: float = 1e-6) -> Array:
    """Give df/dx by central differences, Shape (m, n).

    Args:
        f: A function of a vector, Shape (n,), to a vector, Shape (m,).
        x: Where, Shape (n,).
        step: Half the distance between the two evaluations.
    """
    x = np.asarray(x, dtype=float)
    columns = [
        (np.asarray(f(x + step * e)) - np.asarray(f(x - step * e))) / (2 * step)
        for e in np.eye(len(x))
    ]
    return np.stack(columns, axis=-1)


def assert_jacobian(
    f: Callable[[Array], ArrayLike],
    x: ArrayLike,
    jacobian: ArrayLike,
    tolerance: float = 1e-6,
    step: float = 1e-6,
) -> None:
    """Hold a Jacobian to central differences, relative to its largest entry (or to 1)."""
    expected = numerical_jacobian(f, x, step)
    scale = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=tolerance * scale)
