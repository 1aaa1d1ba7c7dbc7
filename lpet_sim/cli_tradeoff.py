"""The command that trades sensors off."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lpet_sim.terminal import print_tables, say, two_bars, wrote


def tradeoff(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.yaml", help="The trade-off.")],
    out: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Its folder; out/tradeoff/NAME if absent.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of candidates, landmarks and draws.")] = 0,
    workers: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
    static_only: Annotated[bool, typer.Option(help="Simulate no survivors.")] = False,
    check: Annotated[
        bool, typer.Option(help="Exit with 1 if no sensor meets the requirement.")
    ] = False,
) -> None:
    """Compare sensors: predict all of a space, simulate the best, recommend one.

    The same command again goes on where the simulation was stopped.
    """
    from lpet_sim.sweep.sweep_pool import Pool
    from lpet_sim.tradeoff.run import run_tradeoff
    from lpet_sim.tradeoff.spec import TradeoffSpec
    from lpet_sim.tradeoff.tradeoff_files import tradeoff_tables, write_tradeoff

    read = TradeoffSpec.from_yaml(spec)
    folder = Path("out") / "tradeoff" / read.name if out is None else out
    with two_bars("predicting", "simulating") as (progress, count):
        try:
            result = run_tradeoff(read, folder, seed, Pool(workers), static_only, progress, count)
        except KeyboardInterrupt:
            say("stopped: the same command goes on from here")
            raise
    paths = write_tradeoff(result, folder)
    print_tables(tradeoff_tables(result))
    picked = result.recommendation
    say(f"{'PASS' if picked.meets else 'FAIL'}: {picked.reason}")
    wrote(*paths)
    if check and not picked.meets:
        raise typer.Exit(1)
