"""Fused odometry knows how wrong it is: NEES over Monte-Carlo runs of its own model."""

from __future__ import annotations

import dataclasses
import functools
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import chi2

from estimators.fused_odometry import FusedOdometry
from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import Calibration, ImuCalibration, WheelCalibration
from lpet_sim.recording.streams import Measurements
from lpet_sim.rng import stream
from lpet_sim.sensors.imu import Imu, ImuSpec
from tests.estimators.traverses import (
    GRAVITY_MPS2,
    MOUNT,
    calibration,
    noisy_drive,
    wheel_calibration,
)

RUNS = 60
VERTICAL_SIGMA_M_RTM = FusedOdometry().spec.vertical_sigma_m_rtm
BLOCKS = {"position": slice(0, 3), "attitude": slice(3, 6), "pose": slice(0, 6)}

MATCHED = ImuSpec().model_copy(
    update={
        "gyro_random_walk_radps_rthz": (1.13e-5,) * 3,
        "gyro_bias_walk_radps_rts": (4e-9,) * 3,
        "gyro_scale_sigma": 0.0,
        "accel_random_walk_mps2_rthz": (1e-4,) * 3,
        "accel_bias_walk_mps2_rts": (8e-7,) * 3,
        "accel_quantum_mps": (1.4e-3,) * 3,
        "accel_jitter_mps": (4e-4,) * 3,
        "accel_scale_sigma": 0.0,
        "misalignment_sigma_rad": 0.0,
    }
)
"""A unit with only the errors that the filter models, equal on all axes."""


def told(declared: Calibration, factor: float) -> Calibration:
    """Declare every noise of the drive larger or smaller than it is."""
    imu, wheels = declared.imu, declared.wheels
    assert isinstance(imu, ImuCalibration)
    assert isinstance(wheels, WheelCalibration)
    noises = {
        name: factor * getattr(imu, name)
        for name in ImuCalibration.model_fields
        if name.startswith(("gyro", "accel"))
    }
    sigmas = {
        name: factor * getattr(wheels, name)
        for name in WheelCalibration.model_fields
        if "sigma" in name
    }
    update = {
        "imu": imu.model_copy(update=noises),
        "wheels": wheels.model_copy(update=sigmas),
    }
    return declared.model_copy(update=update)


def estimator(factor: float) -> FusedOdometry:
    """Make the filter, its own noises scaled likewise."""
    names = ("vertical_sigma_m_rtm", "gyro_bias_walk_radps_rts", "accel_bias_walk_mps2_rts")
    spec = FusedOdometry().spec
    scaled = {n: factor * getattr(spec, n) for n in names}
    # The synthetic rover stands as still as a rock.
    return FusedOdometry(spec.model_copy(update=scaled | {"rest_turn_sigma_radps": 0.0}))


@functools.cache
def sensed(seed: int) -> tuple[SE3, Measurements]:
    """Drive and sense once; give the last true pose and the rightly declared measurements."""
    drive = noisy_drive(stream(seed, "drive"), wheel_calibration(), VERTICAL_SIGMA_M_RTM)
    imu = Imu(MATCHED, MOUNT, GRAVITY_MPS2, stream(seed, "imu")).sense(drive.body)
    declared = calibration(drive.body.T_world_body[0], imu=MATCHED.declared(MOUNT, 100.0))
    return drive.body.T_world_body[-1], Measurements(declared, imu=imu, wheels=drive.wheels)


def final_errors(seed: int, factor: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give the error of the last pose, Shape (6,), and its covariance, Shape (6, 6)."""
    T_true, true = sensed(seed)
    measurements = dataclasses.replace(true, calibration=told(true.calibration, factor))
    estimate = estimator(factor).estimate(measurements)
    assert estimate.covariance is not None
    T_est = estimate.trajectory.T_world_body[-1]
    return (T_est.inverse() @ T_true).log(), estimate.covariance[-1]


def anees(factor: float) -> dict[str, float]:
    """Give the average NEES of each block over the runs."""
    runs = [final_errors(seed, factor) for seed in range(RUNS)]
    return {
        name: float(
            np.mean([xi[rows] @ np.linalg.solve(P[rows, rows], xi[rows]) for xi, P in runs])
        )
        for name, rows in BLOCKS.items()
    }


def band(dof: int) -> tuple[float, float]:
    """Give the two-sided 99 % band of the average NEES."""
    low, high = chi2.ppf([0.005, 0.995], RUNS * dof) / RUNS
    return float(low), float(high)


def test_the_filter_that_is_told_the_truth_is_consistent() -> None:
    """Position, attitude and pose inside the two-sided chi-square band."""
    found = anees(1.0)
    for name, rows in BLOCKS.items():
        low, high = band(rows.stop - rows.start)
        assert low < found[name] < high, f"{name}: {found[name]:.2f} not in {low:.2f}-{high:.2f}"


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_the_filter_that_is_told_half_or_twice_the_noise_is_not(factor: float) -> None:
    """Negative control: the same test on a filter told wrongly fails in every block."""
    found = anees(factor)
    for name, rows in BLOCKS.items():
        low, high = band(rows.stop - rows.start)
        assert not low < found[name] < high
        assert math.copysign(1, found[name] - high) == (1 if factor < 1 else -1)
