"""The command that goes from requirement to verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lpet_sim.terminal import either_bar, print_tables, say, wrote


def study(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.yaml", help="The study.")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Its folder; out/study/NAME if absent.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of all that is drawn.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    check: Annotated[bool, typer.Option(help="Exit with 1 unless the verdict is PASS.")] = False,
) -> None:
    """Go from requirement to verdict: reachability, worst ways, sensor, algorithms.

    The same command again goes on where a study was stopped. Each stage's product may be replaced
    by one's own; what hangs on it is made anew.
    """
    from lpet_sim.study.chain import Hands, run_study
    from lpet_sim.study.report import study_sheets, verdict_of, write_study
    from lpet_sim.study.spec import StudySpec
    from lpet_sim.study.worst_runs import save_worst_runs

    read = StudySpec.from_yaml(spec)
    folder = Path("out") / "study" / read.name if out is None else out
    try:
        result = run_study(read, folder, seed, Hands(workers, either_bar))
        verdict = verdict_of(result)
        with either_bar("writing the page") as (progress, _):
            paths = write_study(result, verdict, progress)
        with either_bar("keeping the worst runs") as (progress, _):
            save_worst_runs(result, verdict, progress)
    except KeyboardInterrupt:
        say("stopped: the same command goes on from here")
        raise
    print_tables(sheet.to_table() for sheet in study_sheets(result, verdict, True))
    for stage in result.stages:
        say(f"{stage.name}: {stage.path} ({stage.state})")
    wrote(*paths)
    say(f"{verdict.word}: {verdict.text}")
    if check and verdict.word != "PASS":
        raise typer.Exit(1)
