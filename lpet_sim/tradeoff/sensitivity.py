"""What matters: how the predicted error hangs on each parameter of the space."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import Array
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.grades import IMU_GRADES
from lpet_sim.tradeoff.space import SensorSpaceSpec
from lpet_sim.tradeoff.static import Prediction, predict
from lpet_sim.tradeoff.static_view import Setting

_BINS = 8
_CURVE_POINTS = 9


@dataclass(frozen=True)
class Sensitivity:
    """What one parameter does to the predicted error.

    Attributes:
        parameter: Its name.
        rank_correlation: Spearman's, of parameter and error over the candidates; the inertial
            unit's grades count from the best down.
        first_order: Share of the variance of the error's logarithm that this parameter explains
            alone.
        values: Values of the one-at-a-time curve from the recommended sensor.
        error_ratio: Predicted error at them, as a share of the distance, Shape (n,).
    """

    parameter: str
    rank_correlation: float
    first_order: float
    values: tuple[Any, ...]
    error_ratio: Array


def sensitivities(
    predictions: Sequence[Prediction],
    centre: Candidate,
    space: SensorSpaceSpec,
    setting: Setting,
    progress: Progress = silent,
) -> tuple[Sensitivity, ...]:
    """Give what each varied parameter does.

    Args:
        predictions: Of candidates drawn from the space.
        centre: From where the one-at-a-time curves start.
        space: The space.
        setting: As for the predictions.
        progress: Called after each parameter.
    """
    error = np.log([p.error_ratio for p in predictions])
    found = []
    for name in track(space.varied, max(1, len(space.varied)), progress):
        x = np.array([_number(p.candidate, name) for p in predictions])
        values = curve_values(space, name)
        curve = [predict(_with(centre, name, v), setting).error_ratio for v in values]
        correlation = _rank_correlation(x, error)
        share = first_order_share(x, error)
        found.append(Sensitivity(name, correlation, share, values, np.array(curve)))
    return tuple(found)


def curve_values(space: SensorSpaceSpec, name: str) -> tuple[Any, ...]:
    """Give the values at which a curve is drawn: those of the list, or nine of the range."""
    if name == "imu" or space.axis(name).values:
        return space.choices(name)
    return tuple(float(x) for x in np.linspace(*space.axis(name).limits, _CURVE_POINTS))


def first_order_share(x: Array, y: Array) -> float:
    """Give ``Var(E[y | x]) / Var(y)`` from given data, Shape (n,) each.

    The means of y over groups of equal x, or eight of about equal size; what their scatter owes to
    the few samples in a group, ``var / n``, is taken off.

    Reference: Saltelli and others, Global Sensitivity Analysis (2008), sec. 1.2.3 [recalled].
    """
    if np.ptp(y) == 0.0 or np.ptp(x) == 0.0:
        return 0.0
    groups = _groups(x)
    means = np.array([y[g].mean() for g in groups])
    sizes = np.array([len(g) for g in groups])
    noise = np.array([y[g].var(ddof=1) if len(g) > 1 else 0.0 for g in groups])
    between = float(np.average((means - y.mean()) ** 2, weights=sizes))
    between -= float(noise.sum() / len(y)) * (1.0 - 1.0 / len(groups))
    return float(np.clip(between / y.var(), 0.0, 1.0))


def _groups(x: Array) -> list[Any]:
    levels, level = np.unique(x, return_inverse=True)
    if len(levels) <= _BINS:
        return [np.flatnonzero(level == k) for k in range(len(levels))]
    return np.array_split(np.argsort(x, kind="stable"), _BINS)


def _rank_correlation(x: Array, y: Array) -> float:
    if len(x) < 3 or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return 0.0
    return float(spearmanr(x, y).statistic)


def _number(candidate: Candidate, name: str) -> float:
    value = getattr(candidate, name)
    return float(list(IMU_GRADES).index(value)) if name == "imu" else float(value)


def _with(candidate: Candidate, name: str, value: object) -> Candidate:
    if name == "resolution_px":
        value = round(float(str(value)))
    return candidate.model_copy(update={name: value})
