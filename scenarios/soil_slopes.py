"""Every soil on the tilt bed, and the measured table at every speed and time step.

    python -m scenarios.soil_slopes [--quick] [--out docs/results] [--workers 2]

Writes ``soil_slopes.csv`` (each point of each soil), ``soil_slopes.md`` (slip up and drift across)
and ``slip_mechanism.md`` (what the drive makes of the table that it is given). A killed run goes on
where it was.
"""

from __future__ import annotations

import argparse
import csv
import math
from itertools import pairwise
from pathlib import Path
from typing import Final

from rich.progress import track

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.rig.slope import DEFAULT_SLOPES_RAD, SlopeReport, run_slope_rig, slope_spec
from lpet_sim.rig.slope_point import SlopePoint
from lpet_sim.soil.load import load_soil, load_wheel, soil_names
from lpet_sim.soil.spec import MeasuredSoilSpec

COMMAND: Final = "python -m scenarios.soil_slopes"
CACHE: Final = Path("out/experiments/soil_slopes")
MECHANISM: Final = tuple((dt, v) for dt in (0.002, 0.005) for v in (0.02, 0.05, 0.2))
_STILL_POINTS: Final = 0.1
"""Slip and drift that fall by less, in points and degrees, are called level."""


def soil_report(soil: str, slopes_rad: tuple[float, ...], workers: int) -> SlopeReport:
    """Drive the rover's own wheels on a soil, up and across."""
    spec = slope_spec(load_soil(soil), slopes_rad=slopes_rad)
    spec = spec.model_copy(update={"headings": ("up", "across")})
    return run_slope_rig(spec, CACHE / soil, workers, keep=True)


def mechanism_report(dt_s: float, speed_mps: float, quick: bool, workers: int) -> SlopeReport:
    """Drive up the slopes of the measured table."""
    soil = load_soil("grc1_loose")
    assert isinstance(soil, MeasuredSoilSpec)
    slopes = soil.slope_rad[1:3] if quick else soil.slope_rad
    spec = slope_spec(
        soil, load_wheel("mgru3"), speed_mps=speed_mps, dt_s=dt_s, slopes_rad=slopes
    ).model_copy(update={"headings": ("up",)})
    return run_slope_rig(spec, CACHE / f"mechanism_{dt_s}_{speed_mps}", workers, keep=True)


def mechanism_lines(reports: dict[tuple[float, float], SlopeReport]) -> list[str]:
    """Set what the drives slip beside the table, at every step and speed."""
    soil = load_soil("grc1_loose")
    assert isinstance(soil, MeasuredSoilSpec)
    first = next(iter(reports.values())).along("up")
    table = {s: 100 * slip for s, slip in zip(soil.slope_rad, soil.slip, strict=True)}
    degrees = (f"{math.degrees(p.slope_rad):.2f}" for p in first)
    measured = (f"{table[p.slope_rad]:.2f}" for p in first)
    lines = [
        "# What a drive makes of a measured table",
        "",
        f"`{COMMAND}`; `exomars` up the bed on `grc1_loose`; slip [%] at each slope [deg].",
        "",
        "| step, speed | " + " | ".join(degrees) + " |",
        "|---" * (len(first) + 1) + "|",
        "| measured | " + " | ".join(measured) + " |",
    ]
    worst = 0.0
    for (dt_s, speed_mps), report in reports.items():
        points = report.along("up")
        worst = max(worst, *(abs(100 * p.slip - table[p.slope_rad]) for p in points))
        cells = " | ".join(f"{100 * p.slip:.2f}" for p in points)
        lines.append(f"| {1e3 * dt_s:g} ms, {100 * speed_mps:g} cm/s | {cells} |")
    return [*lines, "", f"Greatest difference: {worst:.2f} points."]


def soil_lines(reports: dict[str, SlopeReport]) -> list[str]:
    """Set slip up the slope and drift across it beside each other for every soil."""
    slopes = [p.slope_rad for p in next(iter(reports.values())).along("up")]
    head = " | ".join(f"{math.degrees(s):.0f}" for s in slopes)
    rule = "|---" * (len(slopes) + 2) + "|"
    text = f"`{COMMAND}`; `exomars` with its own wheels, 5 cm/s, steps of 5 ms."
    lines = ["# Every soil on the tilt bed", "", text, ""]
    for title, heading in (("Slip up the slope [%]", "up"), ("Drift across it [deg]", "across")):
        lines += [f"{title}:", "", f"| soil | {head} | monotone |", rule]
        for name, report in reports.items():
            points = report.along("up" if heading == "up" else "across")
            cells = " | ".join(_cell(p) for p in points)
            lines.append(f"| `{name}` | {cells} | {'yes' if is_monotone(points) else 'no'} |")
        lines.append("")
    lines.append("A word in place of a number: the rover slides, turns aside or digs in there.")
    return lines


def value(point: SlopePoint) -> float:
    """Give slip up the slope in percent, or drift across it in degrees."""
    if point.heading == "up":
        return 100 * point.slip
    return math.degrees(point.drift_rad)


def _cell(point: SlopePoint) -> str:
    return f"{value(point):.1f}" if point.held else f"{value(point):.0f} {point.ended}"


def is_monotone(points: tuple[SlopePoint, ...]) -> bool:
    """Tell whether slip or drift never falls as the slope rises, over the points that held."""
    held = [value(point) for point in points if point.held]
    return all(after >= before - _STILL_POINTS for before, after in pairwise(held))


def write(folder: Path, reports: dict[str, SlopeReport], texts: dict[str, list[str]]) -> None:
    """Write the tables."""
    with whole_file(folder / "soil_slopes.csv") as temporary, temporary.open("w") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(
            ["soil", "heading", "slope_deg", "slip_percent", "drift_deg", "sinkage_mm", "ended"]
        )
        for name, report in reports.items():
            for p in report.points:
                numbers = (
                    math.degrees(p.slope_rad),
                    100 * p.slip,
                    math.degrees(p.drift_rad),
                    1e3 * p.sinkage_m,
                )
                writer.writerow([name, p.heading, *(f"{x:.2f}" for x in numbers), p.ended])
    for name, lines in texts.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text("\n".join(lines) + "\n")
        print("\n".join(lines))
        print(f"wrote {folder / name}")


def main() -> None:
    """Run both experiments."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="docs/results; out/experiments with --quick")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="one soil, two slopes, one step")
    options = parser.parse_args()
    names = ("bedrock",) if options.quick else soil_names()
    slopes = DEFAULT_SLOPES_RAD[:2] if options.quick else DEFAULT_SLOPES_RAD
    settings = MECHANISM[-1:] if options.quick else MECHANISM
    reports = {name: soil_report(name, slopes, options.workers) for name in track(names, "soils")}
    mechanism = {
        (dt, v): mechanism_report(dt, v, options.quick, options.workers)
        for dt, v in track(settings, "steps and speeds")
    }
    texts = {"soil_slopes.md": soil_lines(reports), "slip_mechanism.md": mechanism_lines(mechanism)}
    folder = options.out or (CACHE if options.quick else Path("docs/results"))
    write(output_folder(folder), reports, texts)


if __name__ == "__main__":
    main()
