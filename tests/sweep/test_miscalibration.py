"""A wrong declared calibration put into measurements does to them what the geometry says."""

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.streams import Measurements, SightingStream
from lpet_sim.sensors.camera_spec import DeclaredErrorSpec
from lpet_sim.sweep.miscalibration import miscalibrate

STEREO = StereoCalibration(
    width_px=640,
    height_px=480,
    focal_px=500.0,
    cx_px=320.0,
    cy_px=240.0,
    baseline_m=0.15,
    T_body_camera=PoseSpec(),
)
POINTS = np.array([[0.3, -0.2, 2.0], [-1.0, 0.4, 5.0], [2.0, 1.0, 9.0]])


def _measured() -> Measurements:
    sightings = SightingStream(
        np.array([0]), np.array([0, 3]), np.arange(3), STEREO.project(POINTS), np.full(3, 0.5)
    )
    return Measurements(Calibration(stereo=STEREO), sightings=sightings)


def _ranges(measurements: Measurements) -> np.ndarray:
    assert measurements.sightings is not None and measurements.calibration.stereo is not None
    return measurements.calibration.stereo.triangulate(measurements.sightings.stereo_px)[:, 2]


def test_a_disparity_bias_brings_points_nearer_by_the_closed_form() -> None:
    """Z' = f b / (d + bias)."""
    wrong = miscalibrate(_measured(), DeclaredErrorSpec(disparity_bias_px=0.2))
    disparity = STEREO.focal_px * STEREO.baseline_m / POINTS[:, 2]
    expected = STEREO.focal_px * STEREO.baseline_m / (disparity + 0.2)
    np.testing.assert_allclose(_ranges(wrong), expected, rtol=1e-12)


def test_a_focal_error_scales_every_range() -> None:
    """Z' = (1 + e) z."""
    wrong = miscalibrate(_measured(), DeclaredErrorSpec(focal_scale_error=0.002))
    np.testing.assert_allclose(_ranges(wrong), 1.002 * POINTS[:, 2], rtol=1e-12)


def test_no_error_changes_nothing() -> None:
    """The measurements stay as they are, and the given ones are not touched."""
    given = _measured()
    same = miscalibrate(given, DeclaredErrorSpec())
    assert same.sightings is not None and given.sightings is not None
    assert same.sightings.equals(given.sightings)
    assert same.calibration == given.calibration


def test_measurements_without_sightings_are_refused() -> None:
    """There is nothing to shift."""
    with pytest.raises(RecordingError, match="no stream 'sightings'"):
        miscalibrate(Measurements(Calibration(stereo=STEREO)), DeclaredErrorSpec())
