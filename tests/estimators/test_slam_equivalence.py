"""The SLAM filter against what it must equal: another filter, other variants, the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimators.slam import Slam
from estimators.slam_spec import AnchorSpec, BoundedQueue, KeepAll, SlamSpec, TimeToLive
from lpet_sim.evaluation.consistency import Consistency, anees, chi_square_band
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements, OdometryStream, SightingStream
from lpet_sim.rng import stream
from tests.estimators.peer_runs import error, kept, recorded
from tests.estimators.slam_worlds import NO_CHECKS
from tests.estimators.stereo_traverse import SIGMA_PX, scene
from tests.estimators.two_image_filter import filter_two_images

IMAGES = 12
ONE_IMAGE = TimeToLive(images=1).to_mapping()
START_VARIANCE = 1e-12
LOOKS = 12
FORMULATIONS = ("standard", "first_estimates", "right_invariant")


def run(given: Measurements, **spec: object) -> Estimate:
    """Run the filter without checks, or with what is given."""
    return Slam(SlamSpec.from_mapping(NO_CHECKS | spec)).estimate(given)


def apart(first: Estimate, second: Estimate) -> Array:
    """Give how far two estimates' poses are apart in standard deviations, Shape (n, 6)."""
    assert first.covariance is not None
    poses = first.trajectory.T_world_body.inverse() @ second.trajectory.T_world_body
    return np.asarray(poses.log() / np.sqrt(np.diagonal(first.covariance, axis1=1, axis2=2)))


def image_of(rows: SightingStream) -> Array:
    """Give the image of each sighting, Shape (m,)."""
    return np.repeat(np.arange(len(rows)), np.diff(rows.offsets))


def seen_twice(given: Measurements) -> Measurements:
    """Rename landmarks, so that each is seen in two images in a row at most.

    Half of them change their name before every even image, the others before every odd one.
    """
    rows = given.sightings
    assert rows is not None
    pair = (image_of(rows) + rows.landmark_id % 2) // 2
    return replace(given, sightings=replace(rows, landmark_id=1000 * rows.landmark_id + pair))


def shrunk(seed: int, images: int, factor: float) -> Measurements:
    """Give a recording with noise, true and declared, that is smaller by a factor."""
    given = recorded(seed, images, noise=factor)
    rows, motion = given.sightings, given.odometry
    assert rows is not None and motion is not None
    return replace(
        given,
        sightings=replace(rows, sigma_px=factor * rows.sigma_px),
        odometry=replace(motion, variance=factor**2 * motion.variance),
    )


def as_if(found: Estimate, poses: SE3) -> Estimate:
    """Put other poses at the times of an estimate."""
    return replace(found, trajectory=replace(found.trajectory, T_world_body=poses))


def correlation_gap(first: Array, second: Array) -> float:
    """Give the largest difference of two stacks of covariances, in units of their sigmas."""
    sigma = np.sqrt(np.diagonal(second, axis1=1, axis2=2))
    return float(np.abs((first - second) / np.einsum("ni,nj->nij", sigma, sigma)).max())


def test_one_image_of_memory_is_the_independent_two_image_filter() -> None:
    """Where no landmark is seen in three images, at the noise of the set-up; both charts alike."""
    given = seen_twice(recorded(0, IMAGES))
    found = run(given, retention=ONE_IMAGE, formulation="standard")
    assert found.covariance is not None
    poses, cov = filter_two_images(given, START_VARIANCE, "world")
    assert np.abs(apart(found, as_if(found, poses))).max() < 1e-6
    assert correlation_gap(found.covariance, cov) < 1e-6
    assert found.diagnostics["matched"][1:].min() > 20


