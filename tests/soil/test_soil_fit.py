"""The fit of loose GRC-1, and the fit itself on a curve of known parameters."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.soil import fit
from lpet_sim.soil.fit import climb, fit_soil, with_values
from lpet_sim.soil.load import load_soil, load_wheel
from lpet_sim.soil.spec import MechanicalSoilSpec
from lpet_sim.soil.wheel_law import wheel_forces

TABLE = Path(__file__).parents[2] / "docs" / "results" / "grc1_fit.csv"
FITTED = 5


def fitted_soil() -> MechanicalSoilSpec:
    """Load the library's fitted soil."""
    soil = load_soil("grc1_fitted")
    assert isinstance(soil, MechanicalSoilSpec)
    return soil


def committed() -> list[dict[str, str]]:
    """Read the committed table of the fit."""
    return list(csv.DictReader(TABLE.read_text().splitlines()))


def test_the_librarys_soil_gives_the_committed_table() -> None:
    """Slip at every slope that it climbs, to the second decimal; the others it cannot climb."""
    rows = committed()
    slope = np.radians([float(row["slope_deg"]) for row in rows])
    measured = load_soil("grc1_loose")
    found = climb(fitted_soil(), load_wheel("mgru3"), np.array(measured.slope_rad))  # type: ignore[union-attr]
    np.testing.assert_allclose(slope, measured.slope_rad, atol=1e-4)  # type: ignore[union-attr]
    for row, slip, climbs in zip(rows, found.slip, found.climbs, strict=True):
        assert climbs == (row["slip_fitted_percent"] != "cannot climb")
        if climbs:
            assert 100 * slip == pytest.approx(float(row["slip_fitted_percent"]), abs=0.01)


def test_the_fit_keeps_its_promise_up_to_20_deg() -> None:
    """Within 2 points up to 10 deg and 8 at 15 and 20; left out, each point is further off."""
    for row in committed()[:FITTED]:
        measured = float(row["slip_measured_percent"])
        error = abs(float(row["slip_fitted_percent"]) - measured)
        assert error <= float(row["tolerance_points"])
        left = row["slip_left_out_percent"]
        without = 100.0 if left == "cannot climb" else float(left)
        assert abs(without - measured) >= error - 0.05


def test_a_climbing_rover_pulls_what_the_slope_asks() -> None:
    """At the slip that is found, all axles pull ``tan(slope)`` of their load together."""
    slope, wheel = np.radians([0.0, 5.0, 12.0, 18.0]), load_wheel("mgru3")
    slip = climb(fitted_soil(), wheel, slope).slip[:, None]
    load = fit.axle_shares(slope) * (wheel.load_n * np.cos(slope))[:, None]
    pull = wheel_forces(fitted_soil(), wheel, slip, 0.0, load, wheel.gravity_mps2).drawbar_n
    np.testing.assert_allclose(pull.sum(1) / load.sum(1), np.tan(slope), atol=0.003)


def test_the_fit_finds_the_soil_that_made_a_curve(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a start some way off it comes back to within a tenth of a point of slip."""
    monkeypatch.setattr(fit, "STARTS", ((math.radians(33.0),), (8e-3,), (6e5,), (-0.3,)))
    wheel, slope = load_wheel("mgru3"), np.radians([0.0, 4.0, 8.0, 12.0, 16.0, 20.0])
    values = {
        "friction_rad": math.radians(35.0),
        "shear_modulus_m": 0.012,
        "pressure_k": 9e5,
        "rear_angle_slip": -0.2,
    }
    slip = climb(with_values(fitted_soil(), values), wheel, slope).slip
    found = fit_soil(fitted_soil(), wheel, slope, slip, np.full(slope.size, 0.01))
    np.testing.assert_allclose(climb(found.soil, wheel, slope).slip, slip, atol=1e-3)
