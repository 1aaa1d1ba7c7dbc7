"""The prediction of Carnegie Mellon's single-wheel rows, nothing fitted."""

from __future__ import annotations

import numpy as np
import pytest

from lpet_sim.datasets import data_path
from lpet_sim.errors import LpetError
from lpet_sim.soil.load import load_soil, load_wheel
from lpet_sim.soil.measured_wheels import (
    MeasuredWheel,
    WheelName,
    measured_wheel,
    prediction_error,
    straight,
)
from lpet_sim.soil.spec import MechanicalSoilSpec

NAMES: tuple[WheelName, ...] = ("smooth", "grouser")


def rows_of(name: WheelName) -> MeasuredWheel:
    """Read a wheel's rows, or skip where the real data are absent."""
    try:
        data_path("wheel/cmu_single_wheel.csv")
    except LpetError as error:
        pytest.skip(str(error))
    return measured_wheel(name)


def sand(name: str = "cmu_sand") -> MechanicalSoilSpec:
    """Load the soil of the testbed, or another."""
    soil = load_soil(name)
    assert isinstance(soil, MechanicalSoilSpec)
    return soil


def test_the_rows_are_those_that_were_published() -> None:
    """Their number, and drawbar pull over load at no slip: -0.055 for both wheels."""
    assert sum(rows_of(name).slip.size for name in NAMES) == 378
    for name in NAMES:
        rows = straight(rows_of(name))
        rows = rows.only(np.abs(rows.slip) < 0.01)
        assert np.mean(rows.drawbar_n / rows.load_n) == pytest.approx(-0.055, abs=0.005)
        assert np.mean(rows.load_n) == pytest.approx(24.0, abs=1.0)


@pytest.mark.parametrize(
    ("name", "driving", "skidding"),
    [("smooth", (0.078, 13.5), (0.274, 5.6)), ("grouser", (0.088, 4.4), (0.286, 4.0))],
)
def test_the_prediction_is_as_far_off_as_it_is_said_to_be(
    name: WheelName, driving: tuple[float, float], skidding: tuple[float, float]
) -> None:
    """RMS of drawbar pull over load and of sinkage [mm], driving and skidding."""
    rows = straight(rows_of(name))
    wheel = load_wheel(f"cmu_{name}")
    for part, (drawbar, depth_mm) in (
        (rows.driving, driving),
        (~rows.driving, skidding),
    ):
        error = prediction_error(rows.only(part), sand(), wheel)
        assert error.drawbar_ratio == pytest.approx(drawbar, abs=5e-4)
        assert 1e3 * error.sinkage_m == pytest.approx(depth_mm, abs=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_another_soil_predicts_worse(name: WheelName) -> None:
    """Mars regolith in place of the testbed's sand: sinkage and pull are further off."""
    rows, wheel = straight(rows_of(name)), load_wheel(f"cmu_{name}")
    ours = prediction_error(rows, sand(), wheel)
    other = prediction_error(rows, sand("mars_regolith"), wheel)
    assert other.drawbar_ratio > 1.5 * ours.drawbar_ratio
    assert other.sinkage_m > 1.2 * ours.sinkage_m


@pytest.mark.parametrize(
    ("name", "sides"), [("smooth", (0.049, 0.106, 0.171)), ("grouser", (0.036, 0.055, 0.102))]
)
def test_side_force_is_as_far_off_as_it_is_said_to_be(
    name: WheelName, sides: tuple[float, ...]
) -> None:
    """RMS of side force over load, driving at slip angles of 15, 30 and 45 deg."""
    rows = rows_of(name)
    for angle_deg, side in zip((15.0, 30.0, 45.0), sides, strict=True):
        near = np.isclose(rows.slip_angle_rad, np.radians(angle_deg)) & rows.driving
        error = prediction_error(rows.only(near), sand(), load_wheel(f"cmu_{name}"))
        assert error.side_ratio == pytest.approx(side, abs=1e-3)
