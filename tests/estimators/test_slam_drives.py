"""The SLAM filter on short synthetic drives: slips, wrong places, lasting errors, long runs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from benchmarks.slam_world import SIGMA, Drive
from estimators import gaussian, gaussian_blocks, slam
from estimators.odometry_steps import image_odometry
from estimators.slam import Slam, SlamRun, odometry_step
from estimators.slam_map import LASTING, POSE
from estimators.slam_spec import BoundedQueue, SlamSpec, TimeToLive
from estimators.slam_state import SlamState
from estimators.slam_values import Innovations, Joint
from lpet_sim.evaluation.consistency import anees
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements, SightingStream
from lpet_sim.rng import stream
from tests.estimators.slam_worlds import FORMS, NO_CHECKS, dense, live, spec

SLIP = 20
"""The image whose odometry is wrong."""
THREE_SIGMA = chi2.ppf(chi2.cdf(9.0, 1), 6)
"""What the square of six errors stays below as often as one error stays within three sigmas."""


def nees(found: Estimate, poses: SE3, image: int) -> float:
    """Give the normalised squared error of a pose."""
    assert found.covariance is not None
    T: SE3 = found.trajectory.T_world_body[image]
    xi = (T.inverse() @ poses[image]).log()
    return float(xi @ np.linalg.solve(found.covariance[image], xi))


def slipped(given: Measurements, metres: float) -> Measurements:
    """Let odometry report some metres too many in one step."""
    assert given.odometry is not None
    twist = given.odometry.twist.copy()
    twist[SLIP, 0] += metres
    return replace(given, odometry=replace(given.odometry, twist=twist))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("metres", [0.3, 0.5, 1.0])
def test_a_slip_is_flagged_and_recovered_from(form: str, metres: float) -> None:
    """In one image, that of the slip; the map stays, and the error is within its sigmas after."""
    drive = Drive(40)
    for seed in range(3):
        found = Slam(spec(form)).estimate(slipped(drive.measurements(seed), metres))
        log = found.diagnostics
        assert np.flatnonzero(log["slipped"]).tolist() == [SLIP]
        assert log["accepted"][SLIP] > 0.8 * log["matched"][SLIP]
        assert log["bridged"].sum() == 0
        for image in (SLIP, SLIP + 1, len(drive.poses()) - 1):
            assert nees(found, drive.poses(), image) < THREE_SIGMA


def test_without_a_slip_none_is_flagged() -> None:
    """Nor where odometry is believed whatever it says: then the slip stays in the estimate."""
    drive = Drive(40)
    given = drive.measurements(0)
    assert not Slam().estimate(given).diagnostics["slipped"].any()
    blind = Slam(SlamSpec(slip_probability=0.0)).estimate(slipped(given, 1.0))
    assert nees(blind, drive.poses(), SLIP) > 1e3


def misnamed(given: Measurements, share: float, seed: int) -> Measurements:
    """Let a share of the sightings be of something else, some hundred pixels off."""
    assert given.sightings is not None
    rng, px = stream(seed, "misnamed"), given.sightings.stereo_px.copy()
    rows = rng.random(len(px)) < share
    px[rows] += 100.0 * rng.standard_normal((int(rows.sum()), 3))
    return replace(given, sightings=replace(given.sightings, stereo_px=px))


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("share", [0.0, 0.05])
def test_a_slip_through_which_most_sightings_fit_is_flagged(form: str, share: float) -> None:
    """Four centimetres in one step: each fits by itself, together they contradict odometry.

    Wrong names neither hide it nor look like one.
    """
    drive = Drive(40)
    for seed in range(3):
        given = misnamed(drive.measurements(seed), share, seed)
        assert not Slam(spec(form)).estimate(given).diagnostics["slipped"].any()
        found = Slam(spec(form)).estimate(slipped(given, 0.04))
        assert np.flatnonzero(found.diagnostics["slipped"]).tolist() == [SLIP]
        blind = Slam(spec(form, slip_probability=0.0)).estimate(slipped(given, 0.04))
        log = blind.diagnostics
        assert log["accepted"][SLIP] > 0.6 * log["matched"][SLIP]
        assert nees(found, drive.poses(), SLIP) < THREE_SIGMA < nees(blind, drive.poses(), SLIP)


@pytest.mark.parametrize(
    ("held", "metres", "flagged"), [(False, 0.04, [SLIP]), (True, 0.04, []), (True, 1.0, [SLIP])]
)
def test_a_step_that_is_only_held_is_asked_where_most_sightings_do_not_fit(
    monkeypatch: pytest.MonkeyPatch, held: bool, metres: float, flagged: list[int]
) -> None:
    """It is no odometry that is contradicted a little; a wild one is found all the same."""
    tell = slam.odometry_step
    monkeypatch.setattr(slam, "odometry_step", lambda o, k: replace(tell(o, k), held=held))
    found = Slam().estimate(slipped(Drive(40).measurements(0), metres))
    assert np.flatnonzero(found.diagnostics["slipped"]).tolist() == flagged


def under_a_skyline(given: Measurements, poses: SE3, seed: int) -> Measurements:
    """Add sixty landmarks on a skyline, half a kilometre off, to the sightings of each image."""
    seen, cameras = given.sightings, given.calibration.stereo
    assert seen is not None and cameras is not None
    rng, eyes = stream(seed, "skyline"), poses @ cameras.T_body_camera.se3()
    bearing = rng.uniform(-0.4, 0.4, 60)
    ahead = np.column_stack([500.0 * np.sin(bearing), np.full(60, -40.0), 500.0 * np.cos(bearing)])
    p_world = np.asarray(eyes[0] @ ahead)
    ids, rows = [], []
    for k in range(len(seen)):
        far = cameras.project(eyes[k].inverse() @ p_world)
        far = far + cameras.sigma_px * rng.standard_normal(far.shape)
        ids.append(np.concatenate([seen.landmark_id[seen.rows(k)], 1_000_000 + np.arange(60)]))
        rows.append(np.concatenate([seen.stereo_px[seen.rows(k)], far]))
    offsets = seen.offsets + 60 * np.arange(len(seen) + 1)
    px = np.concatenate(rows)
    sigma = np.full(len(px), cameras.sigma_px)
    both = SightingStream(seen.t_ns.copy(), offsets, np.concatenate(ids), px, sigma)
    return replace(given, sightings=both)


@pytest.mark.parametrize("form", FORMS)
def test_a_slip_under_a_skyline_is_flagged(form: str) -> None:
    """Most sightings are of far landmarks, which fit whatever the wheels say."""
    drive = Drive(40, visible=25, sightings=20)
    given = under_a_skyline(drive.measurements(0), drive.poses(), 0)
    assert not Slam(spec(form)).estimate(given).diagnostics["slipped"].any()
    found = Slam(spec(form)).estimate(slipped(given, 0.5))
    assert np.flatnonzero(found.diagnostics["slipped"]).tolist() == [SLIP]
    for image in (SLIP, SLIP + 1, len(drive.poses()) - 1):
        assert nees(found, drive.poses(), image) < THREE_SIGMA


def misplaced(given: Measurements, image: int, count: int) -> tuple[Measurements, list[int]]:
    """Sight the newest landmarks of an image 40 px off, and only those."""
    assert given.sightings is not None
    rows, px = given.sightings.rows(image), given.sightings.stereo_px.copy()
    wrong = slice(rows.stop - count, rows.stop)
    px[wrong] += [40.0, 25.0, -30.0]
    ids = given.sightings.landmark_id[wrong].tolist()
    return replace(given, sightings=replace(given.sightings, stereo_px=px)), ids


@pytest.mark.parametrize("form", FORMS)
def test_landmarks_that_entered_at_a_wrong_place_leave(form: str) -> None:
    """After three sightings in a row that do not fit, and come back at the right one."""
    drive = Drive(14, visible=30, sightings=30)
    given, wrong = misplaced(drive.measurements(2), 0, 4)
    run, entered = driven(spec(form), given), []
    for _ in run:
        m = run.state.landmarks
        entered.append([int(m.entered[m.slot_of[i]]) if i in m.slot_of else 0 for i in wrong])
    first, late = np.array(entered[:3]), np.array(entered[4:])
    assert (first <= 30).all() and (first > 0).all()
    assert not np.array(entered[3]).any()
    assert (late > 30).all()
    log = run.run.diagnostics()
    assert log["rejected"][1:4].tolist() == [4.0, 4.0, 4.0]
    assert log["dropped"][:5].sum() == 4
    assert log["rejected"][5:].sum() <= 2


class Driven:
    """A filter that takes one image after the other while it is looked at."""

    def __init__(self, chosen: SlamSpec, given: Measurements) -> None:
        """Start at the start of a recording."""
        stereo, imu = given.calibration.stereo, given.calibration.imu
        assert stereo is not None and imu is not None and given.sightings is not None
        self.run = SlamRun(chosen, SE3.identity(), stereo, imu.gyro_bias_radps)
        self._sightings = given.sightings
        self._odometry = image_odometry(given, given.sightings.t_ns)

    @property
    def state(self) -> SlamState:
        """The filter's."""
        return self.run.state

    def __iter__(self) -> Any:
        """Take in each image and give its number."""
        seen, odometry = self._sightings, self._odometry
        for k in range(len(seen)):
            self.run.advance(odometry_step(odometry, k))
            rows = seen.rows(k)
            self.run.see(seen.landmark_id[rows], seen.stereo_px[rows], seen.sigma_px[rows])
            yield k


