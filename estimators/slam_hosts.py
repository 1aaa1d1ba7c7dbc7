"""The landmarks of the SLAM filter as their host cameras see them, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from estimators.observation import push
from estimators.slam_kernels import homogeneous, numbers_of
from lpet_sim.recording.arrays import Array


@njit(cache=True)
def in_hosts(
    camera: Array, numbers: tuple[Array, Array, Array], alive: Array, P: Array, out: Array
) -> None:
    """Give disparity and summed variance of what host cameras see of their landmarks, in place.

    Args:
        camera: `observation.camera_vector`.
        numbers: As in `linearise`.
        alive: 1 where there is a landmark, Shape (c,).
        P: Covariance of the state, Shape (6 + 3 c, 6 + 3 c).
        out: Takes both [px, px^2], Shape (2, c), 0 where there is no landmark.
    """
    out[:] = 0.0
    D = np.empty((3, 3))
    for s in np.flatnonzero(alive):
        point, basis = homogeneous(camera, numbers[2][s], numbers[0][s])
        out[0, s] = camera[0] * camera[3] * point[3] / point[2]
        for k in range(3):
            D[k, 0], D[k, 1], D[k, 2] = push(camera, point, basis[k])
        cov = np.ascontiguousarray(P[6 + 3 * s : 9 + 3 * s, 6 + 3 * s : 9 + 3 * s])
        out[1, s] = np.trace(D.T @ cov @ D)


@njit(cache=True)
def by_sighting(camera: Array, x: Array, far: Array, alive: Array, out: Array) -> None:
    """Give the derivatives of landmarks' numbers by what their host cameras see, in place.

    Args:
        camera: `observation.camera_vector`.
        x: The three numbers of each, Shape (c, 3).
        far: 1 where they are image coordinates, Shape (c,).
        alive: 1 where there is a landmark, Shape (c,).
        out: Takes the derivatives, Shape (c, 3, 3), 0 where there is no landmark.
    """
    out[:] = 0.0
    z, place = np.empty(3), np.empty(3)
    focal, cx, cy, b = camera
    for s in np.flatnonzero(alive):
        z[:] = x[s]
        if far[s] == 0.0:
            z[0] = cx + focal * x[s, 0] / x[s, 2]
            z[1] = z[0] - focal * b / x[s, 2]
            z[2] = cy + focal * x[s, 1] / x[s, 2]
        numbers_of(camera, far[s], z, place, out[s])
