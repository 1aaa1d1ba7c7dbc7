"""Telling by vision whether odometry slipped."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimators import gaussian, gaussian_blocks, slam_gate
from estimators.slam_map import POSE
from estimators.slam_state import SlamState
from estimators.slam_values import Innovations, Joint
from lpet_sim.recording.arrays import Array

Bools = NDArray[np.bool_]


def moves(state: SlamState, seen: Innovations) -> Array:
    """Give how unit right perturbations of the pose move the predictions, Shape (3 m, 6)."""
    moved = seen.moved_by(state.directions(np.eye(POSE)))
    return np.ascontiguousarray(moved.reshape(POSE, -1).T)


def agreeing(seen: Innovations, moves: Array, S: Array, sizes: Array, threshold: float) -> Bools:
    """Tell which sightings agree with one another, whatever odometry says.

    The pose is free to within a slip, so that a slip does not part them and a wrong name does not
    join them.

    Args:
        seen: Sightings of landmarks in the map.
        moves: As `moves` gives them.
        S: Covariance of the innovations, Shape (3 m, 3 m).
        sizes: Error of the pose [m, rad] in a slip, 1 sigma, Shape (6,).
        threshold: Gate of the consensus: chi-square of three degrees of freedom.
    """
    together = np.empty(len(seen))
    free = S + gaussian.of_noise(moves, sizes**2)
    slam_gate.consensus(free, seen.r, threshold, together)
    return np.asarray(together > 0)


def contradiction(seen: Innovations, moves: Array, joint: Joint, agree: Bools) -> float:
    """Tell how much sightings that agree with one another contradict odometry, by a score test.

    Would any move of the pose make them likelier under the noise that odometry declares? A slip
    that leaves most sightings within their gates, because the landmarks are far or little known,
    shows in their sum.

    Returns:
        A chi-square of six degrees of freedom if odometry is right.

    Reference:
        Rao (1948), Large sample tests of statistical hypotheses [recalled].
    """
    rows = np.repeat(agree, 3)
    return gaussian_blocks.score_square(joint.take(agree).L, moves[rows], seen.r[agree].ravel())
