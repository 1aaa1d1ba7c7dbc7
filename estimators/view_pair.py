"""One step of visual motion estimation: the landmarks common to two image pairs, and the motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from estimators import two_view
from estimators.observation import camera_vector
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream
from lpet_sim.spec import Spec

# Estimating and gating take turns until the same landmarks agree, whatever sample began it.
_ROUNDS_MAX = 8


class TwoViewSpec(Spec):
    """Parameters of the motion between two views.

    Attributes:
        gate_chi2: Chi-square of a landmark's innovation (3 degrees of freedom) up to which it
            agrees with a motion; 16.27 keeps 99.9 % of the sound ones.
        student_dof: Degrees of freedom of the Student-t noise model of the final estimate; heavy
            tails are what a front end really makes. 0 means Gaussian.
        samples_max: Most samples of three landmarks that RANSAC tries.
        confidence: Probability asked for that one of them is free of outliers.
        inliers_min: Fewest agreeing landmarks for which a motion is believed.
        iterations_max: Most Gauss-Newton iterations of the final estimate.
    """

    gate_chi2: float = Field(default=16.27, gt=0)
    student_dof: float = Field(default=6.0, ge=0)
    samples_max: int = Field(default=200, ge=1)
    confidence: float = Field(default=0.9999, gt=0, lt=1)
    inliers_min: int = Field(default=8, ge=3)
    iterations_max: int = Field(default=10, ge=1)


@dataclass(frozen=True)
class ViewPair:
    """The landmarks common to two images.

    Attributes:
        landmark_id: Shape (n,).
        s_a: Sightings in the earlier image [px], Shape (n, 3).
        s_b: Sightings in the later image [px], Shape (n, 3).
        var_a: Variances of the image coordinates [px^2], Shape (n,).
        var_b: Likewise.
    """

    landmark_id: Ints
    s_a: Array
    s_b: Array
    var_a: Array
    var_b: Array

    @classmethod
    def of(cls, sightings: SightingStream, a: int, b: int) -> ViewPair:
        """Pair the sightings of two images by landmark."""
        rows_a, rows_b = sightings.rows(a), sightings.rows(b)
        ids, i, j = np.intersect1d(
            sightings.landmark_id[rows_a],
            sightings.landmark_id[rows_b],
            assume_unique=True,
            return_indices=True,
        )
        s, variance = sightings.stereo_px, sightings.sigma_px**2
        return cls(ids, s[rows_a][i], s[rows_b][j], variance[rows_a][i], variance[rows_b][j])


@dataclass(frozen=True)
class CameraStep:
    """The motion of the camera, or of what it is fixed to, between two images.

    Attributes:
        T_prev_curr: Pose of the camera at the later image in that at the earlier one.
        inliers: Number of landmarks that agree with it.
        reduced_chi2: Mean chi-square of these per degree of freedom; 1 where the noise declared is
            the noise there is.
        landmark_id: The landmarks used, Shape (n,).
        by_prev: Derivative of the twist by each sighting in the earlier image, Shape (n, 6, 3).
        by_curr: Likewise in the later image.
        var_prev: Variances of these sightings [px^2], Shape (n,).
        var_curr: Likewise.
    """

    T_prev_curr: SE3
    inliers: int
    reduced_chi2: float
    landmark_id: Ints
    by_prev: Array
    by_curr: Array
    var_prev: Array
    var_curr: Array

    def covariance(self) -> Array:
        """Give the covariance of the motion's right perturbation, Shape (6, 6)."""
        scaled_prev = self.by_prev * np.sqrt(self.var_prev)[:, None, None]
        scaled_curr = self.by_curr * np.sqrt(self.var_curr)[:, None, None]
        both = np.concatenate([scaled_prev, scaled_curr])
        return np.asarray(np.einsum("nij,nkj->ik", both, both))

    def in_frame(self, T_body_camera: SE3) -> CameraStep:
        """Give the same motion as that of a body the camera is fixed to."""
        T = T_body_camera
        Ad = T.adjoint()
        return replace(
            self,
            T_prev_curr=T @ self.T_prev_curr @ T.inverse(),
            by_prev=Ad @ self.by_prev,
            by_curr=Ad @ self.by_curr,
        )


def estimate_step(
    pair: ViewPair,
    calibration: StereoCalibration,
    spec: TwoViewSpec,
    rng: np.random.Generator,
    T_start: SE3,
) -> CameraStep | None:
    """Estimate the motion between two images; None where too few landmarks agree on one.

    Args:
        pair: The common landmarks.
        calibration: The declared camera pair.
        spec: Parameters.
        rng: Draws the samples.
        T_start: Where Gauss-Newton starts, such as the motion before.
    """
    if len(pair.landmark_id) < spec.inliers_min:
        return None
    camera = camera_vector(calibration)
    data = (pair.s_a, pair.s_b, pair.var_a, pair.var_b)
    samples = draw_samples(rng, len(pair.s_a), spec.samples_max)
    R, t, agree = two_view.ransac(
        camera, *_parts(T_start), *data, samples, spec.gate_chi2, spec.confidence
    )
    for _ in range(_ROUNDS_MAX):
        if agree.sum() < spec.inliers_min:
            return None
        R, t, x = two_view.refine(
            camera, R, t, *data, agree.astype(np.float64), spec.student_dof, spec.iterations_max
        )
        r, info, G, J = two_view.innovations(camera, R, t, *data, x)
        chi2 = two_view.chi_squares(r, info)
        before, agree = agree, chi2 < spec.gate_chi2
        if np.array_equal(before, agree):
            break
    if agree.sum() < spec.inliers_min:
        return None
    return _step(pair, SE3(R, t), agree, chi2, info, G, J, spec.student_dof)


def _step(
    pair: ViewPair,
    T: SE3,
    agree: NDArray[np.bool_],
    chi2: Array,
    info: Array,
    G: Array,
    J: Array,
    student_dof: float,
) -> CameraStep:
    weight = agree * two_view.student_weights(chi2, student_dof)
    by_a, by_b = two_view.influence(info, G, J, weight)
    return CameraStep(
        T,
        int(agree.sum()),
        float(chi2[agree].mean()) / 3,
        pair.landmark_id[agree],
        by_a[agree],
        by_b[agree],
        pair.var_a[agree],
        pair.var_b[agree],
    )


def draw_samples(rng: np.random.Generator, n: int, count: int) -> Ints:
    """Draw ``count`` samples of three different rows out of ``n``, Shape (count, 3)."""
    first = rng.integers(n, size=count)
    second = rng.integers(n - 1, size=count)
    third = rng.integers(n - 2, size=count)
    second += second >= first
    low, high = np.minimum(first, second), np.maximum(first, second)
    third += third >= low
    third += third >= high
    return np.stack([first, second, third], axis=1).astype(np.int64)


def _parts(T: SE3) -> tuple[Array, Array]:
    return np.array(T.rotation), np.array(T.translation)