def driven(chosen: SlamSpec, given: Measurements) -> Driven:
    """Make a filter to be looked at on its way."""
    return Driven(chosen, given)


@pytest.mark.parametrize("form", FORMS)
def test_images_that_fit_nowhere_do_not_cost_the_map(form: str) -> None:
    """All sightings of five images are wrong, each elsewhere: the map waits and is found again."""
    drive = Drive(40)
    given = drive.measurements(3)
    assert given.sightings is not None
    px = given.sightings.stereo_px.copy()
    wrong = slice(given.sightings.rows(SLIP).start, given.sightings.rows(SLIP + 4).stop)
    px[wrong] += 150.0 * stream(3, "wrong").standard_normal(px[wrong].shape)
    lost = replace(given, sightings=replace(given.sightings, stereo_px=px))
    found = Slam(spec(form)).estimate(lost)
    log = found.diagnostics
    assert log["accepted"][SLIP : SLIP + 5].max() < 0.25 * log["matched"][SLIP : SLIP + 5].min()
    assert log["landmarks"][SLIP : SLIP + 5].min() > 40
    assert log["accepted"][SLIP + 5] > 0.7 * log["matched"][SLIP + 5]
    assert log["matched"][SLIP + 5] > 20
    assert nees(found, drive.poses(), -1) < THREE_SIGMA


