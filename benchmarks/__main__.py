"""The `make bench` command: all benchmarks in one run, as one table."""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
import time
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.table import Table

from benchmarks import camera, landmarks, physics, pipeline, slam, store, vision, wheel_law
from benchmarks.case import Case
from benchmarks.timing import Row, tell
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.sensors.camera_spec import StereoCameraSpec

_COLUMNS = ("part", "LPET", "bare", "unit", "LPET / bare", "of processor", "aim")
_LEGEND = (
    "LPET / bare is time over time: 1 costs nothing, below 1 LPET is faster. Medians of runs in "
    "turn. 'of processor' is the same of processor time, which other work hardly disturbs."
)


def main() -> None:
    """Run all benchmarks, print the table, write it to a folder."""
    options = _options()
    begin = time.perf_counter()
    rows = run(Case.quick() if options.quick else Case.full())
    tell(f"done in {time.perf_counter() - begin:.0f} s")
    _print(rows)
    folder = output_folder(options.out)
    with whole_file(folder / "bench.json") as path:
        path.write_text(
            json.dumps({"machine": _machine(), "rows": [asdict(r) for r in rows]}, indent=1)
        )
    with whole_file(folder / "bench.md") as path:
        path.write_text(markdown(rows))


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="only show that everything runs")
    parser.add_argument("--out", type=Path, default=Path("out"), help="for bench.json and bench.md")
    return parser.parse_args()


def run(case: Case) -> list[Row]:
    """Run all benchmarks on one case.

    Returns:
        The rows of the table, in order.
    """
    tell("physics ...")
    world = case.build()
    driven = physics.measure(world)
    tell("wheels on soil ...")
    law = wheel_law.measure(case.build(), case.repetitions)
    tell("cameras ...")
    seen = camera.measure(world, case.poses(driven.pieces), StereoCameraSpec.small())
    tell("vision ...")
    spec = case.traverse()
    assert spec.sensors.stereo is not None
    calibration = spec.sensors.stereo.declared_calibration(world.frames.T_body_camera)
    looked = vision.measure(seen.pairs, calibration)
    tell("landmarks ...")
    strewn = landmarks.measure(case.build().terrain, calibration, case.sensed_m)
    tell("SLAM, in a process of its own ...")
    filtered = slam.measure(case.images)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "benchmark.rrd"
        tell("the whole pipeline ...")
        done = pipeline.run(spec, path)
        tell("store ...")
        stored = store.measure(path, case.repetitions)
    simulated_s = driven.pieces[-1].body.t_ns[-1] / 1e9
    hz = 1.0 / spec.rover.physics_dt_s
    bare = pipeline.BareParts(driven.bare, (seen.bare, looked.bare, stored.bare), hz)
    whole = pipeline.rows(done, bare, simulated_s)
    return [driven.row, *law, *seen.rows, *looked.rows, *strewn, *filtered, *stored.rows, *whole]


def _machine() -> dict[str, object]:
    return {
        "processor": platform.processor() or platform.machine(),
        "cores": len(os.sched_getaffinity(0)),
        "load": os.getloadavg()[0],
        "python": platform.python_version(),
    }


def _cells(row: Row) -> list[str]:
    def number(value: float | None) -> str:
        if value is None:
            return "-"
        return f"{value:,.0f}" if value >= 1000 else f"{value:.3g}"

    return [
        row.part,
        number(row.ours),
        number(row.bare),
        row.unit,
        *(number(value) for value in (row.cost, row.cpu_cost)),
        row.aim,
    ]


def _print(rows: list[Row]) -> None:
    console = Console()
    table = Table(title="LPET against its bare counterparts", caption=_LEGEND)
    for column in _COLUMNS:
        table.add_column(column, justify="left" if column in ("part", "unit") else "right")
    for row in rows:
        table.add_row(*_cells(row))
    console.print(table)
    for row in rows:
        console.print(f"[bold]{row.part}[/bold]: {row.note}", highlight=False)


def markdown(rows: list[Row]) -> str:
    """Give the table as markdown, with the notes under it."""
    lines = [_line(list(_COLUMNS)), _line(["---"] * len(_COLUMNS))]
    lines += [_line(_cells(row)) for row in rows]
    return "\n".join([*lines, "", _LEGEND, "", *(f"- {r.part}: {r.note}" for r in rows), ""])


def _line(cells: list[str]) -> str:
    return f"| {' | '.join(cells)} |"


if __name__ == "__main__":
    main()
