"""How far an estimate is from the truth: error series, endpoint, worst moment, segment drift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, ArrayStruct, Ints
from lpet_sim.recording.trajectory import Trajectory

ARC_STEP_M = 0.02
"""Shortest chord of the distance driven [m]: the paper's step between two images."""


@dataclass(frozen=True, eq=False)
class ErrorSeries(ArrayStruct):
    """Errors at the times of an estimate, unaligned: both start from the pose that is given.

    Attributes:
        t_ns: Times of the estimate within the truth [ns], Shape (n,).
        distance_m: Distance that the rover has truly driven [m], Shape (n,).
        position_error_m: ``p_est - p_true`` in the world [m], Shape (n, 3).
        attitude_error_rad: Roll, pitch, yaw of the estimate less those of the truth, wrapped to
            (-pi, pi] [rad], Shape (n, 3).
        xi: Right perturbation with ``T_true = T_est @ exp(xi)`` [m, rad], Shape (n, 6).
        nees: NEES of position, attitude and pose, NaN where the covariance is not positive
            definite (as at a given start), Shape (n, 3); None without covariances.
    """

    t_ns: Ints
    distance_m: Array
    position_error_m: Array
    attitude_error_rad: Array
    xi: Array
    nees: Array | None = None

    @property
    def position_ratio(self) -> Array:
        """Length of the position error over the distance driven so far, Shape (n,).

        A rover that has not yet driven `ARC_STEP_M` counts as having driven that.
        """
        length = np.linalg.norm(self.position_error_m, axis=-1)
        return np.asarray(length / np.maximum(self.distance_m, ARC_STEP_M))


@dataclass(frozen=True)
class SegmentDrift:
    """Mean error of the relative pose over all segments of one length.

    Attributes:
        length_m: Length of a segment along the true path [m].
        translation_ratio: Translation error over the length.
        rotation_radpm: Angle of the rotation error over the length [rad/m].
        count: Number of segments; they overlap, so they are not independent.
    """

    length_m: float
    translation_ratio: float
    rotation_radpm: float
    count: int


def distance_driven_m(trajectory: Trajectory, step_m: float = ARC_STEP_M) -> Array:
    """Give the distance driven up to each pose, without counting jitter.

    A pose becomes a node of the path when it lies at least ``step_m`` from the node before; the
    distance is the sum of the chords between nodes, plus the chord from the last node, and never
    falls. Jitter of a standing rover so adds at most ``step_m``, however long it stands. Lateral
    jitter of sigma j on a drive lengthens the path by about ``2 (j / step_m)^2`` of itself, and
    along the path it cancels; chords cut a curve of radius r by ``(step_m / r)^2 / 24``.

    Args:
        trajectory: Poses at any rate.
        step_m: Shortest chord [m].

    Returns:
        Distance [m], Shape (n,).
    """
    p_world_body = np.ascontiguousarray(trajectory.T_world_body.translation)
    return np.asarray(_walk(p_world_body, step_m))


@njit(cache=True)
def _walk(p: Array, step_m: float) -> Array:
    out = np.zeros(len(p))
    node, driven = 0, 0.0
    for i in range(1, len(p)):
        chord = np.sqrt(np.sum((p[i] - p[node]) ** 2))
        out[i] = max(out[i - 1], driven + chord)
        if chord >= step_m:
            node, driven = i, driven + chord
    return out