def test_the_independent_filter_in_the_chart_of_the_body_moves_as_the_right_invariant_one() -> None:
    """With one image of memory only motion from image to image is seen, which both errors share."""
    given = seen_twice(recorded(1, IMAGES))
    found = run(given, retention=ONE_IMAGE, formulation="right_invariant")
    poses, _ = filter_two_images(given, START_VARIANCE, "body")
    assert np.abs(apart(found, as_if(found, poses))).max() < 1e-6


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_errors_in_any_form_agree_the_better_the_smaller_the_noise(formulation: str) -> None:
    """What sets them apart is of second order: a tenth of the noise, a tenth of the sigmas."""
    gaps = []
    for factor in (1e-1, 1e-2, 1e-3):
        given = seen_twice(shrunk(2, IMAGES, factor))
        found = run(given, retention=ONE_IMAGE, formulation=formulation)
        poses, _ = filter_two_images(given, START_VARIANCE, "body")
        gaps.append(float(np.abs(apart(found, as_if(found, poses))).max()))
    assert gaps[1] < max(0.2 * gaps[0], 1e-6) and gaps[2] < max(0.2 * gaps[1], 1e-6)
    assert gaps[2] < 1e-3


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_an_unlimited_time_to_live_keeps_all(formulation: str) -> None:
    """To the bit."""
    given = recorded(3, IMAGES)
    every = run(given, retention=KeepAll().to_mapping(), formulation=formulation)
    long = run(given, retention=TimeToLive(images=9999).to_mapping(), formulation=formulation)
    assert long.trajectory.equals(every.trajectory)
    np.testing.assert_array_equal(long.covariance, every.covariance)


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize(
    "leave", ["first_in_first_out", "shortest_time_to_live", "least_confidence"]
)
def test_an_unlimited_queue_keeps_all_that_is_seen_again(formulation: str, leave: str) -> None:
    """A landmark enters with its second sighting: it is as if the first had not been made."""
    given = recorded(3, IMAGES)
    queue = BoundedQueue(size=9999, leave=leave, waiting_images=9999)  # type: ignore[arg-type]
    bounded = run(given, retention=queue.to_mapping(), formulation=formulation)
    later = without_first_sightings(given)
    every = run(later, retention=KeepAll().to_mapping(), formulation=formulation)
    assert np.abs(apart(every, bounded)).max() < 1e-9
    assert bounded.covariance is not None and every.covariance is not None
    assert correlation_gap(bounded.covariance, every.covariance) < 1e-9
    assert bounded.diagnostics["landmarks"].tolist() == every.diagnostics["landmarks"].tolist()


def without_first_sightings(given: Measurements) -> Measurements:
    """Take away the first sighting of every landmark."""
    assert given.sightings is not None
    _, first = np.unique(given.sightings.landmark_id, return_index=True)
    keep = np.ones(len(given.sightings.landmark_id), bool)
    keep[first] = False
    return replace(given, sightings=kept(given.sightings, keep))


def test_a_first_sighting_is_worth_something() -> None:
    """Control of the test before: with all sightings, a filter that keeps all is elsewhere."""
    given = recorded(3, IMAGES)
    every, later = (
        run(g, retention=KeepAll().to_mapping()) for g in (given, without_first_sightings(given))
    )
    assert np.abs(apart(every, later)).max() > 1e-2


def standing_first(given: Measurements, looks: int, noise: float, seed: int) -> Measurements:
    """Look at what the first image shows several times before setting off."""
    rows, motion = given.sightings, given.odometry
    assert rows is not None and motion is not None
    first = rows.rows(0)
    count, rng = first.stop, stream(seed, "standing")
    exact = sightings_of_the_start(given)
    again = exact + noise * SIGMA_PX * rng.standard_normal((looks, *exact.shape))
    sightings = SightingStream(
        np.arange(looks + len(rows), dtype=np.int64) * NS_PER_S,
        np.concatenate([np.arange(looks) * count, rows.offsets + looks * count]),
        np.concatenate([np.tile(rows.landmark_id[first], looks), rows.landmark_id]),
        np.concatenate([again.reshape(-1, 3), rows.stereo_px]),
        np.concatenate([np.tile(rows.sigma_px[first], looks), rows.sigma_px]),
    )
    still = np.zeros((looks, 6))
    odometry = OdometryStream(
        sightings.t_ns,
        np.concatenate([still, motion.twist]),
        np.concatenate([still + 1e-10, motion.variance]),
        np.concatenate([still, motion.scale_sigma]),
    )
    return replace(given, sightings=sightings, odometry=odometry)


def sightings_of_the_start(given: Measurements) -> Array:
    """Give the exact image coordinates of what the first image shows [px], Shape (n, 3)."""
    assert given.sightings is not None
    ids = given.sightings.landmark_id[given.sightings.rows(0)]
    world = scene(2)
    return world.stereo_px[0][[int(np.flatnonzero(world.visible[0] == i)[0]) for i in ids]]


def variants() -> list[dict[str, object]]:
    """Give one of each kind."""
    retentions = [KeepAll(), TimeToLive(images=3), BoundedQueue(size=30), BoundedQueue(size=5)]
    retentions += [
        BoundedQueue(size=30, leave="shortest_time_to_live"),
        BoundedQueue(size=30, leave="least_confidence"),
    ]
    every: list[dict[str, object]] = [
        {"retention": r.to_mapping(), "formulation": f} for r in retentions for f in FORMULATIONS
    ]
    for coupling in ("decoupled", "decoupled_pose_kept"):
        every += [{"coupling": coupling, "formulation": f} for f in FORMULATIONS[:2]]
    anchors = AnchorSpec(count_max=10).to_mapping()
    return every + [{"anchors": anchors, "formulation": f} for f in FORMULATIONS]


