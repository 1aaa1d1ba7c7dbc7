"""The laws of SE(3)."""

import numpy as np
import pytest
from scipy.linalg import expm

from lpet_sim.geometry import SE3, so3
from tests.laws.samples import numerical_jacobian, twists


def _assert_same(a: SE3, b: SE3, atol: float = 1e-13) -> None:
    np.testing.assert_allclose(a.rotation, b.rotation, atol=atol)
    np.testing.assert_allclose(a.translation, b.translation, atol=atol)


def test_composition_is_a_group() -> None:
    """Associative, with identity and inverse on both sides."""
    a, b, c = (SE3.exp(twists(name)) for name in "abc")
    identity = SE3.identity(len(a))
    _assert_same((a @ b) @ c, a @ (b @ c))
    _assert_same(a @ identity, a)
    _assert_same(identity @ a, a)
    _assert_same(a @ a.inverse(), identity)
    _assert_same(a.inverse() @ a, identity)
    _assert_same((a @ b).inverse(), b.inverse() @ a.inverse())


def test_composition_is_that_of_homogeneous_matrices() -> None:
    """(T_a_b @ T_b_c).matrix() is the product of the matrices, and from_matrix inverts."""
    a, b = SE3.exp(twists("a")), SE3.exp(twists("b"))
    np.testing.assert_allclose((a @ b).matrix(), a.matrix() @ b.matrix(), atol=1e-13)
    _assert_same(SE3.from_matrix(a.matrix()), a, atol=0)
    _assert_same(SE3.from_matrix(a.matrix()[:, :3]), a, atol=0)


def test_points_go_through_as_frames_cancel() -> None:
    """p_a = T_a_b @ (T_b_c @ p_c) = (T_a_b @ T_b_c) @ p_c, for one motion and for stacks."""
    T_a_b, T_b_c = SE3.exp(twists("a")), SE3.exp(twists("b"))
    p_c = twists("p")[:, :3]
    np.testing.assert_allclose((T_a_b @ T_b_c) @ p_c, T_a_b @ (T_b_c @ p_c), atol=1e-12)
    np.testing.assert_allclose(
        T_a_b[3] @ p_c, (T_a_b[3].matrix() @ np.c_[p_c, np.ones(len(p_c))].T).T[:, :3], atol=1e-13
    )


def test_exp_is_the_matrix_exponential() -> None:
    """Against SciPy, over all samples."""
    for xi in twists("a")[::3]:
        generator = np.zeros((4, 4))
        generator[:3, :3], generator[:3, 3] = so3.hat(xi[3:]), xi[:3]
        np.testing.assert_allclose(SE3.exp(xi).matrix(), expm(generator), atol=3e-14)


def test_log_inverts_exp_near_the_identity_and_near_pi() -> None:
    """To 1e-13 of a few metres and below pi."""
    xi = twists("a")
    np.testing.assert_allclose(SE3.exp(xi).log(), xi, atol=1e-13)
    tiny = 1e-7 * np.array([[1, -2, 3, 0.5, -1, 2.0]])
    np.testing.assert_allclose(SE3.exp(tiny).log(), tiny, rtol=1e-7)


def test_the_adjoint_moves_a_twist_through_a_motion() -> None:
    """T exp(xi) T^-1 = exp(Ad xi), and Ad is a homomorphism."""
    T, b = SE3.exp(twists("a")), SE3.exp(twists("b"))
    xi = 0.1 * twists("x", half_turns=True)
    moved = np.einsum("nij,nj->ni", T.adjoint(), xi)
    _assert_same(T @ SE3.exp(xi) @ T.inverse(), SE3.exp(moved), atol=1e-12)
    np.testing.assert_allclose((T @ b).adjoint(), T.adjoint() @ b.adjoint(), atol=1e-12)


def test_the_right_perturbation_is_additive_to_first_order() -> None:
    """Differentiating log(T^-1 T exp(xi)) by xi gives I at zero."""
    T = SE3.exp(twists("a"))[7]
    jacobian = numerical_jacobian(lambda x: (T.inverse() @ T @ SE3.exp(x)).log(), np.zeros(6))
    np.testing.assert_allclose(jacobian, np.eye(6), atol=1e-8)


def test_quaternion_and_rpy_constructors_agree_with_their_readers() -> None:
    """from_quat_wxyz(T.quat_wxyz()) and from_rpy(T.rpy()) give T back."""
    T = SE3.exp(twists("a"))
    _assert_same(SE3.from_quat_wxyz(T.quat_wxyz(), T.translation), T)
    _assert_same(SE3.from_rpy(T.rpy(), T.translation), T, atol=1e-12)


def test_a_stack_is_indexed_and_joined() -> None:
    """Stacking the single motions gives the stack back; a mask and a slice select."""
    T = SE3.exp(twists("a"))
    joined = SE3.stack(T[i] for i in range(len(T)))
    _assert_same(joined, T, atol=0)
    assert T[0].shape == ()
    assert len(T[2:5]) == 3
    assert len(T[np.arange(len(T)) < 4]) == 4
    assert len(SE3.stack([])) == 0


def test_shapes_that_do_not_match_are_refused() -> None:
    """A rotation of one shape and a translation of another."""
    with pytest.raises(ValueError, match="do not match"):
        SE3(np.zeros((2, 3, 3)), np.zeros((3, 3)))


def test_a_motion_cannot_be_changed() -> None:
    """Neither its arrays, nor through those it was made from."""
    p = np.zeros(3)
    T = SE3(np.eye(3), p)
    p[0] = 1.0
    assert T.translation[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        T.translation[0] = 1.0
