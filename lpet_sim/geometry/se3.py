"""SE(3): rigid motions, one or a stack of them.

``T_a_b`` is the pose of frame b in frame a: ``p_a = T_a_b @ p_b`` and
``T_a_c = T_a_b @ T_b_c``. Errors are right perturbations, ``T_true = T_est @ exp(xi)`` with
``xi = (translation, rotation)``.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lpet_sim.geometry import so3

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SE3:
    """A rigid motion or a stack of them.

    Attributes:
        rotation: Rotation matrices, Shape (..., 3, 3).
        translation: Translations [m], Shape (..., 3).
    """

    rotation: Array
    translation: Array

    def __post_init__(self) -> None:
        """Hold both parts as read-only float arrays of matching leading shape."""
        rotation = np.array(self.rotation, dtype=float)
        translation = np.array(self.translation, dtype=float)
        if rotation.shape != (*translation.shape, 3) or translation.shape[-1:] != (3,):
            raise ValueError(
                f"rotation {rotation.shape} and translation {translation.shape} do not match: "
                "valid are (..., 3, 3) and (..., 3)"
            )
        rotation.flags.writeable = False
        translation.flags.writeable = False
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @classmethod
    def identity(cls, *shape: int) -> SE3:
        """Make identities of the given leading shape."""
        return cls(np.broadcast_to(np.eye(3), (*shape, 3, 3)), np.zeros((*shape, 3)))

    @classmethod
    def from_quat_wxyz(cls, q_wxyz: ArrayLike, translation: ArrayLike) -> SE3:
        """Make motions from unit quaternions, Shape (..., 4), and translations [m]."""
        q = np.asarray(q_wxyz, dtype=float)
        return cls(so3.from_quat_wxyz(q), np.asarray(translation, dtype=float))

    @classmethod
    def from_rpy(cls, rpy_rad: ArrayLike, translation: ArrayLike) -> SE3:
        """Make motions from roll, pitch, yaw [rad], Shape (..., 3), and translations [m]."""
        rpy = np.asarray(rpy_rad, dtype=float)
        return cls(so3.from_rpy(rpy), np.asarray(translation, dtype=float))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> SE3:
        """Make motions from homogeneous matrices, Shape (..., 4, 4) or (..., 3, 4)."""
        m = np.asarray(matrix, dtype=float)
        return cls(m[..., :3, :3], m[..., :3, 3])

    @classmethod
    def exp(cls, xi: ArrayLike) -> SE3:
        """Map twists ``(translation, rotation)`` to motions.

        ``exp(rho, phi) = (exp(phi), J(phi) rho)`` with J the left Jacobian of SO(3).

        Args:
            xi: Twists [m, rad], Shape (..., 6).

        Reference:
            Barfoot (2017), eq. 7.24 and 7.33.
        """
        xi = np.asarray(xi, dtype=float)
        rho, phi = xi[..., :3], xi[..., 3:]
        return cls(so3.exp(phi), np.einsum("...ij,...j->...i", so3.left_jacobian(phi), rho))

    @classmethod
    def stack(cls, motions: Iterable[SE3]) -> SE3:
        """Join single motions into one stack of leading shape (n,)."""
        items = list(motions)
        return cls(
            np.array([m.rotation for m in items]).reshape(-1, 3, 3),
            np.array([m.translation for m in items]).reshape(-1, 3),
        )

    def log(self) -> Array:
        """Give the twists ``(translation, rotation)``, Shape (..., 6), the inverse of `exp`."""
        phi = so3.log(self.rotation)
        rho = np.einsum("...ij,...j->...i", so3.left_jacobian_inv(phi), self.translation)
        return np.concatenate([rho, phi], axis=-1)

    def inverse(self) -> SE3:
        """Give ``T_b_a`` of ``T_a_b``."""
        rotation = np.swapaxes(self.rotation, -1, -2)
        return SE3(rotation, -np.einsum("...ij,...j->...i", rotation, self.translation))

    def adjoint(self) -> Array:
        """Give Ad with ``T exp(xi) T^-1 = exp(Ad xi)``, Shape (..., 6, 6) (Barfoot eq. 7.44)."""
        out = np.zeros((*self.shape, 6, 6))
        out[..., :3, :3] = self.rotation
        out[..., 3:, 3:] = self.rotation
        out[..., :3, 3:] = so3.hat(self.translation) @ self.rotation
        return out

    def matrix(self) -> Array:
        """Give homogeneous matrices, Shape (..., 4, 4)."""
        out = np.zeros((*self.shape, 4, 4))
        out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = self.rotation, self.translation, 1.0
        return out

    def quat_wxyz(self) -> Array:
        """Give unit quaternions, scalar first, Shape (..., 4)."""
        return so3.to_quat_wxyz(self.rotation)

    def rpy(self) -> Array:
        """Give roll, pitch, yaw [rad], Shape (..., 3)."""
        return so3.to_rpy(self.rotation)

    @property
    def shape(self) -> tuple[int, ...]:
        """The leading shape: () for one motion, (n,) for a stack."""
        return self.translation.shape[:-1]

    def __len__(self) -> int:
        return int(self.shape[0])

    def __getitem__(self, index: Any) -> SE3:
        return SE3(self.rotation[index], self.translation[index])

    @overload
    def __matmul__(self, other: SE3) -> SE3: ...
    @overload
    def __matmul__(self, other: Array) -> Array: ...

    def __matmul__(self, other: SE3 | Array) -> SE3 | Array:
        """Compose with a motion, or transform points of Shape (..., 3) [m].

        A single motion transforms any number of points; a stack (n,) goes with points (n, 3).
        """
        if isinstance(other, SE3):
            moved = np.einsum("...ij,...j->...i", self.rotation, other.translation)
            return SE3(self.rotation @ other.rotation, moved + self.translation)
        moved = np.einsum("...ij,...j->...i", self.rotation, np.asarray(other, dtype=float))
        return np.asarray(moved + self.translation)
