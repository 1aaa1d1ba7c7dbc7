"""Recordings to be carried over, and how equal they come back."""

from __future__ import annotations

import numpy as np

from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import StereoImages
from tests.recording import synthetic

STREAMS = ("imu", "wheels", "odometry", "sightings")
ROUNDING = 4e-15
"""What a rotation loses on its way through a unit quaternion, and a velocity through a rotation."""


def small(bits: int = 8) -> Recording:
    """Make four seconds with every stream, with images of so many bits."""
    return synthetic.recording(4.0, seed=3, bits=bits)


def assert_same_images(read: StereoImages | None, given: StereoImages | None) -> None:
    """Hold images to be equal to the bit, and their times to the nanosecond."""
    assert read is not None
    assert given is not None
    assert read.t_ns.tolist() == given.t_ns.tolist()
    for index in range(len(given)):
        for back, sent in zip(read.pair(index), given.pair(index), strict=True):
            assert back.dtype == sent.dtype
            np.testing.assert_array_equal(back, sent)


def assert_same_measurements(read: Recording, given: Recording) -> None:
    """Hold every stream and the calibration to be equal to the bit."""
    for name in STREAMS:
        back, sent = getattr(read.measurements, name), getattr(given.measurements, name)
        assert back.equals(sent), name
    assert read.measurements.calibration == given.measurements.calibration
    assert_same_images(read.measurements.images, given.measurements.images)


def assert_same_truth(read: Recording, given: Recording, rounding: float) -> None:
    """Hold the truth to be equal to the bit, rotations and velocities to a rounding."""
    assert read.truth is not None
    assert given.truth is not None
    back, sent = read.truth, given.truth
    assert back.events == sent.events
    assert back.wheels is not None
    assert sent.wheels is not None
    assert back.wheels.equals(sent.wheels)
    exact = {"t_ns": back.body.t_ns, "omega": back.body.omega_body_radps}
    assert exact["t_ns"].tobytes() == sent.body.t_ns.tobytes()
    assert exact["omega"].tobytes() == sent.body.omega_body_radps.tobytes()
    poses, true = back.body.T_world_body, sent.body.T_world_body
    assert poses.translation.tobytes() == true.translation.tobytes()
    np.testing.assert_allclose(poses.rotation, true.rotation, rtol=0, atol=rounding)
    np.testing.assert_allclose(
        back.body.v_world_body_mps, sent.body.v_world_body_mps, rtol=0, atol=rounding
    )
