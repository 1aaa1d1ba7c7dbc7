"""What the runs of one variant say together: errors, passes, consistency, efficiency, cost.

A failed run is counted, never dropped: in a quantile over all runs its error is infinite. What is
taken over the completed runs alone has that in its name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.evaluation.consistency import Consistency, anees, chi_square_band
from lpet_sim.evaluation.requirement import AXES
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.statistics import (
    Interval,
    draw_runs,
    interval_of,
    pass_rate,
    quantile,
    rms,
)
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream

NEES_DOF = {"position": 3, "attitude": 3, "pose": 6}
COORDINATES = 3
"""Image coordinates of a stereo sighting: u of the left image, u of the right one, v."""
_DRAWS_SEED = 0
Draws = NDArray[np.int64]


@dataclass(frozen=True)
class ErrorSpread:
    """How an error scatters over runs; intervals are bootstrapped over runs.

    Attributes:
        completed: Runs that did not fail.
        rms_completed: Root mean square over the completed runs.
        median: Median over all runs, failed ones at infinity.
        high: 95th percentile over all runs, failed ones at infinity.
        median_completed: Median over the completed runs.
    """

    completed: int
    rms_completed: Interval
    median: Interval
    high: Interval
    median_completed: float


@dataclass(frozen=True)
class Efficiency:
    """RMS error over the RMS of the Cramer-Rao bound, over completed runs.

    Attributes:
        ratio: The ratio with its bootstrap interval over runs; 1 is the best there is.
        runs: Completed runs with a bound.
    """

    ratio: Interval
    runs: int

    @property
    def is_suspicious(self) -> bool:
        """Whether it is below 1 within its interval: the truth may leak, or the bound is wrong."""
        return self.ratio.high < 1


@dataclass(frozen=True)
class InnovationTest:
    """Mean normalised innovation squared per degree of freedom; its expectation is 1.

    Attributes:
        mean: Mean over runs with its bootstrap interval.
        low: Lower end of the chi-square band of so many matched coordinates.
        high: Upper end of that band.
    """

    mean: Interval
    low: float
    high: float

    @property
    def is_consistent(self) -> bool:
        """Whether the band and the interval of the mean, or else the mean itself, overlap."""
        known = np.isfinite(self.mean.low)
        low, high = (self.mean.low, self.mean.high) if known else (self.mean.value,) * 2
        return bool(low <= self.high and self.low <= high)


@dataclass(frozen=True, eq=False)
class Summary:
    """All runs of one variant in one arm.

    Attributes:
        arm: Kind of conditions, such as ``ideal``.
        variant: The variant's label.
        runs: All runs, failed ones included.
        failures: Number of failed runs by kind.
        errors: Spreads by column: ``end_percent``, ``worst_percent``, and for each axis
            ``end_roll_deg`` and ``worst_roll_deg`` ...
        passes: Pass rates by column, with Clopper-Pearson intervals: ``passed`` as a whole, and
            each line ``pass_...`` of the requirement.
        passed: Runs that passed as a whole.
        nees: ANEES of position, attitude and pose at the end, where runs have one.
        nis: Innovations; None where no run has any.
        position_efficiency: RMS end position error over its bound; None without a bound.
        attitude_efficiency: The same of the end attitude.
        means: Means over runs of the other numbers: state size, landmarks per image, cost ...
        state_max: The largest state that any run had [landmarks].
    """

    arm: str
    variant: str
    runs: int
    failures: Mapping[str, int]
    errors: Mapping[str, ErrorSpread]
    passes: Mapping[str, Interval]
    passed: int
    nees: Mapping[str, Consistency]
    nis: InnovationTest | None
    position_efficiency: Efficiency | None
    attitude_efficiency: Efficiency | None
    means: Mapping[str, float]
    state_max: float

    @property
    def failed(self) -> int:
        """Number of failed runs."""
        return sum(self.failures.values())


ATTITUDES = tuple(f"{when}_{axis}_deg" for when in ("end", "worst") for axis in AXES)
ERRORS = ("end_percent", "worst_percent", *ATTITUDES)
MEANS = (
    "completion",
    "path_m",
    "images",
    "state_mean",
    "state_max",
    "new_mean",
    "matched_mean",
    "dropped_mean",
    "anchors_seen_share",
    "bridged_share",
)
TIMES = ("time_total_s", "time_per_image_ms")


def summarise(rows: Rows, progress: Progress = silent) -> list[Summary]:
    """Summarise the runs of every variant in every arm.

    Args:
        rows: All rows.
        progress: Told the share that is done.
    """
    groups = list(rows.groups("arm", "variant"))
    out = []
    for k, ((arm, variant), group) in enumerate(groups, 1):
        out.append(summarise_variant(arm, variant, group))
        progress(k / len(groups))
    return out


def summarise_variant(arm: str, variant: str, rows: Rows) -> Summary:
    """Summarise rows that belong to one variant in one arm.

    The same resamples serve all groups of one size, so that equal rows give equal intervals.
    """
    draws = draw_runs(len(rows), stream(_DRAWS_SEED, "bootstrap", "runs", len(rows)))
    lines = [name for name in rows.columns if name == "passed" or name.startswith("pass_")]
    passes = {name: int(np.sum(rows[name].astype(bool))) for name in lines}
    attitude_rad = np.radians([rows.numbers(f"end_{axis}_deg") for axis in AXES])
    return Summary(
        arm=arm,
        variant=variant,
        runs=len(rows),
        failures=dict(sorted(Counter(rows["failure"][rows.failed].tolist()).items())),
        errors={name: error_spread(rows.errors(name), draws) for name in ERRORS if name in rows},
        passes={name: pass_rate(count, len(rows)) for name, count in passes.items()},
        passed=passes["passed"],
        nees=_nees(rows),
        nis=_nis(rows, draws),
        position_efficiency=_efficiency(rows, rows.numbers("end_error_m"), "bound_m", draws),
        attitude_efficiency=_efficiency(
            rows, np.linalg.norm(attitude_rad, axis=0), "bound_rad", draws
        ),
        means={
            **{name: _mean(rows[name]) for name in MEANS if name in rows},
            **{name: _mean(rows.times(name)) for name in TIMES if name in rows},
        },
        state_max=_largest(rows.numbers("state_max")),
    )


def error_spread(errors: Array, draws: Draws) -> ErrorSpread:
    """Give median, 95th percentile and RMS of an error over runs with their intervals.

    Args:
        errors: Errors, infinite for failed runs, Shape (runs,).
        draws: Resamples of the runs as of `draw_runs`, Shape (resamples, runs).
    """
    x = np.sort(errors)
    resampled = x[draws]
    completed = x[np.isfinite(x)]
    of_completed = float(np.median(completed)) if len(completed) else np.nan

    def at(share: float) -> Interval:
        return interval_of(quantile(x, share, True), quantile(resampled, share, True))

    return ErrorSpread(
        completed=len(completed),
        rms_completed=interval_of(rms(x), rms(resampled)),
        median=at(0.5),
        high=at(0.95),
        median_completed=of_completed,
    )


def _nees(rows: Rows) -> dict[str, Consistency]:
    """Average what NEES there is; a failed run that has one counts like any other."""
    out = {}
    for block, dof in NEES_DOF.items():
        known = rows.numbers(f"nees_{block}")
        known = known[np.isfinite(known)]
        if len(known):
            out[block] = anees(known, dof)
    return out


def _nis(rows: Rows, draws: Draws) -> InnovationTest | None:
    per_dof = rows.numbers("nis_mean")
    if not np.isfinite(per_dof).any():
        return None
    resampled = np.where(np.isfinite(per_dof), per_dof, np.nan)[draws]
    mean = interval_of(_mean(per_dof), _means(resampled))
    matched = rows.numbers("matched_mean") * rows.numbers("images")
    dof = int(COORDINATES * np.nansum(matched))
    low, high = chi_square_band(1, dof) if dof else (np.nan, np.nan)
    return InnovationTest(mean, low / dof if dof else np.nan, high / dof if dof else np.nan)


def _efficiency(rows: Rows, error: Array, bound: str, draws: Draws) -> Efficiency | None:
    limit = rows.numbers(bound)
    known = np.isfinite(limit) & np.isfinite(error) & ~rows.failed
    if not known.any():
        return None
    e, b = np.where(known, error, np.nan), np.where(known, limit, np.nan)
    ratio = interval_of(rms(e) / rms(b), rms(e[draws]) / rms(b[draws]))
    return Efficiency(ratio, int(known.sum()))


def _mean(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else np.nan


def _largest(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(known.max()) if len(known) else np.nan


def _means(values: Array) -> Array:
    """Give the means along the last axis of what is finite there; NaN where nothing is."""
    known = np.isfinite(values)
    count = known.sum(axis=-1)
    total = np.where(known, values, 0.0).sum(axis=-1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
