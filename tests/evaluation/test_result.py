"""The score of a run, its failures and the verdict."""

import json
import math

import numpy as np
import pytest

from lpet_sim.errors import SpecError
from lpet_sim.evaluation import EvaluationSpec, Requirement, evaluate, failed
from lpet_sim.geometry import SE3
from lpet_sim.recording.trajectory import Trajectory
from tests.evaluation.trajectories import as_estimate, as_truth, scaled, straight, winding


def _covariances(count: int, variance: float = 1e-4) -> np.ndarray:
    out = np.tile(variance * np.eye(6), (count, 1, 1))
    out[0] = 0.0
    return out


def test_a_perfect_estimate_scores_zero_and_passes() -> None:
    """No error, all covered, no failure, every line met."""
    truth = winding()
    result = evaluate(as_estimate(truth), as_truth(truth))
    assert result.endpoint_ratio < 1e-12
    assert result.worst_ratio < 1e-12
    assert result.completion == 1.0
    assert result.failure is None
    assert Requirement().check(result).passed


def test_a_scale_error_is_reported_in_every_figure() -> None:
    """2 % too long: 2 % at the end, at worst and over segments, and FAIL for position only."""
    truth = straight(20.0, 1001)
    result = evaluate(as_estimate(scaled(truth, 1.02)), as_truth(truth))
    np.testing.assert_allclose([result.endpoint_ratio, result.worst_ratio], 0.02, rtol=1e-9)
    np.testing.assert_allclose(result.endpoint_error_m, [0.4, 0, 0], atol=1e-12)
    assert [s.length_m for s in result.segments] == [1, 2, 5, 10]
    lines = Requirement().check(result).lines
    assert [x.quantity for x in lines if not x.passed] == [
        "position, throughout",
        "position, at the end",
    ]
    np.testing.assert_allclose(lines[1].margin, -0.01, rtol=1e-9)


def test_an_error_that_comes_and_goes_fails_throughout_but_not_at_the_end() -> None:
    """The verdict looks at every moment."""
    truth = straight(20.0, 201)
    rpy = np.zeros((201, 3))
    rpy[50, 2] = math.radians(1.5)
    estimate = Trajectory(truth.t_ns, SE3.from_rpy(rpy, truth.T_world_body.translation))
    result = evaluate(as_estimate(estimate), as_truth(truth))
    failing = [line.quantity for line in Requirement().check(result).lines if not line.passed]
    assert failing == ["yaw, throughout"]
    assert Requirement(throughout=False).check(result).passed
    assert Requirement(yaw_rad=math.radians(2)).check(result).passed


def test_the_worst_attitude_is_the_largest_of_either_sign() -> None:
    """A pitch of -1.5 deg is worse than one of 0.4 deg, and the end keeps its sign."""
    truth = straight(20.0, 51)
    rpy = np.zeros((51, 3))
    rpy[10, 1], rpy[20, 1], rpy[50, 1] = np.radians([0.4, -1.5, -0.2])
    estimate = Trajectory(truth.t_ns, SE3.from_rpy(rpy, truth.T_world_body.translation))
    result = evaluate(as_estimate(estimate), as_truth(truth))
    np.testing.assert_allclose(np.degrees(result.worst_attitude_rad), [0, 1.5, 0], atol=1e-9)
    np.testing.assert_allclose(np.degrees(result.endpoint_attitude_rad), [0, -0.2, 0], atol=1e-9)


def test_each_axis_is_held_to_its_own_limit() -> None:
    """A roll error fails the roll lines only."""
    truth = straight(20.0, 51)
    rpy = np.tile([math.radians(-1.2), 0, 0], (51, 1))
    estimate = Trajectory(truth.t_ns, SE3.from_rpy(rpy, truth.T_world_body.translation))
    lines = Requirement().check(evaluate(as_estimate(estimate), as_truth(truth))).lines
    assert [x.quantity for x in lines if not x.passed] == ["roll, throughout", "roll, at the end"]


def test_the_requirement_starts_where_it_is_told() -> None:
    """An early error as a share of little distance counts only from start_m on."""
    truth = straight(20.0, 201)
    position = truth.T_world_body.translation.copy()
    position[30, 1] += 0.1
    estimate = Trajectory(truth.t_ns, SE3(truth.T_world_body.rotation, position))
    result = evaluate(as_estimate(estimate), as_truth(truth))
    assert Requirement().check(result).passed
    assert not Requirement(start_m=2.0).check(result).passed


def test_an_estimate_that_ends_early_is_incomplete_and_fails() -> None:
    """Half the traverse, perfectly, is not a pass."""
    truth = straight(20.0, 201)
    half = Trajectory(truth.t_ns[:101], truth.T_world_body[:101])
    result = evaluate(as_estimate(half), as_truth(truth))
    np.testing.assert_allclose(result.completion, 0.5)
    assert result.failure == "incomplete"
    assert not Requirement().check(result).passed


def test_an_estimate_that_ends_with_the_last_image_is_complete() -> None:
    """The drive went on by 1.5 % after it; one that ends an image earlier is not complete."""
    truth = straight(20.0, 201)
    cut = Trajectory(truth.t_ns[:198].copy(), truth.T_world_body[:198])
    last = int(cut.t_ns[-1])
    assert evaluate(as_estimate(cut), as_truth(truth)).failure == "incomplete"
    result = evaluate(as_estimate(cut), as_truth(truth), last_image_t_ns=last)
    assert result.completion == 1.0 and result.failure is None
    shorter = Trajectory(truth.t_ns[:197].copy(), truth.T_world_body[:197])
    early = evaluate(as_estimate(shorter), as_truth(truth), last_image_t_ns=last)
    assert early.failure == "incomplete"


