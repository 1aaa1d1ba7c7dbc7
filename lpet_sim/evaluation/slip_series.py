"""Slip of the whole rover between images: what the wheels report against what the cameras see."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydantic import Field

from lpet_sim.errors import RecordingError
from lpet_sim.recording.arrays import Array, ArrayStruct, Ints
from lpet_sim.recording.calibration import WheelCalibration
from lpet_sim.recording.estimate import Estimate
from lpet_sim.spec import Spec

STEP_SIGMA = "step_sigma_m"
"""The diagnostic that holds the error of a visual step [m], 1 sigma."""

_BRIDGED = "bridged"


class SlipSeriesSpec(Spec):
    """What is measured between two images. Every value is this project's choice.

    Attributes:
        min_step_m: Least motion by the wheels of which a slip is given [m]; a point turn is less.
        vision_sigma_m: Error of a visual step whose estimator declares none, 1 sigma [m].
        around: Number of intervals on either side whose median slip is called ordinary.
        max_ordinary_slip: An interval that slips by more has no part in that median.
    """

    min_step_m: float = Field(default=0.02, gt=0)
    vision_sigma_m: float = Field(default=0.005, gt=0)
    around: int = Field(default=10, ge=1)
    max_ordinary_slip: float = Field(default=0.5, ge=0, lt=1)


@dataclass(frozen=True, eq=False)
class SlipSeries(ArrayStruct):
    """Slip along the motion, one row for each interval between images.

    Attributes:
        t_ns: End of each interval since the start [ns], Shape (n,).
        begin_ns: Its begin [ns], Shape (n,).
        wheel_m: Motion of the body by the wheels ``d`` [m], Shape (n,).
        lost_m: ``d`` less the seen motion along the same direction [m], Shape (n,); NaN where
            vision failed.
        slip: ``lost_m / d``, negative where the rover slid on; NaN where vision failed or the
            wheels moved the body by less than the least step, Shape (n,).
        ordinary: Median slip of the intervals around, never negative; 0 where none of them slips
            by little enough, Shape (n,).
        vision_sigma_m: Error of the seen motion, 1 sigma [m], Shape (n,).
    """

    t_ns: Ints
    begin_ns: Ints
    wheel_m: Array
    lost_m: Array
    slip: Array
    ordinary: Array
    vision_sigma_m: Array

    @property
    def standing_share(self) -> Array:
        """The share f of each interval in which the rover would have stood, Shape (n,).

        It stands for f of the interval and slips as is ordinary (s0) for the rest:
        ``1 - s = (1 - f) (1 - s0)``; limited to 0 and 1, NaN where the slip is.
        """
        return np.asarray(np.clip(1.0 - (1.0 - self.slip) / (1.0 - self.ordinary), 0.0, 1.0))


def slip_series(
    vision: Estimate, wheels: Estimate, spec: SlipSeriesSpec | None = None
) -> SlipSeries:
    """Compare the body's motion by the wheels with the seen one, from image to image.

    With ``t_w`` and ``t_v`` the translations of ``T_prev_curr`` by wheels and by vision, in the
    body at the earlier image: ``d = |t_w|``, ``u = t_w / d``, ``lost = d - u . t_v``. Motions of
    the body are compared and not the paths of wheels, so a point turn is no slip. An image whose
    step was bridged by odometry says nothing.

    Args:
        vision: Visual motion, with ``bridged`` and `STEP_SIGMA` among its diagnostics if it has
            them; its poses are at the times of the images.
        wheels: Dead reckoning of the same traverse.
        spec: What is measured.

    Returns:
        The slip between the images that both cover.

    Raises:
        RecordingError: They share fewer than two images.
    """
    spec = spec or SlipSeriesSpec()
    rows = _shared(vision, wheels)
    t_ns = vision.trajectory.t_ns[rows]
    by_wheels = _steps(wheels, t_ns)
    distance = np.linalg.norm(by_wheels, axis=-1)
    direction = by_wheels / np.maximum(distance, 1e-12)[:, None]
    seen = np.einsum("ni,ni->n", direction, _steps(vision, t_ns))
    lost = np.where(_failed(vision, rows), np.nan, distance - seen)
    slip = np.where(distance >= spec.min_step_m, lost / np.maximum(distance, 1e-12), np.nan)
    return SlipSeries(
        t_ns=t_ns[1:].copy(),
        begin_ns=t_ns[:-1].copy(),
        wheel_m=distance,
        lost_m=lost,
        slip=slip,
        ordinary=_ordinary(slip, spec),
        vision_sigma_m=_sigma(vision, rows, spec),
    )


def odometry_sigma(distance_m: Array, wheels: WheelCalibration) -> Array:
    """Give the declared error of wheel odometry over a distance, 1 sigma [m].

    ``sigma^2 = white^2 d + (scale d)^2``.
    """
    white = wheels.white_sigma_m_rtm**2 * distance_m
    return np.asarray(np.sqrt(white + (wheels.scale_sigma * distance_m) ** 2))


def _shared(vision: Estimate, wheels: Estimate) -> Ints:
    seen, known = vision.trajectory.t_ns, wheels.trajectory.t_ns
    rows = np.flatnonzero((seen >= known[0]) & (seen <= known[-1]))
    if len(rows) < 2:
        raise RecordingError(
            f"'{vision.name}' and '{wheels.name}' share {len(rows)} images: slip needs at least 2"
        )
    return rows


def _steps(estimate: Estimate, t_ns: Ints) -> Array:
    """Give the translation of each step in the body at its begin [m], Shape (n - 1, 3)."""
    T = estimate.trajectory.at(t_ns)
    return (T[:-1].inverse() @ T[1:]).translation


def _failed(vision: Estimate, rows: Ints) -> Array:
    """Tell which steps vision did not see, Shape (n - 1,); the flag of an image is its step's."""
    flags = vision.diagnostics.get(_BRIDGED, np.zeros(len(vision.trajectory)))
    return np.asarray(flags[rows[1:]] > 0)


def _sigma(vision: Estimate, rows: Ints, spec: SlipSeriesSpec) -> Array:
    declared = vision.diagnostics.get(STEP_SIGMA)
    if declared is None:
        return np.full(len(rows) - 1, spec.vision_sigma_m)
    return np.array(declared[rows[1:]])


def _ordinary(slip: Array, spec: SlipSeriesSpec) -> Array:
    usual = np.where(slip <= spec.max_ordinary_slip, slip, np.nan)
    padded = np.pad(usual, spec.around, constant_values=np.nan)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * spec.around + 1)
    known = ~np.isnan(around).all(axis=1)
    median = np.zeros(len(slip))
    median[known] = np.nanmedian(around[known], axis=1)
    return np.maximum(median, 0.0)
