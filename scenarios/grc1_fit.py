"""Loose GRC-1 fitted to the slope and slip of NASA's MGRU3 up to 20 deg, and each point left out.

    python -m scenarios.grc1_fit [--quick] [--out docs/results]

Prints the table and the fitted values, as they stand in ``lpet_sim/soil/library/grc1_fitted.yaml``,
and writes ``grc1_fit.csv`` and ``grc1_fit.md``. ``--quick`` shows the soil of the library as it is,
without fitting.
"""

from __future__ import annotations

import argparse
import csv
import math
from pathlib import Path
from typing import Any, Final

import numpy as np

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.recording.arrays import Array
from lpet_sim.soil.fit import Climb, climb, fit_soil, left_out
from lpet_sim.soil.load import load_soil, load_wheel
from lpet_sim.soil.spec import MeasuredSoilSpec, MechanicalSoilSpec

COMMAND: Final = "python -m scenarios.grc1_fit"
FITTED: Final = 5  # points up to 20 deg
TOLERANCE: Final = np.array([0.02, 0.02, 0.02, 0.08, 0.08])
"""Points of slip to claim: near 15 deg the tests of two years differ by 8."""

Row = dict[str, Any]


def measured() -> tuple[Array, Array]:
    """Give slopes [rad] and slips of the measured table."""
    soil = load_soil("grc1_loose")
    assert isinstance(soil, MeasuredSoilSpec)
    return np.array(soil.slope_rad), np.array(soil.slip)


def library_soil() -> MechanicalSoilSpec:
    """Give the fitted soil as it stands in the library."""
    soil = load_soil("grc1_fitted")
    assert isinstance(soil, MechanicalSoilSpec)
    return soil


def table(soil: MechanicalSoilSpec, without: Climb | None) -> list[Row]:
    """Set the soil's slip beside the measured one, and beside that of the fits to other points."""
    slope, slip = measured()
    found = climb(soil, load_wheel("mgru3"), slope)
    rows = []
    for i in range(slope.size):
        row = {
            "slope_deg": round(math.degrees(slope[i]), 2),
            "slip_measured_percent": round(100 * slip[i], 2),
            "slip_fitted_percent": _percent(found, i),
            "greatest_traction_deg": round(math.degrees(math.atan(found.most[i])), 2),
            "tolerance_points": round(100 * TOLERANCE[i]) if i < FITTED else "",
            "slip_left_out_percent": _percent(without, i) if without and i < FITTED else "",
        }
        rows.append(row)
    return rows


def _percent(found: Climb, i: int) -> float | str:
    """Give a slip in percent, or say that there is none at which the slope is climbed."""
    return round(100 * float(found.slip[i]), 2) if found.climbs[i] else "cannot climb"


def markdown(rows: list[Row], soil: MechanicalSoilSpec, quick: bool) -> str:
    """Write the table with the error of every point, the fitted values and the command."""
    lines = [
        "# Loose GRC-1, fitted",
        "",
        f"`{COMMAND}{' --quick' if quick else ''}`; wheel `mgru3` on axles loaded as those of the "
        "tilt bed's rover, Earth gravity; fitted to the points up to 20 deg. Left out: the slip "
        "that a fit to the other points up to 20 deg predicts.",
        "",
        "| slope [deg] | measured [%] | fitted [%] | error [points] | to claim | left out [%] "
        "| its error |",
        "|---|---|---|---|---|---|---|",
        *(_line(row) for row in rows),
        "",
        f"Fitted: phi {math.degrees(soil.friction_rad):.1f} deg (bound: 30 or more), "
        f"K {1e3 * soil.shear_modulus_x_m:.2f} mm, k {getattr(soil.pressure, 'k', math.nan):.4g} "
        f"N/m^(n+2), b1 {soil.rear_angle_slip:.3f}. Greatest traction: that of a slope of "
        f"{rows[-1]['greatest_traction_deg']:.1f} deg at the load on the steepest.",
    ]
    return "\n".join(lines) + "\n"


def _line(row: Row) -> str:
    was = row["slip_measured_percent"]
    fitted, left = row["slip_fitted_percent"], row["slip_left_out_percent"]
    cells = [row["slope_deg"], was, fitted, _error(fitted, was), row["tolerance_points"]]
    return "| " + " | ".join(str(x) for x in [*cells, left, _error(left, was)]) + " |"


def _error(found: float | str, was: float) -> str:
    if found == "":
        return ""
    return f"over {100 - was:+.1f}" if isinstance(found, str) else f"{found - was:+.1f}"


def write(rows: list[Row], text: str, folder: Path) -> None:
    """Write both files."""
    output_folder(folder)
    with whole_file(folder / "grc1_fit.csv") as path, path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    with whole_file(folder / "grc1_fit.md") as path:
        path.write_text(text)
    print(text)
    for name in ("grc1_fit.csv", "grc1_fit.md"):
        print(f"wrote {folder / name}")


def main() -> None:
    """Fit, or with ``--quick`` take the library's fit; print and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="show the library's soil, fit nothing")
    parser.add_argument("--out", type=Path, default=Path("out/grc1_fit"))
    options = parser.parse_args()
    soil, without = library_soil(), None
    if not options.quick:
        slope, slip = (column[:FITTED] for column in measured())
        wheel = load_wheel("mgru3")
        fitted = fit_soil(soil, wheel, slope, slip, TOLERANCE)
        print(f"fitted: {fitted.values}; greatest error over tolerance {fitted.greatest:.2f}")
        without = left_out(soil, wheel, slope, slip, TOLERANCE)
        soil = fitted.soil
    write(table(soil, without), markdown(table(soil, without), soil, options.quick), options.out)


if __name__ == "__main__":
    main()
