"""GTSAM's estimators on our measurements: conventions, closed forms, and failing openly."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from estimators import ESTIMATORS, PEERS, build_estimator, gaussian
from estimators.peers.graph import from_pose3, to_pose3
from lpet_sim.errors import LpetError, RecordingError, UnknownNameError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.rng import stream
from tests.estimators.peer_runs import error, recorded, sight_only
from tests.estimators.stereo_traverse import scene, stereo

IMAGES = 15
EXACT = {"relinearize_threshold": 0.0, "extra_iterations": 2}

pytest.importorskip("gtsam")


def run(name: str, given: Measurements, **spec: object) -> Estimate:
    """Estimate with a peer."""
    return build_estimator(name, dict(spec)).estimate(given)


def tiny(seed: int = 0) -> Measurements:
    """Give three images that share eight landmarks."""
    given = recorded(seed, 3)
    rows = given.sightings
    assert rows is not None
    ids, count = np.unique(rows.landmark_id, return_counts=True)
    return sight_only(given, np.isin(rows.landmark_id, ids[count == 3][:8]))


def test_the_tangent_of_a_pose_is_ours_with_its_halves_exchanged() -> None:
    """Moving GTSAM's pose by (rotation, translation) is our right perturbation."""
    pose = SE3.from_rpy([0.3, -0.2, 1.1], [4.0, -2.0, 0.5])
    for xi in stream(0, "tangent").normal(0.0, 0.3, (5, 6)):
        moved = from_pose3(to_pose3(pose).retract(xi[[3, 4, 5, 0, 1, 2]]))
        np.testing.assert_allclose(moved.matrix(), (pose @ SE3.exp(xi)).matrix(), atol=1e-12)


@pytest.mark.parametrize("name", sorted(PEERS))
def test_without_noise_a_peer_makes_no_error(name: str) -> None:
    """Exact sightings and odometry give the true poses."""
    assert np.abs(error(run(name, recorded(0, IMAGES, noise=0.0)))).max() < 1e-7


@pytest.mark.parametrize("name", sorted(PEERS))
def test_without_sightings_the_covariance_is_that_of_chained_odometry(name: str) -> None:
    """The closed form: ``P' = F P F' + Q`` with ``F = Ad(T_prev_curr^-1)``, a linear case."""
    given = recorded(0, IMAGES)
    assert given.odometry is not None
    blind = sight_only(given, np.zeros(len(given.sightings.landmark_id), bool))  # type: ignore
    estimate = run(name, blind)
    assert estimate.covariance is not None
    P, T = 1e-12 * np.eye(6), scene(IMAGES).T_world_body[0]
    for k in range(1, IMAGES):
        step = SE3.exp(given.odometry.twist[k])
        P = gaussian.propagate(P, step.inverse().adjoint(), np.diag(given.odometry.variance[k]))
        T = T @ step
        np.testing.assert_allclose(estimate.covariance[k], P, rtol=1e-3, atol=1e-11)
    assert estimate.trajectory.T_world_body[-1].translation == pytest.approx(T.translation)


def dense_solution(given: Measurements) -> tuple[SE3, Array]:
    """Solve for poses and landmarks with SciPy, from the definitions alone.

    Returns:
        The poses, and the covariance of all unknowns, pose by pose and then the landmarks.
    """
    rows, motion = given.sightings, given.odometry
    assert rows is not None and motion is not None
    images = len(rows)
    image = np.repeat(np.arange(images), np.diff(rows.offsets))
    _, which = np.unique(rows.landmark_id, return_inverse=True)
    start = SE3.stack([given.calibration.T_world_body_start.se3()] * images)
    mount, steps = stereo().T_body_camera.se3(), SE3.exp(motion.twist[1:])
    sigma = np.sqrt(motion.variance[1:])
    first = scene(images).T_world_body[image] @ (mount @ stereo().triangulate(rows.stereo_px))

    def residuals(x: Array) -> Array:
        poses = start @ SE3.exp(x[: 6 * images].reshape(-1, 6))
        points = x[6 * images :].reshape(-1, 3)[which]
        seen = stereo().project((poses[image] @ mount).inverse() @ points)
        moved = (steps.inverse() @ poses[:-1].inverse() @ poses[1:]).log() / sigma
        white = (seen - rows.stereo_px) / rows.sigma_px[:, None]
        return np.concatenate([1e6 * x[:6], moved.ravel(), white.ravel()])

    points = np.array([first[which == i][0] for i in range(which.max() + 1)])
    poses = start.inverse() @ scene(images).T_world_body
    x0 = np.concatenate([poses.log().ravel(), points.ravel()])
    found = least_squares(residuals, x0, xtol=1e-15, ftol=1e-15, gtol=1e-12, x_scale="jac")
    return start @ SE3.exp(found.x[: 6 * images].reshape(-1, 6)), found.x


