"""The bound of the pose: against dense algebra, closed forms, and an estimator that reaches it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation import bounds
from lpet_sim.evaluation.bounds import PoseBound, end_bound, pose_bounds
from lpet_sim.evaluation.consistency import chi_square_band
from lpet_sim.evaluation.sighting_model import (
    Landmarks,
    Rows,
    homogeneous,
    homogeneous_jacobian,
    in_view,
    into_camera,
    out_of_camera,
    seen_at,
    seen_at_jacobian,
    triangulate,
)
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.streams import OdometryStream, SightingStream, concatenate_slices
from lpet_sim.rng import stream
from lpet_sim.sensors.s_curve import SCurveRun, SCurveSpec, s_curve_run
from tests.finite_difference import assert_jacobian, numerical_jacobian

SPEC = SCurveSpec(images=8, step_m=0.4, landmarks_per_m2=0.3)
CAMERA = SPEC.stereo


@pytest.fixture(scope="module")
def run() -> SCurveRun:
    """Give a short run of about 20 sightings an image."""
    return s_curve_run(SPEC, 1)


def bound_of(run: SCurveRun, with_odometry: bool = True) -> PoseBound:
    """Give the bound at the end with the landmarks as they are."""
    odometry = run.odometry if with_odometry else None
    return end_bound(run.poses, run.sightings, CAMERA, odometry, run.p_world_of)


def residuals(run: SCurveRun, rows: Rows, state: Array) -> Array:
    """Give all residuals over their noise, from the errors of poses, scale and landmarks.

    Written plainly: landmarks are points in the world here, poses move by ``T exp(xi)``.
    """
    n = len(run.poses)
    xi = np.concatenate([np.zeros((1, 6)), state[: 6 * (n - 1)].reshape(-1, 6)])
    scale, p = state[6 * (n - 1)], state[6 * (n - 1) + 1 :].reshape(-1, 3)
    poses = run.poses @ SE3.exp(xi)
    camera = (poses @ CAMERA.T_body_camera.se3())[rows.image]
    p_world = run.p_world_landmark[rows.landmark_id] + p
    seen = CAMERA.project(camera.inverse() @ p_world[rows.landmark])
    sighted = (rows.stereo_px - seen) / rows.sigma_px[:, None]
    measured = run.odometry.twist[1:].copy()
    true = (poses[:-1].inverse() @ poses[1:]).log()
    measured[:, 0] -= true[:, 0] * scale
    wrong = (SE3.exp(measured).inverse() @ SE3.exp(true)).log()
    stepped = wrong / np.sqrt(run.odometry.variance[1:])
    sigma = run.odometry.scale_sigma[0, 0]
    return np.concatenate([sighted.ravel(), stepped.ravel(), [scale / sigma]])


def size_of(run: SCurveRun, rows: Rows) -> int:
    """Give the number of unknowns of `residuals`."""
    return 6 * (len(run.poses) - 1) + 1 + 3 * len(rows.landmark_id)


def test_the_bound_is_the_inverse_of_the_dense_normal_matrix(run: SCurveRun) -> None:
    """Of numerical derivatives, with landmarks as points of the world; every block of time's end.

    Odometry is measured without noise here, so that the derivatives are those at the truth.
    """
    exact = without_noise(run)
    rows = Rows.of(exact.sightings)
    J = numerical_jacobian(lambda x: residuals(exact, rows, x), np.zeros(size_of(run, rows)), 1e-5)
    last = slice(6 * (len(run.poses) - 2), 6 * (len(run.poses) - 1))
    expected = np.linalg.inv(J.T @ J)[last, last]
    found = bound_of(run).covariance
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(
        found / scale / scale[:, None], expected / scale / scale[:, None], rtol=0, atol=2e-3
    )


def without_noise(run: SCurveRun) -> SCurveRun:
    """Replace what was measured by what is true."""
    true = (run.poses[:-1].inverse() @ run.poses[1:]).log()
    twist = np.concatenate([np.zeros((1, 6)), true])
    odometry = replace(run.odometry, twist=twist)
    return replace(run, measurements=replace(run.measurements, odometry=odometry))


def test_without_sightings_the_bound_is_the_odometrys_noise() -> None:
    """Without sightings the covariance of a chain is the sum of moved steps, scale and all."""
    run = s_curve_run(SPEC, 2)
    poses, t_ns = run.poses, run.odometry.t_ns
    nothing = SightingStream(
        t_ns, np.zeros(len(t_ns) + 1, dtype=np.int64), np.zeros(0, dtype=np.int64),
        np.zeros((0, 3)), np.zeros(0),
    )  # fmt: skip
    found = pose_bounds(poses, nothing, CAMERA, run.odometry)
    end = poses[-1].inverse() @ poses
    twist = (poses[:-1].inverse() @ poses[1:]).log()
    Ad = end.adjoint()
    expected = bounds.START_VARIANCE * Ad[0] @ Ad[0].T
    along = np.zeros(6)
    for k in range(1, len(poses)):
        expected = expected + (Ad[k] * run.odometry.variance[k]) @ Ad[k].T
        along = along + Ad[k][:, 0] * twist[k - 1, 0]
    expected = expected + SPEC.scale_sigma**2 * np.outer(along, along)
    np.testing.assert_allclose(found[-1].covariance, expected, rtol=1e-6, atol=1e-12)


def test_one_landmark_seen_twice_tells_how_far_the_rover_moved() -> None:
    """Where rotation is known and odometry knows no step: two looks, each with the stereo's error.

    The landmark is at depth z midway between the eyes, where errors along the axes part: sideways
    s z / (f sqrt 2), for two eyes look; up s z / f; in depth sqrt 2 s z^2 / (f b).
    """
    z, s, f, b = 4.0, 0.5, CAMERA.focal_px, CAMERA.baseline_m
    p_camera = np.array([0.5 * b, 0.0, z])
    poses = SE3.identity(2)
    p_world = CAMERA.T_body_camera.se3() @ p_camera
    px = np.repeat(CAMERA.project(p_camera)[None], 2, axis=0)
    t_ns = np.array([0, 1], dtype=np.int64)
    sightings = SightingStream(t_ns, np.array([0, 1, 2]), np.array([7, 7]), px, np.full(2, s))
    variance = np.tile([1e6, 1e6, 1e6, 1e-30, 1e-30, 1e-30], (2, 1))
    odometry = OdometryStream(t_ns, np.zeros((2, 6)), variance, np.zeros((2, 6)))
    found = end_bound(poses, sightings, CAMERA, odometry, {7: p_world})
    R = CAMERA.T_body_camera.se3().rotation
    in_camera = R.T @ found.covariance[:3, :3] @ R
    # On the axis between the eyes x, y and z part: u_left + u_right, v, and disparity.
    expected = 2 * np.diag([(s * z / f) ** 2 / 2, (s * z / f) ** 2, 2 * (s * z * z / (f * b)) ** 2])
    np.testing.assert_allclose(in_camera, expected, rtol=1e-4, atol=1e-9)


def test_the_bound_falls_with_every_sighting_and_with_odometry(run: SCurveRun) -> None:
    """Information only adds: the matrix that leaves is positive semidefinite."""
    less = fewer_sightings(run.sightings, 1)
    covariances = [
        bound_of(run).covariance,
        bound_of(run, with_odometry=False).covariance,
        end_bound(run.poses, less, CAMERA, None, run.p_world_of).covariance,
    ]
    for better, worse in pairwise(covariances):
        assert np.linalg.eigvalsh(worse - better)[0] > -1e-12
        assert np.trace(worse[:3, :3]) > 1.001 * np.trace(better[:3, :3])


def fewer_sightings(sightings: SightingStream, drop: int) -> SightingStream:
    """Leave out the first rows of each image."""
    keep = [np.arange(r.start + drop, r.stop) for r in map(sightings.rows, range(len(sightings)))]
    rows, offsets = np.concatenate(keep), concatenate_slices(keep)
    columns = sightings.landmark_id[rows], sightings.stereo_px[rows], sightings.sigma_px[rows]
    return SightingStream(sightings.t_ns, offsets, *columns)


def test_a_batch_estimator_reaches_the_bound(run: SCurveRun) -> None:
    """Gauss-Newton over all unknowns, 200 draws of the noise: NEES and RMS within their scatter."""
    exact = without_noise(run)
    rows = Rows.of(exact.sightings)
    true_px = CAMERA.project(
        (exact.poses @ CAMERA.T_body_camera.se3())[rows.image].inverse()
        @ exact.p_world_landmark[rows.landmark_id][rows.landmark]
    )
    rng, draws, size = stream(5, "batch"), 200, size_of(run, rows)
    J = numerical_jacobian(lambda x: residuals(exact, rows, x), np.zeros(size), 1e-5)
    solve = np.linalg.pinv(J)
    errors = []
    for _ in range(draws):
        noisy = true_px + rows.sigma_px[:, None] * rng.standard_normal(true_px.shape)
        seen = replace(rows, stereo_px=noisy)
        noise = np.sqrt(exact.odometry.variance[1:]) * rng.standard_normal(
            (len(exact.poses) - 1, 6)
        )
        scaled = exact.odometry.twist[1:].copy()
        scaled[:, 0] *= 1 + SPEC.scale_sigma * rng.standard_normal()
        twist = np.concatenate([np.zeros((1, 6)), (SE3.exp(scaled) @ SE3.exp(noise)).log()])
        world = replace(exact, measurements=replace(
            exact.measurements, odometry=replace(exact.odometry, twist=twist)))  # fmt: skip
        x = np.zeros(size)
        for _ in range(3):
            x = x - solve @ residuals(world, seen, x)
        errors.append(x[6 * (len(run.poses) - 2) : 6 * (len(run.poses) - 1)])
    found, e = bound_of(run), np.array(errors)
    nees = np.einsum("ni,ij,nj->n", e, np.linalg.inv(found.covariance), e).mean()
    low, high = chi_square_band(draws, 6, 0.99)
    assert low < nees < high
    rms_m = float(np.sqrt((e[:, :3] ** 2).sum(axis=1).mean()))
    assert 0.85 < rms_m / found.position_rms_m < 1.15


def test_landmarks_triangulated_at_the_truth_give_the_same_bound(run: SCurveRun) -> None:
    """Their error moves the derivatives a little, and the bound by less than a hundredth."""
    known = bound_of(run)
    found = end_bound(run.poses, run.sightings, CAMERA, run.odometry)
    assert found.position_rms_m == pytest.approx(known.position_rms_m, rel=0.01)
    assert found.attitude_rms_rad == pytest.approx(known.attitude_rms_rad, rel=0.01)


def test_outliers_are_left_out(run: SCurveRun) -> None:
    """Every tenth sighting is somewhere else: the bound is that of the other nine."""
    wrong = np.arange(len(run.sightings.landmark_id)) % 10 == 3
    px = run.sightings.stereo_px.copy()
    px[wrong] += [80.0, 95.0, -60.0]
    spoilt = replace(run.sightings, stereo_px=px)
    offsets = np.concatenate([[0], np.cumsum(~wrong)])[run.sightings.offsets]
    sound = SightingStream(
        spoilt.t_ns, offsets, spoilt.landmark_id[~wrong], px[~wrong], spoilt.sigma_px[~wrong]
    )
    poses = run.poses
    expected = end_bound(poses, sound, CAMERA, run.odometry).position_rms_m
    found = end_bound(poses, spoilt, CAMERA, run.odometry).position_rms_m
    assert found == pytest.approx(expected, rel=0.01)
    known = end_bound(poses, spoilt, CAMERA, run.odometry, run.p_world_of).position_rms_m
    assert known == pytest.approx(expected, rel=0.01)


def test_landmarks_at_the_horizon_carry_attitude_and_no_place(run: SCurveRun) -> None:
    """Three of them, with disparities that noise makes negative, pin the attitude alone."""
    poses, rng = run.poses, stream(3, "horizon")
    p_world = np.array([[5e4, y, 2e3] for y in (-1e4, 0.0, 1e4)])
    camera = poses @ CAMERA.T_body_camera.se3()
    px = np.concatenate([CAMERA.project(camera[k].inverse() @ p_world) for k in range(len(poses))])
    px += 0.5 * rng.standard_normal(px.shape)
    assert (px[:, 0] < px[:, 1]).any()
    ids = np.tile(np.arange(3), len(poses))
    offsets = 3 * np.arange(len(poses) + 1)
    far = SightingStream(run.sightings.t_ns, offsets, ids, px, np.full(len(ids), 0.5))
    found = end_bound(poses, far, CAMERA, run.odometry)
    alone = end_bound(poses, fewer_sightings(far, 3), CAMERA, run.odometry)
    heading_rad = float(np.sqrt(found.covariance[5, 5]))
    assert heading_rad < 0.5 / CAMERA.focal_px < float(np.sqrt(alone.covariance[5, 5]))
    assert 0.9 * alone.position_rms_m < found.position_rms_m <= alone.position_rms_m


def test_the_derivatives_are_those_of_the_projection(run: SCurveRun) -> None:
    """By the point, by the host's image coordinates, and by the pose; near, far and negative."""
    points = np.array([[1.0, 0.5, 3.0, 1.0], [-4.0, 0.2, 9.0, 1e-3], [0.3, 0.1, 2.0, -0.01]])
    for point in points:
        assert_jacobian(lambda p: seen_at(CAMERA, p), point, seen_at_jacobian(CAMERA, point), 1e-5)
    x = np.array([500.0, 470.0, 300.0])
    assert_jacobian(lambda y: homogeneous(CAMERA, y), x, homogeneous_jacobian(CAMERA))
    rows = Rows.of(run.sightings)
    T_world_camera = run.poses @ CAMERA.T_body_camera.se3()
    landmarks, _ = triangulate(rows, T_world_camera, CAMERA)
    _, G, J = in_view(rows, T_world_camera, landmarks, CAMERA)
    for row in (0, 40, 90):
        i, k = rows.landmark[row], rows.image[row]

        def seen(z: Array, i: int = i, k: int = k) -> Array:
            moved = (T_world_camera[k] @ SE3.exp(z[3:]))[None]
            host = landmarks.T_world_camera[i][None]
            world = out_of_camera(host, homogeneous(CAMERA, (landmarks.x[i] + z[:3])[None]))
            return seen_at(CAMERA, into_camera(moved, world))[0]

        assert_jacobian(seen, np.zeros(9), np.concatenate([G[row], J[row]], axis=1), 1e-5)


