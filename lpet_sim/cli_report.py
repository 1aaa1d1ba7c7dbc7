"""The command that turns the rows of a sweep into tables, charts and a page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lpet_sim.terminal import bar, print_tables, say, wrote

_TABLE = "rows.parquet"
_ON_TERMINAL = (
    "requirement",
    "position",
    "attitude",
    "consistency",
    "state",
    "failures",
    "orderings",
)


def report(
    rows: Annotated[
        Path, typer.Argument(metavar="ROWS.parquet", help="Rows of a sweep, or its folder.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="The page to write; report.html beside the rows if absent.")
    ] = None,
    requirement: Annotated[
        Path | None, typer.Option(help="YAML of another requirement than the sweep's.")
    ] = None,
    figures: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Write the charts as PNG, too.")
    ] = None,
) -> None:
    """Turn the rows of a sweep into tables, charts and one HTML page."""
    from lpet_sim.evaluation import Requirement
    from lpet_sim.evaluation.rows import read_rows
    from lpet_sim.sweep.page import write_page
    from lpet_sim.sweep.sweep_report import build_report, hold_to, write_figures

    path = rows / _TABLE if rows.is_dir() else rows
    read = read_rows(path)
    if requirement is not None:
        read = hold_to(read, Requirement.from_yaml(requirement))
    with bar(f"reporting {len(read)} runs") as progress:
        made = build_report(read, path.stem, progress=progress)
    page = out or path.parent / "report.html"
    write_page(made, page)
    drawn = [] if figures is None else write_figures(made, figures)
    print_tables(sheet.to_table() for sheet in made.sheets if sheet.key in _ON_TERMINAL)
    for text in (*(sentence for sentence, _ in made.verdicts), *made.warnings):
        say(text)
    wrote(page, *drawn)
