"""Intervals over runs against published numbers and by coverage."""

import numpy as np

from lpet_sim.evaluation.statistics import bootstrap, paired_difference, pass_rate
from lpet_sim.rng import stream


def test_clopper_pearson_has_its_published_ends() -> None:
    """10 of 10 at 95 %: 0.6915 to 1; 99 of 100 shows 95 % one-sided, 98 of 100 does not."""
    np.testing.assert_allclose(pass_rate(10, 10).low, 0.025 ** (1 / 10), rtol=1e-9)
    assert pass_rate(10, 10).high == 1.0
    np.testing.assert_allclose(pass_rate(0, 10).high, 1 - 0.025 ** (1 / 10), rtol=1e-9)
    assert pass_rate(99, 100, confidence=0.90).low >= 0.95
    assert pass_rate(98, 100, confidence=0.90).low < 0.95


def test_the_bootstrap_covers_the_true_median() -> None:
    """Of 200 samples of 30, about 95 % of the intervals hold the median of the distribution."""
    samples = stream(1, "samples").normal(2.0, 1.0, (200, 30))
    rng = stream(1, "bootstrap")
    intervals = [bootstrap(sample, rng, resamples=500) for sample in samples]
    covered = np.mean([i.low <= 2.0 <= i.high for i in intervals])
    assert 0.88 <= covered <= 1.0
    assert all(i.low <= i.value <= i.high for i in intervals)


def test_the_bootstrap_is_the_same_for_the_same_generator() -> None:
    """Randomness comes in from outside."""
    values = stream(2, "values").normal(size=20)
    assert bootstrap(values, stream(2, "b")) == bootstrap(values, stream(2, "b"))


def test_a_paired_difference_sees_what_the_scatter_between_runs_hides() -> None:
    """A constant gain of 0.1 under a scatter of 5 between runs is found, in its direction."""
    common = stream(3, "runs").normal(0, 5, 20)
    noise = stream(3, "noise").normal(0, 0.02, 20)
    gain = paired_difference(common - 0.1 + noise, common, stream(3, "bootstrap"))
    assert gain.high < 0
    none = paired_difference(common + noise - np.median(noise), common, stream(3, "bootstrap"))
    assert none.low <= 0 <= none.high
