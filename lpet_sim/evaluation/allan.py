"""Allan deviation: how the mean of a signal over tau differs from the next one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lpet_sim.recording.arrays import Array


def allan_deviation(rates: ArrayLike, rate_hz: float, tau_s: ArrayLike) -> Array:
    """Give the overlapping Allan deviation of evenly sampled rates.

    ``sigma^2(tau) = <(x_k+2m - 2 x_k+m + x_k)^2> / (2 tau^2)`` with x the integral of the rates and
    ``tau = m / rate``.

    Args:
        rates: Samples, each the mean over its interval, Shape (n,) or (n, axes).
        rate_hz: Sample rate.
        tau_s: Averaging times [s], Shape (t,), each rounded to whole samples and less than half
            of the recording.

    Returns:
        In the unit of the rates, Shape (t,) or (t, axes).

    Raises:
        ValueError: A tau is shorter than a sample or longer than half the samples.

    Reference:
        IEEE Std 952, annex C [recalled].
    """
    samples = np.asarray(rates, dtype=float)
    start = np.zeros((1, *samples.shape[1:]))
    x = np.concatenate([start, np.cumsum(samples - samples.mean(axis=0), axis=0)]) / rate_hz
    spans = np.rint(np.asarray(tau_s, dtype=float) * rate_hz).astype(int)
    if spans.min() < 1 or 2 * spans.max() >= len(x):
        raise ValueError(
            f"averaging times must lie between {1 / rate_hz:g} s and half of the "
            f"{len(samples) / rate_hz:g} s recorded"
        )
    return np.array([_deviation(x, span, span / rate_hz) for span in spans])


def _deviation(x: Array, span: int, tau_s: float) -> Array:
    second = x[2 * span :] - 2 * x[span:-span] + x[: -2 * span]
    return np.asarray(np.sqrt(np.mean(second**2, axis=0) / 2) / tau_s)
