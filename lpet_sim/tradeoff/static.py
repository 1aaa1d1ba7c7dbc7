"""The static prediction: how well a candidate can do along a straight path, without any drive.

The Fisher information of all poses along a straight path over flat ground is made of the sightings
of an even sample of landmarks, and of the odometry's steps with their lasting errors. What is left
of the last pose when all others are eliminated is the least covariance that any unbiased estimator
of this memory can have: the Cramer-Rao bound of `evaluation.bounds` for a drive that was never
driven.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import Array
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.footprint import Footprint, footprint_of
from lpet_sim.tradeoff.proxies import Costs, costs_of
from lpet_sim.tradeoff.spec import TradeoffSpec
from lpet_sim.tradeoff.static_view import Setting, View
from lpet_sim.tradeoff.static_world import draw_world


@dataclass(frozen=True, eq=False)
class Prediction:
    """What the static analysis says of a candidate.

    Attributes:
        candidate: The sensor.
        costs: Its data volume, computing and mass.
        footprint: What a view covers of flat ground.
        sightings: Mean sightings of an image pair.
        far_sightings: Those on far relief.
        range_m: Median range of the sighted landmarks on ground and rocks [m]; NaN: none.
        covariance: Of the pose's right perturbation at the end of the distance [m, rad],
            Shape (6, 6).
        covariance_per_m: What a metre of the analysed path adds to it, on average, Shape (6, 6).
        distance_m: The distance.
    """

    candidate: Candidate
    costs: Costs
    footprint: Footprint
    sightings: float
    far_sightings: float
    range_m: float
    covariance: Array
    covariance_per_m: Array
    distance_m: float

    @property
    def position_rms_m(self) -> float:
        """Root of the mean squared length of the position error [m]."""
        return math.sqrt(float(np.trace(self.covariance[:3, :3])))

    @property
    def error_ratio(self) -> float:
        """The same as a share of the distance."""
        return self.position_rms_m / self.distance_m

    @property
    def attitude_rms_rad(self) -> tuple[float, float, float]:
        """RMS errors about the body's axes [rad]."""
        x, y, z = np.sqrt(np.diagonal(self.covariance)[3:])
        return float(x), float(y), float(z)


def setting_of(spec: TradeoffSpec, seed: int) -> Setting:
    """Draw the landmarks of a trade-off.

    Args:
        spec: The trade-off.
        seed: Of the landmarks.
    """
    distance_m = spec.site.distance_m
    path_m = distance_m / math.ceil(distance_m / spec.static.path_max_m)
    world = draw_world(spec.site, path_m, seed)
    return Setting(spec.site, spec.static, spec.proxies, world, path_m)


def predict_all(
    candidates: tuple[Candidate, ...], setting: Setting, progress: Progress = silent
) -> list[Prediction]:
    """Predict every candidate; see `predict`."""
    done = (predict(candidate, setting) for candidate in candidates)
    return list(track(done, len(candidates), progress))


def predict(candidate: Candidate, setting: Setting) -> Prediction:
    """Predict how well a candidate localizes at the end of the distance.

    A distance that is longer than the analysed path is made of equal stretches, the errors of which
    are independent: ``P = sum_j Ad_j C Ad_j^T`` with the motion that is left after stretch j.

    Args:
        candidate: The sensor.
        setting: What all have in common.
    """
    view = View.of(candidate, setting)
    end = view.end_covariance()
    counts, far, ranges = view.sighted()
    shown = setting.site.landmarks.detection_probability
    return Prediction(
        candidate,
        costs_of(candidate, shown * counts, setting.proxies),
        footprint_of(candidate, setting.site.landmarks.visibility.range_max_m),
        shown * counts,
        shown * far,
        ranges,
        chained(end, setting.path_m, setting.stretches),
        end / setting.path_m,
        setting.site.distance_m,
    )


def chained(covariance: Array, path_m: float, stretches: int) -> Array:
    """Chain the errors of equal straight stretches, Shape (6, 6).

    Args:
        covariance: Of the right perturbation at the end of one, Shape (6, 6).
        path_m: Its length.
        stretches: How many there are.
    """
    left = np.arange(stretches) * path_m
    rest = SE3.exp(np.outer(-left, [1.0, 0, 0, 0, 0, 0])).adjoint()
    return np.asarray((rest @ covariance @ np.swapaxes(rest, 1, 2)).sum(axis=0))
