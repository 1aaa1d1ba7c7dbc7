"""Slip found by comparing vision with the wheels: when the wheels go on and the rover does not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lpet_sim.evaluation.slip_series import SlipSeries, SlipSeriesSpec, odometry_sigma, slip_series
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import WheelCalibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.spec import Spec


class SlipOnsetSpec(Spec):
    """When a slip raises the alarm. Every value is this project's choice.

    Attributes:
        series: How slip is measured between images.
        alarm_slip: Least share of the wheels' motion that is lost.
        alarm_sigmas: Least loss beyond what is ordinary, in standard deviations of the declared
            errors. Over the 800 windows of 25 m, chance passes 4 in one traverse of forty.
        longest_window: Number of intervals over which a loss is summed: a slip that begins and
            ends within intervals is not whole in any of them.
        neighbour_share: Least share of an interval beside the window in which the rover would
            have stood, for the slip to reach into it; ordinary slip scatters by as much.
    """

    series: SlipSeriesSpec = SlipSeriesSpec()
    alarm_slip: float = Field(default=0.5, gt=0)
    alarm_sigmas: float = Field(default=4.0, gt=0)
    longest_window: int = Field(default=3, ge=1)
    neighbour_share: float = Field(default=0.1, gt=0, le=1)


@dataclass(frozen=True)
class SlipFound:
    """A slip that raised the alarm.

    Attributes:
        onset_ns: When it began, as told by the motion lost within the first interval [ns].
        end_ns: When it ended, likewise [ns].
        alarm_ns: Time of the image at which it was certain [ns].
        between_ns: The images between which it began [ns].
        lost_m: Motion of the wheels that moved nothing, beyond ordinary slip [m].
        slip: Share of the wheels' motion that was lost in the window that raised the alarm.
        sigmas: Loss of that window beyond ordinary slip, in standard deviations.
    """

    onset_ns: int
    end_ns: int
    alarm_ns: int
    between_ns: tuple[int, int]
    lost_m: float
    slip: float
    sigmas: float


@dataclass(frozen=True)
class SlipReport:
    """Slip of a traverse as its own measurements show it.

    Attributes:
        series: Slip between the images.
        found: The slips that raised the alarm, in order of time.
        spec: When the alarm was to be raised, and how slip was measured.
    """

    series: SlipSeries
    found: tuple[SlipFound, ...]
    spec: SlipOnsetSpec


@dataclass(frozen=True)
class _Window:
    """Intervals ``first`` to ``last``, both within, with their loss."""

    first: int
    last: int
    slip: float
    sigmas: float


def find_slip(
    vision: Estimate,
    wheels: Estimate,
    calibration: WheelCalibration,
    spec: SlipOnsetSpec | None = None,
) -> SlipReport:
    """Find where the wheels moved and the cameras saw far less, without the truth.

    Over each window of up to three intervals, with ``D`` the wheels' motion, ``L`` the lost and
    ``s0`` the ordinary slip: ``slip = L / D`` and
    ``z = (L - sum s0 d) / sqrt(white^2 D + (scale D)^2 + sum sigma_v^2)``. A window raises the
    alarm where both reach their limits; of overlapping ones that of greatest z stands, and it
    grows as long as the intervals beside it slip by as much.

    A slip begins within an interval. The standing share f of the first one
    (`SlipSeries.standing_share`) puts the onset at ``t_end - f dt``, that of the last one the end
    at ``t_begin + f dt``; a slip of a single interval is put in its middle.

    Args:
        vision: Visual motion.
        wheels: Dead reckoning.
        calibration: The declared wheels.
        spec: When the alarm is raised.

    Returns:
        The slip between images, and what raised the alarm. A slip during a point turn is not
        found, for the body moves by neither.

    Raises:
        RecordingError: The estimates share fewer than two images.
    """
    spec = spec or SlipOnsetSpec()
    series = slip_series(vision, wheels, spec.series)
    taken = np.isnan(series.slip)
    found = []
    for window in sorted(_alarms(series, calibration, spec), key=lambda w: -w.sigmas):
        if not taken[window.first : window.last + 1].any():
            grown = _grow(series, window, taken, spec)
            taken[grown[0] : grown[1] + 1] = True
            found.append(_summary(series, window, grown))
    return SlipReport(series, tuple(sorted(found, key=lambda f: f.onset_ns)), spec)


def _alarms(
    series: SlipSeries, calibration: WheelCalibration, spec: SlipOnsetSpec
) -> Iterator[_Window]:
    """Give every window that raises the alarm; one with an interval of unknown slip does not."""
    known = np.where(np.isnan(series.slip), np.nan, series.wheel_m)
    for count in range(1, min(spec.longest_window, len(series)) + 1):
        distance, lost = _sums(known, count), _sums(series.lost_m, count)
        beyond = lost - _sums(series.ordinary * known, count)
        seen = _sums(series.vision_sigma_m**2, count)
        sigmas = beyond / np.sqrt(odometry_sigma(distance, calibration) ** 2 + seen)
        slip = lost / distance
        for k in np.flatnonzero((slip >= spec.alarm_slip) & (sigmas >= spec.alarm_sigmas)):
            yield _Window(int(k), int(k) + count - 1, float(slip[k]), float(sigmas[k]))


def _sums(values: Array, count: int) -> Array:
    """Sum each run of ``count`` values."""
    return np.asarray(np.lib.stride_tricks.sliding_window_view(values, count).sum(axis=1))


def _grow(
    series: SlipSeries, window: _Window, taken: NDArray[np.bool_], spec: SlipOnsetSpec
) -> tuple[int, int]:
    """Widen a window by what slips like it, then by the intervals in which it began and ended."""
    first, last = window.first, window.last
    slips = (series.slip >= spec.alarm_slip) & ~taken
    reached = (series.standing_share >= spec.neighbour_share) & ~taken
    while first > 0 and slips[first - 1]:
        first -= 1
    while last + 1 < len(slips) and slips[last + 1]:
        last += 1
    first -= int(first > 0 and reached[first - 1])
    last += int(last + 1 < len(slips) and reached[last + 1])
    return first, last


def _summary(series: SlipSeries, window: _Window, grown: tuple[int, int]) -> SlipFound:
    first, last = grown
    share = series.standing_share[first : last + 1]
    begin, end = series.begin_ns[first : last + 1], series.t_ns[first : last + 1]
    stood = share * (end - begin)
    onset, stop = end[0] - stood[0], begin[-1] + stood[-1]
    if first == last:
        middle = (begin[0] + end[0]) / 2
        onset, stop = middle - stood[0] / 2, middle + stood[0] / 2
    return SlipFound(
        onset_ns=round(float(onset)),
        end_ns=round(float(stop)),
        alarm_ns=int(series.t_ns[window.last]),
        between_ns=(int(begin[0]), int(end[0])),
        lost_m=float(share @ series.wheel_m[first : last + 1]),
        slip=window.slip,
        sigmas=window.sigmas,
    )
