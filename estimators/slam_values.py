"""What goes into the SLAM filter at each image: a step of odometry, and innovations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from estimators import gaussian_blocks, slam_gate
from lpet_sim.recording.arrays import Array, Ints


@dataclass
class Innovations:
    """Sightings of known landmarks against their prediction.

    Attributes:
        slots: Which landmarks, Shape (m,).
        rows: First row in the state of each landmark and of its keyframe, -1 if it has none.
        z: The sightings [px], Shape (m, 3).
        r: Seen minus predicted [px], Shape (m, 3).
        H: Derivatives by the pose's error; by the keyframe's it is -H, Shape (m, 3, 6).
        G: Derivatives by the landmark's own, Shape (m, 3, 3).
        variance: Of each image coordinate [px^2], Shape (m,).
    """

    slots: Ints
    rows: tuple[Ints, Ints]
    z: Array
    r: Array
    H: Array
    G: Array
    variance: Array

    def __len__(self) -> int:
        return len(self.slots)

    def take(self, which: NDArray[np.bool_]) -> Innovations:
        """Keep some of them."""
        if which.all():
            return self
        rows = self.rows[0][which], self.rows[1][which]
        values = (a[which] for a in (self.z, self.r, self.H, self.G, self.variance))
        return Innovations(self.slots[which], rows, *values)

    def moved_by(self, dx: Array) -> Array:
        """Give how corrections of the state, Shape (..., n), move the predictions, (..., m, 3)."""
        out = np.empty((*dx.shape[:-1], len(self), 3))
        slam_gate.moved(
            self.rows, self.H, self.G, dx.reshape(-1, dx.shape[-1]), out.reshape(-1, len(self), 3)
        )
        return out


@dataclass
class Joint:
    """The covariances of stacked innovations.

    Attributes:
        HP: With the state, Shape (3 m, n).
        S: Among themselves, Shape (3 m, 3 m).
    """

    HP: Array
    S: Array

    @cached_property
    def L(self) -> Array:
        """The lower Cholesky factor of S."""
        return gaussian_blocks.square_root(self.S)

    def take(self, which: NDArray[np.bool_]) -> Joint:
        """Keep some sightings, given by a mask of Shape (m,)."""
        if which.all():
            return self
        rows = np.flatnonzero(np.repeat(which, 3))
        return Joint(self.HP[rows], self.S[rows[:, None], rows])


@dataclass(frozen=True)
class Step:
    """The motion to an image by odometry, and what is unsure of its right perturbation.

    Attributes:
        twist: ``log(T_prev_curr)``, Shape (6,).
        noise: What unit noises do, Shape (k, 6).
        lasting: What the lasting errors do: turning at 1 rad/s about x, y, z, and scale, by one
            standard deviation, Shape (4, 6).
        drift_px: Random walk of sightings of a landmark with the distance [px/sqrt(m)].
        held: Whether there was no odometry, and the step is held to be like the one before it.
    """

    twist: Array
    noise: Array
    lasting: Array
    drift_px: float = 0.0
    held: bool = False