def dense_covariance(given: Measurements, poses: SE3, x: Array) -> Array:
    """Give the poses' covariance by finite differences about the solution, Shape (n, 6, 6)."""
    rows, motion = given.sightings, given.odometry
    assert rows is not None and motion is not None
    images = len(rows)
    image = np.repeat(np.arange(images), np.diff(rows.offsets))
    _, which = np.unique(rows.landmark_id, return_inverse=True)
    mount, steps = stereo().T_body_camera.se3(), SE3.exp(motion.twist[1:])
    sigma, points = np.sqrt(motion.variance[1:]), x[6 * images :]

    def residuals(d: Array) -> Array:
        moved = poses @ SE3.exp(d[: 6 * images].reshape(-1, 6))
        p = (points + d[6 * images :]).reshape(-1, 3)[which]
        seen = stereo().project((moved[image] @ mount).inverse() @ p) / rows.sigma_px[:, None]
        between = (steps.inverse() @ moved[:-1].inverse() @ moved[1:]).log() / sigma
        return np.concatenate([1e6 * d[:6], between.ravel(), seen.ravel()])

    h, n = 1e-6, len(x)
    J = np.stack([(residuals(h * e) - residuals(-h * e)) / (2 * h) for e in np.eye(n)], axis=1)
    whole = np.linalg.inv(J.T @ J)
    return np.array([whole[6 * k : 6 * k + 6, 6 * k : 6 * k + 6] for k in range(images)])


@pytest.mark.parametrize("method", ["levenberg_marquardt", "gauss_newton", "dogleg"])
def test_the_batch_solution_is_that_of_dense_least_squares(method: str) -> None:
    """Poses and covariances of three images with eight landmarks, by SciPy."""
    given = tiny()
    poses, x = dense_solution(given)
    found = run("gtsam_batch", given, method=method, tolerance=1e-13)
    apart = (poses.inverse() @ found.trajectory.T_world_body).log()
    assert found.covariance is not None
    sigma = np.sqrt(np.diagonal(found.covariance[1:], axis1=1, axis2=2))
    assert np.abs(apart[1:] / sigma).max() < 1e-3
    expected = dense_covariance(given, poses, x)
    scale = np.sqrt(np.einsum("ni,nj->nij", *[np.diagonal(expected, axis1=1, axis2=2)] * 2))
    assert np.abs((found.covariance - expected) / scale).max() < 1e-3


def test_a_lag_as_long_as_the_run_ends_where_the_batch_does() -> None:
    """With every landmark still in the window the last pose has seen the same."""
    given = recorded(1, IMAGES)
    batch = run("gtsam_batch", given)
    window = run("gtsam_fixed_lag", given, lag_images=IMAGES, **EXACT)
    assert batch.covariance is not None and window.covariance is not None
    ends = [e.trajectory.T_world_body[-1] for e in (batch, window)]
    sigma = np.sqrt(np.diag(batch.covariance[-1]))
    assert np.all(np.abs((ends[0].inverse() @ ends[1]).log()) < 1e-3 * sigma)
    np.testing.assert_allclose(
        window.covariance[-1], batch.covariance[-1], atol=1e-3 * float(sigma.max() ** 2)
    )
    middle = [e.trajectory.T_world_body[7] for e in (batch, window)]
    assert np.abs((middle[0].inverse() @ middle[1]).log()).max() > 1e-6


def test_a_short_lag_is_less_accurate_than_a_long_one() -> None:
    """Over 6 seeds and 20 images."""
    ends = {1: [], 10: []}  # type: dict[int, list[float]]
    for lag, seed in ((lag, seed) for lag in ends for seed in range(6)):
        spec = {"lag_images": lag, "covariances": "none"}
        found = run("gtsam_fixed_lag", recorded(seed, 20), **spec)
        ends[lag].append(float(np.linalg.norm(error(found)[-1, :3])))
    assert np.mean(np.square(ends[1])) > 1.5 * np.mean(np.square(ends[10]))


@pytest.mark.parametrize("name", sorted(PEERS))
def test_the_names_of_landmarks_do_not_matter_to_a_peer(name: str) -> None:
    """Relabelled landmarks give the same poses."""
    given = recorded(2, IMAGES)
    assert given.sightings is not None
    other = replace(given.sightings, landmark_id=90_000 - given.sightings.landmark_id)
    ends = [run(name, g, covariances="none") for g in (given, replace(given, sightings=other))]
    first, second = (e.trajectory.T_world_body for e in ends)
    assert np.abs((first.inverse() @ second).log()).max() < 1e-6


