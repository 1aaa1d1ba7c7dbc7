"""With every error switched off, the errors that are left are nought."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from estimators import build_estimator
from lpet_sim.evaluation.errors import ErrorSeries, error_series
from lpet_sim.recording.overlay import add_sightings
from lpet_sim.recording.reader import read_measurements, read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import SightingStream
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.terrain import build_terrain
from tests.truth.drives import driven_once, traverse_spec, with_perfect_sensors
from tests.truth.exact_sightings import exact_sightings, landmarks_around

SEED = 1
IMAGE_EVERY = 160  # samples at 100 Hz: 8 cm


@pytest.fixture(scope="session")
def perfect(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the recording of a drive whose sensors have no errors."""
    spec = with_perfect_sensors(traverse_spec())
    return driven_once(tmp_path_factory, spec, SEED, "perfect")


def sightings_of(recording: Recording) -> SightingStream:
    """Make exact sightings of what lies around the path, by the declared calibration."""
    assert recording.truth is not None and recording.measurements.calibration.stereo is not None
    spec = TraverseSpec.from_mapping(recording.manifest.specs["traverse"])
    body = recording.truth.body
    landmarks_m = landmarks_around(build_terrain(spec.terrain, SEED), body.T_world_body.translation)
    stereo = recording.measurements.calibration.stereo
    return exact_sightings(landmarks_m, body, stereo, IMAGE_EVERY)


def errors_of(name: str, path: Path) -> ErrorSeries:
    """Run an estimator on a file and compare with the truth in it."""
    estimate = build_estimator(name).estimate(read_measurements(path))
    truth = read_recording(path).truth
    assert truth is not None
    return error_series(estimate.trajectory, truth.trajectory)


def test_visual_motion_from_exact_sightings_ends_at_zero(perfect: Path, tmp_path: Path) -> None:
    """Points of the ground, projected from the true poses, lead back to the true poses."""
    sighted = tmp_path / "sighted.rrd"
    stream = sightings_of(read_recording(perfect))
    assert np.diff(stream.offsets).min() >= 50
    add_sightings(perfect, stream, sighted)
    errors = errors_of("frame_to_frame", sighted)
    assert errors.distance_m[-1] > 3.5
    assert np.abs(errors.position_error_m).max() < 1e-6
    assert np.abs(errors.attitude_error_rad).max() < 1e-6


def test_visual_motion_from_sightings_a_tenth_of_a_pixel_off_does_not_end_at_zero(
    perfect: Path, tmp_path: Path
) -> None:
    """A disparity that is off by 0.1 px breaks the limits that exact sightings keep."""
    sighted = tmp_path / "sighted.rrd"
    stream = sightings_of(read_recording(perfect))
    off_px = stream.stereo_px + np.array([0.1, 0.0, 0.0])
    parts = (stream.t_ns, stream.offsets, stream.landmark_id, off_px, stream.sigma_px)
    add_sightings(perfect, SightingStream(*parts), sighted)
    assert np.abs(errors_of("frame_to_frame", sighted).position_error_m).max() > 1e-3


def test_a_perfect_inertial_unit_keeps_the_attitude(perfect: Path) -> None:
    """Increments of a true rotation, summed, are the true rotation."""
    assert np.abs(errors_of("fused_odometry", perfect).attitude_error_rad).max() < 1e-9


def test_perfect_encoders_read_the_angles_that_physics_turned(perfect: Path) -> None:
    """Without errors the encoders' stream is the truth's own arrays."""
    truth, measurements = read_recording(perfect).truth, read_measurements(perfect)
    assert truth is not None and truth.wheels is not None and measurements.wheels is not None
    assert np.array_equal(measurements.wheels.drive_angle_rad, truth.wheels.drive_angle_rad)
    assert np.array_equal(measurements.wheels.steer_angle_rad, truth.wheels.steer_angle_rad)