def test_a_triangulated_landmark_is_where_it_was_seen_exactly(run: SCurveRun) -> None:
    """Without noise it comes back to where it is."""
    rows = Rows.of(run.sightings)
    T_world_camera = run.poses @ CAMERA.T_body_camera.se3()
    p_world = run.p_world_landmark[rows.landmark_id][rows.landmark]
    exact = replace(rows, stereo_px=CAMERA.project(T_world_camera[rows.image].inverse() @ p_world))
    found, chi2 = triangulate(exact, T_world_camera, CAMERA)
    assert isinstance(found, Landmarks)
    assert chi2.max() < 1e-12


def test_the_bound_at_a_time_is_that_of_the_run_cut_there(run: SCurveRun) -> None:
    """What comes later does not help."""
    poses, sightings, odometry = run.poses, run.sightings, run.odometry
    until = 5
    end = int(sightings.offsets[until + 1])
    cut = SightingStream(
        sightings.t_ns[: until + 1], sightings.offsets[: until + 2], sightings.landmark_id[:end],
        sightings.stereo_px[:end], sightings.sigma_px[:end],
    )  # fmt: skip
    parts = (odometry.t_ns, odometry.twist, odometry.variance, odometry.scale_sigma)
    short = OdometryStream(*(part[: until + 1] for part in parts))
    expected = end_bound(poses[: until + 1], cut, CAMERA, short, run.p_world_of)
    found = pose_bounds(poses, sightings, CAMERA, odometry, run.p_world_of, at=[until])[0]
    np.testing.assert_allclose(found.covariance, expected.covariance, rtol=1e-6, atol=1e-15)


def test_a_rover_that_sees_and_measures_nothing_could_be_anywhere(run: SCurveRun) -> None:
    """The bound is then far away, and finite."""
    none = fewer_sightings(run.sightings, 10_000)
    assert 50.0 < end_bound(run.poses, none, CAMERA).position_rms_m < 1e5


def test_what_is_not_at_the_same_times_is_refused(run: SCurveRun) -> None:
    """Poses and odometry go with the images."""
    with pytest.raises(RecordingError, match="give the pose of each"):
        end_bound(run.poses[:-1], run.sightings, CAMERA)
    shifted = replace(run.odometry, t_ns=run.odometry.t_ns + 1)
    with pytest.raises(RecordingError, match="times of the images"):
        end_bound(run.poses, run.sightings, CAMERA, shifted)


def test_tracks_that_slide_have_no_bound(run: SCurveRun) -> None:
    """Their noise is not white, and the bound would promise what cannot be had."""
    slid = replace(run.sightings, drift_px=np.full(len(run.sightings), 0.2))
    with pytest.raises(RecordingError, match="no bound for tracks that slide"):
        end_bound(run.poses, slid, CAMERA, run.odometry)
