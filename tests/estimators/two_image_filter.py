"""A stereo filter that remembers one image, written for itself from the definitions.

State: the pose ``(R, t)`` of the body and the points in the world of the landmarks that the
previous image showed, ``x_true = x + e``. Errors of the pose come in two charts, which agree to
first order only:

- ``world``: ``t_true = t + a``, ``R_true = exp(b) R``, the chart of plain EKF-SLAM;
- ``body``: ``T_true = T exp(xi)``, ``xi = (rho, phi)``.

It is plain numpy with dense matrices and shares no code with the estimators but SE(3) and the
camera.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import Measurements

Chart = Literal["world", "body"]


@dataclass
class Belief:
    """What the filter believes.

    Attributes:
        chart: Which errors of the pose the covariance is of.
        pose: ``T_world_body``.
        names: Landmarks in the state.
        points: Where they are in the world [m], Shape (n, 3).
        cov: Covariance of (pose, points), Shape (6 + 3 n, 6 + 3 n).
    """

    chart: Chart
    pose: SE3
    names: list[int]
    points: Array
    cov: Array


def filter_two_images(
    given: Measurements, start_variance: float, chart: Chart
) -> tuple[SE3, Array]:
    """Run over all images.

    Args:
        given: Sightings, the cameras, the start, and odometry at the times of the images.
        start_variance: Of each part of the first pose [m^2, rad^2].
        chart: Which errors of the pose are taken.

    Returns:
        Poses, Shape (n,), and covariances of their right perturbations, Shape (n, 6, 6).
    """
    rows, motion, camera = given.sightings, given.odometry, given.calibration.stereo
    assert rows is not None and motion is not None and camera is not None
    start = given.calibration.T_world_body_start.se3()
    belief = Belief(chart, start, [], np.zeros((0, 3)), start_variance * np.eye(6))
    poses, covs = [], []
    for k in range(len(rows)):
        if k > 0:
            along = motion.scale_sigma[k] * motion.twist[k]
            noise = np.diag(motion.variance[k]) + np.outer(along, along)
            belief = moved(belief, SE3.exp(motion.twist[k]), noise)
        now = rows.rows(k)
        ids, px, sigma = rows.landmark_id[now], rows.stereo_px[now], rows.sigma_px[now]
        belief = corrected(belief, camera, ids, px, sigma)
        belief = renewed(belief, camera, ids, px, sigma)
        poses.append(belief.pose)
        to_body = into_chart(belief).T
        covs.append(to_body @ belief.cov[:6, :6] @ to_body.T)
    return SE3.stack(poses), np.array(covs)


def into_chart(belief: Belief) -> Array:
    """Give the orthogonal matrix that takes xi to the errors of the chart, Shape (6, 6).

    ``a = R rho``, ``b = R phi`` to first order.
    """
    if belief.chart == "body":
        return np.eye(6)
    return np.kron(np.eye(2), belief.pose.rotation)


def moved(belief: Belief, step: SE3, noise: Array) -> Belief:
    """Move the pose; points stay.

    By ``exp(d)`` after the step the right perturbation becomes ``Ad(step^-1) xi + d``. In the world
    a turn by b shifts the way moved: ``a' = a + b x (R step)``.
    """
    after = Belief(belief.chart, belief.pose @ step, belief.names, belief.points, belief.cov)
    F = np.eye(len(belief.cov))
    if belief.chart == "body":
        F[:6, :6] = step.inverse().adjoint()
    else:
        F[:3, 3:6] = -so3.hat(belief.pose.rotation @ step.translation)
    after.cov = F @ belief.cov @ F.T
    C = into_chart(after)
    after.cov[:6, :6] += C @ noise @ C.T
    return after


def corrected(
    belief: Belief, camera: StereoCalibration, ids: Ints, px: Array, sigma: Array
) -> Belief:
    """Correct pose and points by the sightings of points in the state, all at once."""
    pairs = [(belief.names.index(n), i) for i, n in enumerate(ids.tolist()) if n in belief.names]
    if not pairs:
        return belief
    H = np.zeros((3 * len(pairs), len(belief.cov)))
    left = np.zeros(3 * len(pairs))
    for row, (slot, i) in enumerate(pairs):
        at = slice(3 * row, 3 * row + 3)
        seen, by_pose, by_point = looked_at(belief, belief.points[slot], camera)
        left[at] = px[i] - seen
        H[at, :6] = by_pose
        H[at, 6 + 3 * slot : 9 + 3 * slot] = by_point
    noise = np.diag(np.repeat([sigma[i] ** 2 for _, i in pairs], 3))
    S = H @ belief.cov @ H.T + noise
    K = np.linalg.solve(S, H @ belief.cov).T
    dx, rest = K @ left, np.eye(len(belief.cov)) - K @ H
    cov = rest @ belief.cov @ rest.T + K @ noise @ K.T
    points = belief.points + dx[6:].reshape(-1, 3)
    return Belief(belief.chart, shifted(belief, dx[:6]), belief.names, points, (cov + cov.T) / 2)


def shifted(belief: Belief, d: Array) -> SE3:
    """Give the pose corrected by an error in the chart."""
    if belief.chart == "body":
        return belief.pose @ SE3.exp(d)
    return SE3(so3.exp(d[3:]) @ belief.pose.rotation, belief.pose.translation + d[:3])


def renewed(
    belief: Belief, camera: StereoCalibration, ids: Ints, px: Array, sigma: Array
) -> Belief:
    """Forget the previous image's landmarks, and take in those that only this one has shown."""
    new = [i for i, name in enumerate(ids.tolist()) if name not in belief.names]
    mount = camera.T_body_camera.se3()
    in_body = (mount @ camera.triangulate(px[new])).reshape(-1, 3)
    G, N = np.zeros((3 * len(new), 6)), np.zeros((3 * len(new), 3 * len(new)))
    for j, i in enumerate(new):
        at = slice(3 * j, 3 * j + 3)
        by_xi = belief.pose.rotation @ np.hstack([np.eye(3), -so3.hat(in_body[j])])
        G[at] = by_xi @ into_chart(belief).T
        per_px = by_finite_steps(camera.triangulate, px[i])
        by_px = belief.pose.rotation @ mount.rotation @ per_px
        N[at, at] = sigma[i] ** 2 * by_px @ by_px.T
    P = belief.cov[:6, :6]
    cov = np.block([[P, P @ G.T], [G @ P, G @ P @ G.T + N]])
    names = [int(ids[i]) for i in new]
    points = (belief.pose @ in_body).reshape(-1, 3)
    return Belief(belief.chart, belief.pose, names, points, cov)


def looked_at(
    belief: Belief, point: Array, camera: StereoCalibration
) -> tuple[Array, Array, Array]:
    """Give the sighting of a point and its derivatives by the pose's error and by the point.

    In the body the point is ``q = R' (p - t)``; ``dq = -rho + q x phi + R' dp``.
    """
    mount = camera.T_body_camera.se3()
    q = belief.pose.inverse() @ point
    c = mount.inverse() @ q
    by_q = camera.projection_jacobian(c) @ mount.rotation.T
    by_pose = by_q @ np.hstack([-np.eye(3), so3.hat(q)])
    return camera.project(c), by_pose @ into_chart(belief).T, by_q @ belief.pose.rotation.T


def by_finite_steps(f: Callable[[Array], Array], x: Array, step: float = 1e-4) -> Array:
    """Differentiate by central differences."""
    return np.stack(
        [(f(x + step * e) - f(x - step * e)) / (2 * step) for e in np.eye(len(x))], axis=-1
    )
