"""NEES and its bands against closed forms and Monte-Carlo."""

import numpy as np

from lpet_sim.evaluation.consistency import anees, chi_square_band, nees, normalised_square
from lpet_sim.rng import stream


def _covariance(rng: np.random.Generator, d: int = 6) -> np.ndarray:
    A = rng.normal(size=(d, d))
    return A @ A.T + 0.1 * np.eye(d)


def test_bands_are_those_published() -> None:
    """Two-sided 95 % bands, chi2(N n)/N: N = 50 and 100 with 3 and 6 degrees of freedom."""
    published = {(50, 3): (2.36, 3.72), (50, 6): (5.08, 7.00)}
    published |= {(100, 3): (2.54, 3.50), (100, 6): (5.34, 6.70)}
    for (runs, dof), band in published.items():
        np.testing.assert_allclose(chi_square_band(runs, dof), band, atol=0.011)


def test_nees_of_a_diagonal_covariance_is_the_sum_of_squares() -> None:
    """Each block counts its own three axes."""
    xi = np.array([[1.0, 2, 3, 0.1, 0.2, 0.3]])
    covariance = np.diag([1.0, 4, 9, 0.01, 0.04, 0.09])[None]
    np.testing.assert_allclose(nees(xi, covariance), [[3, 3, 6]])


def test_nees_sees_correlation() -> None:
    """The NEES of the pose is not the sum of those of its blocks where they are correlated."""
    rng = stream(3, "nees")
    P = _covariance(rng)[None]
    xi = rng.normal(size=(1, 6))
    position, attitude, pose = nees(xi, P)[0]
    np.testing.assert_allclose(pose, xi[0] @ np.linalg.inv(P[0]) @ xi[0])
    assert abs(pose - position - attitude) > 0.1


def test_a_consistent_estimator_is_in_the_band_and_a_wrong_one_is_not() -> None:
    """Noise told right passes; told half or twice its size it fails on its own side."""
    rng = stream(4, "anees")
    P = _covariance(rng)
    error = rng.multivariate_normal(np.zeros(6), P, size=200)
    told = {
        k: anees(normalised_square(error, np.tile(k * P, (200, 1, 1))), 6) for k in (1, 0.25, 4)
    }
    assert told[1].is_consistent
    assert told[0.25].value > told[0.25].high
    assert told[4].value < told[4].low


def test_the_band_holds_what_it_says() -> None:
    """Of 2000 averages over 20 consistent runs 95 % lie inside."""
    averages = stream(5, "band").chisquare(3, size=(2000, 20)).mean(axis=1)
    low, high = chi_square_band(20, 3)
    inside = np.mean((averages >= low) & (averages <= high))
    assert abs(inside - 0.95) < 3 * np.sqrt(0.95 * 0.05 / 2000)


def test_a_covariance_that_is_not_positive_definite_gives_no_number() -> None:
    """Zero at the given start and an indefinite one give NaN; their neighbours are untouched."""
    P = np.stack([np.zeros((6, 6)), np.eye(6), np.eye(6) - 2 * np.eye(6)[::-1]])
    value = normalised_square(np.ones((3, 6)), P)
    np.testing.assert_array_equal(np.isnan(value), [True, False, True])
    assert value[1] == 6
