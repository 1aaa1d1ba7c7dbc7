"""The wheel rig: the law's curve against slip, the table's curve read backwards, and the files."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.datasets import DataError, data_path
from lpet_sim.rig.files import WHEEL_HEADER, write_wheel_csv
from lpet_sim.rig.measured import measured_beside
from lpet_sim.rig.wheel import (
    WheelCurve,
    curve_of_table,
    run_wheel_rig,
    slip_of_scale,
    slip_scale,
    wheel_rig_spec,
)
from lpet_sim.rig.wheel_figure import plot_wheel
from lpet_sim.soil.load import load_soil, load_wheel, soil_names
from lpet_sim.soil.plain_laws import firm_slip, measured_slip
from lpet_sim.soil.slip_table import RATIO_MAX, RATIO_NODES
from lpet_sim.soil.tabulate import tabulate
from lpet_sim.soil.wheel_law import wheel_forces


def _curve(soil: str, wheel: str | None = None) -> WheelCurve:
    return run_wheel_rig(wheel_rig_spec(load_soil(soil), load_wheel(wheel) if wheel else None))


@pytest.mark.parametrize("name", soil_names())
def test_slip_never_falls_as_the_slope_grows(name: str) -> None:
    """In every soil's table for the rover's wheel, slip rises with the traction over load."""
    wheel = wheel_rig_spec(load_soil(name)).wheel
    table = tabulate(load_soil(name), wheel.bare(), wheel.load_n, wheel.gravity_mps2)
    advance = table.value[:, :, 0, 0]
    assert np.all(np.diff(advance, axis=1) <= 1e-9)
    assert advance[:, 0].min() > 1.0 > advance[:, -1].max()


def test_a_table_read_backwards_is_the_measured_curve() -> None:
    """The drawbar pull at each measured slip of GRC-1 is the tangent of the slope there."""
    soil = load_soil("grc1_loose")
    assert soil.kind == "table"
    spec = wheel_rig_spec(soil).model_copy(update={"slip": soil.slip})
    curve = run_wheel_rig(spec)
    np.testing.assert_allclose(curve.traction_angle_rad, soil.slope_rad, atol=math.radians(0.15))


def test_the_table_of_a_mechanical_soil_read_backwards_is_its_forward_law() -> None:
    """Where drawbar pull rises with slip both ways of reading agree."""
    spec = wheel_rig_spec(load_soil("lunar_simulant"), load_wheel("ishigami"))
    spec = spec.model_copy(update={"slip": (-0.3, -0.1, 0.1, 0.2, 0.3, 0.4)})
    wheel = spec.wheel
    table = tabulate(spec.soil, wheel.bare(), wheel.load_n, wheel.gravity_mps2)
    forward, backward = run_wheel_rig(spec), curve_of_table(spec, table)
    np.testing.assert_allclose(backward.drawbar_ratio, forward.drawbar_ratio, atol=0.005)
    np.testing.assert_allclose(backward.sinkage_m, forward.sinkage_m, atol=5e-4)


def test_a_locked_wheel_is_drawn_at_minus_one() -> None:
    """The scale leaves slip alone, bounds skid, and is undone by its inverse."""
    slip = np.array([-np.inf, -4.0, -1.0, 0.0, 0.3, 0.9])
    np.testing.assert_allclose(slip_scale(slip), [-1.0, -0.8, -0.5, 0.0, 0.3, 0.9])
    np.testing.assert_allclose(slip_of_scale(slip_scale(slip[1:])), slip[1:])


def test_more_load_sinks_the_wheel_deeper() -> None:
    """Load and gravity given by hand reach the law."""
    soil, wheel = load_soil("cmu_sand"), load_wheel("cmu_grouser")
    light, heavy = (run_wheel_rig(wheel_rig_spec(soil, wheel, load_n=n)) for n in (12.0, 48.0))
    both = np.isfinite(heavy.sinkage_m) & np.isfinite(light.sinkage_m)
    assert both.sum() > len(both) / 2
    assert np.all(heavy.sinkage_m[both] > light.sinkage_m[both])


def test_a_soil_that_does_not_carry_the_load_leaves_gaps(tmp_path: Path) -> None:
    """A small wheel digs to its axle in its sand at the highest slips, and only there."""
    spec = wheel_rig_spec(load_soil("cmu_sand"), load_wheel("cmu_grouser"))
    curve, wheel = run_wheel_rig(spec), spec.wheel
    soil = load_soil("cmu_sand")
    assert soil.kind == "mechanics"
    forces = wheel_forces(soil, wheel, curve.slip, 0.0, wheel.load_n, wheel.gravity_mps2)
    assert not forces.carried[-1]
    for column in (curve.drawbar_ratio, curve.torque_ratio, curve.sinkage_m):
        np.testing.assert_array_equal(np.isfinite(column), forces.carried)
    assert np.isnan(curve.side_ratio[-1])
    write_wheel_csv(curve, tmp_path / "wheel.csv")
    last = (tmp_path / "wheel.csv").read_text().splitlines()[-1]
    assert last.split(",")[2:7] == [""] * 5


@pytest.mark.parametrize("slip_angle_deg", [5.0, 15.0, 40.0])
@pytest.mark.parametrize("name", ["bedrock", "duricrust", "grc1_loose"])
def test_side_force_on_plain_ground_is_that_of_its_law_and_then_unknown(
    name: str, slip_angle_deg: float
) -> None:
    """Along the slip, as large as the law has it for the slip's length; past the friction, nan."""
    spec = wheel_rig_spec(load_soil(name), slip_angle_rad=math.radians(slip_angle_deg))
    soil, curve = spec.soil, run_wheel_rig(spec)
    assert soil.kind != "mechanics"
    known = np.isfinite(curve.side_ratio)
    assert 15 < known.sum() < len(known)
    slip, side = curve.slip[known], curve.side_ratio[known]
    advance = 1 - slip
    along = slip / np.maximum(advance, 1.0)
    across = np.minimum(advance, 1.0) * math.tan(spec.slip_angle_rad)
    length, demand = np.hypot(along, across), np.linspace(0.0, 1.0, 100_001)
    law = firm_slip(soil, demand) if soil.kind == "firm" else measured_slip(soil, demand)
    expected = np.interp(length, law, demand) * across / length
    node = 2 * RATIO_MAX / (RATIO_NODES - 1)  # a monotone curve, read between two of its nodes
    np.testing.assert_allclose(side, expected, atol=node)
    assert np.abs(np.diff(side)).max() < 0.1