def test_counts_are_those_of_the_window() -> None:
    """Landmarks in the window are those that entered, less those that left."""
    given = recorded(0, 30)
    assert given.sightings is not None
    counts = run("gtsam_fixed_lag", given, lag_images=3, covariances="none").diagnostics
    inside = np.cumsum(counts["new"] - counts["dropped"])
    assert counts["landmarks"].tolist() == inside.tolist()
    assert np.all(counts["accepted"] == counts["new"] + counts["matched"])
    recent = [
        len(np.unique(given.sightings.landmark_id[slice(*given.sightings.offsets[[k - 3, k + 1]])]))
        for k in range(3, 30)
    ]
    assert counts["landmarks"][3:].tolist() == recent
    assert counts["bridged"].sum() == 0


@pytest.mark.parametrize("name", sorted(PEERS))
def test_a_landmark_without_disparity_does_not_enter(name: str) -> None:
    """Sightings at the horizon and beyond it change nothing."""
    given = recorded(0, IMAGES)
    rows = given.sightings
    assert rows is not None
    far = rows.landmark_id % 5 == 0
    px = rows.stereo_px.copy()
    px[far, 1] = px[far, 0] + stream(0, "horizon").normal(0.0, 0.5, int(far.sum()))
    soiled = replace(given, sightings=replace(rows, stereo_px=px))
    found, clean = (run(name, g) for g in (soiled, sight_only(given, ~far)))
    assert found.diagnostics["accepted"].tolist() == clean.diagnostics["accepted"].tolist()
    assert found.trajectory.equals(clean.trajectory)


@pytest.mark.parametrize("name", sorted(PEERS))
@pytest.mark.parametrize("kernel", ["huber", "geman_mcclure"])
def test_a_robust_kernel_takes_little_harm_from_false_sightings(name: str, kernel: str) -> None:
    """5 % of the sightings lie tens of pixels off."""
    given = recorded(3, 30)
    rows = given.sightings
    assert rows is not None
    bad = stream(0, "bad").random(len(rows.landmark_id)) < 0.05
    px = rows.stereo_px.copy()
    px[bad] += stream(0, "by").uniform(-40.0, 40.0, (int(bad.sum()), 3))
    soiled = replace(given, sightings=replace(rows, stereo_px=px))
    plain, robust = (run(name, soiled, robust=r, covariances="none") for r in ("none", kernel))
    size = [float(np.linalg.norm(error(e)[-1, :3])) for e in (plain, robust)]
    assert size[1] < 0.5 * size[0]


@pytest.mark.parametrize("name", sorted(PEERS))
def test_covariances_are_given_where_they_are_asked_for(name: str) -> None:
    """Poses do not depend on it, and the last one's is the same."""
    given = recorded(0, 8)
    every, last, none = (
        run(name, given, covariances=c) for c in ("every_image", "last_image", "none")
    )
    assert none.covariance is None and last.covariance is not None and every.covariance is not None
    assert every.trajectory.equals(none.trajectory) and last.trajectory.equals(none.trajectory)
    assert np.all(np.isnan(last.covariance[:-1])) and np.all(np.isfinite(every.covariance))
    np.testing.assert_array_equal(last.covariance[-1], every.covariance[-1])


def test_a_rover_that_stands_between_images_breaks_no_graph() -> None:
    """Odometry that is sure of standing still outweighs what is seen."""
    given = recorded(0, 4)
    assert given.odometry is not None
    twist, variance = given.odometry.twist.copy(), given.odometry.variance.copy()
    twist[2], variance[2] = 0.0, 0.0
    still = replace(given, odometry=replace(given.odometry, twist=twist, variance=variance))
    batch, window = (run(name, still) for name in ("gtsam_batch", "gtsam_fixed_lag"))
    poses = batch.trajectory.T_world_body
    assert np.abs((poses[1].inverse() @ poses[2]).log()).max() < 1e-3
    assert window.covariance is not None and np.all(np.isfinite(window.covariance))


@pytest.mark.parametrize("name", sorted(PEERS))
def test_a_peer_runs_only_where_it_is_named(name: str) -> None:
    """It is built by name, and is not among the estimators that run unasked."""
    assert name not in ESTIMATORS
    assert build_estimator(name).name == name
    with pytest.raises(UnknownNameError, match=name):
        build_estimator("nothing")


@pytest.mark.parametrize("name", sorted(PEERS))
def test_without_the_library_the_sentence_says_what_to_install(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A missing package is the user's to mend."""
    monkeypatch.setitem(sys.modules, "gtsam", None)
    with pytest.raises(LpetError, match=r"pip install lpet\[peers\]"):
        build_estimator(name)


@pytest.mark.parametrize("name", sorted(PEERS))
def test_a_peer_without_odometry_is_refused_in_one_sentence(name: str) -> None:
    """Nothing ties its poses together where nothing is seen."""
    with pytest.raises(RecordingError, match="'odometry' or 'wheels'"):
        run(name, replace(recorded(0, 3), odometry=None))
