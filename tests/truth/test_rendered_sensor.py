"""The landmark sensor stands for a camera: measured on rendered images, it is as accurate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from estimators.frame_to_frame import FrameToFrame
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import SightingStream
from lpet_sim.sweep.calibrate import calibrate_sensor
from lpet_sim.sweep.sensing import sense_recording
from lpet_sim.sweep.traverse import ImagesSpec
from tests.truth.drives import driven_once, traverse_spec

FACTOR = 2.0
"""The landmark sensor has neither the memory nor the tails of real noise, and its landmarks are
further away than those that a front end prefers."""


def step_errors(recording: Recording, sightings: SightingStream) -> Array:
    """Give the root mean square error of a step of frame-to-frame motion [m, rad], Shape (2,)."""
    assert recording.truth is not None
    # Without wheels, and without images that are not looked at again.
    given = replace(recording.measurements, sightings=sightings, wheels=None, images=None)
    found = FrameToFrame().estimate(given).trajectory
    true = recording.truth.trajectory.at(found.t_ns)
    step, true_step = (T[:-1].inverse() @ T[1:] for T in (found.T_world_body, true))
    off = (step.inverse() @ true_step).log()
    return np.sqrt([np.mean(off[:, :3] ** 2), np.mean(off[:, 3:] ** 2)])


def test_a_sensor_measured_on_rendered_images_is_as_accurate_as_they_are(
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    """Steps between images are off by as much, within a factor of two, for each of three seeds."""
    spec = traverse_spec(images=ImagesSpec(period_s=1.6))
    recording = read_recording(driven_once(tmp_path_factory, spec, 1, "seen"))
    assert recording.measurements.sightings is not None
    rendered = step_errors(recording, recording.measurements.sightings)
    found = calibrate_sensor(recording)
    for seed in range(3):
        sensed = step_errors(recording, sense_recording(recording, found.spec, seed))
        assert np.all(sensed < FACTOR * rendered)
        assert np.all(sensed > rendered / FACTOR)
