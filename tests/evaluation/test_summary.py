"""What runs say together: failures at infinity, intervals that cover, bands that reject."""

import numpy as np
import pytest

from lpet_sim.evaluation.claims import fewest_runs, headline, pass_claim
from lpet_sim.evaluation.rows import Rows, rows_of
from lpet_sim.evaluation.statistics import (
    confidence_against_share,
    confidence_of_share,
    draw_runs,
    interval_of,
    pass_rate,
    quantile,
    rms,
)
from lpet_sim.evaluation.summary import error_spread, summarise, summarise_variant
from lpet_sim.rng import stream
from tests.evaluation.made_rows import made_rows

INF = np.inf


def runs(n: int = 100, failed: int = 0, passed: int | None = None, **columns: np.ndarray) -> Rows:
    """Make the rows of one variant; the last ones failed, the first ones passed."""
    failure = np.array([""] * (n - failed) + ["lost"] * failed, dtype=object)
    known = {"failure": failure, "passed": np.arange(n) < (n if passed is None else passed)}
    return Rows({**known, "end_percent": np.ones(n), **columns})


def test_a_quantile_is_numpys_where_all_is_finite() -> None:
    """At every share, along the last axis."""
    values = stream(1, "values").normal(size=(4, 31))
    for share in (0.0, 0.025, 0.31, 0.5, 0.95, 1.0):
        np.testing.assert_allclose(
            quantile(values, share), np.quantile(values, share, axis=-1), rtol=1e-12, atol=1e-12
        )


@pytest.mark.parametrize(
    ("values", "share", "expected"),
    [
        ([1, 2, INF], 0.5, 2.0),
        ([1, 2, INF, INF], 0.5, INF),
        ([1, 2, 3, INF], 0.5, 2.5),
        ([-INF, -INF, 5, 6], 0.5, -INF),
        ([-INF, INF], 0.5, 0.0),
        ([INF, INF, INF], 0.3, INF),
        ([1] * 95 + [INF] * 5, 0.95, INF),
        ([1] * 96 + [INF] * 4, 0.95, 1.0),
    ],
)
def test_a_quantile_keeps_infinite_errors_in_their_place(
    values: list[float], share: float, expected: float
) -> None:
    """Between a finite and an infinite value lies infinity, between both infinities zero."""
    assert float(quantile(values, share)) == expected


def test_failed_runs_move_the_median_up_and_stay_out_of_what_is_named_completed() -> None:
    """Errors 1 to 9 with three failures more: the median over twelve is 6.5, over nine it is 5."""
    errors = np.append(np.arange(1.0, 10.0), [INF] * 3)
    spread = error_spread(errors, draw_runs(12, stream(1, "draws")))
    assert spread.completed == 9
    assert spread.median.value == 6.5
    assert spread.median_completed == 5.0
    np.testing.assert_allclose(spread.rms_completed.value, np.sqrt(285 / 9))
    assert spread.high.value == INF
    assert spread.median.low < 6.5 < spread.median.high
    nothing = error_spread(np.full(7, INF), draw_runs(7, stream(1, "draws")))
    assert nothing.median.value == nothing.median.low == INF
    assert np.isnan(nothing.rms_completed.value)


def test_the_bootstrap_of_median_and_rms_covers_the_truth() -> None:
    """Of 300 samples of 60, 95 % of the intervals hold the value of the distribution."""
    samples = np.abs(stream(1, "samples").normal(0.0, 1.0, (300, 60)))
    draws = draw_runs(60, stream(1, "draws"), resamples=600)
    spreads = [error_spread(sample, draws) for sample in samples]
    for kind, truth in (("median", 0.67449), ("rms_completed", 1.0)):
        held = [getattr(s, kind).low <= truth <= getattr(s, kind).high for s in spreads]
        assert 0.89 <= np.mean(held) <= 0.99, kind


def test_resamples_keep_a_sorted_array_sorted() -> None:
    """And every run is drawn once on average."""
    draws = draw_runs(7, stream(1, "draws"), resamples=3000)
    assert (np.diff(draws, axis=1) >= 0).all()
    np.testing.assert_allclose(np.bincount(draws.ravel()) / 3000, 1.0, atol=0.08)


def test_an_interval_leaves_out_what_is_no_number() -> None:
    """Resamples without any completed run have no RMS."""
    known = interval_of(1.0, [np.nan, 1.0, 1.0, np.nan])
    assert (known.low, known.high) == (1.0, 1.0)
    assert np.isnan(interval_of(np.nan, [np.nan]).low)
    assert np.isnan(rms([INF, np.nan]))


def test_a_summary_counts_failures_by_kind_and_every_run_in_a_rate() -> None:
    """Nothing is dropped: 8 of 10 pass, 2 of 10 failed."""
    summary = summarise_variant("ideal", "a", runs(10, failed=2, passed=8))
    assert (summary.runs, summary.failed, summary.passed) == (10, 2, 8)
    assert summary.failures == {"lost": 2}
    assert summary.passes["passed"] == pass_rate(8, 10)
    assert summary.nis is None and summary.position_efficiency is None and summary.nees == {}