@pytest.mark.parametrize(
    ("rows", "share"),
    [
        (np.r_[0:31, 60:101], 0.7),
        (np.arange(90, 101), 0.1),
        (np.r_[0:38, 41:101], 1.0),
    ],
    ids=["hole", "late", "short gap"],
)
def test_a_hole_in_an_estimate_is_not_covered(rows: np.ndarray, share: float) -> None:
    """100 m in metres: 30 to 60 m left out, or all before 90 m, or less than the longest gap."""
    truth = straight(100.0, 101)
    cut = Trajectory(truth.t_ns[rows], truth.T_world_body[rows])
    for last in (None, int(truth.t_ns[-1])):
        result = evaluate(as_estimate(cut), as_truth(truth), last_image_t_ns=last)
        assert result.completion == pytest.approx(share)
        assert result.failure == (None if share == 1.0 else "incomplete")


def test_poses_that_are_not_finite_end_the_estimate() -> None:
    """The part before is scored, the failure is named."""
    truth = straight(20.0, 201)
    position = truth.T_world_body.translation.copy()
    position[150:] = np.nan
    estimate = Trajectory(truth.t_ns, SE3(truth.T_world_body.rotation, position))
    result = evaluate(as_estimate(estimate), as_truth(truth))
    assert result.failure == "not_finite"
    assert result.endpoint_ratio == 0.0
    assert not Requirement().check(result).passed


def test_divergence_and_loss_are_named() -> None:
    """Over 10 % of the distance has diverged; over 50 bridged images in a row is lost."""
    truth = straight(20.0, 201)
    far = evaluate(as_estimate(scaled(truth, 1.2)), as_truth(truth))
    assert far.failure == "diverged"
    bridged = np.zeros(201)
    bridged[20:71] = 1
    lost = evaluate(as_estimate(truth, diagnostics={"bridged": bridged}), as_truth(truth))
    assert lost.failure == "lost"
    spec = EvaluationSpec(max_lost_images=51)
    kept = evaluate(as_estimate(truth, diagnostics={"bridged": bridged}), as_truth(truth), spec)
    assert kept.failure is None


def test_nees_is_given_per_block_where_a_covariance_is() -> None:
    """One sigma on each axis of the position: 3 for position, 0 for attitude, 3 for the pose."""
    truth = straight(20.0, 201)
    shifted = Trajectory(truth.t_ns, truth.T_world_body @ SE3.exp([0.01, 0.01, 0.01, 0, 0, 0]))
    result = evaluate(as_estimate(shifted, covariance=_covariances(201)), as_truth(truth))
    assert result.nees_end is not None
    np.testing.assert_allclose(list(result.nees_end.values()), [3, 0, 3], atol=1e-9)
    assert result.series is not None
    assert result.series.nees is not None
    assert np.isnan(result.series.nees[0]).all()


def test_a_covariance_that_is_not_positive_definite_is_a_failure() -> None:
    """No NEES and a named failure."""
    truth = straight(20.0, 201)
    covariance = _covariances(201)
    covariance[-1, 0, 0] = -1.0
    result = evaluate(as_estimate(truth, covariance=covariance), as_truth(truth))
    assert result.failure == "bad_covariance"
    assert result.nees_end is None


def test_scoring_from_an_anchor_leaves_what_came_before_out() -> None:
    """A turn made before the anchor does not count; the distance is that from the anchor on."""
    truth = straight(20.0, 201)
    moved = Trajectory(truth.t_ns, SE3.exp([0, 1, 0, 0, 0, 0.2]) @ truth.T_world_body)
    whole = evaluate(as_estimate(moved), as_truth(truth))
    part = evaluate(as_estimate(moved), as_truth(truth), anchor_t_ns=int(truth.t_ns[50]))
    assert whole.endpoint_ratio > 0.1
    assert part.endpoint_ratio < 1e-9
    np.testing.assert_allclose([part.distance_m, part.completion], [15.0, 1.0])


def test_a_run_that_ended_in_an_exception_fails_every_line() -> None:
    """It is never dropped."""
    verdict = Requirement().check(failed("broken", text="out of memory"))
    assert len(verdict.lines) == 9
    assert not any(line.passed for line in verdict.lines)


def test_a_broken_run_fails_however_small_its_errors() -> None:
    """No error makes up for a covariance that is none."""
    truth = straight(20.0, 201)
    result = evaluate(as_estimate(truth, covariance=-_covariances(201)), as_truth(truth))
    verdict = Requirement().check(result)
    assert all(line.passed for line in verdict.lines)
    assert not verdict.passed
    assert verdict.broken == "bad_covariance"


def test_the_score_goes_to_json() -> None:
    """Everything but the series, as plain values."""
    truth = straight(20.0, 201)
    result = evaluate(as_estimate(truth, covariance=_covariances(201)), as_truth(truth))
    back = json.loads(json.dumps(result.to_mapping()))
    assert back["name"] == "candidate"
    assert len(back["segments"]) == 4


def test_an_unknown_line_of_a_requirement_names_the_valid_ones() -> None:
    """A YAML with a wrong key is refused."""
    with pytest.raises(SpecError, match="position_ratio"):
        Requirement.from_mapping({"position": 0.01})
