"""What the slip table of every soil of the library must keep, whatever way the soil is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lpet_sim.soil.load import load_soil, soil_names
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    RATIO_NODES,
    SIDE_CREEP,
    SIDE_NODES,
    SINKAGE,
    TORQUE,
    SlipTable,
    side_ratios,
    traction_ratios,
)
from lpet_sim.soil.spec import FirmSoilSpec, WheelSpec
from lpet_sim.soil.tabulate import tabulate

WHEEL = WheelSpec(radius_m=0.1425, width_m=0.12)
LOAD_N = 192.0
MARS_MPS2 = 3.71


def table_of(name: str) -> SlipTable:
    """Tabulate a soil under a wheel of an ExoMars-class rover."""
    return tabulate(load_soil(name), WHEEL, LOAD_N, MARS_MPS2)


@pytest.mark.parametrize("name", soil_names())
def test_slip_is_monotone_in_traction(name: str) -> None:
    """At every load and side force, more traction gives less advance; all numbers are finite."""
    value = table_of(name).value
    assert value.shape == (LOAD_NODES, RATIO_NODES, SIDE_NODES, 4)
    assert np.isfinite(value).all()
    assert np.diff(value[..., ADVANCE], axis=1).max() <= 1e-9
    at_rest = np.interp(0.0, traction_ratios(), value[LOAD_NODES // 2, :, 0, ADVANCE])
    steep = np.interp(0.45, traction_ratios(), value[LOAD_NODES // 2, :, 0, ADVANCE])
    assert steep < at_rest - 0.03


@pytest.mark.parametrize("name", soil_names())
def test_torque_pays_for_traction(name: str) -> None:
    """As far as friction reaches, ``M omega >= T v``; nothing is sunk in above the ground."""
    table = table_of(name)
    loss = table.value[..., TORQUE] - traction_ratios()[:, None] * table.value[..., ADVANCE]
    asked = np.hypot(traction_ratios()[:, None], side_ratios())
    assert loss[asked <= table.friction[:, None, None]].min() >= -1e-9
    assert table.value[..., SINKAGE].min() >= 0.0
    assert table.value[..., SINKAGE].max() <= WHEEL.radius_m + 1e-9


@pytest.mark.parametrize("name", soil_names())
def test_a_side_force_makes_a_wheel_creep(name: str) -> None:
    """None without a force, and on a cross slope of 5, 10 and 15 deg more with each."""
    creep = table_of(name).value[LOAD_NODES // 2, RATIO_NODES // 2, :, SIDE_CREEP]
    slopes = np.tan(np.radians([0.0, 5.0, 10.0, 15.0]))
    assert creep[0] == pytest.approx(0.0, abs=1e-9)
    assert (np.diff(np.interp(slopes, side_ratios(), creep)) > 0).all()


def test_flat_ground_of_the_exomars_preset_costs_a_few_percent() -> None:
    """Crust costs under 1 % on the flat, drift 2 to 6 %, and 10 deg of drift about a fifth."""
    curves = {
        name: table_of(name).value[LOAD_NODES // 2, :, 0, ADVANCE]
        for name in ("duricrust", "mars_regolith")
    }
    assert isinstance(load_soil("duricrust"), FirmSoilSpec)
    assert 1 - np.interp(0.0, traction_ratios(), curves["duricrust"]) < 0.01
    assert 0.02 < 1 - np.interp(0.0, traction_ratios(), curves["mars_regolith"]) < 0.06
    uphill = math.tan(math.radians(10.0))
    slip = 1 - np.interp(uphill, traction_ratios(), curves["mars_regolith"])
    assert slip == pytest.approx(0.2, abs=0.05)
