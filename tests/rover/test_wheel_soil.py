"""The tabulated law by itself: its lookup against the tables that it was made of."""

import numpy as np
import pytest

from lpet_sim.errors import SpecError
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.rover.wheel_contact import law_on
from lpet_sim.rover.wheel_soil import TabulatedLaw, WheelResponse, WheelSoilSpec, WheelState
from lpet_sim.soil.load import load_soil
from lpet_sim.soil.slip_table import (
    ADVANCE,
    LOAD_NODES,
    LOAD_SPAN,
    SIDE_CREEP,
    SINKAGE,
    TORQUE,
    SlipTable,
    load_nodes,
    side_ratios,
    traction_ratios,
)
from lpet_sim.soil.spec import WheelSpec
from lpet_sim.soil.tabulate import tabulate
from tests.rover.grounds import Waves, of_soil

LOAD_N = 200.0
RADIUS_M = 0.1425


def _plain(scale: float) -> SlipTable:
    """Make a table that is linear in every axis, so that its lookup is exact."""
    u = np.arange(LOAD_NODES)[:, None, None]
    x, y = traction_ratios()[None, :, None], side_ratios()[None, None, :]
    value = np.stack([scale * q + 0.1 * u + q * x + 0.2 * y for q in range(1, 5)], axis=-1)
    return SlipTable(LOAD_N, value, 0.5 + 0.05 * np.arange(LOAD_NODES))


def _respond(law: TabulatedLaw, **forces: object) -> WheelResponse:
    state, response = WheelState.of(6), WheelResponse.of(6)
    state.omega_radps[:] = 0.3
    for name, values in forces.items():
        getattr(state, name)[:] = values
    law.respond(state, response)
    return response


def test_the_lookup_is_exact_where_the_table_is_linear() -> None:
    """Forces between the nodes, both signs of the side force, two soils and a rock."""
    law = TabulatedLaw([_plain(1.0), _plain(2.0)], _plain(3.0), RADIUS_M)
    load = LOAD_N * 4.0 ** np.array([-1.0, -0.5, 0.0, 0.25, 0.5, 1.0])
    x = np.array([-0.7, -0.2, 0.0, 0.013, 0.3, 0.9])
    y = np.array([0.1, -0.1, 0.0, 0.4, -0.4, 0.77])
    soil, rock = np.array([0, 1, 0, 1, 0, 1]), np.array([0, 0, 1, 0, 0, 1], dtype=bool)
    got = _respond(law, traction_n=x * load, side_n=y * load, load_n=load, soil=soil, on_rock=rock)
    middle = (LOAD_NODES - 1) / 2
    u = middle + np.log(load / LOAD_N) / np.log(LOAD_SPAN) * middle
    scale = np.where(rock, 3.0, soil + 1.0)
    value = [scale * q + 0.1 * u + q * x + 0.2 * np.abs(y) for q in range(1, 5)]
    np.testing.assert_allclose(1 - got.slip, value[ADVANCE], atol=2e-6)
    side = -np.copysign(value[SIDE_CREEP], y)
    np.testing.assert_allclose(got.side_creep, side, atol=2e-6)
    np.testing.assert_allclose(got.sinkage_m, value[SINKAGE], atol=2e-6)
    np.testing.assert_allclose(got.torque_nm, value[TORQUE] * load * RADIUS_M, rtol=1e-6)
    np.testing.assert_allclose(got.friction, 0.5 + 0.05 * u, atol=1e-12)
    np.testing.assert_allclose(got.slip_steepness, 1.0, rtol=1e-3)
    np.testing.assert_allclose(got.side_steepness, 0.2, rtol=1e-3)


def test_beyond_the_table_its_ends_hold() -> None:
    """More force or load than the axes have, and a wheel in the air, give finite ends."""
    table = _plain(1.0)
    law = TabulatedLaw([table], table, RADIUS_M)
    load = np.array([0.0, 1.0, LOAD_N, LOAD_N, 1e5, 1e5])
    got = _respond(law, traction_n=1e6, side_n=-1e6, load_n=load)
    ends = table.value[[0, 0, LOAD_NODES // 2, LOAD_NODES // 2, -1, -1], -1, -1]
    np.testing.assert_allclose(1 - got.slip, ends[:, ADVANCE], atol=2e-6)
    np.testing.assert_allclose(got.side_creep, ends[:, SIDE_CREEP], atol=2e-6)


def test_a_wheel_that_stands_is_as_deep_as_its_load_presses_it() -> None:
    """Whatever forces it holds against, its depth is that without them, and grows with load."""
    law = law_on(Waves(spec=of_soil("mars_sand")), RoverSpec())
    load = load_nodes(LOAD_N)[:6]
    free = _respond(law, load_n=load)
    state = {"omega_radps": 0.0, "traction_n": 0.3 * load, "side_n": 0.2 * load, "load_n": load}
    braced = _respond(law, **state)
    np.testing.assert_array_equal(braced.sinkage_m, free.sinkage_m)
    assert np.all(np.diff(free.sinkage_m) > 0)


def test_the_law_of_another_wheel_is_read_at_loads_in_proportion() -> None:
    """With a test load, equal forces over load give equal slip; sinkage goes with the radius."""
    ground = Waves(spec=of_soil("mars_sand"))
    wheel = WheelSpec(radius_m=0.285, width_m=0.24)
    spec = WheelSoilSpec(wheel=wheel, law_load_n=400.0, law_gravity_mps2=9.81)
    law = law_on(ground, RoverSpec(wheel_soil=spec))
    share = 310 * 3.721 / 6
    got = _respond(law, traction_n=0.1 * share, load_n=share)
    own = _respond(law_on(ground, RoverSpec()), traction_n=0.1 * share, load_n=share)
    table = tabulate(load_soil("mars_sand"), wheel, 400.0, 9.81)
    at = np.interp(0.1, traction_ratios(), table.value[LOAD_NODES // 2, :, 0, SINKAGE])
    np.testing.assert_allclose(got.sinkage_m, 0.5 * at, rtol=1e-3)
    assert got.slip[0] != own.slip[0]


def test_tables_of_different_loads_are_refused() -> None:
    """They could not be stacked."""
    other = SlipTable(100.0, _plain(1.0).value, _plain(1.0).friction)
    with pytest.raises(SpecError, match="all must have one"):
        TabulatedLaw([_plain(1.0)], other, RADIUS_M)
