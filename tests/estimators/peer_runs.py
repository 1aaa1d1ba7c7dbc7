"""Short recordings with odometry for the peers, from the traverse of 100 m."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements, OdometryStream, SightingStream
from lpet_sim.rng import stream
from tests.estimators.stereo_traverse import measurements, scene, sightings

SIGMA = np.array([0.01, 0.005, 0.005, 0.01, 0.01, 0.005])
"""White noise of a motion, each part of xi [m, rad]."""


def odometry(seed: int, images: int, noise: float = 1.0) -> OdometryStream:
    """Give the true motion from image to image with white noise as declared, times a factor."""
    poses = scene(images).T_world_body
    true = (poses[:-1].inverse() @ poses[1:]).log()
    twist, variance = np.zeros((images, 6)), np.zeros((images, 6))
    drawn = stream(seed, "odometry").standard_normal(true.shape)
    twist[1:], variance[1:] = true + noise * SIGMA * drawn, SIGMA**2
    return OdometryStream(sightings(0, images).t_ns, twist, variance, np.zeros((images, 6)))


def recorded(seed: int, images: int, noise: float = 1.0) -> Measurements:
    """Give sightings and odometry; noise 0 makes both exact."""
    seen = sightings(seed, images, 0.5 * noise)
    return replace(measurements(seen), odometry=odometry(seed, images, noise))


def kept(rows: SightingStream, keep: Array) -> SightingStream:
    """Keep some sightings."""
    return rows.chosen(keep)


def sight_only(given: Measurements, keep: Array) -> Measurements:
    """Take away all sightings but some."""
    assert given.sightings is not None
    return replace(given, sightings=kept(given.sightings, keep))


def error(run: Estimate) -> Array:
    """Give the right perturbations of the poses, Shape (n, 6)."""
    poses = run.trajectory.T_world_body
    return np.asarray((poses.inverse() @ scene(len(poses)).T_world_body).log())
