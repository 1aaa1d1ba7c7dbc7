"""The tables of the paper's experiment, from the rows of its sweeps: Markdown and CSV."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

from lpet_sim.evaluation.equal_size import EqualSize, Size, at_equal_size
from lpet_sim.evaluation.families import Variant, manners, paper_pairs, size_families, variants_of
from lpet_sim.evaluation.ordering import paired_orderings
from lpet_sim.evaluation.row_sheets import (
    attitude_sheet,
    consistency_sheet,
    failure_sheet,
    line_sheet,
    ordering_sheet,
    pass_sheet,
    position_sheet,
    size_sheet,
    state_sheet,
)
from lpet_sim.evaluation.rows import Rows
from lpet_sim.evaluation.sheet import Sheet
from lpet_sim.evaluation.statistics import quantile
from lpet_sim.evaluation.summary import Summary, summarise
from lpet_sim.outputs import whole_file
from lpet_sim.sweep.sweep_report import AT_LEAST_AS_GOOD
from scenarios.paper.growth import growth_sheet, slip_sheet
from scenarios.paper.variants import SPOILT, WRONG

IDEAL: Final = "ideal"
TITLES: Final = {
    "variants": "The paper's variants in the ideal arm",
    "orderings": "The paper's orderings",
    "arms": "One thing wrong each",
    "pass_rates": "Who meets the requirement",
}


def write_tables(
    rows: Rows, slips_m: Mapping[str, float], said: Sequence[str], folder: Path
) -> list[Path]:
    """Write all tables.

    Args:
        rows: Rows of all sweeps of the experiment.
        slips_m: Distance at which the long forced slip of each data set began [m].
        said: Paragraphs that stand on top of each table: command, data sets, seeds.
        folder: Where they go.

    Returns:
        The files.
    """
    written = []
    for name, sheets in _tables(rows, summarise(rows), slips_m).items():
        sheets = [sheet for sheet in sheets if sheet.rows]
        if not sheets:
            continue
        path = folder / f"paper_{name}.md"
        _write(path, "\n\n".join([f"# {TITLES[name]}", *said, *map(markdown, sheets)]) + "\n")
        written.append(path)
        for label, text in _csv_texts(name, sheets).items():
            path = folder / f"paper_{label}.csv"
            _write(path, text)
            written.append(path)
    return written


def _tables(
    rows: Rows, summaries: Sequence[Summary], slips_m: Mapping[str, float]
) -> dict[str, list[Sheet]]:
    """Give the sheets of each table; those of variants tell of the same rows in the same order."""
    ideal = [s for s in summaries if s.arm == IDEAL]
    beside = _beside(rows)
    wrong = [s for s in summaries if s.arm in (IDEAL, *WRONG) and s.variant in beside]
    held = [s for s in summaries if s.arm in (IDEAL, "spoilt")]
    return {
        "variants": [sheet(ideal) for sheet in _MAKERS],
        "orderings": [*_orderings(rows), growth_sheet(rows), slip_sheet(rows, slips_m)],
        "arms": [sheet(wrong) for sheet in _MAKERS] if wrong else [],
        "pass_rates": [pass_sheet(held), line_sheet(held)],
    }


_MAKERS: Final = (
    position_sheet,
    attitude_sheet,
    consistency_sheet,
    state_sheet,
    failure_sheet,
)


def _beside(rows: Rows) -> set[str]:
    """Give the variants that ran in the arms with one thing wrong."""
    return {v for arm, v in zip(rows["arm"], rows["variant"], strict=True) if arm in WRONG}


def _orderings(rows: Rows) -> list[Sheet]:
    """Compare the paper's kinds at equal memory and at the best of each, and at equal size."""
    standard = rows.where(rows["formulation"] == "standard")
    paired = ordering_sheet(
        [
            o
            for arm in ("ideal", "spoilt")
            if len(of := standard.where(standard["arm"] == arm))
            for o in paired_orderings(of, list(dict.fromkeys([*paper_pairs(of), *_best_pairs(of)])))
        ]
    )
    ideal = rows.where(rows["arm"] == IDEAL)
    invariant = _form_pairs(ideal)
    forms = ordering_sheet(paired_orderings(ideal, invariant) if invariant else [], "forms")
    sized = size_sheet(_equal_sizes(ideal.where(ideal["formulation"] == "standard")))
    return [paired, _retitled(forms, "Standard form against right-invariant"), sized]


def _retitled(sheet: Sheet, title: str) -> Sheet:
    return Sheet(sheet.key, title, "", sheet.headings, sheet.rows)


def _best_pairs(rows: Rows) -> list[tuple[str, str]]:
    """Pair the three kinds each at its own best memory, by the median end error."""
    best = [
        _best(rows, of) for name, of in manners(variants_of(rows)).items() if "kept" not in name
    ]
    return list(pairwise(best))


def _best(rows: Rows, variants: Sequence[Variant]) -> str:
    """Give the variant of least median error among those that ran on every data set."""
    of = {v.label: rows.select(variant=v.label).errors("end_percent") for v in variants}
    most = max(len(errors) for errors in of.values())
    return min(
        (label for label in of if len(of[label]) == most),
        key=lambda label: float(quantile(of[label], 0.5)),
    )


def _form_pairs(rows: Rows) -> list[tuple[str, str]]:
    labels = set(rows.values("variant"))
    pairs = [(v, v.replace("-standard", "-invariant")) for v in labels if v.endswith("-standard")]
    return sorted(pair for pair in pairs if pair[1] in labels)


def _equal_sizes(rows: Rows) -> list[EqualSize]:
    sizes: tuple[Size, ...] = ("state_max", "state_mean")
    return [
        point
        for manner, several, queued in size_families(rows)
        for by in sizes
        for point in at_equal_size(
            rows,
            several,
            queued,
            (f"multiframe, {manner}", f"bounded, {manner}"),
            by,
            tolerance=AT_LEAST_AS_GOOD,
        )
    ]


def markdown(sheet: Sheet) -> str:
    """Write a table as Markdown, with its note above."""
    lines = [f"## {sheet.title}", "", *([sheet.note, ""] if sheet.note else [])]
    lines.append(_line([heading.text for heading in sheet.headings]))
    lines.append(_line(["---"] * len(sheet.headings)))
    lines += [_line([cell.text for cell in row]) for row in sheet.rows]
    return "\n".join(lines)


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _csv_texts(name: str, sheets: Sequence[Sheet]) -> dict[str, str]:
    """Give CSV texts by name: sheets of the same rows beside each other, others by themselves."""
    if name == "orderings":
        return {sheet.key: sheet.to_csv() for sheet in sheets}
    tables = [list(csv.reader(io.StringIO(sheet.to_csv()))) for sheet in sheets]
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    for lines in zip(*tables, strict=True):
        writer.writerow([*lines[0], *(cell for line in lines[1:] for cell in line[2:])])
    return {name: out.getvalue()}


def _write(path: Path, text: str) -> None:
    with whole_file(path) as temporary:
        temporary.write_text(text)


def arms_said() -> str:
    """Say in a paragraph what each arm is."""
    arms = {"spoilt": SPOILT, **WRONG}
    told = "; ".join(f"`{name}` {json.dumps(dict(spec))}" for name, spec in arms.items())
    return f"Arms, beside `ideal` (the defaults of the landmark sensor): {told}."
