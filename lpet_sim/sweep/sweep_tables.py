"""A sweep as tables for a terminal: what came of each variant, and which data sets were used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from lpet_sim.evaluation.statistics import pass_rate, quantile
from lpet_sim.sweep.sweep_data import DataSet
from lpet_sim.sweep.sweep_store import Row


def sweep_table(name: str, rows: Sequence[Row]) -> Table:
    """Give a line for each variant in each arm; a failed run's error counts as infinite."""
    table = Table(title=f"Sweep {name}: {len(rows)} runs")
    for column in (
        "arm",
        "variant",
        "runs",
        "failed",
        "end %, median",
        "passed",
        "95 %",
        "ms/image",
    ):
        table.add_column(column, justify="left" if column in ("arm", "variant") else "right")
    groups: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row["arm"], row["variant"]), []).append(row)
    for (arm, variant), group in groups.items():
        table.add_row(arm, variant, *_cells(group))
    return table


def _cells(group: Sequence[Row]) -> tuple[str, ...]:
    failures = sum(bool(row["failure"]) for row in group)
    errors = [np.inf if row["failure"] else row["end_percent"] for row in group]
    passed = pass_rate(sum(row["passed"] for row in group), len(group))
    times = [row["time_per_image_ms"] for row in group if not row["failure"]]
    return (
        str(len(group)),
        str(failures),
        f"{float(quantile(errors, 0.5)):.3f}",
        f"{100 * passed.value:.0f} %",
        f"{100 * passed.low:.0f}-{100 * passed.high:.0f}",
        f"{np.median(times):.2f}" if times else "",
    )


def noted_table(data_sets: Sequence[DataSet]) -> Table | None:
    """List the data sets of which something is to be said; None if there are none."""
    noted = [data_set for data_set in data_sets if data_set.note or data_set.left_out]
    if not noted:
        return None
    table = Table("data set", "path [m]", "what is to be said", "left out", title="Data sets")
    for data_set in noted:
        path_m = f"{data_set.path_m:.1f}"
        table.add_row(data_set.name, path_m, data_set.note, data_set.left_out or "no")
    return table
