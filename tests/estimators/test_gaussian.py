"""Laws of the Gaussian algebra."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from estimators import gaussian
from lpet_sim.rng import stream

Array = NDArray[np.float64]


def covariance(size: int, seed: int, spread: float = 1.0) -> Array:
    """Make a covariance whose standard deviations span ``spread`` decades either way."""
    rng = stream(seed, "covariance", size)
    root = rng.standard_normal((size, size + 2)) * 10 ** rng.uniform(-spread, spread, (size, 1))
    return root @ root.T


@pytest.mark.parametrize("seed", range(5))
def test_joseph_form_equals_the_information_form(seed: int) -> None:
    """``P+^-1 = P^-1 + H^T W^-1 H`` and ``dx = P+ H^T W^-1 y``."""
    rng = stream(seed, "update")
    P, W = covariance(9, seed), covariance(4, seed + 100)
    H, y = rng.standard_normal((4, 9)), rng.standard_normal(4)
    dx, updated = gaussian.update(P, H, y, W)
    information = np.linalg.inv(P) + H.T @ np.linalg.solve(W, H)
    expected = np.linalg.inv(information)
    np.testing.assert_allclose(updated, expected, rtol=1e-6, atol=1e-9 * np.abs(expected).max())
    np.testing.assert_allclose(dx, expected @ H.T @ np.linalg.solve(W, y), rtol=1e-5, atol=1e-9)


def test_updates_in_sequence_equal_one_joint_update() -> None:
    """Independent measurements commute."""
    rng = stream(1, "sequence")
    P, H, y = covariance(6, 1, 0.3), rng.standard_normal((4, 6)), rng.standard_normal(4)
    W = np.diag([0.1, 0.2, 0.3, 0.4])
    joint_dx, joint_P = gaussian.update(P, H, y, W)
    dx, stepped = np.zeros(6), P
    for i in range(4):
        row = H[i : i + 1]
        step, stepped = gaussian.update(
            stepped, row, y[i : i + 1] - row @ dx, W[i : i + 1, i : i + 1]
        )
        dx = dx + step
    np.testing.assert_allclose(stepped, joint_P, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(dx, joint_dx, rtol=1e-9)


def test_ten_thousand_precise_updates_leave_a_positive_covariance() -> None:
    """From a kilometre to a micrometre, symmetric to the bit, and as small as batch says."""
    P, W = np.diag([1e6, 1e6, 1.0]), np.array([[1e-8]])
    information = np.linalg.inv(P)
    rng = stream(2, "exact")
    for _ in range(10_000):
        H = rng.standard_normal((1, 3))
        information += H.T @ H / W
        _, P = gaussian.update(P, H, np.zeros(1), W)
    assert np.array_equal(P, P.T)
    np.testing.assert_allclose(P, np.linalg.inv(information), rtol=0.05, atol=1e-14)


def test_propagation_is_symmetric_to_the_bit_and_follows_its_law() -> None:
    """``F P F^T + noise``, for derivatives of any layout and shape."""
    P, F = covariance(7, 3), stream(3, "F").standard_normal((7, 5)).T
    out = gaussian.propagate(P, F, covariance(5, 4))
    assert np.array_equal(out, out.T)
    np.testing.assert_allclose(out, F @ P @ F.T + covariance(5, 4), rtol=1e-12)
    np.testing.assert_allclose(gaussian.transport(P, F), F @ P @ F.T, rtol=1e-10)


def test_noise_through_a_derivative_is_that_of_its_columns() -> None:
    """``B diag(v) B^T`` and the diagonal itself."""
    B, v = stream(4, "B").standard_normal((6, 3)), np.array([1.0, 2.0, 3.0])
    np.testing.assert_allclose(gaussian.of_noise(B, v), B @ np.diag(v) @ B.T, rtol=1e-12)
    assert np.array_equal(gaussian.independent(v), np.diag(v))
    assert np.array_equal(gaussian.with_noise(np.eye(3), v), np.diag([2.0, 3.0, 4.0]))


def test_solving_by_cholesky_is_solving() -> None:
    """Against LAPACK's general solver."""
    S, B = covariance(8, 5), stream(5, "B").standard_normal((8, 3))
    np.testing.assert_allclose(gaussian.cholesky_solve(S, B), np.linalg.solve(S, B), rtol=1e-7)
    np.testing.assert_allclose(gaussian.from_information(S) @ S, np.eye(8), atol=1e-8)


def test_what_is_not_positive_definite_is_refused() -> None:
    """An information matrix with an unobserved direction has no covariance."""
    with pytest.raises(np.linalg.LinAlgError):
        gaussian.from_information(np.diag([1.0, 0.0, 1.0]))


def test_dropping_rows_keeps_the_rest_and_an_update_after_it_agrees() -> None:
    """Marginalising, then updating what is left, equals updating, then marginalising."""
    P, keep = covariance(6, 6), np.array([0, 2, 5])
    H, W, y = stream(6, "H").standard_normal((2, 3)), np.eye(2), np.ones(2)
    wide = np.zeros((2, 6))
    wide[:, keep] = H
    _, late = gaussian.update(P, wide, y, W)
    _, early = gaussian.update(gaussian.marginalise(P, keep), H, y, W)
    np.testing.assert_allclose(gaussian.marginalise(late, keep), early, rtol=1e-8, atol=1e-10)


def test_the_gate_passes_the_share_it_is_told_to() -> None:
    """Of 20,000 fitting innovations 1 % fail a gate of 99 %."""
    S = covariance(3, 7, 0.5)
    draws = stream(7, "gate").standard_normal((20_000, 3)) @ np.linalg.cholesky(S).T
    distance = np.array([gaussian.normalised_square(draw, S) for draw in draws])
    assert np.mean(distance > gaussian.chi_square_threshold(3, 0.99)) == pytest.approx(
        0.01, abs=2e-3
    )
    assert distance.mean() == pytest.approx(3.0, abs=0.06)
    inside = np.sqrt(chi2.ppf(0.98, 1)) * np.ones(1)
    assert gaussian.passes_gate(inside, np.eye(1), 0.99)
    assert not gaussian.passes_gate(inside, np.eye(1), 0.97)
