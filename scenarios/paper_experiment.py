"""The paper's experiment: a hundred data sets of ExoMars terrain, every variant of the filter.

    python -m scenarios.paper_experiment [--quick] [--out docs/results] [--pictures docs/pictures]
        [--workers 2] [--data-sets DIR] [--work out/paper] [--count 100] [--only PART ...]
        [--report]

Drives the data sets (or takes those in DIR/traverses), runs the sweeps, and writes the tables
``paper_*.md`` and ``.csv`` and the pictures. Each run is kept as it ends, so a killed experiment
goes on where it was; ``--report`` makes tables and pictures of what is there, while it runs too.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from lpet_sim.errors import LpetError
from lpet_sim.evaluation.rows import Rows, read_rows
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.sweep.sweep_agenda import plan_rows, rows_of
from lpet_sim.sweep.sweep_data import find_data_sets, prepare_data_sets
from lpet_sim.sweep.sweep_plan import code_digest, expand
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_run import JOURNALS, run_sweep
from lpet_sim.sweep.sweep_spec import SweepSpec
from lpet_sim.sweep.sweep_store import Redo, Row, RowStore, write_table
from lpet_sim.terminal import bar, say, two_bars, wrote
from scenarios.paper.figures import write_figures
from scenarios.paper.tables import arms_said, write_tables
from scenarios.paper.variants import Part, label_order, parts, quick_parts
from scenarios.paper_data_sets import (
    LENGTH_M,
    MIN_PATH_M,
    QUICK_COUNT,
    QUICK_FIRST,
    QUICK_LENGTH_M,
    QUICK_MIN_PATH_M,
    DrivenSet,
    drive_until,
    driven_sets,
    traverse_file,
)

COMMAND: Final = "python -m scenarios.paper_experiment"
RESULTS, PICTURES, WORK = Path("docs/results"), Path("docs/pictures"), Path("out/paper")


@dataclass(frozen=True)
class Setting:
    """How large the experiment is.

    Attributes:
        parts: What is run.
        count: How many data sets.
        length_m: Length of their planned paths [m].
        min_path_m: Data sets with shorter paths are left out [m].
        start_m: Distance after which errors count as a share of it [m].
        first: Seed of the first data set.
    """

    parts: tuple[Part, ...]
    count: int
    length_m: float = LENGTH_M
    min_path_m: float = MIN_PATH_M
    start_m: float = 5.0
    first: int = 1


QUICK: Final = Setting(
    quick_parts(), QUICK_COUNT, QUICK_LENGTH_M, QUICK_MIN_PATH_M, 1.0, QUICK_FIRST
)


def run_part(part: Part, sweep: SweepSpec, folder: Path, workers: int) -> list[Row]:
    """Run what is missing of a part, beside its spec as YAML."""
    with whole_file(output_folder(folder) / "sweep.yaml") as temporary:
        sweep.to_yaml(temporary)
    with two_bars("data sets", part.name) as (driving, count):
        result = run_sweep(sweep, folder, Pool(workers), driving=driving, count=count)
    say(f"{part.name}: ran {result.ran} runs, {len(result.rows) - result.ran} were there")
    return list(result.rows)


def rows_there(sweep: SweepSpec, folder: Path, workers: int) -> list[Row]:
    """Give the rows that are there of a part, of data sets on which every variant has run."""
    if not (folder / JOURNALS).exists():
        return []
    found = find_data_sets(sweep.data_sets, folder)
    used = prepare_data_sets(sweep.data_sets, found, folder, Pool(workers))
    planned = list(plan_rows(sweep, expand(sweep.variants), [d for d in used if not d.left_out]))
    store, redo = RowStore(folder / JOURNALS).refresh(), Redo(sweep.time_limit_s)
    missing = set(store.missing([p.key for p in planned], redo))
    partly = {p.data_set.name for p in planned if p.key in missing}
    return rows_of([p for p in planned if p.data_set.name not in partly], store, redo)


def put_together(rows: Sequence[Row], chosen: Sequence[Part], path: Path) -> Rows:
    """Write the rows of all parts as one table, variants in the order of the tables."""
    place = label_order(chosen)
    ordered = [{**row, "variant_order": place[row["variant"]]} for row in rows]
    about = {"sweep": {"name": "paper"}, "code": code_digest(True)}
    write_table(path, ordered, about)
    return read_rows(path)


def said_on_top(rows: Rows, driven: Sequence[DrivenSet], setting: Setting) -> list[str]:
    """Say how the tables were made: command, data sets and their seeds, and what was left out."""
    seeds = {int(float(seed)) for seed in rows["seed"]}
    used = [drive for drive in driven if drive.seed in seeds]
    short = [d for d in driven if d.path_m < setting.min_path_m and d.seed <= max(seeds)]
    left = (
        ", ".join(f"{d.seed} ({d.path_m:.1f} m, {d.ended.split(':')[0]})" for d in short) or "none"
    )
    lengths = [drive.path_m for drive in used]
    stuck = sum(drive.ended != "goal" for drive in used)
    return [
        f"`{COMMAND}`; {len(used)} data sets, seeds {_ranges(sorted(seeds))}; paths of "
        f"{min(lengths):.1f} to {max(lengths):.1f} m; {stuck} of them ended short of their goal. "
        f"Left out as shorter than {setting.min_path_m:g} m: seeds {left}.",
        arms_said(),
    ]


def _ranges(numbers: Sequence[int]) -> str:
    """Write whole numbers as ranges: 1-3, 5."""
    ranges: list[list[int]] = []
    for number in numbers:
        if ranges and number == ranges[-1][-1] + 1:
            ranges[-1][1:] = [number]
        else:
            ranges.append([number])
    return ", ".join("-".join(map(str, pair)) for pair in ranges)


def data_sets(options: argparse.Namespace, setting: Setting, home: Path) -> list[DrivenSet]:
    """Drive the data sets, or look over those that are there."""
    if options.data_sets is not None or options.report:
        return driven_sets(home)
    with bar("driving") as progress:
        return drive_until(
            home,
            setting.count,
            options.workers,
            setting.length_m,
            setting.min_path_m,
            setting.first,
            progress,
        )


def parsed() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, help="docs/results; with --quick the work folder")
    parser.add_argument("--pictures", type=Path, help="docs/pictures, or the same")
    parser.add_argument("--work", type=Path, help="out/paper, or out/paper_quick")
    parser.add_argument("--data-sets", type=Path, help="a folder with traverses that are driven")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--count", type=int, help="only the first so many data sets")
    parser.add_argument("--only", nargs="+", choices=[part.name for part in parts()])
    parser.add_argument("--report", action="store_true", help="of what is there; runs nothing")
    parser.add_argument("--quick", action="store_true", help="four data sets of 3 m")
    return parser.parse_args()


def main() -> None:
    """Drive, sweep, and write tables and pictures."""
    options = parsed()
    setting = QUICK if options.quick else Setting(parts(), 100)
    setting = replace(setting, count=options.count or setting.count)
    work = options.work or Path(f"{WORK}_quick" if options.quick else WORK)
    os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))
    home = options.data_sets or work
    driven = data_sets(options, setting, home)
    long = [drive for drive in driven if drive.path_m >= setting.min_path_m][: setting.count]
    paths = [traverse_file(home, drive.seed).resolve() for drive in long]
    if not paths:
        raise LpetError(f"no data set in {home / 'traverses'} covers {setting.min_path_m:g} m")
    rows: list[Row] = []
    for part in setting.parts:
        if options.only and part.name not in options.only:
            continue
        sweep, folder = part.sweep(paths, setting.min_path_m, setting.start_m), work / part.name
        if options.report:
            rows += rows_there(sweep, folder.resolve(), options.workers)
        else:
            rows += run_part(part, sweep, folder, options.workers)
    report(rows, driven, setting, options, work)


def report(
    rows: Sequence[Row],
    driven: Sequence[DrivenSet],
    setting: Setting,
    options: Any,
    work: Path,
) -> None:
    """Write the rows as one file, the tables and the pictures."""
    path = work / "rows.parquet"
    table = put_together(rows, setting.parts, path)
    slips_m = {f"paper{drive.seed:03d}": drive.slip_at_m for drive in driven}
    out = output_folder(options.out or (work if options.quick else RESULTS))
    pictures = output_folder(options.pictures or (work if options.quick else PICTURES))
    first = traverse_file(options.data_sets or work, min(int(float(s)) for s in table["seed"]))
    wrote(path, *write_tables(table, slips_m, said_on_top(table, driven, setting), out))
    wrote(*write_figures(table, first, pictures))


if __name__ == "__main__":
    main()
