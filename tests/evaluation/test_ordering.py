"""Paired orderings on rows whose answer is known, failures and sizes included."""

import numpy as np
import pytest

from lpet_sim.errors import RowsError
from lpet_sim.evaluation.equal_size import at_equal_size, size_curve
from lpet_sim.evaluation.ordering import compare_errors, paired_orderings
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.statistics import pass_rate
from lpet_sim.rng import stream

INF = np.inf
LABELS = ("poor", "good")


def table(errors: dict[str, np.ndarray], **columns: np.ndarray) -> Rows:
    """Make rows of variants on the same data sets; an infinite error is a failed run."""
    n = {len(e) for e in errors.values()}.pop()
    all_errors = np.concatenate(list(errors.values()))
    known = {
        "run": np.array([f"{v}-{k}" for v in errors for k in range(n)], dtype=object),
        "arm": np.full(len(all_errors), "ideal", dtype=object),
        "data_set": np.array([f"set{k}" for _ in errors for k in range(n)], dtype=object),
        "variant": np.repeat(np.array(list(errors), dtype=object), n),
        "failure": np.where(np.isinf(all_errors), "lost", "").astype(object),
        "end_percent": np.where(np.isinf(all_errors), 0.01, all_errors),
    }
    return Rows({**known, **columns})


def test_a_paired_gain_is_found_under_the_scatter_of_the_data_sets() -> None:
    """20 % under a scatter of a factor of three between data sets: all pairs, ratio 1.2."""
    good = np.exp(stream(1, "sets").normal(0, 1.1, 50))
    (found,) = paired_orderings(table({"poor": 1.2 * good, "good": good}), [LABELS])
    assert found.verdict == "holds"
    np.testing.assert_allclose(found.rms_ratio_completed.low, 1.2)
    np.testing.assert_allclose(found.rms_ratio_completed.high, 1.2)
    assert found.share == pass_rate(50, 50)
    np.testing.assert_allclose(found.p_sign, 0.5**50)
    assert found.p_wilcoxon < 1e-6
    (reverse,) = paired_orderings(table({"poor": 1.2 * good, "good": good}), [LABELS[::-1]])
    assert reverse.verdict == "does not hold"
    np.testing.assert_allclose(reverse.median_difference.value, -found.median_difference.value)


def test_no_difference_is_seldom_decided() -> None:
    """Of 200 pairs of equal distributions at most 8 % are decided either way."""
    rng = stream(2, "null")
    found = [compare_errors("a", LABELS, *rng.lognormal(size=(2, 30))) for _ in range(200)]
    assert np.mean([o.verdict != "not decided" for o in found]) <= 0.08
    assert np.mean([o.p_sign < 0.05 for o in found]) <= 0.08


def test_a_failed_run_is_worse_than_any_error_and_two_failed_runs_tie() -> None:
    """Sixteen pairs: in four only the first failed, in two only the second, in one both."""
    poor = np.array([INF] * 4 + [1.0] * 2 + [INF] + [2.0] * 9)
    good = np.array([1.0] * 4 + [INF] * 2 + [INF] + [1.0] * 9)
    o = paired_orderings(table({"poor": poor, "good": good}), [LABELS])[0]
    assert (o.runs, o.failed_worse, o.failed_better, o.ties) == (16, 5, 3, 1)
    assert o.share == pass_rate(13, 15)
    assert o.median_difference.value == 1.0
    assert o.mean_difference_completed == 1.0
    assert o.rms_ratio_completed.value == 2.0
    assert o.verdict == "holds"
    failing = compare_errors("a", LABELS, np.full(9, INF), np.ones(9))
    assert failing.verdict == "holds" and failing.median_difference.low == INF
    assert np.isnan(failing.rms_ratio_completed.value)
    both = compare_errors("a", LABELS, np.full(9, INF), np.full(9, INF))
    assert (both.ties, both.verdict, both.p_sign, both.p_wilcoxon) == (9, "not decided", 1.0, 1.0)


def test_a_tolerance_lets_an_equal_variant_hold() -> None:
    """Equal up to noise is not decided strictly, and holds with 5 %; 10 % worse does not hold."""
    base = np.exp(stream(3, "sets").normal(0, 0.5, 60))
    half = np.exp(stream(3, "noise").normal(0, 0.02, 30))
    noise = np.concatenate([half, 1 / half])  # As often above as below.
    assert compare_errors("a", LABELS, base * noise, base).verdict == "not decided"
    assert compare_errors("a", LABELS, base * noise, base, tolerance=0.05).verdict == "holds"
    worse = compare_errors("a", LABELS, base, 1.1 * base * noise, tolerance=0.05)
    assert worse.verdict == "does not hold"
    assert worse.median_difference == compare_errors("a", LABELS, base, 1.1 * base * noise).deciding


