"""The command that tells whether a rover of one's own is good to drive."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lpet_sim.terminal import bar, print_tables, say, wrote


def check_rover(
    rover: Annotated[
        str, typer.Argument(metavar="ROVER.yaml", help="A rover's description, or a name.")
    ],
    out: Annotated[
        Path | None, typer.Option(help="The picture to write; out/rover/NAME.png if absent.")
    ] = None,
) -> None:
    """Load a rover, show its figures, take its picture, park it, and drive it two metres.

    Ends with 1 where it is not good to drive.
    """
    from lpet_sim.sweep.rover_check import check_rover as check
    from lpet_sim.sweep.rover_tables import rover_tables

    picture = Path("out") / "rover" / f"{Path(rover).stem}.png" if out is None else out
    with bar(f"checking {Path(rover).stem}") as progress:
        found = check(rover, picture, progress)
    print_tables(rover_tables(found))
    wrote(picture)
    for problem in found.problems:
        say(f"not good: {problem}")
    if found.problems:
        raise typer.Exit(1)
    say("good to drive")
