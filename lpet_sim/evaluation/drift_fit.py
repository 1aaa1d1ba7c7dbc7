"""How far tracks slide: white noise, and a walk that grows with the distance driven.

Sightings of one landmark some images apart differ by white noise, however few images that is, and
by a walk, the more the further the rover has driven (`drift_pairs`). Both are found where the
normalised squares of these differences are what they ought to be, over all numbers of images
between. Real tracks do not slide alike: most hardly do, and a few slide far. So the walk is found
twice, from means of squares that are cut off at the chi-square gate of 99.9 %, which is how a
filter with that gate feels it, and from medians, which is how the most slide; white noise is the
same for both. From the two follows how far landmarks spread (`drift_spread`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.drift_pairs import Pairs, driven_m
from lpet_sim.evaluation.drift_spread import GATE, MEAN_CUT, MEDIAN, Spread, spread_of
from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks
from lpet_sim.evaluation.statistics import Interval, interval_of
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.rng import stream

LAGS: Final = (1, 2, 3, 5, 10)
"""How many images the sightings of a pair are apart."""
WRONG: Final = 1000.0
"""Normalised square from which on a pair is of a wrong name and not of a track that slid."""
_PAIRS_MIN: Final = 50
_ROUNDS: Final = 3
_STEPS: Final = 30
_WIDE: Final = (1.0, 1.0)
_LEAST_PX2: Final = 1e-9
_STEP: Final = 0.02
_STEP_MIN_PX2: Final = 1e-6
_LOG_LEAST: Final = -40.0
_HALVINGS: Final = 30
_RESAMPLES: Final = 1000
_NEAR: Final = 0.2


@dataclass(frozen=True, eq=False)
class DriftFit:
    """How tracks slide.

    Attributes:
        sigma_px: White noise of a coordinate, 1 sigma, with its interval over tracks.
        drift_px: Walk by means of squares, 1 sigma [px/sqrt(m)]: what to tell a filter.
        drift_median_px: Walk by medians [px/sqrt(m)]: as far as a landmark in the middle slides.
        spread: Landmarks' own walks that would give both.
        wrong: Share of sightings with a wrong name, by pairs of consecutive images.
        distance_m: Distance driven.
        lag: Images between, Shape (k,).
        pairs: Number of pairs, Shape (k,).
        walked_m: Mean distance driven between, Shape (k,).
        square: Mean normalised square, cut off at the gate, over its expectation, at white noise
            and `drift_px`, Shape (k,); 1 where they explain it.
        median: Median over its expectation, at white noise and `drift_median_px`, Shape (k,).
        by_mean_px: White noise alone that would give the pairs their mean cut square, Shape (k,);
            it grows with the images between where tracks slide.
        by_median_px: The same of their median square, Shape (k,).
        beyond: Share beyond the gate at `drift_px`, Shape (k,); 0.001 for Gaussian walks.
    """

    sigma_px: Interval
    drift_px: Interval
    drift_median_px: Interval
    spread: Spread
    wrong: float
    distance_m: float
    lag: Ints
    pairs: Ints
    walked_m: Array
    square: Array
    median: Array
    by_mean_px: Array
    by_median_px: Array
    beyond: Array

    @property
    def slides(self) -> bool:
        """Whether tracks slide beyond doubt: the intervals of both walks leave zero out."""
        return self.drift_px.low > 0.0 and self.drift_median_px.low > 0.0


def fit_drift(
    tracks: Tracks,
    path: CameraPath,
    stereo: StereoCalibration,
    lags: tuple[int, ...] = LAGS,
    seed: int = 0,
) -> DriftFit:
    """Measure white noise and walk of tracks at true poses.

    Args:
        tracks: The sightings, the errors that all share taken out.
        path: True poses of the camera in the images.
        stereo: The cameras as they truly are.
        lags: How many images the sightings of a pair are apart.
        seed: Seed of the resamples.

    Raises:
        RecordingError: There are too few pairs.
    """
    pairs = Pairs.of(tracks, path, stereo, lags)
    theta = np.array([float(np.median(tracks.sigma_px)) ** 2, *_WIDE])
    for _ in range(_ROUNDS):
        known = pairs.chosen(pairs.distance2(theta[0], theta[1]) < WRONG)
        counts = _counts(known, lags)
        theta = _solved(known, lags, theta)
    off = pairs.distance2(theta[0], theta[1])[pairs.lag == lags[0]] >= WRONG
    bare = known.distance2(1.0, 0.0)
    white, mean, middle = _intervals(known, lags, theta, seed)
    return DriftFit(
        sigma_px=white,
        drift_px=mean,
        drift_median_px=middle,
        spread=spread_of(mean.value, middle.value),
        wrong=1.0 - float(np.sqrt(1.0 - off.mean())),
        distance_m=float(driven_m(path, stereo)[-1]),
        lag=np.array(lags),
        pairs=counts,
        walked_m=np.array([known.walked_m[known.lag == lag].mean() for lag in lags]),
        square=_squares(known, lags, theta),
        median=_medians(known, lags, theta),
        by_mean_px=np.array([_white_by_mean_px(bare[known.lag == lag]) for lag in lags]),
        by_median_px=np.array([_white_by_median_px(bare[known.lag == lag]) for lag in lags]),
        beyond=_by_lag(known, lags, known.distance2(theta[0], theta[1]) >= GATE),
    )


def _counts(pairs: Pairs, lags: tuple[int, ...]) -> Ints:
    """Count the pairs of each number of images between, Shape (k,), and refuse too few."""
    counts = np.array([np.sum(pairs.lag == lag) for lag in lags])
    if counts.min() < _PAIRS_MIN:
        raise RecordingError(
            f"only {counts.min()} pairs of sightings of one landmark are "
            f"{lags[int(counts.argmin())]} images apart; a drift is measured on {_PAIRS_MIN}"
        )
    return counts


def _by_lag(pairs: Pairs, lags: tuple[int, ...], values: NDArray[np.generic]) -> Array:
    """Average values of pairs, Shape (m,), over those of each number of images between, (k,)."""
    return np.array([np.mean(values[pairs.lag == lag], dtype=float) for lag in lags])


def _squares(pairs: Pairs, lags: tuple[int, ...], theta: Array) -> Array:
    """Give mean cut squares over what they ought to be, Shape (k,)."""
    cut = np.minimum(pairs.distance2(theta[0], theta[1]), GATE)
    return _by_lag(pairs, lags, cut) / MEAN_CUT


def _medians(pairs: Pairs, lags: tuple[int, ...], theta: Array) -> Array:
    """Give median squares over what they ought to be, Shape (k,)."""
    far = pairs.distance2(theta[0], theta[2])
    return np.array([np.median(far[pairs.lag == lag]) for lag in lags]) / MEDIAN


def _white_by_mean_px(square_px2: Array) -> float:
    """Give the white noise at which the mean of cut squares is what it ought to be [px]."""
    low = high = float(np.log(np.median(square_px2) + _LEAST_PX2))
    while np.minimum(square_px2 / np.exp(low), GATE).mean() < MEAN_CUT and low > _LOG_LEAST:
        low -= 1.0
    while np.minimum(square_px2 / np.exp(high), GATE).mean() > MEAN_CUT:
        high += 1.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        larger = np.minimum(square_px2 / np.exp(middle), GATE).mean() > MEAN_CUT
        low, high = (middle, high) if larger else (low, middle)
    return float(np.exp(0.5 * high))


def _white_by_median_px(square_px2: Array) -> float:
    """Give the white noise at which the median is what it ought to be [px]."""
    return float(np.sqrt(np.median(square_px2) / MEDIAN))


def _logs(pairs: Pairs, lags: tuple[int, ...], theta: Array) -> Array:
    """Give the logarithms of what ought to be 1, Shape (2 k,)."""
    return np.log(np.append(_squares(pairs, lags, theta), _medians(pairs, lags, theta)))


def _slopes(pairs: Pairs, lags: tuple[int, ...], theta: Array) -> Array:
    """Give the derivatives of `_logs` by white noise and both walks, Shape (2 k, 3)."""
    steps = np.maximum(_STEP * theta, _STEP_MIN_PX2)
    at = _logs(pairs, lags, theta)
    rows = [(_logs(pairs, lags, theta + step) - at) / step.sum() for step in np.diag(steps)]
    return np.stack(rows, axis=1)


def _solved(pairs: Pairs, lags: tuple[int, ...], start: Array) -> Array:
    """Find white noise [px^2] and both walks [px^2/m] that explain all squares best, Shape (3,)."""
    found = least_squares(
        lambda theta: _logs(pairs, lags, theta),
        np.maximum(start, _LEAST_PX2 * 1.01),
        lambda theta: _slopes(pairs, lags, theta),
        bounds=(_LEAST_PX2, np.inf),
        x_scale=np.maximum(start, _STEP_MIN_PX2),
        max_nfev=_STEPS,
    )
    return np.asarray(found.x)


def _intervals(
    pairs: Pairs, lags: tuple[int, ...], theta: Array, seed: int
) -> tuple[Interval, ...]:
    """Give 1 sigma of white noise and both walks, with intervals by a bootstrap over tracks.

    A resample shifts means and, over their density, medians; one Gauss-Newton step follows it.
    """
    counts, cut, below = _track_sums(pairs, lags, theta)
    tracks = len(counts)
    rng = stream(seed, "drift_fit", "tracks")
    drawn = rng.multinomial(tracks, np.full(tracks, 1.0 / tracks), _RESAMPLES).astype(float)
    many = np.maximum(drawn @ counts, 1.0)
    of_means = np.log((drawn @ cut) / many) - np.log(cut.sum(axis=0) / counts.sum(axis=0))
    of_medians = -(drawn @ below / many - 0.5) / _densities(pairs, lags, theta)
    shift = np.concatenate([of_means, of_medians], axis=1)
    moved = theta - shift @ np.linalg.pinv(_slopes(pairs, lags, theta)).T
    sigmas = np.sqrt(np.maximum(moved, 0.0)).T
    return tuple(interval_of(np.sqrt(x), own) for x, own in zip(theta, sigmas, strict=True))


def _track_sums(pairs: Pairs, lags: tuple[int, ...], theta: Array) -> tuple[Array, Array, Array]:
    """Sum over each track's pairs: their number, cut squares, how many are below the median."""
    names, track = np.unique(pairs.track, return_inverse=True)
    cut = np.minimum(pairs.distance2(theta[0], theta[1]), GATE)
    middle = MEDIAN * _medians(pairs, lags, theta)
    at = np.searchsorted(lags, pairs.lag)
    below = pairs.distance2(theta[0], theta[2]) < middle[at]
    out = np.zeros((3, len(names), len(lags)))
    for values, total in zip((np.ones(len(cut)), cut, below), out, strict=True):
        np.add.at(total, (track, at), values)
    return out[0], out[1], out[2]


def _densities(pairs: Pairs, lags: tuple[int, ...], theta: Array) -> Array:
    """Give the density of the squares' logarithm at the median, Shape (k,)."""
    middle = MEDIAN * _medians(pairs, lags, theta)[np.searchsorted(lags, pairs.lag)]
    far = np.maximum(pairs.distance2(theta[0], theta[2]) / middle, 1e-12)
    return np.maximum(_by_lag(pairs, lags, np.abs(np.log(far)) < _NEAR) / (2.0 * _NEAR), 1e-3)
