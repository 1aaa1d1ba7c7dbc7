"""The rigs' results and the library of soils as tables; made here, printed by the commands."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from rich.table import Table
from rich.text import Text

from lpet_sim.recording.arrays import Array
from lpet_sim.rig.measured import WheelMeasurements
from lpet_sim.rig.published import published_beside
from lpet_sim.rig.slope import SlopeReport
from lpet_sim.rig.slope_figure import published_label
from lpet_sim.rig.slope_point import Heading, SlopePoint
from lpet_sim.rig.wheel import WheelCurve, slip_scale
from lpet_sim.rover.model_spec import wheel_names
from lpet_sim.soil.load import load_soil, soil_names
from lpet_sim.soil.published import PublishedCurve

_TITLES: Final[dict[Heading, str]] = {
    "up": "Up the slope",
    "down": "Down the slope",
    "across": "Across the slope",
}
_SAME_SLOPE_RAD: Final = math.radians(0.35)
_TABLE_STEP: Final = 0.1
_SOURCE_LENGTH: Final = 110


def slope_tables(report: SlopeReport) -> Iterator[Table]:
    """Make the tables of a slope rig: one for each heading, and the wheels one by one.

    What others published of this soil has a column going up, with a value where it was measured
    within 0.35 deg of the bed's slope.
    """
    published = published_beside(report.spec.soil)
    for heading in report.spec.headings:
        beside = published if heading == "up" else ()
        yield _slope_table(report, heading, beside)
    yield _wheels_table(report)


def _slope_table(report: SlopeReport, heading: Heading, beside: Sequence[PublishedCurve]) -> Table:
    spec = report.spec
    table = Table(title=f"{_TITLES[heading]}: {spec.rover.model} on {spec.soil.name}")
    last = ("std", "drift [deg]", "turned [deg]", "sinkage [mm]", "load [N]")
    for text in ("slope [deg]", "slip [%]", *map(published_label, beside), *last):
        table.add_column(Text(text), justify="right")
    table.add_column("ended")
    for point in report.along(heading):
        load = point.wheel_load_n
        table.add_row(
            f"{math.degrees(point.slope_rad):.2f}",
            f"{100 * point.slip:.2f}",
            *(_published_slip(point, curve) for curve in beside),
            "-" if point.slip_std is None else f"{100 * point.slip_std:.2f}",
            f"{math.degrees(point.drift_rad):.2f}",
            f"{math.degrees(point.turned_rad):.2f}",
            f"{1e3 * point.sinkage_m:.1f}",
            f"{min(load):.0f} to {max(load):.0f}",
            point.ended,
        )
    return table


def _published_slip(point: SlopePoint, curve: PublishedCurve) -> str:
    away = np.abs(np.array(curve.slope_rad) - point.slope_rad)
    k = int(np.argmin(away))
    if away[k] > _SAME_SLOPE_RAD:
        return ""
    bound = "below " if curve.upper_bound else ""
    return f"{bound}{100 * curve.slip[k]:.1f} at {math.degrees(curve.slope_rad[k]):.1f}"


def _wheels_table(report: SlopeReport) -> Table:
    """Make the table of the single wheels: slip, traction over load and load of each."""
    table = Table(title="Wheel by wheel: slip [%], traction over load, load [N]")
    table.add_column("heading")
    table.add_column(Text("slope [deg]"), justify="right")
    for wheel in wheel_names(report.spec.rover.model):
        table.add_column(wheel.replace("_", " "), justify="right")
    for point in report.points:
        wheels = zip(point.wheel_slip, point.wheel_traction, point.wheel_load_n, strict=True)
        cells = (f"{100 * s:.1f} {x:+.3f} {n:.0f}" for s, x, n in wheels)
        table.add_row(point.heading, f"{math.degrees(point.slope_rad):.2f}", *cells)
    return table


def wheel_tables(curve: WheelCurve, measured: Sequence[WheelMeasurements] = ()) -> Iterator[Table]:
    """Make the tables of a wheel rig: the curve, and its errors against measured rows.

    Args:
        curve: The curve.
        measured: What others measured with the same wheel on the same soil.
    """
    spec = curve.spec
    angle = f"{math.degrees(spec.slip_angle_rad):.0f} deg"
    table = Table(
        title=f"{spec.wheel.name} on {spec.soil.name}: {spec.wheel.load_n:g} N, "
        f"{spec.wheel.gravity_mps2:g} m/s2"
    )
    headings = ("slip or skid [%]", "drawbar / load", "traction angle [deg]", "sinkage [mm]")
    for heading in (*headings, "torque / (load r)", f"side / load at {angle}"):
        table.add_column(Text(heading), justify="right")
    scale = slip_scale(curve.slip)
    for k in _rows_shown(scale):
        table.add_row(
            f"{100 * scale[k]:.1f}",
            _number(curve.drawbar_ratio[k], ".4f"),
            _number(math.degrees(curve.traction_angle_rad[k]), ".2f"),
            _number(1e3 * curve.sinkage_m[k], ".1f"),
            _number(curve.torque_ratio[k], ".4f"),
            _number(curve.side_ratio[k], ".4f"),
        )
    yield table
    if measured:
        yield _error_table(measured)


def _rows_shown(scale: Array) -> list[int]:
    """Give the rows at whole tenths of slip or skid, and the last."""
    steps = scale / _TABLE_STEP
    whole = np.abs(steps - np.rint(steps)) < 1e-6
    return [*np.flatnonzero(whole), *([] if whole[-1] else [len(whole) - 1])]


def _error_table(measured: Sequence[WheelMeasurements]) -> Table:
    table = Table(title="Prediction against measured rows, nothing fitted to them here: RMS (mean)")
    table.add_column("rows")
    for heading in ("how many", "drawbar / load", "sinkage [mm]"):
        table.add_column(Text(heading), justify="right")
    for rows in measured:
        parts = (
            ("all", rows.error),
            ("driving", rows.error_driving),
            ("skidding", rows.error_skidding),
        )
        for part, error in parts:
            table.add_row(
                f"{rows.label}: {part}",
                f"{error.rows}",
                f"{error.drawbar_ratio:.4f} ({error.drawbar_bias:+.4f})",
                f"{1e3 * error.sinkage_m:.2f} ({1e3 * error.sinkage_bias_m:+.2f})",
            )
    return table


def soil_table() -> Table:
    """Make the table of the library's soils: what kind each is, how well known, from where."""
    table = Table(title="Soils of the library", show_lines=True)
    for heading in ("name", "kind", "evidence", "wheel"):
        table.add_column(heading, no_wrap=True)
    table.add_column("source")
    for name in soil_names():
        soil = load_soil(name)
        source = _shortened(soil.source)
        table.add_row(name, soil.kind, soil.evidence, soil.measured_with or "-", Text(source))
    return table


def _shortened(text: str) -> str:
    whole = " ".join(text.split())
    return whole if len(whole) <= _SOURCE_LENGTH else whole[:_SOURCE_LENGTH].rsplit(" ", 1)[0] + "…"


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
