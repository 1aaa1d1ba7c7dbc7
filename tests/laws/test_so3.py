"""The laws of SO(3)."""

import numpy as np

from lpet_sim.geometry import compiled, so3
from tests.laws.samples import numerical_jacobian, rotation_vectors


def test_hat_is_the_cross_product() -> None:
    """hat(a) b = a x b, and hat(a)^T = -hat(a)."""
    a, b = rotation_vectors("a"), rotation_vectors("b")
    np.testing.assert_allclose(np.einsum("nij,nj->ni", so3.hat(a), b), np.cross(a, b), atol=1e-14)
    np.testing.assert_array_equal(so3.hat(a), -np.swapaxes(so3.hat(a), 1, 2))


def test_exp_gives_rotations() -> None:
    """R^T R = I and det R = 1."""
    R = so3.exp(rotation_vectors("a"))
    np.testing.assert_allclose(
        np.swapaxes(R, 1, 2) @ R, np.broadcast_to(np.eye(3), R.shape), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)


def test_exp_turns_by_its_angle_about_its_axis() -> None:
    """The axis stays, and the trace is 1 + 2 cos(angle)."""
    phi = rotation_vectors("a")
    R = so3.exp(phi)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", R, phi), phi, atol=1e-14)
    angle = np.linalg.norm(phi, axis=1)
    np.testing.assert_allclose(np.trace(R, axis1=1, axis2=2), 1 + 2 * np.cos(angle), atol=1e-14)


def test_log_inverts_exp_near_the_identity_and_near_pi() -> None:
    """To 1e-14 rad everywhere below pi, and to one part in 1e7 at 1e-7 rad."""
    phi = rotation_vectors("a")
    back = so3.log(so3.exp(phi))
    np.testing.assert_allclose(back, phi, atol=2e-14)
    tiny = np.array([[1e-7, -2e-7, 3e-8]])
    np.testing.assert_allclose(so3.log(so3.exp(tiny)), tiny, rtol=1e-7)


def test_exp_inverts_log_at_exactly_pi() -> None:
    """At a half turn the vector may point either way, the rotation is the same."""
    axes = rotation_vectors("a", half_turns=False)[-40:]
    phi = np.pi * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    R = so3.exp(phi)
    np.testing.assert_allclose(so3.exp(so3.log(R)), R, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(so3.log(R), axis=1), np.pi, atol=1e-7)


def test_the_inverse_turns_back() -> None:
    """exp(-phi) = exp(phi)^T."""
    phi = rotation_vectors("a")
    np.testing.assert_allclose(so3.exp(-phi), np.swapaxes(so3.exp(phi), 1, 2), atol=1e-15)


def test_the_left_jacobian_is_that_of_finite_differences() -> None:
    """log(exp(phi + d) exp(phi)^-1) = J d."""
    for phi in rotation_vectors("a", count=2):
        R = so3.exp(phi)
        numerical = numerical_jacobian(lambda x, R=R: so3.log(so3.exp(x) @ R.T), phi)
        np.testing.assert_allclose(so3.left_jacobian(phi), numerical, atol=1e-8)


