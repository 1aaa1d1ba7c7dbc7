"""The observation of a landmark from another pose: projection and Jacobians."""

from __future__ import annotations

import numpy as np
import pytest

from estimators.observation import camera_vector, transfer, transfer_with_jacobians
from lpet_sim.geometry import SE3
from tests.estimators.stereo_traverse import stereo
from tests.finite_difference import assert_jacobian

XI = np.array([0.2, -0.1, 0.5, 0.05, -0.2, 0.1])
NEAR, FAR, HORIZON = (400.0, 300.0, 600.0), (700.0, 699.9, 300.0), (200.0, 200.0, 150.0)


def test_a_transfer_is_projecting_the_moved_triangulated_point() -> None:
    """For positive disparity it is triangulate, move, project."""
    x, T_a_b = np.array([NEAR, FAR]), SE3.exp(XI)
    expected = stereo().project(T_a_b.inverse() @ stereo().triangulate(x))
    np.testing.assert_allclose(transfer(stereo(), T_a_b, x), expected, atol=1e-8)


def test_a_point_at_the_horizon_feels_rotation_only() -> None:
    """Without disparity a translation moves nothing, and nothing is divided by zero."""
    moved = transfer(stereo(), SE3.exp(np.array([1.0, 2.0, 3.0, 0, 0, 0])), np.array([HORIZON]))
    np.testing.assert_allclose(moved[0], HORIZON, atol=1e-9)


@pytest.mark.parametrize("x", [NEAR, FAR, HORIZON])
def test_both_jacobians_agree_with_finite_differences(x: tuple[float, float, float]) -> None:
    """By the sighting in the first view, and by the right perturbation of the motion."""
    T_a_b, camera, at = SE3.exp(XI), camera_vector(stereo()), np.array([x])
    R, t = np.array(T_a_b.rotation), np.array(T_a_b.translation)
    _, G, J = transfer_with_jacobians(camera, R, t, at)
    by_x = lambda v: transfer(stereo(), T_a_b, v[None])[0]  # noqa: E731
    by_xi = lambda v: transfer(stereo(), T_a_b @ SE3.exp(v), at)[0]  # noqa: E731
    assert_jacobian(by_x, at[0], G[0], step=1e-4)
    assert_jacobian(by_xi, np.zeros(6), J[0])
