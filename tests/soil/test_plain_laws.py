"""The slip tables of measured soil and firm ground against their curves and against physics."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from lpet_sim.recording.arrays import Array
from lpet_sim.soil.load import load_soil
from lpet_sim.soil.plain_laws import SKID_MAX, SLIP_MAX, firm_slip, measured_slip
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    RATIO_NODES,
    SIDE_CREEP,
    SIDE_NODES,
    SINKAGE,
    TORQUE,
    SlipTable,
    load_nodes,
    side_ratios,
    traction_ratios,
)
from lpet_sim.soil.spec import FirmSoilSpec, MeasuredSoilSpec, WheelSpec
from lpet_sim.soil.tabulate import tabulate

PLAIN = ["grc1_loose", "duricrust", "bedrock", "rock"]
LOAD_N = 170.0


def table_of(name: str) -> SlipTable:
    """Tabulate a plain soil of the library."""
    return tabulate(load_soil(name), WheelSpec(radius_m=0.2, width_m=0.1), LOAD_N, 3.71)


def looked_up(table: SlipTable, traction: Array, side: Array) -> Array:
    """Interpolate a table at its nominal load, Shape (n,), (n,) -> (n, 4)."""
    axes = (load_nodes(table.nominal_load_n), traction_ratios(), side_ratios())
    load = np.full_like(traction, table.nominal_load_n)
    return np.asarray(RegularGridInterpolator(axes, table.value)((load, traction, side)))


def grc1() -> MeasuredSoilSpec:
    """Give the measured soil of the library."""
    soil = load_soil("grc1_loose")
    assert isinstance(soil, MeasuredSoilSpec)
    return soil


@pytest.mark.parametrize("name", PLAIN)
def test_a_table_has_the_axes_of_all_tables(name: str) -> None:
    """So that those of several soils can be stacked."""
    table = table_of(name)
    assert table.value.shape == (LOAD_NODES, RATIO_NODES, SIDE_NODES, 4)
    assert table.friction.shape == (LOAD_NODES,)
    assert np.isfinite(table.value).all()
    assert (np.diff(table.value, axis=0) == 0).all()


def test_a_measured_soil_gives_back_what_was_measured() -> None:
    """The table's own points within 0.2 of a point, the lines between them within 0.3."""
    soil = grc1()
    slopes = np.array(soil.slope_rad)
    got = 1 - looked_up(table_of("grc1_loose"), np.tan(slopes), np.zeros(7))[:, ADVANCE]
    assert got == pytest.approx(soil.slip, abs=0.002)
    traction = np.linspace(-0.08, 0.6, 2000)
    got = 1 - looked_up(table_of("grc1_loose"), traction, np.zeros(2000))[:, ADVANCE]
    exact = measured_slip(soil, traction + soil.rolling_resistance)
    assert got == pytest.approx(exact, abs=0.003)


def test_a_measured_soil_goes_on_with_its_last_steepness() -> None:
    """Beyond the last point slip passes 1, a wheel that slides back, and ends at its most."""
    soil = grc1()
    last = math.tan(soil.slope_rad[-1]) + soil.rolling_resistance
    slip = measured_slip(soil, np.array([last, last + 0.1, last + 0.2, 9.0]))
    assert slip[2] - slip[1] == pytest.approx(slip[1] - slip[0])
    assert slip[0] == pytest.approx(soil.slip[-1])
    assert slip[2] > 1.0
    assert slip[3] == SLIP_MAX


def test_firm_ground_inverts_its_law() -> None:
    """The traction of a slip gives that slip, and the stiffness is the law's slope at 0."""
    soil = load_soil("bedrock")
    assert isinstance(soil, FirmSoilSpec)
    slip = np.linspace(0.0, 0.5, 50)
    demand = soil.friction * (1 - np.exp(-soil.slip_stiffness * slip / soil.friction))
    assert firm_slip(soil, demand) == pytest.approx(slip, abs=1e-9)
    assert 1e-6 / firm_slip(soil, np.array([1e-6]))[0] == pytest.approx(
        soil.slip_stiffness, rel=1e-5
    )


