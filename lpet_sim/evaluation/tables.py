"""Scores as tables for a terminal; made here, printed by the command line."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from rich.table import Table
from rich.text import Text

from lpet_sim.evaluation.attribution import ErrorAttribution
from lpet_sim.evaluation.errors import SegmentDrift
from lpet_sim.evaluation.requirement import Requirement, Verdict, VerdictLine
from lpet_sim.evaluation.result import RunResult
from lpet_sim.evaluation.slip_match import SlipMatch
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.truth import Event

_CAUSES = (
    "scale: encoders' scale and noise, track width; slip: along the wheels; side_slip: across "
    "them; model: the tilt of the ground, which wheels cannot see. Vectors add up, lengths do not."
)
_FOUND = (
    "From dead reckoning and frame-to-frame vision alone. In time: onset within one image interval "
    "of the true one. A slip that nothing forced is the ground's own."
)

_ROUTINE = frozenset({"start", "stop", "point_turn"})


def result_table(
    results: Sequence[RunResult], requirement: Requirement | None = None, title: str | None = None
) -> Table:
    """Make a table with one column for each run: its errors, and its verdict below them.

    Args:
        results: Scores.
        requirement: What they are held to; the default one if None.
        title: Title of the table.
    """
    requirement = requirement or Requirement()
    table = Table(title=Text(title) if title else None)
    table.add_column("")
    for result in results:
        table.add_column(Text(result.name), justify="right")
    for heading, cell in _rows(requirement):
        table.add_row(Text(heading), *(cell(result) for result in results))
    verdicts = (_verdict_text(requirement.check(result), result) for result in results)
    table.add_row("verdict", *verdicts)
    return table


def verdict_table(verdicts: Sequence[Verdict]) -> Table:
    """Make a table with one row for each line of a requirement and one column for each run.

    Args:
        verdicts: At least one, all of the same requirement.
    """
    table = Table(title=Text("Requirement, line by line"))
    table.add_column("line")
    table.add_column("limit", justify="right")
    for verdict in verdicts:
        table.add_column(Text(verdict.name), justify="right")
    for lines in zip(*(verdict.lines for verdict in verdicts), strict=True):
        limit = _quantity(lines[0], lines[0].limit)
        table.add_row(lines[0].quantity, limit, *(_line_text(line) for line in lines))
    return table


def _line_text(line: VerdictLine) -> Text:
    return Text(_quantity(line, line.value) + " ").append_text(pass_or_fail(line.passed))


def segment_table(results: Sequence[RunResult]) -> Table:
    """Make a table of the drift over segments, one column for each run and one row per length."""
    lengths = sorted({s.length_m for result in results for s in result.segments})
    table = Table(title=Text("Drift over segments: translation [%], rotation [deg/m]"))
    table.add_column("length", justify="right")
    for result in results:
        table.add_column(Text(result.name), justify="right")
    drifts = [{s.length_m: s for s in result.segments} for result in results]
    for length in lengths:
        table.add_row(f"{length:g} m", *(_drift(by_length.get(length)) for by_length in drifts))
    return table


def attribution_table(attribution: ErrorAttribution) -> Table:
    """Make a table of the causes of dead reckoning's endpoint error."""
    table = Table(title=f"Dead reckoning's error after {attribution.distance_m:.1f} m, by cause")
    table.caption = Text(_CAUSES, justify="left")
    table.add_column("cause")
    for heading in ("x [m]", "y [m]", "z [m]", "length [m]", "length [% of dist.]"):
        table.add_column(Text(heading), justify="right")
    for cause, vector in {**attribution.contributions_m, "total": attribution.total_m}.items():
        length = math.hypot(*vector)
        ratio = length / attribution.distance_m
        table.add_row(cause, *(f"{c:+.4f}" for c in vector), f"{length:.4f}", f"{ratio:.3%}")
    return table


def slip_table(matches: Sequence[SlipMatch]) -> Table:
    """Make a table of the slips found by comparing vision with the wheels, beside the true ones."""
    table = Table(title=Text("Slip found by comparing vision with the wheels"))
    table.caption = Text(_FOUND, justify="left")
    table.add_column(Text("what truly happened"))
    for heading in ("found at", "late (of one image)", "lost [m] (true)"):
        table.add_column(Text(heading), justify="right")
    for match in matches:
        table.add_row(*_slip_cells(match))
    return table


