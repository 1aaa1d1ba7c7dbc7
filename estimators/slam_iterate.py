"""Linearising sightings where they lead, for steps that odometry got wrong."""

from __future__ import annotations

from dataclasses import replace

from estimators import gaussian_blocks
from estimators.slam_state import SlamState
from estimators.slam_values import Innovations
from lpet_sim.errors import BrokenFilterError
from lpet_sim.recording.arrays import Array

Mean = tuple[Array, Array, Array, Array, Array, Array]


def relinearised(
    state: SlamState, known: Innovations, believed: Innovations, rounds: int
) -> Innovations:
    """Give the innovations of known landmarks with derivatives at the pose they lead to.

    ``dx_i+1 = K_i (z - h(x_i) + H_i dx_i)``, an iterated filter: the innovations that come back
    belong to the estimate as it is, which is not changed. Where the way leads nowhere, innovations
    come back as they were.

    Args:
        state: The filter's.
        known: All sightings of landmarks in the map.
        believed: Those of them that lead the way.
        rounds: Iterations.

    Reference:
        Bell and Cathey (1993), The iterated Kalman filter update as a Gauss-Newton method
        [recalled].
    """
    start, there = _mean(state), known
    try:
        for _ in range(rounds):
            joint = state.joint(believed)
            dx = joint.HP.T @ gaussian_blocks.solved(joint.L, believed.r.ravel())
            state.retract(dx)
            believed = state.innovations(believed.slots, believed.z, believed.variance)
            believed = replace(believed, r=believed.r + believed.moved_by(dx))
            there = state.innovations(known.slots, known.z, known.variance)
            there = replace(there, r=there.r + there.moved_by(dx))
            _restore(state, start)
        gaussian_blocks.square_root(state.joint(there).S)
    except BrokenFilterError:
        # They lead nowhere: to where their derivatives are no more than rounding.
        return known
    return there


def _mean(state: SlamState) -> Mean:
    """Give a copy of the estimate without its covariance."""
    m = state.landmarks
    hosts = m.R_world_host.copy(), m.p_world_host.copy()
    return state.R, state.p, state.lasting, m.x.copy(), *hosts


def _restore(state: SlamState, mean: Mean) -> None:
    """Put an estimate back that `_mean` gave, for the same slots."""
    m = state.landmarks
    state.R, state.p, state.lasting, m.x[:], m.R_world_host[:], m.p_world_host[:] = mean
