"""The declared cameras: projection, triangulation and the Jacobian."""

import numpy as np
import pytest
from pydantic import ValidationError

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import PoseSpec, StereoCalibration
from lpet_sim.rng import stream
from tests.laws.samples import numerical_jacobian


def _stereo() -> StereoCalibration:
    return StereoCalibration(
        width_px=1024,
        height_px=768,
        focal_px=804.0,
        cx_px=511.5,
        cy_px=380.0,
        baseline_m=0.15,
        T_body_camera=PoseSpec(),
    )


def _points() -> np.ndarray:
    rng = stream(1, "points")
    z = np.geomspace(0.5, 2000.0, 60)
    return np.stack([0.6 * z * rng.uniform(-1, 1, 60), 0.5 * z * rng.uniform(-1, 1, 60), z], axis=1)


def test_projection_has_its_closed_form() -> None:
    """A point 1 m right, 0.5 m down at 4 m: f/4, f/8 from the centre, disparity f b/4."""
    u_left, u_right, v = _stereo().project([1.0, 0.5, 4.0])
    np.testing.assert_allclose([u_left, v], [511.5 + 201, 380 + 100.5])
    np.testing.assert_allclose(u_left - u_right, 804 * 0.15 / 4)


def test_triangulation_inverts_projection() -> None:
    """From half a metre to the skyline, to the precision that the disparity leaves."""
    p = _points()
    back = _stereo().triangulate(_stereo().project(p))
    np.testing.assert_allclose(back, p, rtol=1e-9)


def test_projection_inverts_triangulation() -> None:
    """For any sighting with a positive disparity."""
    rng = stream(2, "sightings")
    u, v, d = rng.uniform(0, 1024, 50), rng.uniform(0, 768, 50), np.geomspace(0.1, 200, 50)
    stereo_px = np.stack([u, u - d, v], axis=1)
    back = _stereo().project(_stereo().triangulate(stereo_px))
    np.testing.assert_allclose(back, stereo_px, atol=1e-9)


def test_the_projection_jacobian_is_that_of_finite_differences() -> None:
    """At every sampled point; steps in proportion to the range."""
    stereo = _stereo()
    for p in _points()[:40]:
        step = 1e-6 * p[2]
        numerical = numerical_jacobian(stereo.project, p, step)
        scale = stereo.focal_px / p[2]
        np.testing.assert_allclose(
            stereo.projection_jacobian(p) / scale, numerical / scale, atol=1e-7
        )


def test_points_of_any_leading_shape_go_through() -> None:
    """A stack is the same as one by one."""
    p = _points()[:6].reshape(2, 3, 3)
    stereo = _stereo()
    np.testing.assert_array_equal(stereo.project(p)[1, 2], stereo.project(p[1, 2]))
    np.testing.assert_array_equal(
        stereo.projection_jacobian(p)[1, 2], stereo.projection_jacobian(p[1, 2])
    )


def test_a_pose_goes_to_its_spec_and_back() -> None:
    """Through YAML-ready numbers, to the last bits of a quaternion."""
    T = SE3.exp([1, 2, 3, 0.4, -0.5, 2.6])
    spec = PoseSpec.from_mapping(PoseSpec.from_se3(T).to_mapping())
    np.testing.assert_allclose(spec.se3().matrix(), T.matrix(), atol=1e-15)


def test_impossible_cameras_are_refused() -> None:
    """No focal length, no baseline, no pixels."""
    for field in ("focal_px", "baseline_m", "width_px"):
        with pytest.raises(ValidationError, match=field):
            StereoCalibration.model_validate(_stereo().model_dump() | {field: 0})