def test_only_common_data_sets_are_paired_and_unknown_names_are_refused() -> None:
    """A data set on which one variant has no row yet is left for later."""
    rows = table({"poor": np.full(6, 2.0), "good": np.ones(6)})
    partial = rows.where(np.arange(12) != 11)
    assert paired_orderings(partial, [LABELS])[0].runs == 5
    with pytest.raises(RowsError, match="variant best; there are good, poor"):
        paired_orderings(rows, [("best", "good")])
    twice = rows.with_columns(data_set=np.full(12, "set0", dtype=object))
    with pytest.raises(RowsError, match="ran twice"):
        paired_orderings(twice, [LABELS])


SIZES = {"a": (20.0, 50.0, 200.0), "b": (10.0, 40.0, 160.0)}


def power_laws(factor: float, n: int = 30) -> Rows:
    """Make two families with error = c size^-0.5 on each data set, b a factor worse than a."""
    scale = np.exp(stream(4, "sets").normal(0, 0.5, n))
    errors, sizes = {}, []
    for family, worse in (("a", 1.0), ("b", factor)):
        for size in SIZES[family]:
            # The size differs from one data set to the next, as it does in a real sweep.
            of = size * np.exp(stream(4, family, str(size)).normal(0, 0.05, n))
            errors[f"{family}{size:g}"] = worse * scale * of**-0.5
            sizes.append(of)
    size = np.concatenate(sizes)
    return table(errors, state_max=size, state_mean=0.8 * size)


FAMILY_A = ["a20", "a50", "a200"]
FAMILY_B = ["b10", "b40", "b160"]


def test_power_laws_are_compared_exactly_at_equal_size() -> None:
    """The ratio of the laws comes back at every size, though no size was swept by both."""
    points = at_equal_size(power_laws(1.3), FAMILY_A, FAMILY_B, ("a", "b"))
    assert len(points) == 5
    for point in points:
        np.testing.assert_allclose(point.ordering.rms_ratio_completed.value, 1.3, rtol=1e-9)
        assert point.ordering.verdict == "holds"
        assert (point.ordering.worse, point.ordering.better) == ("b", "a")
        assert 18 < point.size < 175
    means = at_equal_size(power_laws(1.3), FAMILY_A, FAMILY_B, by="state_mean")
    np.testing.assert_allclose([p.size for p in means], [0.8 * p.size for p in points])
    strict = at_equal_size(power_laws(1 / 1.3), FAMILY_A, FAMILY_B)
    assert {p.ordering.verdict for p in strict} == {"does not hold"}


def test_beyond_the_sizes_of_a_data_set_nothing_is_made_up() -> None:
    """At the ends of the common span only the data sets that reach it are paired."""
    points = at_equal_size(power_laws(1.3), FAMILY_A, FAMILY_B)
    assert points[0].ordering.runs < 30 and points[2].ordering.runs == 30
    assert at_equal_size(power_laws(1.3), FAMILY_A, ["b160"]) == []


def test_a_failed_run_without_a_size_is_still_in_its_place() -> None:
    """It spoils the sizes next to it, and is not stepped over."""
    rows = power_laws(1.3)
    failed = (rows["variant"] == "b40") & (rows["data_set"] == "set3")
    broken = rows.with_columns(
        failure=np.where(failed, "timeout", rows["failure"]).astype(object),
        state_max=np.where(failed, np.nan, rows["state_max"]),
    )
    points = at_equal_size(broken, FAMILY_A, FAMILY_B)
    whole = at_equal_size(rows, FAMILY_A, FAMILY_B)
    assert [p.ordering.failed_worse for p in points[:4]] == [1] * 4
    assert [p.ordering.failed_worse for p in whole[:4]] == [0] * 4


def test_a_curve_meets_its_points_and_ends_with_them() -> None:
    """Also next to an infinite error; equal sizes are put together."""
    rows = table({"v": np.array([4.0, 2.0, INF, 1.0, 1.0])},
                 state_max=np.array([10.0, 40.0, 80.0, 160.0, 160.0]))  # fmt: skip
    curve = size_curve(rows, "state_max", "end_percent")
    assert curve is not None and list(curve.size) == [10.0, 40.0, 80.0, 160.0]
    errors = curve.at(np.array([10.0, 20.0, 40.0, 50.0, 80.0, 100.0, 160.0, 9.0, 170.0]))
    expected = [4.0, np.sqrt(8.0), 2.0, INF, INF, INF, 1.0, np.nan, np.nan]
    np.testing.assert_allclose(errors, expected)
