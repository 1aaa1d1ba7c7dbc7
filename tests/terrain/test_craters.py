"""Craters have the shape and the numbers that were asked for."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.rng import stream
from lpet_sim.terrain.craters import REACH, build_craters, crater_profile
from lpet_sim.terrain.spec import CraterSpec


def test_profile_has_bowl_rim_and_ejecta() -> None:
    """Floor at rim - depth, crest near r = 1 above the plain, ejecta falling to nothing."""
    r = np.linspace(0.0, REACH + 0.5, 2001)
    z = np.array([crater_profile(x, 0.2, 0.04, 0.01)[0] for x in r])
    assert z[0] == pytest.approx(0.04 - 0.2)
    assert 0.97 < r[np.argmax(z)] < 1.06
    assert 0.03 < z.max() <= 0.04
    assert np.all(np.diff(z[(r > 1.1)]) <= 0.0)
    assert np.all(z[r >= REACH] == 0.0)


def test_profile_slope_agrees_with_finite_differences() -> None:
    """The analytic derivative is that of the height everywhere, over the rounded crest too."""
    for r in np.linspace(0.01, REACH + 0.2, 333):
        above, below = (
            crater_profile(r + 1e-6, 0.2, 0.04, 0.05),
            crater_profile(r - 1e-6, 0.2, 0.04, 0.05),
        )
        slope = (above[0] - below[0]) / 2e-6
        assert crater_profile(r, 0.2, 0.04, 0.05)[1] == pytest.approx(slope, abs=1e-5)


def test_counts_follow_the_power_law() -> None:
    """The mean counts of the octaves sum to ``N(>D) = density D^-b`` for every lower limit."""
    spec = CraterSpec(density_1m_per_m2=0.02, diameter_min_m=1.0, diameter_max_m=64.0, exponent=2.5)
    levels = build_craters(spec, stream(1, "test")).levels
    per_m2 = levels[:, 3] / levels[:, 2] ** 2
    above = np.cumsum(per_m2[::-1])[::-1]
    assert above == pytest.approx(0.02 * (levels[:, 0] ** -2.5 - 64.0**-2.5))


def test_craters_drawn_are_as_many_as_expected() -> None:
    """The area below the plain over 1 km^2 is what the mean count of one octave predicts."""
    spec = CraterSpec(density_1m_per_m2=0.01, diameter_min_m=4.0, diameter_max_m=8.0)
    field = build_craters(spec, stream(2, "test"))
    xy = stream(3, "test").uniform(0.0, 1000.0, (200_000, 2))
    bowls = np.mean(field.height(xy) < -0.02)
    count = spec.density_1m_per_m2 * (4.0**-2 - 8.0**-2)
    area = np.pi / 4 * 2 * np.log(2.0) / (4.0**-2 - 8.0**-2)  # mean of pi D^2 / 4 for D^-3 dD
    assert 0.6 < bowls / (count * area) < 1.0
