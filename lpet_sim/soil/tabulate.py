"""From a soil to the slip table of a wheel on it, whatever way the soil is known."""

from __future__ import annotations

from functools import lru_cache

from lpet_sim.soil.mechanics_table import mechanics_table
from lpet_sim.soil.plain_laws import firm_table, measured_table
from lpet_sim.soil.slip_table import SlipTable
from lpet_sim.soil.spec import FirmSoilSpec, MeasuredSoilSpec, SoilSpec, WheelSpec


@lru_cache(maxsize=64)
def tabulate(
    soil: SoilSpec, wheel: WheelSpec, nominal_load_n: float, gravity_mps2: float
) -> SlipTable:
    """Tabulate what a wheel does on a soil; each table is made once for each process.

    Args:
        soil: The soil.
        wheel: The wheel; it matters to a soil known by its mechanics only.
        nominal_load_n: Middle of the table's load axis [N].
        gravity_mps2: Gravity, which the weight of soil in Reece's law and beside the wheel needs.
    """
    if isinstance(soil, FirmSoilSpec):
        return firm_table(soil, nominal_load_n)
    if isinstance(soil, MeasuredSoilSpec):
        return measured_table(soil, nominal_load_n)
    return mechanics_table(soil, wheel, nominal_load_n, gravity_mps2)