LEARNT = {"visible": 12, "sightings": 12, "sigma_px": 0.3}


def test_a_constant_error_of_the_gyro_is_learnt_on_a_long_drive() -> None:
    """1e-5 rad/s about each axis over 1000 images: found within 3 sigmas, and better than told."""
    rate = (1e-5, -1e-5, 1e-5)
    drive = Drive(1000, **LEARNT, rate_radps=rate, scale=1.0)  # type: ignore[arg-type]
    run = driven(SlamSpec(), drive.measurements(0))
    for _ in run:
        pass
    sigma = np.sqrt(np.diag(run.state.P)[POSE : POSE + LASTING])
    error = run.state.lasting - [*rate, 1.0]
    assert (np.abs(error) < 3 * sigma).all()
    assert sigma[:3].max() < 0.7e-5
    assert sigma[3] < 0.2


def test_lasting_errors_and_pose_are_consistent_over_many_short_drives() -> None:
    """Rates and scale drawn from what is declared; NEES of what is learnt, and of the pose."""
    of_pose, of_lasting = [], []
    for seed in range(20):
        drawn = stream(seed, "lasting").standard_normal(4)
        rate = tuple(2e-4 * drawn[:3])
        drive = Drive(
            60,
            **LEARNT,  # type: ignore[arg-type]
            rate_radps=rate,
            rate_sigma_radps=2e-4,
            scale=drawn[3],
        )
        run = driven(SlamSpec(), drive.measurements(seed))
        for _ in run:
            pass
        P, rows = run.state.P, slice(POSE, POSE + LASTING)
        e = run.state.lasting - [*rate, drawn[3]]
        of_lasting.append(float(e @ np.linalg.solve(P[rows, rows], e)))
        xi = (run.state.pose.inverse() @ drive.poses()[-1]).log()
        of_pose.append(float(xi @ np.linalg.solve(run.state.pose_covariance(), xi)))
        assert np.sqrt(np.diag(P)[POSE : POSE + 3]).max() < 1.5e-4
    assert anees(of_pose, 6).is_consistent
    assert anees(of_lasting, LASTING).is_consistent


