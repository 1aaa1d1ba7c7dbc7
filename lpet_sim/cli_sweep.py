"""The command that runs a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lpet_sim.terminal import print_tables, say, two_bars, wrote


def sweep(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.yaml", help="The sweep.")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Its folder; out/NAME if absent.")
    ] = None,
    workers: Annotated[
        int,
        typer.Option(
            min=1, help="Processes of this machine, or how many workers the scheduler has."
        ),
    ] = 2,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="tcp://HOST:PORT", help="A Dask scheduler, in place of processes."),
    ] = None,
    limit: Annotated[
        int | None, typer.Option(min=1, help="Use the first so many data sets only.")
    ] = None,
    retry_failed: Annotated[
        bool, typer.Option(help="Run again what ended in an exception or a timeout.")
    ] = False,
) -> None:
    """Run estimators on many data sets: one row for each run, in rows.parquet.

    The same command again goes on where a sweep was stopped.
    """
    from lpet_sim.sweep.sweep_pool import Pool
    from lpet_sim.sweep.sweep_run import run_sweep
    from lpet_sim.sweep.sweep_spec import SweepSpec
    from lpet_sim.sweep.sweep_tables import noted_table, sweep_table

    read = SweepSpec.from_yaml(spec)
    folder = Path("out") / read.name if out is None else out
    pool = Pool(workers, scheduler)
    with two_bars("data sets", "runs") as (driving, count):
        try:
            result = run_sweep(read, folder, pool, limit, retry_failed, driving, count)
        except KeyboardInterrupt:
            say("stopped: the same command goes on from here")
            raise
    noted = noted_table(result.data_sets)
    print_tables([*([] if noted is None else [noted]), sweep_table(read.name, result.rows)])
    say(f"ran {result.ran} runs, {len(result.rows) - result.ran} were there")
    wrote(result.path)
