"""Rotations, rigid motions and planar paths; numpy, scipy and numba only."""

from lpet_sim.geometry.se3 import SE3

__all__ = ["SE3"]
