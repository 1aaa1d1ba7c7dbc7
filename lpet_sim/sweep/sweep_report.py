"""The report of a sweep: what was run, who meets the requirement, tables and charts."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from matplotlib.figure import Figure

from lpet_sim.errors import SpecError
from lpet_sim.evaluation import EvaluationSpec, Requirement
from lpet_sim.evaluation import charts as draw
from lpet_sim.evaluation.claims import Outcome, headline, pass_claim
from lpet_sim.evaluation.equal_size import EqualSize, Size, at_equal_size
from lpet_sim.evaluation.families import paper_pairs, size_families
from lpet_sim.evaluation.figures import save
from lpet_sim.evaluation.ordering import paired_orderings
from lpet_sim.evaluation.requirement import AXES
from lpet_sim.evaluation.row_sheets import ordering_sheet, size_sheet, summary_sheets
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.sheet import Sheet
from lpet_sim.evaluation.summary import Summary, summarise
from lpet_sim.failures import BROKEN
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.progress import Progress, silent

AT_LEAST_AS_GOOD = 0.05
"""At equal state size multiframe counts as no worse than bounded up to this share of its error."""
_MARK = "lpet."
_SWEEP = f"{_MARK}sweep"


@dataclass(frozen=True, eq=False)
class Drawing:
    """A chart.

    Attributes:
        key: Name for files and links.
        title: Title.
        caption: What is drawn, in a sentence or two.
        figure: The figure, in the style of the charts, or a picture that is there as PNG.
    """

    key: str
    title: str
    caption: str
    figure: Figure | Path


@dataclass(frozen=True, eq=False)
class SweepReport:
    """All that a sweep's rows say.

    Attributes:
        title: Name of the sweep.
        scope: How much was run, in a sentence.
        verdicts: A sentence for each arm, with what became of the claim there.
        warnings: What the reader should mistrust.
        facts: What was run, by name, as text.
        sheets: Tables.
        drawings: Charts, by arm.
    """

    title: str
    scope: str
    verdicts: tuple[tuple[str, Outcome], ...]
    warnings: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    sheets: tuple[Sheet, ...]
    drawings: tuple[tuple[str, tuple[Drawing, ...]], ...]


def build_report(
    rows: Rows, title: str = "Sweep", charts: bool = True, progress: Progress = silent
) -> SweepReport:
    """Make the report of a sweep.

    Args:
        rows: Its rows.
        title: What to call it where the rows do not say.
        charts: Whether to draw.
        progress: Told the share that is done.
    """
    summaries = summarise(rows, lambda share: progress(0.5 * share))
    sheets = [*summary_sheets(summaries), *_comparisons(rows)]
    progress(0.7)
    drawings = tuple((arm, _draw_arm(arm, of)) for (arm,), of in rows.groups("arm") if charts)
    progress(1.0)
    return SweepReport(
        title=str(_sweep_of(rows).get("name", title)),
        scope=_scope(rows),
        verdicts=tuple(headline([pass_claim(summary) for summary in summaries])),
        warnings=tuple(_warnings(summaries)),
        facts=tuple(_facts(rows)),
        sheets=tuple(sheet for sheet in sheets if sheet.rows),
        drawings=drawings,
    )


def hold_to(rows: Rows, requirement: Requirement) -> Rows:
    """Hold the runs to another requirement than the one of their sweep.

    Args:
        rows: Rows with the errors at the end and at the worst moment.
        requirement: The requirement; its first metres must be those after which the rows' worst
            errors were taken.

    Raises:
        SpecError: The first metres differ.
    """
    taken = EvaluationSpec(**_sweep_of(rows).get("evaluation", {})).start_m
    if requirement.start_m != taken:
        raise SpecError(
            f"the rows tell the worst position error after {taken:g} m: "
            f"the requirement's start_m must be {taken:g}, got {requirement.start_m:g}"
        )
    sound = ~np.isin(rows["failure"].astype(str), [*BROKEN, "timeout"])
    sound &= rows.numbers("completion") >= requirement.completion
    lines = {f"pass_{name}": sound & met for name, met in _lines(rows, requirement).items()}
    asked = [("throughout", requirement.throughout), ("end", requirement.at_end)]
    counted = [when for when, wanted in asked if wanted]
    whole = [met for name, met in lines.items() if name.rsplit("_", 1)[1] in counted]
    held = rows.with_columns(**lines, passed=np.all([sound, *whole], axis=0))
    said = json.dumps(requirement.to_mapping())
    return replace(held, metadata={**rows.metadata, f"{_MARK}requirement": said})


def write_figures(report: SweepReport, folder: Path) -> list[Path]:
    """Write every chart that is not a picture already as PNG into a folder and give their paths."""
    output_folder(folder)
    paths = []
    for _, drawings in report.drawings:
        for drawing in drawings:
            if isinstance(drawing.figure, Path):
                continue
            path = folder / f"{drawing.key}.png"
            with whole_file(path) as temporary, draw.chart_style():
                save(drawing.figure, temporary)
            paths.append(path)
    return paths


def _lines(rows: Rows, requirement: Requirement) -> dict[str, Any]:
    """Tell which runs meet each limit, by line; a run without a number meets none."""
    limits = {"position": (100 * requirement.position_ratio, "percent", "position")}
    for axis, limit in zip(AXES, requirement.attitude_rad, strict=True):
        limits[axis] = (math.degrees(limit), f"{axis}_deg", axis)
    return {
        f"{name}_{when}": np.abs(rows.numbers(f"{prefix}_{column}")) <= limit
        for limit, column, name in limits.values()
        for when, prefix in (("throughout", "worst"), ("end", "end"))
    }


def _comparisons(rows: Rows) -> list[Sheet]:
    points: list[EqualSize] = []
    sizes: tuple[Size, ...] = ("state_max", "state_mean")
    for manner, multiframe, bounded in size_families(rows):
        names = (f"multiframe, {manner}", f"bounded, {manner}")
        for by in sizes:
            points += at_equal_size(
                rows, multiframe, bounded, names, by, tolerance=AT_LEAST_AS_GOOD
            )
    return [ordering_sheet(paired_orderings(rows, paper_pairs(rows))), size_sheet(points)]


def _draw_arm(arm: str, rows: Rows) -> tuple[Drawing, ...]:
    made = []
    with draw.chart_style():
        for key, title, caption, applies, plot in _CHARTS:
            if applies(rows):
                made.append(Drawing(f"{_slug(arm)}-{key}", title, caption, plot(rows)))
    return tuple(made)


_MEDIANS = "Medians over all runs, failed ones at infinity, with the 95 % interval of the median"
_Chart = tuple[str, str, str, Callable[[Rows], bool], Callable[[Rows], Figure]]
_CHARTS: tuple[_Chart, ...] = (
    (
        "error-over-memory",
        "Error against time to live and queue length",
        f"{_MEDIANS}; dashed: all images and landmarks kept.",
        draw.has_memory,
        draw.plot_error_over_memory,
    ),
    (
        "error-over-size",
        "Error over the maximum state size",
        f"{_MEDIANS}; multiframe against bounded.",
        lambda rows: bool(size_families(rows)),
        draw.plot_error_over_size,
    ),
    (
        "growth",
        "Growth of the error along the traverse",
        "Median and middle half of the runs; a failed run's error is infinite where it ended.",
        draw.has_growth,
        draw.plot_error_growth,
    ),
    (
        "cost",
        "Cost against time to live and queue length",
        "Medians over completed runs with the 95 % interval of the median.",
        draw.has_cost,
        draw.plot_cost_over_memory,
    ),
    (
        "pass-rates",
        "Runs that meet the requirement",
        "All runs counted; whiskers: 95 % Clopper-Pearson interval; dashed: 95 % of runs.",
        lambda rows: bool(len(rows)),
        draw.plot_pass_rates,
    ),
    (
        "nees",
        "Consistency: NEES of the pose at the end",
        "Boxes: quartiles over runs, whiskers 1.5 of their distance. A filter whose mean is right "
        "of the narrow band is overconfident.",
        draw.has_nees,
        draw.plot_nees,
    ),
)


def _scope(rows: Rows) -> str:
    failed = int(rows.failed.sum())
    counts = {name: len(rows.values(name)) for name in ("data_set", "arm", "variant")}
    named = [_counted(n, name.replace("_", " ")) for name, n in counts.items()]
    return f"{_counted(len(rows), 'run')}: {', '.join(named)}; {failed} failed."


def _counted(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"


def _warnings(summaries: Sequence[Summary]) -> list[str]:
    out = []
    for s in summaries:
        sizes = {"position": s.position_efficiency, "attitude": s.attitude_efficiency}
        out += [
            f"Arm {s.arm}, {s.variant}: the {what} error is below its Cramer-Rao bound "
            f"({e.ratio.value:.2f} [{e.ratio.low:.2f}, {e.ratio.high:.2f}] times it): "
            "the truth may leak into the estimate, or the bound is not that of these data."
            for what, e in sizes.items()
            if e is not None and e.is_suspicious
        ]
    return out


def _sweep_of(rows: Rows) -> dict[str, Any]:
    """Read the spec of the sweep from what the rows say of themselves; empty where they do not."""
    try:
        spec = json.loads(rows.metadata.get(_SWEEP, "{}"))
    except ValueError:
        return {}
    return spec if isinstance(spec, dict) else {}


def _facts(rows: Rows) -> list[tuple[str, str]]:
    """Give what the rows say of themselves as YAML, by name."""
    return [
        (key.removeprefix(_MARK).replace("_", " "), _as_yaml(text))
        for key, text in rows.metadata.items()
    ]


def _as_yaml(text: str) -> str:
    try:
        value = json.loads(text)
    except ValueError:
        return text
    return yaml.safe_dump(value, sort_keys=False, allow_unicode=True, default_flow_style=None)


def _slug(text: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in text).strip("-").lower() or "arm"