def test_efficiency_is_rms_over_rms_and_below_the_bound_it_is_marked() -> None:
    """Errors drawn from the bound have 1 within the interval; 0.8 of them are suspicious."""
    rng = stream(1, "errors")
    bound = rng.uniform(0.05, 0.2, 100)
    error = np.linalg.norm(rng.normal(size=(100, 3)), axis=1) * bound / np.sqrt(3)
    at_bound = summarise_variant("a", "v", runs(end_error_m=error, bound_m=bound))
    good = at_bound.position_efficiency
    assert good is not None and good.ratio.low < 1 < good.ratio.high and not good.is_suspicious
    np.testing.assert_allclose(good.ratio.value, rms(error) / rms(bound))
    scaled = summarise_variant("a", "v", runs(end_error_m=1.15 * bound, bound_m=bound))
    assert scaled.position_efficiency is not None
    ends = scaled.position_efficiency.ratio.low, scaled.position_efficiency.ratio.high
    np.testing.assert_allclose(ends, 1.15)  # Error and bound are resampled together.
    leaking = summarise_variant("a", "v", runs(end_error_m=0.6 * error, bound_m=bound))
    assert leaking.position_efficiency is not None
    assert leaking.position_efficiency.is_suspicious
    some = summarise_variant("a", "v", runs(failed=30, end_error_m=error, bound_m=bound))
    assert some.position_efficiency is not None and some.position_efficiency.runs == 70


def test_nees_is_held_to_the_band_of_its_runs() -> None:
    """N = 50: 5.08 to 7.00 for 6 dof; half the noise is overconfident, twice is the opposite."""
    nees = stream(3, "nees").chisquare(6, 50)
    average = summarise_variant("a", "v", runs(50, nees_pose=nees)).nees["pose"]
    np.testing.assert_allclose((average.low, average.high), (5.08, 7.00), atol=0.005)
    assert average.is_consistent
    for factor in (4.0, 0.25):
        wrong = summarise_variant("a", "v", runs(50, nees_pose=factor * nees)).nees["pose"]
        assert not wrong.is_consistent
    known = np.append(nees[:40], np.full(10, np.nan))
    assert summarise_variant("a", "v", runs(50, nees_pose=known)).nees["pose"].runs == 40


def test_nis_of_white_innovations_is_consistent_and_that_of_wrong_noise_is_not() -> None:
    """Chi-square means over 300 coordinates for each run."""
    per_run = stream(4, "nis").chisquare(300, 40) / 300
    facts = {"images": np.full(40, 10.0), "matched_mean": np.full(40, 10.0)}
    good = summarise_variant("a", "v", runs(40, nis_mean=per_run, **facts)).nis
    bad = summarise_variant("a", "v", runs(40, nis_mean=1.1 * per_run, **facts)).nis
    assert good is not None and good.is_consistent
    assert bad is not None and not bad.is_consistent
    np.testing.assert_allclose((good.low, good.high), 1 + np.array([-1, 1]) * 0.0253, atol=2e-4)


def test_ninety_nine_of_a_hundred_show_95_percent_and_98_do_not() -> None:
    """Closed forms; a claim is shown exactly where the one-sided Clopper-Pearson end reaches it."""
    np.testing.assert_allclose(confidence_of_share(59, 59), 1 - 0.95**59)
    np.testing.assert_allclose(confidence_against_share(0, 10), 1 - 0.05**10, rtol=1e-9)
    assert fewest_runs() == 59
    for passed, outcome in ((99, "shown"), (98, "not decided"), (90, "refuted")):
        claim = pass_claim(summarise_variant("a", "v", runs(passed=passed)))
        assert claim.outcome == outcome
    for passed in range(85, 101):
        rate = pass_rate(passed, 100, confidence=0.9)
        assert (rate.low >= 0.95) == (confidence_of_share(passed, 100) >= 0.95)
        assert (rate.high < 0.95) == (confidence_against_share(passed, 100) > 0.95)


def test_the_headline_names_who_passes_or_who_is_nearest() -> None:
    """One sentence for each arm; with too few runs it says how many it takes."""
    claims = [
        pass_claim(summarise_variant("ideal", name, runs(n, passed=k)))
        for name, k, n in (("sure", 100, 100), ("poor", 10, 100))
    ]
    (text, outcome), *rest = headline(claims)
    assert rest == [] and outcome == "shown"
    assert "1 of 2 variants" in text and "sure (100/100)" in text and "Refuted: 1" in text
    few = headline([pass_claim(summarise_variant("real", "only", runs(12, passed=12)))])
    assert few[0][1] == "not decided"
    assert "only passes (12/12)" in few[0][0] and "59 runs" in few[0][0]


def test_all_variants_of_all_arms_are_summarised_alike_every_time() -> None:
    """The draws are by name: the same rows give the same intervals."""
    rows = rows_of(made_rows(data_sets=4))
    told: list[float] = []
    first = summarise(rows, told.append)
    assert len(first) == 48 and told[-1] == 1.0
    assert first[0].arm == "ideal"
    assert sum(s.failed for s in first) == int(rows.failed.sum()) > 0
    again = summarise(rows)
    assert [s.errors for s in first] == [s.errors for s in again]


def test_a_handful_of_runs_has_no_bootstrap_interval() -> None:
    """Five runs have their values alone; the sixth brings an interval."""
    five, six = (error_spread(np.arange(1.0, n + 1), draw_runs(n, stream(1, "d"))) for n in (5, 6))
    assert five.median.value == 3.0 and np.isnan([five.median.low, five.high.high]).all()
    assert np.isnan(five.rms_completed.low)
    assert six.median.low < six.median.value < six.median.high


def test_the_first_run_of_a_process_does_not_count_for_the_time() -> None:
    """Unless there is no other."""
    cold = np.array([True, False, False])
    facts = {"time_per_image_ms": np.array([100.0, 2.0, 4.0])}
    assert summarise_variant("a", "v", runs(3, cold=cold, **facts)).means == {
        "time_per_image_ms": 3.0
    }
    alone = summarise_variant("a", "v", runs(3, cold=np.ones(3, dtype=bool), **facts))
    np.testing.assert_allclose(alone.means["time_per_image_ms"], 106 / 3)
