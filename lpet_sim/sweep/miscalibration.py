"""A recording as it would be with a wrong declared calibration, without rendering it again."""

from __future__ import annotations

from dataclasses import replace

from lpet_sim.errors import RecordingError
from lpet_sim.recording.streams import Measurements
from lpet_sim.sensors.camera_spec import DeclaredErrorSpec


def miscalibrate(measurements: Measurements, error: DeclaredErrorSpec) -> Measurements:
    """Put errors of the declared calibration into measurements that were taken with a true one.

    A disparity bias shifts every sighting's ``u_right`` by its negative; focal length and baseline
    are scaled in the declared calibration. The images are left out, for they are not re-rendered.

    Args:
        measurements: Taken with a true declared calibration, with sightings.
        error: What shall be wrong; its rotation must be zero.

    Returns:
        The same measurements as a rover of wrong calibration would hold them.

    Raises:
        RecordingError: There is no stereo calibration, or there are no sightings.
    """
    measurements.require("sightings")
    stereo, sightings = measurements.calibration.stereo, measurements.sightings
    if stereo is None or sightings is None:
        raise RecordingError("the recording declares no stereo camera; give one that does")
    if any(error.rotation_rad):
        raise ValueError("a wrong mount is not put in afterwards; simulate it")
    stereo_px = sightings.stereo_px.copy()
    stereo_px[:, 1] -= error.disparity_bias_px
    wrong = stereo.model_copy(
        update={
            "focal_px": stereo.focal_px * (1 + error.focal_scale_error),
            "baseline_m": stereo.baseline_m * (1 + error.baseline_scale_error),
        }
    )
    return replace(
        measurements,
        calibration=measurements.calibration.model_copy(update={"stereo": wrong}),
        sightings=replace(sightings, stereo_px=stereo_px),
        images=None,
    )