def test_the_left_jacobian_is_smooth_across_the_change_to_its_series() -> None:
    """Both sides of every small angle agree with J = integral of exp(s phi) over s."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    s, w = 0.5 * (nodes + 1), 0.5 * weights
    for phi in rotation_vectors("a", count=2):
        integral = np.einsum("s,sij->ij", w, so3.exp(s[:, None] * phi))
        np.testing.assert_allclose(so3.left_jacobian(phi), integral, atol=5e-15)


def test_the_inverse_of_the_left_jacobian_is_its_inverse() -> None:
    """J J^-1 = I, up to a half turn."""
    phi = rotation_vectors("a")
    product = so3.left_jacobian(phi) @ so3.left_jacobian_inv(phi)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=1e-13)


def test_quaternions_are_scalar_first() -> None:
    """A quarter turn about z is (cos 45, 0, 0, sin 45) and takes x to y."""
    half = np.sqrt(0.5)
    q = np.array([half, 0, 0, half])
    R = so3.from_quat_wxyz(q)
    np.testing.assert_allclose(R @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(so3.to_quat_wxyz(R), q, atol=1e-15)


def test_quaternions_go_to_matrices_and_back() -> None:
    """Over all samples, with w >= 0 and unit length; -q is the same rotation."""
    R = so3.exp(rotation_vectors("a"))
    q = so3.to_quat_wxyz(R)
    assert np.all(q[:, 0] >= 0)
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, atol=1e-15)
    np.testing.assert_allclose(so3.from_quat_wxyz(q), R, atol=1e-14)
    np.testing.assert_allclose(so3.from_quat_wxyz(-q), R, atol=1e-14)


def test_roll_pitch_yaw_is_rz_ry_rx() -> None:
    """Yaw last, about the world's z: each factor alone is the rotation about its axis."""
    roll, pitch, yaw = 0.3, -0.4, 2.5
    Rx, Ry, Rz = (so3.exp(a * e) for a, e in zip((roll, pitch, yaw), np.eye(3), strict=True))
    R = so3.from_rpy(np.array([roll, pitch, yaw]))
    np.testing.assert_allclose(R, Rz @ Ry @ Rx, atol=1e-15)
    np.testing.assert_allclose(so3.to_rpy(R), [roll, pitch, yaw], atol=1e-14)


def test_a_positive_pitch_lowers_the_nose_and_a_positive_roll_lifts_the_left_side() -> None:
    """With x forward, y left, z up."""
    assert (so3.from_rpy(np.array([0, 0.1, 0])) @ [1, 0, 0])[2] < 0
    assert (so3.from_rpy(np.array([0.1, 0, 0])) @ [0, 1, 0])[2] > 0
    assert (so3.from_rpy(np.array([0, 0, 0.1])) @ [1, 0, 0])[1] > 0


def test_slerp_starts_and_ends_and_turns_evenly() -> None:
    """Half of the way is the square root of the step."""
    R_a, R_b = so3.exp(rotation_vectors("a")), so3.exp(rotation_vectors("b", half_turns=False))
    R_b = R_a[: len(R_b)] @ R_b
    R_a = R_a[: len(R_b)]
    zero, half, one = (so3.slerp(R_a, R_b, np.full(len(R_a), f)) for f in (0, 0.5, 1))
    np.testing.assert_allclose(zero, R_a, atol=1e-15)
    np.testing.assert_allclose(one, R_b, atol=1e-13)
    step = np.swapaxes(R_a, 1, 2) @ half
    np.testing.assert_allclose(R_a @ step @ step, R_b, atol=1e-13)


def test_stacks_of_any_shape_go_through() -> None:
    """A leading shape (4, 2) gives the same as one by one."""
    phi = rotation_vectors("a")[-8:].reshape(4, 2, 3)
    R = so3.exp(phi)
    np.testing.assert_array_equal(R[2, 1], so3.exp(phi[2, 1]))
    assert so3.log(R).shape == (4, 2, 3)
    assert so3.to_rpy(R).shape == (4, 2, 3)
    assert so3.to_quat_wxyz(R).shape == (4, 2, 4)
    np.testing.assert_allclose(so3.from_rpy(so3.to_rpy(R)), R, atol=1e-13)


def test_compiled_rotations_are_those_of_the_stacks() -> None:
    """Exponential map over all samples, logarithm below a quarter turn, and the products."""
    for phi in rotation_vectors("a", count=3):
        R = compiled.small_exp(phi)
        np.testing.assert_allclose(R, so3.exp(phi), atol=1e-15)
        np.testing.assert_allclose(compiled.times(R, phi), phi, atol=1e-14)
        np.testing.assert_allclose(compiled.times_transposed(R, R), np.eye(3), atol=1e-14)
        if np.linalg.norm(phi) < np.pi / 2:
            np.testing.assert_allclose(compiled.small_log(R), phi, atol=1e-15)
