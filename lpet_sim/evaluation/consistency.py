"""Does an estimator know how wrong it is? NEES, NIS and their chi-square bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2

from lpet_sim.recording.arrays import Array

BLOCKS = {"position": slice(0, 3), "attitude": slice(3, 6), "pose": slice(0, 6)}
"""The blocks of ``xi = (translation, rotation)`` of which a NEES is given."""


@dataclass(frozen=True)
class Consistency:
    """An average normalised squared error against its chi-square band.

    Attributes:
        value: The average over runs (ANEES or ANIS); its expectation is ``dof``.
        low: Lower end of the two-sided band.
        high: Upper end of the band.
        runs: Number of independent runs averaged.
        dof: Degrees of freedom of each.
    """

    value: float
    low: float
    high: float
    runs: int
    dof: int

    @property
    def is_consistent(self) -> bool:
        """Whether the average lies inside the band; above it the estimator is overconfident."""
        return self.low <= self.value <= self.high


def normalised_square(error: ArrayLike, covariance: ArrayLike) -> Array:
    """Give ``e^T P^-1 e``: the NEES of an estimation error, the NIS of an innovation.

    Args:
        error: Errors or innovations, Shape (n, d).
        covariance: Their covariances, Shape (n, d, d).

    Returns:
        Shape (n,); NaN where the covariance is not positive definite.

    Reference:
        Bar-Shalom, Li, Kirubarajan (2001), eq. 5.4.2-1 and 5.4.2-3 [recalled].
    """
    e, P = np.asarray(error, dtype=float), np.asarray(covariance, dtype=float)
    good = is_positive_definite(P)
    out = np.full(len(e), np.nan)
    if good.any():
        weighted = np.linalg.solve(P[good], e[good][..., None])[..., 0]
        out[good] = np.einsum("ni,ni->n", e[good], weighted)
    return out


def is_positive_definite(covariance: Array) -> NDArray[np.bool_]:
    """Tell which covariances, Shape (n, d, d), are finite and positive definite, Shape (n,)."""
    positive = np.diagonal(covariance, axis1=1, axis2=2) > 0
    good = np.asarray(np.isfinite(covariance).all(axis=(1, 2)) & positive.all(axis=1))
    try:
        np.linalg.cholesky(covariance[good])
    except np.linalg.LinAlgError:
        # One bad matrix fails the whole stack: only then is each one looked at.
        good[good] = np.linalg.eigvalsh(covariance[good])[:, 0] > 0
    return good


def nees(xi: Array, covariance: Array) -> Array:
    """Give the NEES of position, attitude and the whole pose.

    Args:
        xi: Right perturbations with ``T_true = T_est @ exp(xi)`` [m, rad], Shape (n, 6).
        covariance: Covariances of xi, Shape (n, 6, 6).

    Returns:
        Columns in the order of `BLOCKS`, Shape (n, 3).
    """
    blocks = [normalised_square(xi[:, b], covariance[:, b, b]) for b in BLOCKS.values()]
    return np.stack(blocks, axis=-1)


def chi_square_band(runs: int, dof: int, confidence: float = 0.95) -> tuple[float, float]:
    """Give the two-sided band of an average of ``runs`` chi-square values of ``dof`` degrees.

    ``chi2_{N d}^{-1}((1 -+ c) / 2) / N``. It holds for independent runs at one time, not for an
    average over the time of one run, whose errors are correlated.

    Args:
        runs: Number N of independent runs.
        dof: Degrees of freedom d of each.
        confidence: Share c of consistent estimators whose average lies inside.
    """
    tail = (1 - confidence) / 2
    low, high = chi2.ppf([tail, 1 - tail], runs * dof) / runs
    return float(low), float(high)


def anees(values: ArrayLike, dof: int, confidence: float = 0.95) -> Consistency:
    """Average the NEES (or NIS) of independent runs at one time, with its band.

    Args:
        values: One value for each run, Shape (runs,).
        dof: Degrees of freedom of each value.
        confidence: See `chi_square_band`.
    """
    per_run = np.asarray(values, dtype=float)
    low, high = chi_square_band(len(per_run), dof, confidence)
    return Consistency(float(per_run.mean()), low, high, len(per_run), dof)
