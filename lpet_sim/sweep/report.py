"""Scores and summaries as tables on a terminal; made here, printed by the command line."""

from __future__ import annotations

import math
from collections.abc import Iterator

from rich.table import Table
from rich.text import Text

from lpet_sim.evaluation import Requirement
from lpet_sim.evaluation.tables import (
    attribution_table,
    event_table,
    result_table,
    segment_table,
    slip_table,
    verdict_table,
)
from lpet_sim.sweep.score import Score
from lpet_sim.terrain.summary import TerrainSummary


def score_tables(score: Score, requirement: Requirement) -> Iterator[Table]:
    """Make the tables of a score: the drive's events, errors, verdict, drift, causes, slips.

    Args:
        score: The score.
        requirement: What the results are held to.
    """
    if score.truth.events:
        yield event_table(score.truth.events)
    source = score.recording.manifest
    seed = "" if source.seed is None else f", seed {source.seed}"
    yield result_table(score.results, requirement, f"{source.source}{seed}")
    yield verdict_table([requirement.check(result) for result in score.results])
    if any(result.segments for result in score.results):
        yield segment_table(score.results)
    if score.attribution is not None:
        yield attribution_table(score.attribution)
    if score.slips:
        yield slip_table(score.slips)


def terrain_tables(summary: TerrainSummary) -> Iterator[Table]:
    """Make the tables of a terrain: its figures, and its rocks beside their size law."""
    facts = Table(title=f"{summary.name}: {summary.area_m2:g} m2")
    facts.add_column("quantity")
    facts.add_column("value", justify="right")
    for quantity, value in _terrain_facts(summary):
        facts.add_row(Text(quantity), value)
    yield facts
    if summary.rock_bins:
        yield _rock_table(summary)


def _terrain_facts(summary: TerrainSummary) -> Iterator[tuple[str, str]]:
    yield "relief [m]", f"{summary.relief_m:.2f}"
    yield "RMS slope at 1 m [deg]", f"{math.degrees(summary.rms_slope_1m_rad):.2f}"
    for name, share in summary.soil_shares:
        yield f"soil '{name}' [%]", f"{100 * share:.1f}"
    yield "covered by rocks [%]", f"{100 * summary.rock_cover:.2f}"
    yield "covered by the size law [%]", f"{100 * summary.rock_cover_expected:.2f}"


def _rock_table(summary: TerrainSummary) -> Table:
    rocks = Table(title="rocks by diameter")
    for heading in ("from [m]", "to [m]", "found", "size law"):
        rocks.add_column(Text(heading), justify="right")
    for rock_bin in summary.rock_bins:
        rocks.add_row(
            f"{rock_bin.diameter_min_m:.2f}",
            f"{rock_bin.diameter_max_m:.2f}",
            f"{rock_bin.count}",
            f"{rock_bin.expected:.1f}",
        )
    return rocks
