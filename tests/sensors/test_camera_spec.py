"""The stereo camera's spec: true and declared calibration kept apart."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.errors import SpecError
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import PoseSpec
from lpet_sim.sensors.camera import make_eyes, place_eyes
from lpet_sim.sensors.camera_spec import DeclaredErrorSpec, StereoCameraSpec

MOUNT = SE3.from_rpy([0.1, -0.2, 0.3], [0.3, 0.1, 1.5])


def test_without_declared_errors_the_true_calibration_is_declared() -> None:
    """No error: both calibrations are the same spec."""
    spec = StereoCameraSpec.small()
    assert spec.declared_calibration(MOUNT) == spec.true_calibration(MOUNT)


def test_declared_errors_change_the_declared_calibration_only() -> None:
    """Focal length, baseline and mount are declared wrong; the truth stays."""
    error = DeclaredErrorSpec(
        focal_scale_error=0.002, baseline_scale_error=-0.01, rotation_rad=(0.0, 0.01, 0.0)
    )
    spec = StereoCameraSpec(declared_error=error)
    true, declared = spec.true_calibration(MOUNT), spec.declared_calibration(MOUNT)
    assert true == StereoCameraSpec().true_calibration(MOUNT)
    assert declared.focal_px == pytest.approx(1.002 * 804.0)
    assert declared.baseline_m == pytest.approx(0.99 * 0.15)
    turn = (MOUNT.inverse() @ declared.T_body_camera.se3()).log()
    np.testing.assert_allclose(turn, [0, 0, 0, 0, 0.01, 0], atol=1e-9)


def test_a_disparity_bias_moves_the_right_eye_so_that_disparities_grow() -> None:
    """u_left - u_right of the true eyes exceeds the declared model by the bias."""
    spec = StereoCameraSpec(declared_error=DeclaredErrorSpec(disparity_bias_px=0.2))
    left, right = make_eyes(spec)
    assert left.cx_px - right.cx_px == pytest.approx(0.2)


def test_the_middle_of_the_image_lies_between_pixels_of_even_size() -> None:
    """Pixel (0, 0) is a centre, so the middle of 640 pixels is at 319.5."""
    assert StereoCameraSpec.small().principal_px == (319.5, 239.5)


def test_a_mount_in_the_spec_wins_over_the_rovers() -> None:
    """The spec's mount replaces the pose that the rover's model gives."""
    spec = StereoCameraSpec(mount=PoseSpec(translation_m=(1.0, 2.0, 3.0)))
    left, right = place_eyes(spec, MOUNT)
    np.testing.assert_allclose(left.translation, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(right.translation, [1.15, 2.0, 3.0])


@pytest.mark.parametrize(
    ("mapping", "sentence"),
    [
        ({"chain": {"bits": 10}}, "8 or 12"),
        ({"cx_px": 2000.0}, "principal point must lie in the image"),
        ({"ground": {"cell_m": 0.03}}, "must be 8, 16"),
        ({"focal": 500.0}, "valid keys are width_px"),
    ],
)
def test_a_wrong_spec_is_refused_with_what_is_valid(mapping: object, sentence: str) -> None:
    """The sentence names the valid values."""
    with pytest.raises(SpecError, match=sentence):
        StereoCameraSpec.from_mapping(mapping)
