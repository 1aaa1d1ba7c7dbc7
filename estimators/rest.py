"""When the rover stands: wheels that neither roll nor steer, and a quiet gyro."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.streams import WheelStream
from lpet_sim.spec import Spec


class RestSpec(Spec):
    """What counts as rest; the values are this project's choice.

    A constant velocity would pass a test by the inertial unit alone, a slide would pass one by the
    wheels alone: both have to be quiet.

    Attributes:
        window_s: Time over which the wheels must not have moved.
        angle_rad: Largest change of a wheel or steering reading over the window: a few counts.
        rate_radps: Largest mean body rate over the window.
        margin_s: What is cut off at both ends of a rest, for the suspension to come to rest.
    """

    window_s: float = Field(default=1.0, gt=0)
    angle_rad: float = Field(default=6e-3, gt=0)
    rate_radps: float = Field(default=1e-3, gt=0)
    margin_s: float = Field(default=0.5, ge=0)


def detect_rest(wheels: WheelStream, delta_theta: Array, spec: RestSpec) -> NDArray[np.bool_]:
    """Tell in which intervals between wheel readings the rover stands.

    Args:
        wheels: Evenly timed readings, n of them.
        delta_theta: Gyro rotation over each interval [rad], Shape (n - 1, 3).
        spec: What counts as rest.

    Returns:
        Shape (n - 1,).
    """
    dt_s = float(np.median(np.diff(wheels.t_ns))) / NS_PER_S
    width = max(1, round(spec.window_s / dt_s))
    intervals = len(delta_theta)
    if intervals < width:
        return np.zeros(intervals, dtype=bool)
    angles = np.concatenate([wheels.drive_angle_rad, wheels.steer_angle_rad], axis=1)
    moved = np.abs(angles[width:] - angles[:-width]).max(axis=1)
    turned = np.cumsum(np.concatenate([np.zeros((1, 3)), delta_theta]), axis=0)
    rate = np.linalg.norm(turned[width:] - turned[:-width], axis=1) / (width * dt_s)
    quiet = (moved < spec.angle_rad) & (rate < spec.rate_radps)
    return _eroded(_covered(quiet, width, intervals), round(spec.margin_s / dt_s))


def _covered(quiet: NDArray[np.bool_], width: int, intervals: int) -> NDArray[np.bool_]:
    """Mark every interval that lies in some quiet window of ``width`` intervals."""
    change = np.zeros(intervals + 1, dtype=np.int64)
    starts = np.flatnonzero(quiet)
    np.add.at(change, starts, 1)
    np.add.at(change, starts + width, -1)
    return np.asarray(np.cumsum(change)[:-1] > 0)


def _eroded(rest: NDArray[np.bool_], margin: int) -> NDArray[np.bool_]:
    """Cut ``margin`` intervals off both ends of every run of rest."""
    moving = np.concatenate([[0], np.cumsum(~rest)])
    index = np.arange(len(rest))
    low, high = np.maximum(index - margin, 0), np.minimum(index + margin + 1, len(rest))
    return np.asarray(moving[high] == moving[low])
