"""The command that finds out whether a goal can be reached."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lpet_sim.terminal import bar, print_tables, say, wrote


def reach(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.yaml", help="The study.")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Its folder; out/reach/NAME if absent.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of terrains, starts and searches.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes, one terrain each.")] = 2,
    worst: Annotated[int, typer.Option(min=0, help="Save so many of the worst ways.")] = 5,
) -> None:
    """Plan from many starts to a goal, over terrains with more and more rocks.

    The same command again goes on where a study was stopped.
    """
    from lpet_sim.planning.reach_outputs import write_reach
    from lpet_sim.planning.reach_run import run_reach
    from lpet_sim.planning.reach_spec import ReachSpec
    from lpet_sim.planning.reach_tables import rate_table, worst_table

    read = ReachSpec.from_yaml(spec)
    folder = Path("out") / "reach" / read.name if out is None else out
    with bar(f"planning {read.name}") as progress:
        try:
            report = run_reach(read, seed, folder, workers, progress)
        except KeyboardInterrupt:
            say("stopped: the same command goes on from here")
            raise
    ways, paths = write_reach(report, read, folder, worst)
    print_tables([rate_table(report), *([worst_table(ways)] if ways else [])])
    say(f"{report.cpu_s:.0f} s of processor time on {len(report.terrains)} terrains")
    wrote(*paths)
