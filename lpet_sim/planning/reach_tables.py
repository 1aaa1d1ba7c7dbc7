"""Tables of a study of reachability."""

from __future__ import annotations

import math
from collections.abc import Sequence

from rich.table import Table

from lpet_sim.planning.reach_result import (
    PERSEVERANCE_LENGTH_RATIO,
    RateResult,
    ReachabilityReport,
)
from lpet_sim.planning.worst_paths import WorstPath


def rate_table(report: ReachabilityReport) -> Table:
    """Give the rates for each abundance and factor."""
    table = Table(
        title=f"reachability: {report.name}",
        caption=(
            f"Clopper-Pearson 95 % over starts; maps of {100 * report.cell_m:g} cm; undecided in "
            f"all {report.undecided:.1%}. Length over straight distance: median and largest; "
            f"Perseverance drove {PERSEVERANCE_LENGTH_RATIO:.2f} through Snowdrift Peak."
        ),
    )
    table.add_column("rocks k", justify="right")
    table.add_column("K", justify="right")
    table.add_column("terrains", justify="right")
    table.add_column("starts", justify="right")
    for name in ("reachable", "unreachable", "undecided", "by terrain", "length ratio"):
        table.add_column(name, justify="right")
    table.add_column("why not")
    for rate in report.rates:
        table.add_row(*_row(rate))
    return table


def _row(rate: RateResult) -> tuple[str, ...]:
    found, (median, _, largest) = rate.reachable, rate.length_ratio
    why = ", ".join(f"{reason} {count}" for reason, count in rate.reasons.items())
    return (
        "own" if math.isnan(rate.abundance) else f"{rate.abundance:.1%}",
        f"{rate.factor:g}",
        str(rate.terrains),
        str(rate.starts),
        f"{found.value:.1%} ({found.low:.1%}-{found.high:.1%})",
        f"{rate.unreachable:.1%}",
        f"{rate.undecided:.1%}",
        f"{rate.terrain_low:.0%}-{rate.terrain_high:.0%}",
        "-" if math.isnan(median) else f"{median:.2f}, {largest:.2f}",
        why or "-",
    )


def worst_table(worst: Sequence[WorstPath]) -> Table:
    """Give the measures of some ways, the worst first."""
    table = Table(title="worst ways", caption="score: mean share of ways that are not worse")
    names = ("terrain", "start", "score", "length m", "ratio", "curves/100 m", "turn deg/m")
    for name in (*names, "slope deg", "roll deg", "rocks m"):
        table.add_column(name, justify="right")
    for way in worst:
        measured = way.start.measures
        if measured is None:
            continue
        table.add_row(
            way.case.key,
            str(way.number),
            f"{way.score:.3f}",
            f"{way.start.length_m:.1f}",
            f"{measured.length_ratio:.2f}",
            f"{measured.curves_per_100m:.1f}",
            f"{math.degrees(measured.tightness_rad_per_m):.1f}",
            f"{math.degrees(measured.slope_rad):.1f}",
            f"{math.degrees(measured.roll_rad):.1f}",
            f"{measured.clearance_m:.2f}",
        )
    return table
