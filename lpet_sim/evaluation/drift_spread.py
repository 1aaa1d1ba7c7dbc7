"""How much further some landmarks slide than others, from what means and medians see of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import brentq
from scipy.stats import chi2

GATE: Final = float(chi2.isf(1e-3, 3))
"""Where squares are cut off: 99.9 % of three Gaussian coordinates are below."""
MEAN_CUT: Final = float(3 * chi2.cdf(GATE, 5) + GATE * chi2.sf(GATE, 3))
"""Mean of a chi-square of three degrees of freedom that is cut off at the gate."""
MEDIAN: Final = float(chi2.median(3))
"""Median of a chi-square of three degrees of freedom."""
SPREAD_MAX: Final = 3.0
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(60)
_FAR: Final = 40.0


@dataclass(frozen=True)
class Spread:
    """Walks of landmarks, log-normally distributed.

    Attributes:
        drift_px: Root mean square over landmarks [px/sqrt(m)].
        spread: Standard deviation of the logarithm.
    """

    drift_px: float
    spread: float


def spread_of(drift_px: float, drift_median_px: float) -> Spread:
    """Give the walks that a Gaussian one explains by means of cut squares, and another by medians.

    A landmark's own walk is ``c exp(s n)``, n standard normal, and the normalised square of a pair
    is a chi-square of three degrees of freedom times its square. White noise is taken as small
    beside it.

    Args:
        drift_px: Walk by means of squares that are cut off at the gate [px/sqrt(m)].
        drift_median_px: Walk by medians [px/sqrt(m)].
    """
    if not 0.0 < drift_median_px < drift_px:
        return Spread(drift_px, 0.0)
    wanted = 2.0 * np.log(drift_px / drift_median_px)
    if _log_ratio(SPREAD_MAX) <= wanted:
        spread = SPREAD_MAX
    else:
        spread = float(brentq(lambda s: _log_ratio(s) - wanted, 0.0, SPREAD_MAX))
    scale = drift_px / np.exp(0.5 * _log_by_mean(spread))
    return Spread(float(scale * np.exp(spread**2)), spread)


def _log_ratio(spread: float) -> float:
    return _log_by_mean(spread) - _log_by_median(spread)


def _log_by_mean(spread: float) -> float:
    """Give the log of the squared walk whose cut squares have the right mean, c being 1.

    ``E min(k X, g) = 3 k F_5(g / k) + g (1 - F_3(g / k))`` for a chi-square X of three degrees.
    """
    own = np.exp(2.0 * spread * _NODES)

    def off(log_square: float) -> float:
        k = own / np.exp(log_square)
        cut = 3.0 * k * chi2.cdf(GATE / k, 5) + GATE * chi2.sf(GATE / k, 3)
        return float(_WEIGHTS @ cut / _WEIGHTS.sum()) - MEAN_CUT

    return float(brentq(off, -_FAR, _FAR))


def _log_by_median(spread: float) -> float:
    """Give the log of the squared walk whose squares have the right median, c being 1."""
    own = np.exp(2.0 * spread * _NODES)

    def off(log_square: float) -> float:
        below = chi2.cdf(MEDIAN * np.exp(log_square) / own, 3)
        return float(_WEIGHTS @ below / _WEIGHTS.sum()) - 0.5

    return float(brentq(off, -_FAR, _FAR))
