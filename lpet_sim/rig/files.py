"""The rigs' results as CSV: one row for a point, units in the header.

``slip`` is ``1 - v / (r omega)`` everywhere; ``slip_or_skid`` is ``r omega / v - 1`` below 0.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from lpet_sim.outputs import whole_file
from lpet_sim.rig.slope import SlopeReport
from lpet_sim.rig.slope_point import SlopePoint
from lpet_sim.rig.wheel import WheelCurve, slip_scale
from lpet_sim.rover.model_spec import wheel_names

Cell = str | float | None

_PER_WHEEL = ("slip_percent", "load_N", "traction_over_load", "sinkage_mm")
_SLOPE_HEADER = (
    "heading",
    "slope_deg",
    "ended",
    "slip_percent",
    "slip_std_percent",
    "drift_deg",
    "turned_deg",
    "sinkage_mm",
    "rolled_m",
)
WHEEL_HEADER = (
    "slip_percent",
    "slip_or_skid_percent",
    "drawbar_over_load",
    "traction_angle_deg",
    "sinkage_mm",
    "torque_over_load_radius",
    "side_force_over_load",
    "side_slip_angle_deg",
)


def slope_header(wheels: Sequence[str]) -> tuple[str, ...]:
    """Name the columns of a slope rig's points, for a rover with these wheels."""
    each = (f"{wheel}_{quantity}" for quantity in _PER_WHEEL for wheel in wheels)
    return (*_SLOPE_HEADER, *each)


def write_slope_csv(report: SlopeReport, path: Path) -> None:
    """Write the points of a slope rig.

    Raises:
        OutputError: The file cannot be written.
    """
    header = slope_header(wheel_names(report.spec.rover.model))
    _write(path, header, (_slope_row(point) for point in report.points))


def write_wheel_csv(curve: WheelCurve, path: Path) -> None:
    """Write the curve of a wheel rig.

    Raises:
        OutputError: The file cannot be written.
    """
    _write(path, WHEEL_HEADER, _wheel_rows(curve))


def _slope_row(point: SlopePoint) -> list[Cell]:
    sinkage_mm = [1e3 * depth for depth in point.wheel_sinkage_m]
    return [
        point.heading,
        math.degrees(point.slope_rad),
        point.ended,
        100 * point.slip,
        None if point.slip_std is None else 100 * point.slip_std,
        math.degrees(point.drift_rad),
        math.degrees(point.turned_rad),
        1e3 * point.sinkage_m,
        point.rolled_m,
        *(100 * slip for slip in point.wheel_slip),
        *point.wheel_load_n,
        *point.wheel_traction,
        *sinkage_mm,
    ]


def _wheel_rows(curve: WheelCurve) -> Iterable[list[Cell]]:
    columns = np.column_stack(
        [
            100 * curve.slip,
            100 * slip_scale(curve.slip),
            curve.drawbar_ratio,
            np.degrees(curve.traction_angle_rad),
            1e3 * curve.sinkage_m,
            curve.torque_ratio,
            curve.side_ratio,
            np.full(len(curve.slip), math.degrees(curve.spec.slip_angle_rad)),
        ]
    )
    return (row for row in columns.tolist())


def _write(path: Path, header: Sequence[str], rows: Iterable[Sequence[Cell]]) -> None:
    with whole_file(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows([_text(cell) for cell in row] for row in rows)


def _text(cell: Cell) -> str:
    """Give a number with six digits; one that is not known gives an empty cell."""
    if cell is None or isinstance(cell, str):
        return cell or ""
    return f"{cell:.6g}" if math.isfinite(cell) else ""