def error_series(
    estimate: Trajectory, truth: Trajectory, anchor_t_ns: int | None = None
) -> ErrorSeries:
    """Compare an estimate with the truth, interpolated at the estimate's times.

    Args:
        estimate: Estimated poses.
        truth: True poses, at any rate.
        anchor_t_ns: Where the scoring starts [ns]: the estimate is then moved as a whole so that
            it has the true pose at its first time from here on. None scores it as it stands.

    Returns:
        Errors at those times of the estimate that the truth covers.

    Raises:
        RecordingError: Estimate and truth do not overlap in time.
    """
    begin = truth.t_ns[0] if anchor_t_ns is None else max(truth.t_ns[0], anchor_t_ns)
    inside = (estimate.t_ns >= begin) & (estimate.t_ns <= truth.t_ns[-1])
    if not inside.any():
        raise RecordingError(
            f"the estimate spans {estimate.t_ns[0]} to {estimate.t_ns[-1]} ns, outside the part "
            f"of the truth to score, {begin} to {truth.t_ns[-1]} ns"
        )
    t_ns = estimate.t_ns[inside]
    T_true, T_est = truth.at(t_ns), estimate.T_world_body[inside]
    if anchor_t_ns is not None:
        T_est = (T_true[0] @ T_est[0].inverse()) @ T_est
    distance_m = np.interp(t_ns, truth.t_ns, distance_driven_m(truth))
    if anchor_t_ns is not None:
        distance_m = distance_m - distance_m[0]
    return ErrorSeries(
        t_ns=t_ns,
        distance_m=distance_m,
        position_error_m=T_est.translation - T_true.translation,
        attitude_error_rad=wrap_angle(T_est.rpy() - T_true.rpy()),
        xi=(T_est.inverse() @ T_true).log(),
    )


def wrap_angle(angle_rad: Array) -> Array:
    """Wrap angles to (-pi, pi] [rad], any shape."""
    return np.asarray(np.pi - np.mod(np.pi - np.asarray(angle_rad), 2 * np.pi))


def worst_position_ratio(series: ErrorSeries, start_m: float) -> float:
    """Give the largest position error over the distance so far, after the first metres.

    On a traverse shorter than ``start_m`` the end alone is looked at.

    Args:
        series: Errors.
        start_m: Distance from which on the ratio means something [m].
    """
    late = series.distance_m >= min(start_m, series.distance_m[-1])
    return float(np.max(series.position_ratio[late]))


def segment_drift(
    estimate: Trajectory, truth: Trajectory, lengths_m: tuple[float, ...], spacing_m: float = 0.5
) -> tuple[SegmentDrift, ...]:
    """Measure the drift over segments of given lengths, as KITTI does.

    Of a segment from i to j the error is ``E = (T_est_i^-1 T_est_j)^-1 (T_true_i^-1 T_true_j)``;
    its translation and angle are divided by the true distance between the poses i and j.

    Args:
        estimate: Estimated poses; those outside the truth are left out.
        truth: True poses, at any rate.
        lengths_m: Lengths of segments [m].
        spacing_m: Distance between the starts of segments [m].

    Returns:
        One entry for each length of which at least one segment fits.

    Reference:
        Geiger, Lenz, Urtasun (2012), "Are we ready for autonomous driving?", section 2.3.
    """
    inside = (estimate.t_ns >= truth.t_ns[0]) & (estimate.t_ns <= truth.t_ns[-1])
    t_ns = estimate.t_ns[inside]
    T_est, T_true = estimate.T_world_body[inside], truth.at(t_ns)
    distance_m = np.interp(t_ns, truth.t_ns, distance_driven_m(truth))
    found = (_drift(T_est, T_true, distance_m, length, spacing_m) for length in lengths_m)
    return tuple(drift for drift in found if drift is not None)


def _drift(
    T_est: SE3, T_true: SE3, distance_m: Array, length_m: float, spacing_m: float
) -> SegmentDrift | None:
    starts_m = np.arange(distance_m[0], distance_m[-1] - length_m, spacing_m)
    i = np.searchsorted(distance_m, starts_m)
    j = np.searchsorted(distance_m, distance_m[i] + length_m)
    i, j = i[j < len(distance_m)], j[j < len(distance_m)]
    if not len(i):
        return None
    step_est, step_true = T_est[i].inverse() @ T_est[j], T_true[i].inverse() @ T_true[j]
    error = step_est.inverse() @ step_true
    span_m = distance_m[j] - distance_m[i]
    angle_rad = np.linalg.norm(error.log()[:, 3:], axis=-1)
    ratio = np.linalg.norm(error.translation, axis=-1) / span_m
    return SegmentDrift(length_m, float(ratio.mean()), float((angle_rad / span_m).mean()), len(i))
