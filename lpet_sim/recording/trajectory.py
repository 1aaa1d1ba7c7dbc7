"""Poses over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array, ArrayStruct, Ints


@dataclass(frozen=True, eq=False)
class Trajectory(ArrayStruct):
    """A body's poses in the world over time.

    Attributes:
        t_ns: Times since the start [ns], Shape (n,), increasing.
        T_world_body: Poses, Shape (n,).
    """

    t_ns: Ints
    T_world_body: SE3

    @property
    def arc_length_m(self) -> Array:
        """Distance driven up to each time [m], Shape (n,): the sum of the chords."""
        steps = np.linalg.norm(np.diff(self.T_world_body.translation, axis=0), axis=-1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    def at(self, t_ns: ArrayLike) -> SE3:
        """Interpolate, linear in position and along the shortest rotation.

        Args:
            t_ns: Times within the trajectory [ns], Shape (m,).

        Returns:
            Poses, Shape (m,).

        Raises:
            RecordingError: A time lies outside the trajectory.
        """
        query = np.asarray(t_ns, dtype=np.int64)
        if len(query) and (query.min() < self.t_ns[0] or query.max() > self.t_ns[-1]):
            raise RecordingError(
                f"times {query.min()} to {query.max()} ns lie outside the trajectory, "
                f"which spans {self.t_ns[0]} to {self.t_ns[-1]} ns"
            )
        right = np.searchsorted(self.t_ns, query, side="left")
        left = np.maximum(right - 1, 0)
        span = np.maximum(self.t_ns[right] - self.t_ns[left], 1)
        fraction = (query - self.t_ns[left]) / span
        p = self.T_world_body.translation
        R = self.T_world_body.rotation
        position = p[left] + fraction[:, None] * (p[right] - p[left])
        return SE3(so3.slerp(R[left], R[right], fraction), position)
