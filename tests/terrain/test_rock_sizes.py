from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from lpet_sim.errors import SpecError
from lpet_sim.terrain.rock_sizes import (
    golombek_rapp_count,
    golombek_rapp_decay,
    size_law,
)
from lpet_sim.terrain.rock_spec import RockAbundanceSpec, RockSizeClass, RockTableSpec

DIAMETERS_M = np.array([0.05, 0.1, 0.2, 0.3, 0.5, 1.0])
PER_100_M2 = {
    0.02: (165, 38.9, 5.27, 1.06, 0.068, 0.0002),
    0.05: (324, 103, 24.0, 8.0, 1.36, 0.037),
    0.07: (407, 138, 35.9, 13.3, 2.72, 0.118),
    0.10: (522, 186, 52.6, 21.1, 4.99, 0.31),
    0.19: (843, 319, 99.2, 43.5, 12.2, 1.11),
}

TABLE = RockTableSpec(
    rows=(
        RockSizeClass(
            diameter_min_m=0.1, diameter_max_m=0.3, count_per_m2=0.5, area_fraction=0.012
        ),
        RockSizeClass(
            diameter_min_m=0.3, diameter_max_m=0.8, count_per_m2=0.05, area_fraction=0.008
        ),
        RockSizeClass(
            diameter_min_m=1.0, diameter_max_m=1.5, count_per_m2=0.004, area_fraction=0.005
        ),
    )
)


@pytest.mark.parametrize("k", PER_100_M2)
def test_counts_of_golombek_and_rapp_match_the_monte_carlo_table(k: float) -> None:
    """The closed form gives the counts per 100 m^2 that an independent sampling gave."""
    counts = 100.0 * golombek_rapp_count(k, DIAMETERS_M)
    # The table was sampled: the last entry of k = 2 % has one digit.
    np.testing.assert_allclose(counts[:5], PER_100_M2[k][:5], rtol=0.02)
    np.testing.assert_allclose(counts[5], PER_100_M2[k][5], rtol=0.03, atol=5e-5)


@pytest.mark.parametrize("k", [0.02, 0.07, 0.19])
def test_the_closed_form_is_the_integral_of_the_cover(k: float) -> None:
    """N(>D) is the integral of -dF / (pi D^2 / 4) over diameters above D."""
    q = golombek_rapp_decay(k)
    for diameter in (0.05, 0.3, 2.0):
        integral = quad(lambda x: k * q * np.exp(-q * x) / (np.pi * x**2 / 4), diameter, np.inf)[0]
        count = golombek_rapp_count(k, np.array([diameter]))[0]
        assert count == pytest.approx(integral, rel=1e-6)


@pytest.mark.parametrize(
    "spec", [RockAbundanceSpec(k=0.07), RockAbundanceSpec(k=0.19, number_multiplier=1.5), TABLE]
)
def test_the_diameter_at_a_rank_inverts_the_count(
    spec: RockAbundanceSpec | RockTableSpec,
) -> None:
    """Going from diameter to rank and back is the identity to a part in a million."""
    law = size_law(spec)
    diameters = np.geomspace(law.diameter_min_m, law.diameter_max_m, 997)[1:-1]
    # Between the classes of a table there is nothing to find.
    rows = spec.rows if isinstance(spec, RockTableSpec) else ()
    inside = [(diameters > r.diameter_min_m) & (diameters < r.diameter_max_m) for r in rows]
    diameters = diameters[np.any(inside, axis=0)] if inside else diameters
    np.testing.assert_allclose(law.diameter_at(law.count_above(diameters)), diameters, rtol=1e-6)


def test_a_table_keeps_both_the_count_and_the_area_of_each_class() -> None:
    """Between the limits of a class the law holds exactly what the customer wrote."""
    law = size_law(TABLE)
    for row in TABLE.rows:
        limits = np.array([row.diameter_min_m, row.diameter_max_m])
        assert -np.diff(law.count_above(limits))[0] == pytest.approx(row.count_per_m2, rel=1e-9)
        assert -np.diff(law.area_above(limits))[0] == pytest.approx(row.area_fraction, rel=1e-9)


@pytest.mark.parametrize("share", [0.0, 0.001, 0.2, 0.5, 0.9, 0.999, 1.0])
def test_any_possible_area_of_a_class_is_reached_by_its_diameters(share: float) -> None:
    """The mean squared diameter of a class matches the area, up to its limits."""
    low, high = (np.pi / 4 * 2.0 * d**2 for d in (0.2, 0.4))
    area = low + share * (high - low)
    row = RockSizeClass(
        diameter_min_m=0.2, diameter_max_m=0.4, count_per_m2=2.0, area_fraction=area
    )
    law = size_law(RockTableSpec(rows=(row,)))
    diameters = law.diameter_at((np.arange(20000) + 0.5) / 20000 * 2.0)
    assert diameters.min() >= 0.2 * (1 - 1e-12) and diameters.max() <= 0.4 * (1 + 1e-12)
    assert 2.0 * np.pi / 4 * np.mean(diameters**2) == pytest.approx(area, rel=0.004)


def test_a_class_without_an_area_has_uniform_diameters() -> None:
    """With only a count the mean is the middle and the variance a twelfth of the width squared."""
    row = RockSizeClass(diameter_min_m=0.2, diameter_max_m=0.6, count_per_m2=1.0)
    diameters = size_law(RockTableSpec(rows=(row,))).diameter_at(np.linspace(0.0, 1.0, 10001))
    assert diameters.mean() == pytest.approx(0.4, rel=1e-3)
    assert diameters.var() == pytest.approx(0.4**2 / 12, rel=1e-3)


def test_an_impossible_area_is_refused_with_the_valid_range() -> None:
    """One rock per m^2 of 0.1 to 0.2 m covers between 0.785 and 3.14 % of the ground."""
    row = {"diameter_min_m": 0.1, "diameter_max_m": 0.2, "count_per_m2": 1.0, "area_fraction": 0.05}
    with pytest.raises(SpecError, match=r"between 0\.007854 and 0\.03142"):
        RockTableSpec.from_mapping({"rows": [row]})


def test_the_number_multiplier_scales_counts_and_cover() -> None:
    """The paper's K multiplies the number of rocks of every size, for either kind of spec."""
    for spec in (RockAbundanceSpec(k=0.05), TABLE):
        plain = size_law(spec)
        more = size_law(spec.model_copy(update={"number_multiplier": 1.7}))
        np.testing.assert_allclose(
            more.count_above(DIAMETERS_M), 1.7 * plain.count_above(DIAMETERS_M)
        )
        np.testing.assert_allclose(
            more.area_above(DIAMETERS_M), 1.7 * plain.area_above(DIAMETERS_M)
        )