def test_an_altered_copy_of_a_soil_or_a_wheel_has_no_measured_rows_beside_it() -> None:
    """Its name in the library is not enough."""
    try:
        data_path("wheel/cmu_single_wheel.csv")
    except DataError:
        pytest.skip("the measured wheel is not in the data folder")
    soil, wheel = load_soil("cmu_sand"), load_wheel("cmu_grouser")
    mine = soil.model_copy(update={"cohesion_pa": 5000.0})
    thin = wheel.model_copy(update={"width_m": 0.01})
    assert len(measured_beside(wheel_rig_spec(soil, wheel))) == 1
    assert measured_beside(wheel_rig_spec(mine, wheel)) == ()
    assert measured_beside(wheel_rig_spec(soil, thin)) == ()


def test_the_csv_of_a_wheel_has_units_and_empty_cells_where_nothing_is_known(
    tmp_path: Path,
) -> None:
    """A row for each slip, in percent, degrees and millimetres."""
    curve = _curve("grc1_loose")
    write_wheel_csv(curve, tmp_path / "wheel.csv")
    with (tmp_path / "wheel.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == WHEEL_HEADER
    assert [float(row["slip_percent"]) for row in rows] == pytest.approx(
        list(100 * curve.slip), rel=1e-5
    )
    known = np.isfinite(curve.drawbar_ratio)
    assert [row["drawbar_over_load"] != "" for row in rows] == known.tolist()
    assert 0 < known.sum() < len(known)
    angle = [float(row["traction_angle_deg"]) for row in rows if row["traction_angle_deg"]]
    np.testing.assert_allclose(np.radians(angle), curve.traction_angle_rad[known], atol=1e-5)


def test_measured_rows_stand_beside_the_wheel_that_was_measured() -> None:
    """Carnegie Mellon's wheel on its sand has rows, errors and a legend; another wheel has none."""
    try:
        data_path("wheel/cmu_single_wheel.csv")
    except DataError:
        pytest.skip("the measured wheel is not in the data folder")
    curve = _curve("cmu_sand", "cmu_grouser")
    (rows,) = measured_beside(curve.spec)
    assert rows.error.rows == len(rows.slip) == 27
    assert rows.error_driving.rows + rows.error_skidding.rows == 27
    # Published: 0.074 of drawbar pull over load at a slip of 20 % at the rim.
    near = (rows.slip > 0.2) & (rows.slip < 0.35)
    assert rows.drawbar_ratio[near].mean() == pytest.approx(0.074, abs=0.02)
    legend = plot_wheel(curve, [rows]).axes[0].get_legend()
    assert legend is not None
    assert rows.label in [text.get_text() for text in legend.get_texts()]
    assert measured_beside(wheel_rig_spec(load_soil("cmu_sand"))) == ()