def test_on_the_hardest_ground_a_wheel_slips_only_beyond_friction() -> None:
    """As stiff as a soil may be: hardly any slip below it, all of it there, and no number lost."""
    hard = FirmSoilSpec(
        name="hard", evidence="assumed", source="none", friction=0.8, slip_stiffness=1000.0
    )
    found = firm_slip(hard, np.array([0.0, 0.5, 0.8, 1.0]))
    assert found[0] == 0.0
    assert found[1] == pytest.approx(8e-4 * np.log(8 / 3), rel=1e-12)
    assert found[2:].tolist() == [SLIP_MAX, SLIP_MAX]


def test_bedrock_stays_below_the_slip_seen_on_mars() -> None:
    """Under 10 % at 20 deg, and crust slips more than bedrock, rock less, sand most."""
    slip = [
        1 - looked_up(table_of(name), np.array([math.tan(math.radians(20.0))]), np.zeros(1))[0, 0]
        for name in ("rock", "bedrock", "duricrust", "grc1_loose")
    ]
    assert slip[1] < 0.10
    assert slip == sorted(slip)


@pytest.mark.parametrize("name", PLAIN)
def test_slip_rises_with_what_is_asked_of_the_soil(name: str) -> None:
    """More traction, less advance; more side force, more creep, as far as friction reaches."""
    table = table_of(name)
    value = table.value[LOAD_NODES // 2]
    reached = np.hypot(traction_ratios()[:, None], side_ratios()) <= table.friction[0]
    assert (np.diff(value[..., ADVANCE], axis=0) <= 1e-12).all()
    assert (np.diff(value[..., SIDE_CREEP], axis=1)[reached[:, 1:]] > 0).all()
    assert value[..., ADVANCE].min() >= 1 - SLIP_MAX - 1e-9
    assert value[..., ADVANCE].max() <= 1 / (1 - SKID_MAX) + 1e-9
    assert (value[:, 0, SIDE_CREEP] == 0).all()


@pytest.mark.parametrize("name", PLAIN)
def test_no_wheel_gives_more_than_its_motor_puts_in(name: str) -> None:
    """Torque times rate less traction times speed is never below 0, braking included."""
    value = table_of(name).value[LOAD_NODES // 2]
    loss = value[..., TORQUE] - traction_ratios()[:, None] * value[..., ADVANCE]
    assert loss.min() >= -1e-12
    assert (value[..., SINKAGE] == 0).all()


@pytest.mark.parametrize("name", PLAIN)
def test_a_braked_wheel_skids_as_a_driven_one_slips(name: str) -> None:
    """About the demand of no slip, ``1 - 1 / advance`` below is minus the slip above."""
    soil = load_soil(name)
    assert isinstance(soil, FirmSoilSpec | MeasuredSoilSpec)
    off = np.linspace(0.0, 0.2, 30)
    none = np.zeros(30)
    driven = looked_up(table_of(name), off - soil.rolling_resistance, none)[:, ADVANCE]
    braked = looked_up(table_of(name), -off - soil.rolling_resistance, none)[:, ADVANCE]
    assert 1 / braked - 1 == pytest.approx(driven - 1, abs=0.003)


def test_a_measured_sinkage_is_kept() -> None:
    """Depth is that of the points, and constant beyond them."""
    depth = tuple(np.linspace(0.01, 0.07, 7))
    soil = grc1().model_copy(update={"sinkage_m": depth})
    table = tabulate(soil, WheelSpec(radius_m=0.2, width_m=0.1), LOAD_N, 3.71)
    asked = np.array([-0.086, *np.tan(soil.slope_rad), 0.9])
    got = looked_up(table, asked, np.zeros(9))[:, SINKAGE]
    assert got == pytest.approx([depth[0], *depth, depth[-1]], abs=2e-4)