@pytest.mark.parametrize("variant", variants(), ids=lambda v: SlamSpec.from_mapping(v).label)
@pytest.mark.parametrize("checks", [NO_CHECKS, {}], ids=["unchecked", "checked"])
def test_without_noise_no_variant_makes_an_error(
    variant: dict[str, object], checks: dict[str, object]
) -> None:
    """Exact sightings and odometry with a standstill before, told the usual noise."""
    given = standing_first(recorded(0, IMAGES, noise=0.0), LOOKS, 0.0, 0)
    found = Slam(SlamSpec.from_mapping(checks | variant)).estimate(given)
    off = found.trajectory.T_world_body[LOOKS:].inverse() @ scene(IMAGES).T_world_body
    assert np.abs(off.log()).max() < 1e-7
    assert found.diagnostics["rejected"].sum() == 0


@pytest.mark.parametrize("variant", variants(), ids=lambda v: SlamSpec.from_mapping(v).label)
def test_the_names_of_landmarks_do_not_matter(variant: dict[str, object]) -> None:
    """Other names for the same landmarks give the same poses and the same counts."""
    given = standing_first(recorded(4, IMAGES), LOOKS, 1.0, 4)
    assert given.sightings is not None
    other = replace(given.sightings, landmark_id=(given.sightings.landmark_id * 7919) % 60_013)
    first, second = (
        Slam(SlamSpec.from_mapping(variant)).estimate(g)
        for g in (given, replace(given, sightings=other))
    )
    assert np.abs(apart(first, second)).max() < 1e-9
    for name in ("accepted", "new", "dropped", "anchors_seen"):
        assert first.diagnostics[name].tolist() == second.diagnostics[name].tolist()


RUNS, STEPS = 40, 9


def consistency(noise_scale: float) -> tuple[Consistency, bool]:
    """Give the ANEES of the last pose over short runs, told the noise times a factor.

    Also whether all their innovations, which are white in a filter that knows its noise, are as
    large as they say.
    """
    nees, nis, dof = [], 0.0, 0
    for seed in range(RUNS):
        found = run(few_landmarks(seed), noise_scale=noise_scale, retention=KeepAll().to_mapping())
        assert found.covariance is not None
        xi = error(found)[-1]
        nees.append(float(xi @ np.linalg.solve(found.covariance[-1], xi)))
        nis += float(found.diagnostics["nis"].sum())
        dof += int(found.diagnostics["nis_dof"].sum())
    low, high = chi_square_band(1, dof)
    return anees(nees, 6), low <= nis <= high


def few_landmarks(seed: int) -> Measurements:
    """Keep a third of the sightings of a short run, for speed."""
    given = recorded(seed, STEPS)
    assert given.sightings is not None
    return replace(given, sightings=kept(given.sightings, given.sightings.landmark_id % 3 == 0))


@pytest.mark.parametrize(("told", "consistent"), [(1.0, True), (0.5, False), (2.0, False)])
def test_the_filter_is_consistent_for_the_noise_there_is(told: float, consistent: bool) -> None:
    """NEES and NIS of 40 short runs; told half or twice the noise both leave their bands."""
    nees, innovations_fit = consistency(told)
    assert nees.is_consistent == consistent
    assert innovations_fit == consistent


def test_after_blind_images_the_standard_form_believes_in_an_attitude_it_cannot_know() -> None:
    """Five blind images leave 1 deg of attitude open; the right-invariant form keeps it open."""
    nees = {"standard": [], "right_invariant": []}  # type: dict[str, list[float]]
    for formulation, seed in ((f, s) for f in nees for s in range(10)):
        given = recorded(seed, IMAGES)
        assert given.sightings is not None
        image = image_of(given.sightings)
        blind = replace(given, sightings=kept(given.sightings, (image < 3) | (image > 7)))
        retention = TimeToLive(images=3).to_mapping()
        found = run(blind, retention=retention, formulation=formulation)
        assert found.covariance is not None
        phi = error(found)[-1, 3:]
        nees[formulation].append(float(phi @ np.linalg.solve(found.covariance[-1, 3:, 3:], phi)))
    assert anees(nees["right_invariant"], 3).is_consistent
    assert np.mean(nees["standard"]) > 10 * np.mean(nees["right_invariant"])
