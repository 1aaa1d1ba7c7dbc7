"""The static prediction is the Cramer-Rao bound of its own drive, and keeps its laws."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lpet_sim.evaluation.bounds import end_bound
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array
from lpet_sim.recording.streams import OdometryStream, SightingStream
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.grades import imu_grade
from lpet_sim.tradeoff.static import chained, predict
from lpet_sim.tradeoff.static_kernels import derivatives
from lpet_sim.tradeoff.static_view import View, camera_row
from tests.finite_difference import assert_jacobian
from tests.tradeoff.tradeoffs import SENSOR, small_setting

CERTAIN: dict[str, Any] = {
    "site": {"standstill_s": 0.0, "slips_per_m": 0.0, "landmarks": {"detection_probability": 1.0}},
    "static": {"memory_images": 1000, "tilt_share": 0.0},
}


def rms_m(candidate: Candidate = SENSOR, **more: Any) -> float:
    """Predict the position error on a small site [m]."""
    return predict(candidate, small_setting(**more)).position_rms_m


def test_the_derivatives_are_those_of_the_projection() -> None:
    """By the landmark's place, and by the right perturbation of the body's pose."""
    calibration = SENSOR.calibration(0.3)
    pose = SE3.from_rpy([0.05, -0.08, 0.4], [1.0, 2.0, 0.3])
    mount, p = calibration.T_body_camera.se3(), np.array([4.0, 4.5, 0.1])

    def seen(x: Array) -> Array:
        moved = (pose @ SE3.exp(x[3:]) @ mount).inverse()
        return np.asarray(calibration.project(moved @ (p + x[:3])))

    G, J = np.empty((3, 3)), np.empty((3, 6))
    body = np.array(pose.rotation), np.array(pose.translation)
    eye = np.array(mount.rotation), np.array(mount.translation)
    derivatives(p, *body, *eye, camera_row(calibration), G, J)
    assert_jacobian(seen, np.zeros(9), np.hstack([G, J]), tolerance=1e-5)


def as_streams(view: View) -> tuple[SightingStream, dict[int, Array], OdometryStream]:
    """Write what a view has seen, without noise, as streams of a recording."""
    calibration, poses = view.calibration, view.T_world_body
    T_world_camera = poses @ calibration.T_body_camera.se3()
    station, i = np.nonzero(view.shown)
    p_camera = [
        T_world_camera[int(k)].inverse() @ view.world.p_world[n]
        for k, n in zip(station, i, strict=True)
    ]
    count = len(poses)
    t_ns = np.round(poses.translation[:, 0] / (100 / 3600) * NS_PER_S).astype(np.int64)
    offsets = np.concatenate([[0], np.cumsum(view.shown.sum(axis=1))]).astype(np.int64)
    sigma = np.full(len(i), SENSOR.matching_sigma_px)
    px = calibration.project(np.array(p_camera))
    sightings = SightingStream(t_ns, offsets, i.astype(np.int64), px, sigma)
    step_m = float(poses.translation[1, 0])
    walk = imu_grade(SENSOR.imu).spec.declared(SE3.identity(), 100.0).gyro_random_walk_radps_rthz
    moved = np.array([0.05, 0.02, 0.02]) ** 2 * step_m
    turned = np.full(3, walk**2 * step_m / (100 / 3600))
    variance = np.tile(np.concatenate([moved, turned]), (count, 1))
    twist = np.concatenate([np.zeros((1, 6)), (poses[:-1].inverse() @ poses[1:]).log()])
    scale = np.tile([0.03, 0, 0, 0, 0, 0], (count, 1))
    known = {int(n): view.world.p_world[n] for n in np.unique(i)}
    return sightings, known, OdometryStream(t_ns, twist, variance, scale)


def test_the_prediction_is_the_bound_of_the_same_drive() -> None:
    """All poses at once here, one image after the other there: the same covariance."""
    setting = small_setting(**CERTAIN)
    view = View.of(SENSOR, setting)
    sightings, known, odometry = as_streams(view)
    bias = imu_grade(SENSOR.imu).spec.gyro_bias_radps
    told = (view.T_world_body, sightings, view.calibration, odometry, known, bias)
    expected = end_bound(*told).covariance
    found = view.end_covariance()
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert view.shown.sum(axis=1).min() > 5
    np.testing.assert_allclose(found / scale, expected / scale, atol=1e-3)


def test_images_taken_together_tell_as_much_as_one_by_one() -> None:
    """Five images in one against each on its own: within a tenth."""
    fine = SENSOR.model_copy(update={"image_interval_m": 0.05})
    alone = rms_m(fine, static={"lump_m": 0.01})
    assert rms_m(fine, static={"lump_m": 0.25}) == pytest.approx(alone, rel=0.1)


@pytest.mark.parametrize(
    ("better", "least"),
    [
        ({"matching_sigma_px": 0.25}, 1.3),
        ({"baseline_m": 0.4}, 1.05),
        ({"image_interval_m": 0.1}, 1.2),
        ({"imu": "navigation"}, 1.0),
    ],
)
def test_a_better_sensor_is_predicted_to_be_better(better: dict[str, Any], least: float) -> None:
    """Finer matching, a longer baseline, more images, a better gyro."""
    finer = SENSOR.model_copy(update=better)
    assert rms_m(SENSOR.model_copy(update={"imu": "tactical_mems"})) >= least * rms_m(finer)


def test_a_shorter_memory_tells_less() -> None:
    """Far landmarks that leave the view when the rover tilts, and come back as new ones."""
    rough = {"site": {"terrain": {"relief": {"rms_slope_rad": 0.2}, "far": None}}}
    narrow = SENSOR.model_copy(update={"field_of_view_rad": 0.7, "depression_rad": 0.3})
    short, long = (rms_m(narrow, **rough, static={"memory_images": n}) for n in (1, 1000))
    assert short > 1.001 * long


def test_slips_cost_accuracy() -> None:
    """A step believed to within its length tells next to nothing."""
    assert rms_m(site={"slips_per_m": 2.0}) > 1.01 * rms_m(site={"slips_per_m": 0.0})


def test_errors_of_stretches_chain_as_a_random_walk() -> None:
    """Position errors add in quadrature; a yaw error is carried over what is left of the way."""
    yaw, side = 1e-3, 2e-2
    covariance = np.diag([0.0, side**2, 0.0, 0.0, 0.0, yaw**2])
    found = chained(covariance, 10.0, 3)
    assert found[5, 5] == pytest.approx(3 * yaw**2)
    assert found[1, 1] == pytest.approx(3 * side**2 + yaw**2 * (20.0**2 + 10.0**2))


def test_a_blind_sensor_is_left_with_its_odometry() -> None:
    """Straight up there is nothing to see: the scale of the wheels alone costs 3 %."""
    blind = SENSOR.model_copy(update={"depression_rad": -0.5, "field_of_view_rad": 0.3})
    found = predict(blind, small_setting())
    assert found.sightings == 0
    assert found.error_ratio > 0.03