def _slip_cells(match: SlipMatch) -> tuple[Text | str, ...]:
    found, late = match.found, match.late_s
    lost = "-" if found is None else f"{found.lost_m:.3f}"
    in_time: Text | str = "-"
    if match.event is not None and not (found is None and match.harmless):
        told = "" if late is None else f"{late:+.1f} s ({match.interval_s:.1f} s) "
        in_time = Text(told).append_text(pass_or_fail(match.within_one_image))
    return (
        match.happened,
        "not found" if found is None else f"{found.onset_ns / NS_PER_S:.1f} s",
        in_time,
        f"{lost} ({match.lost_true_m:.3f})",
    )


def event_table(events: Sequence[Event]) -> Table:
    """Make a table of what happened on a drive, stops and turns left out, and how it ended."""
    ending = next((event for event in events if event.ends), None)
    ended = f", ended by {ending.kind}" if ending is not None else ""
    table = Table(title=Text(f"The drive{ended}"))
    for heading in ("from [s]", "for [s]"):
        table.add_column(Text(heading), justify="right")
    table.add_column("event")
    table.add_column("what happened")
    for event in events:
        if event.kind not in _ROUTINE:
            lasted = f"{event.duration_s:.1f}" if event.duration_s else ""
            row = (f"{event.t_ns / NS_PER_S:.1f}", lasted, Text(event.kind), Text(event.text))
            table.add_row(*row, style="bold" if event.ends else None)
    return table


def pass_or_fail(passed: bool) -> Text:
    """Give the word PASS in green or FAIL in red."""
    return Text("PASS", style="bold green") if passed else Text("FAIL", style="bold red")


def _verdict_text(verdict: Verdict, result: RunResult) -> Text:
    text = pass_or_fail(verdict.passed)
    return text.append(f" ({result.failure})") if result.failure else text


def _rows(requirement: Requirement) -> list[tuple[str, Callable[[RunResult], str]]]:
    """Give the heading of each row with what makes its cells."""
    return [
        ("distance [m]", lambda r: f"{r.distance_m:.2f}"),
        ("covered [%]", lambda r: f"{100 * r.completion:.1f}"),
        ("end error [m]", lambda r: f"{math.hypot(*r.endpoint_error_m):.4f}"),
        ("RMS error [m], not aligned", _rms),
        ("end error [% of dist.]", lambda r: f"{100 * r.endpoint_ratio:.3f}"),
        (
            f"worst after {requirement.start_m:g} m [% of dist.]",
            lambda r: _worst(r, requirement.start_m),
        ),
        ("end roll, pitch, yaw [deg]", lambda r: _degrees(r.endpoint_attitude_rad, "+.2f")),
        ("worst roll, pitch, yaw [deg]", lambda r: _degrees(r.worst_attitude_rad, ".2f")),
        ("NEES at the end [6 dof]", lambda r: f"{r.nees_end['pose']:.2f}" if r.nees_end else "-"),
    ]


def _rms(result: RunResult) -> str:
    """Give the RMS of the position error over all poses, the absolute trajectory error."""
    if result.series is None:
        return "-"
    squares = np.sum(result.series.position_error_m**2, axis=1)
    return f"{math.sqrt(squares.mean()):.4f}"


def _worst(result: RunResult, start_m: float) -> str:
    """Give the largest share of the error; on a drive shorter than that it is the end's."""
    short = " (at the end)" if result.distance_m < start_m else ""
    return f"{100 * result.worst_ratio:.3f}{short}"


def _drift(segment: SegmentDrift | None) -> str:
    if segment is None:
        return "-"
    return f"{segment.translation_ratio:.3%}, {math.degrees(segment.rotation_radpm):.4f}"


def _degrees(angles_rad: Sequence[float], form: str) -> str:
    return " ".join(format(math.degrees(angle), form) for angle in angles_rad)


def _quantity(line: VerdictLine, value: float) -> str:
    return f"{100 * value:.3f} %" if line.unit == "ratio" else f"{math.degrees(value):.3f} deg"
