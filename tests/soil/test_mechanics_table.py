"""The table of a soil known by its mechanics is the inverse of the forward law."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from lpet_sim.recording.arrays import Array
from lpet_sim.soil.load import load_soil
from lpet_sim.soil.mechanics_table import BACKWARDS, DROP_RATIO, mechanics_table
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    SIDE_CREEP,
    SINKAGE,
    TORQUE,
    SlipTable,
    load_nodes,
    side_ratios,
    traction_ratios,
)
from lpet_sim.soil.spec import MechanicalSoilSpec, WheelSpec
from lpet_sim.soil.tabulate import tabulate
from lpet_sim.soil.wheel_law import wheel_forces

WHEEL = WheelSpec(radius_m=0.1425, width_m=0.12)
LOAD_N = 192.0
MARS_MPS2 = 3.71
SOILS = ("lunar_simulant", "mars_regolith", "mars_sand")
NOMINAL = LOAD_NODES // 2


def soil_of(name: str) -> MechanicalSoilSpec:
    """Load a soil that is known by its mechanics."""
    soil = load_soil(name)
    assert isinstance(soil, MechanicalSoilSpec)
    return soil


def table_of(name: str) -> SlipTable:
    """Tabulate a soil under a wheel of an ExoMars-class rover."""
    return tabulate(soil_of(name), WHEEL, LOAD_N, MARS_MPS2)


def looked_up(table: SlipTable, traction: Array, side: Array, load: int = NOMINAL) -> Array:
    """Read the table between its nodes of force, Shape (n, 4)."""
    read = RegularGridInterpolator((traction_ratios(), side_ratios()), table.value[load])
    return np.asarray(read(np.stack([traction, side], axis=-1)))


@pytest.mark.parametrize("name", SOILS)
@pytest.mark.parametrize("load", [0, NOMINAL, LOAD_NODES - 1])
def test_the_table_gives_back_the_slip_that_made_the_traction(name: str, load: int) -> None:
    """Forward law, then table, at loads of a quarter, one and four times the nominal."""
    slip = np.array([-0.4, -0.2, -0.1, 0.0, 0.04, 0.12])
    newtons = load_nodes(LOAD_N)[load]
    forces = wheel_forces(soil_of(name), WHEEL, slip, 0.0, newtons, MARS_MPS2)
    traction = forces.drawbar_n / newtons
    found = looked_up(table_of(name), traction, np.zeros_like(slip), load)
    np.testing.assert_allclose(found[:, ADVANCE], 1 - slip, atol=0.004)
    np.testing.assert_allclose(found[:, SINKAGE], forces.sinkage_m, atol=2e-4)
    torque = forces.torque_nm / (newtons * WHEEL.radius_m)
    np.testing.assert_allclose(found[:, TORQUE], torque, atol=0.004)
    np.testing.assert_allclose(found[:, SIDE_CREEP], 0.0, atol=1e-12)


@pytest.mark.parametrize("name", SOILS)
def test_the_table_gives_back_the_creep_that_made_the_side_force(name: str) -> None:
    """Slip and creep at once, driven and braked."""
    slip, creep = (x.ravel() for x in np.meshgrid([-0.3, 0.0, 0.1], [0.03, 0.08, 0.15]))
    forces = wheel_forces(soil_of(name), WHEEL, slip, creep, LOAD_N, MARS_MPS2)
    found = looked_up(table_of(name), forces.drawbar_n / LOAD_N, -forces.side_n / LOAD_N)
    np.testing.assert_allclose(found[:, ADVANCE], 1 - slip, atol=0.015)
    np.testing.assert_allclose(found[:, SIDE_CREEP], creep, atol=0.015)


@pytest.mark.parametrize("name", SOILS)
def test_beyond_the_most_the_wheel_stands_then_slides_back(name: str) -> None:
    """Past the greatest traction the advance is 0 within the drop, and lowest at the limit."""
    slip = np.linspace(0.0, 1.0, 201)
    forces = wheel_forces(soil_of(name), WHEEL, slip, 0.0, LOAD_N, MARS_MPS2)
    most, table = forces.drawbar_n.max() / LOAD_N, table_of(name)
    limit = table.friction[NOMINAL]
    asked = np.array([most - 0.01, most + DROP_RATIO + 0.01, limit + 0.01])
    advance = looked_up(table, asked, np.zeros(3))[:, ADVANCE]
    assert advance[0] > 0 > advance[1] > advance[2]
    assert advance[2] == pytest.approx(-BACKWARDS)
    assert limit > most


@pytest.mark.parametrize("name", SOILS)
def test_a_wheel_that_digs_in_is_as_deep_as_the_law_says(name: str) -> None:
    """Sliding back, its sinkage is that of a wheel that spins on the spot."""
    spinning = wheel_forces(soil_of(name), WHEEL, 1.0, 0.0, LOAD_N, MARS_MPS2)
    deep = looked_up(table_of(name), np.array([0.6]), np.zeros(1))[0, SINKAGE]
    assert deep == pytest.approx(float(spinning.sinkage_m), rel=1e-6)


@pytest.mark.parametrize("modulus", [1e3, 3e4])
def test_a_soil_that_does_not_carry_the_wheel_still_gives_a_sane_table(modulus: float) -> None:
    """Under all loads or some: finite, slip rises with traction, sunk to the axle at most."""
    pressure = {"kind": "modulus", "k": modulus}
    mud = MechanicalSoilSpec.model_validate(
        soil_of("cmu_sand").model_dump() | {"pressure": pressure}
    )
    carried = wheel_forces(mud, WHEEL, 0.2, 0.0, load_nodes(LOAD_N), MARS_MPS2).carried
    assert not carried[-1]
    table = mechanics_table(mud, WHEEL, LOAD_N, MARS_MPS2)
    assert np.isfinite(table.value).all() and np.isfinite(table.friction).all()
    assert (np.diff(table.value[..., ADVANCE], axis=1) <= 1e-9).all()
    sinkage = table.value[..., SINKAGE]
    assert sinkage.min() >= 0.0 and sinkage.max() <= WHEEL.radius_m * (1 + 1e-12)
    assert (table.friction > 0.0).all()
