"""The covariance that is changed in place, against dense algebra on the whole of it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from estimators import gaussian, gaussian_blocks
from lpet_sim.errors import BrokenFilterError
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from tests.estimators.test_gaussian import covariance

N = 18
FREE = slice(12, 15)


def state(seed: int = 0) -> Array:
    """Make a covariance of 18 variables with three free ones in it."""
    P = covariance(N, seed, 0.3)
    P[FREE], P[:, FREE] = 0.0, 0.0
    return P


def matrix(rows: int, columns: int, seed: int = 1) -> Array:
    """Draw a matrix."""
    return stream(seed, "matrix").standard_normal((rows, columns))


def same(found: Array, wanted: Array) -> None:
    """Hold a covariance to another, and to symmetry, both to rounding."""
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-13 * np.abs(wanted).max())
    np.testing.assert_allclose(found, found.T, rtol=0, atol=1e-14 * np.abs(wanted).max())


def test_moving_a_block_is_a_linear_step_of_the_first_variables() -> None:
    """``F P F' + cov`` with F the identity but for the block."""
    P, F, added = state(), matrix(6, 6), covariance(6, 2)
    wide = np.eye(N)
    wide[:6, :6] = F
    wanted = wide @ P @ wide.T
    wanted[:6, :6] += added
    gaussian_blocks.move_block(P, F, added)
    same(P, wanted)


def test_noise_is_added_where_it_enters() -> None:
    """``P + B B'``; rows that no noise reaches stay as they are to the bit."""
    P, B_T = state(), matrix(4, N)
    B_T[:, [2, 13]] = 0.0
    before = P.copy()
    gaussian_blocks.add_noise(P, B_T)
    same(P, before + B_T.T @ B_T)
    assert np.array_equal(P[2], before[2]) and np.array_equal(P[:, 13], before[:, 13])


def test_lasting_errors_act_on_what_they_move() -> None:
    """``x += B d``: F is the identity plus B in the columns of d."""
    P, B_T = state(), matrix(3, N)
    B_T[:, 6:9], B_T[:, FREE] = 0.0, 0.0
    F = np.eye(N)
    F[:, 6:9] += B_T.T
    wanted = F @ P @ F.T
    gaussian_blocks.carry(P, B_T, 6)
    same(P, wanted)


def test_a_joined_block_is_a_linear_map_of_others_plus_noise() -> None:
    """Its covariance, and its correlation with all else; what was there stays to the bit."""
    P, J, B = state(), matrix(3, 5), matrix(3, 2, 2)
    known = np.array([0, 3, 6, 7, 17])
    F = np.eye(N)
    F[FREE] = 0.0
    F[FREE, known] = J
    before, wanted = P.copy(), F @ P @ F.T
    wanted[FREE, FREE] += B @ B.T
    gaussian_blocks.join_block(P, 12, known, J, B)
    same(P, wanted)
    others = np.delete(np.arange(N), np.arange(12, 15))
    assert np.array_equal(P[np.ix_(others, others)], before[np.ix_(others, others)])


def test_a_clone_is_its_original() -> None:
    """The difference of both has no variance, and each is correlated with the rest alike."""
    P = state()
    before = P.copy()
    gaussian_blocks.clone_block(P, 12, 3)
    same(P[:3, :3], P[12:15, 12:15])
    difference = np.zeros(N)
    difference[0], difference[12] = 1.0, -1.0
    assert not (P @ difference).any()
    P[FREE], P[:, FREE] = 0.0, 0.0
    assert np.array_equal(P, before)


def test_freed_variables_leave_the_rest_as_it_is() -> None:
    """To the bit: marginalising is dropping rows."""
    P = covariance(N, 3)
    before = P.copy()
    gaussian_blocks.free_block(P, 12, 3)
    rest = np.delete(np.arange(N), np.arange(12, 15))
    assert np.array_equal(P[np.ix_(rest, rest)], gaussian.marginalise(before, rest))
    assert not P[FREE].any() and not P[:, FREE].any()
    wide = gaussian_blocks.enlarged(P, N + 4)
    assert np.array_equal(wide[:N, :N], P) and not wide[N:].any() and not wide[:, N:].any()