class Joseph:
    """The same updates in Joseph's form, on the rows that live."""

    def __init__(self) -> None:
        """Begin without sightings."""
        self._seen: tuple[SlamState, Innovations] | None = None

    def joint(self, state: SlamState, seen: Innovations) -> Joint:
        """Remember what is about to be taken in."""
        self._seen = state, seen
        return Joint(np.zeros((3 * len(seen), len(state.P))), np.eye(3 * len(seen)))

    def update(self, P: Array, _HP: Array, _L: Array, r: Array) -> tuple[Array, float]:
        """Take it in."""
        assert self._seen is not None
        state, seen = self._seen
        rows = live(state)
        H = np.ascontiguousarray(dense(state, seen.rows, seen.H, seen.G)[:, rows])
        noise = np.diag(np.repeat(seen.variance, 3))
        part, mine = np.ascontiguousarray(P[np.ix_(rows, rows)]), np.ix_(rows, rows)
        nis = gaussian.normalised_square(r, H @ part @ H.T + noise)
        moved, P[mine] = gaussian.update(part, H, r, noise)
        dx = np.zeros(len(P))
        dx[rows] = moved
        return dx, nis


def test_two_thousand_updates_keep_the_covariance_positive_and_equal_to_josephs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Through some thousand entries, drops and keyframes; the two runs end at one estimate."""
    given = Drive(2000, visible=8, sightings=8).measurements(0)
    chosen = SlamSpec.from_mapping(NO_CHECKS | {"retention": TimeToLive(images=5).to_mapping()})
    run, least = driven(chosen, given), []
    for k in run:
        if k % 50 == 49:
            rows = live(run.state)
            P = run.state.P[np.ix_(rows, rows)]
            # In units of its own sigmas, as lengths and turns and pixels stand side by side.
            scale = np.sqrt(np.diag(P))
            least.append(np.linalg.eigvalsh(P / np.outer(scale, scale)).min())
            assert np.array_equal(P, P.T) or np.abs(P - P.T).max() < 1e-12 * P.max()
    assert min(least) > 0.0
    other, joseph = driven(chosen, given), Joseph()
    monkeypatch.setattr(SlamState, "joint", lambda state, seen: joseph.joint(state, seen))
    monkeypatch.setattr(gaussian_blocks, "update_in_place", joseph.update)
    for _ in other:
        pass
    P, Q = run.state.pose_covariance(), other.state.pose_covariance()
    sigma = np.sqrt(np.diag(Q))
    assert np.abs((P - Q) / np.outer(sigma, sigma)).max() < 1e-6
    apart = (run.state.pose.inverse() @ other.state.pose).log() / sigma
    assert np.abs(apart).max() < 1e-6


def test_noise_is_declared_as_it_is() -> None:
    """The drive itself: its odometry strays from the truth by what it says."""
    drive = Drive(2000)
    z = (drive.odometry(0).twist[1:] - drive.twists()) / SIGMA
    np.testing.assert_allclose(z.std(axis=0), 1.0, atol=0.06)
    queue = SlamSpec(retention=BoundedQueue(size=30))
    exact = Slam(queue).estimate(replace(Drive(30, noise=0.0)).measurements(0))
    off = exact.trajectory.T_world_body.inverse() @ Drive(30).poses()
    assert np.abs(off.log()).max() < 1e-9
