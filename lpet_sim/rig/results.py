"""What a rig leaves in its folder: a CSV and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from lpet_sim.outputs import whole_file
from lpet_sim.rig.files import write_slope_csv, write_wheel_csv
from lpet_sim.rig.measured import WheelMeasurements
from lpet_sim.rig.published import published_beside
from lpet_sim.rig.slope import SlopeReport
from lpet_sim.rig.slope_figure import plot_slope
from lpet_sim.rig.wheel import WheelCurve
from lpet_sim.rig.wheel_figure import plot_wheel

_DPI = 150


def write_slope(report: SlopeReport, folder: Path) -> tuple[Path, Path]:
    """Write ``slope.csv`` and ``slope.png``, the latter with what was published of the soil.

    Raises:
        OutputError: A file cannot be written.
    """
    table, picture = folder / "slope.csv", folder / "slope.png"
    write_slope_csv(report, table)
    _save(plot_slope(report, published_beside(report.spec.soil)), picture)
    return table, picture


def write_wheel(
    curve: WheelCurve, measured: Sequence[WheelMeasurements], folder: Path
) -> tuple[Path, Path]:
    """Write ``wheel.csv`` and ``wheel.png``.

    Raises:
        OutputError: A file cannot be written.
    """
    table, picture = folder / "wheel.csv", folder / "wheel.png"
    write_wheel_csv(curve, table)
    _save(plot_wheel(curve, measured), picture)
    return table, picture


def _save(figure: Figure, path: Path) -> None:
    with whole_file(path) as temporary:
        figure.savefig(temporary, dpi=_DPI, format="png")