@pytest.mark.parametrize("keep", [True, False])
def test_decoupled_blocks_know_nothing_of_each_other(keep: bool) -> None:
    """The first six variables stay; with the blocks they stay correlated if they may."""
    P = covariance(N, 4)
    mask = np.kron(np.eye(6), np.ones((3, 3)))
    mask[:6, :6] = 1.0
    if keep:
        mask[:6], mask[:, :6] = 1.0, 1.0
    wanted = P * mask
    gaussian_blocks.drop_correlations(P, 6, keep)
    assert np.array_equal(P, wanted)


@pytest.mark.parametrize("size", [1, 31, 32, 33, 100])
def test_the_lower_triangle_is_mirrored(size: int) -> None:
    """At sizes around the tile's."""
    P = matrix(size, size)
    wanted = np.tril(P) + np.tril(P, -1).T
    gaussian_blocks.mirror_lower(P)
    assert np.array_equal(P, wanted)


@pytest.mark.parametrize("seed", range(5))
def test_an_update_by_the_square_root_equals_josephs(seed: int) -> None:
    """State, covariance and NIS, with free variables in between, to ten digits."""
    P, H, noise = state(seed), matrix(7, N, seed), 0.5 * np.eye(7)
    H[:, FREE] = 0.0
    r = stream(seed, "r").standard_normal(7)
    dx, joseph = gaussian.update(P, H, r, noise)
    S = H @ P @ H.T + noise
    found = P.copy()
    L, HP = gaussian_blocks.square_root(S), np.ascontiguousarray(H @ P)
    moved, nis = gaussian_blocks.update_in_place(found, HP, L, r)
    np.testing.assert_allclose(gaussian_blocks.solved(L, r), np.linalg.solve(S, r), rtol=1e-10)
    np.testing.assert_allclose(found, joseph, rtol=0, atol=1e-10 * np.abs(joseph).max())
    np.testing.assert_allclose(moved, dx, rtol=0, atol=1e-10 * np.abs(dx).max())
    assert nis == pytest.approx(gaussian.normalised_square(r, S), rel=1e-10)
    assert np.array_equal(found, found.T)
    assert not found[FREE].any()


def test_a_covariance_that_is_none_ends_the_filter() -> None:
    """An indefinite S, and a P that an update would drive below zero."""
    P, H = np.eye(3), np.eye(3)[:1]
    with pytest.raises(BrokenFilterError, match="innovation is not positive definite"):
        gaussian_blocks.square_root(np.array([[-1.0]]))
    with pytest.raises(BrokenFilterError, match="state is not positive definite"):
        gaussian_blocks.update_in_place(P.copy(), H @ P, np.sqrt([[0.5]]), np.ones(1))
    indefinite = np.diag([1.0, -1e-3, 1.0])
    with pytest.raises(BrokenFilterError, match="state is not positive definite"):
        gaussian_blocks.update_in_place(indefinite, H @ P, np.sqrt([[2.0]]), np.ones(1))


def test_a_score_square_is_what_a_free_move_takes_off_the_misfit() -> None:
    """Least squares tells the same, and where S holds it is chi-square of as many freedoms."""
    M, root = matrix(12, 3, 0), matrix(12, 12, 1)
    S = root @ root.T + np.eye(12)
    L, draws = gaussian_blocks.square_root(S), stream(1, "score")
    r = draws.standard_normal(12)
    white_M, white_r = np.linalg.solve(np.tril(L), M), np.linalg.solve(np.tril(L), r)
    _, rest, *_ = np.linalg.lstsq(white_M, white_r)
    taken_off = white_r @ white_r - rest[0]
    assert gaussian_blocks.score_square(L, M, r) == pytest.approx(taken_off, rel=1e-9)
    noise = draws.standard_normal((4000, 12)) @ np.tril(L).T
    squares = [gaussian_blocks.score_square(L, M, row) for row in noise]
    assert kstest(squares, chi2(3).cdf).pvalue > 1e-3
    blind = np.column_stack([M, np.zeros(12)])
    assert gaussian_blocks.score_square(L, blind, r) == pytest.approx(taken_off, rel=1e-9)
