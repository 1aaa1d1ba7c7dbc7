"""The command that looks over an estimator."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lpet_sim.spec import read_fields
from lpet_sim.terminal import bar, print_tables


def check_estimator(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="Its name, or MODULE:CLASS, or 'program'.")
    ],
    spec: Annotated[Path | None, typer.Option(help="YAML of its spec.")] = None,
) -> None:
    """Hold an estimator to what every estimator must do, on a drive without any error.

    Ends with exit code 1 if it does not do one of them.
    """
    from lpet_sim.sweep.conformance import check_estimator as run
    from lpet_sim.sweep.conformance import finding_table

    fields = {} if spec is None else read_fields(spec)
    with bar(f"driving for {name}") as progress:
        findings = run(name, fields, progress)
    print_tables([finding_table(name, findings)])
    if any(finding.passed is False for finding in findings):
        raise typer.Exit(1)
