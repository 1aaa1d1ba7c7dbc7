"""A sweep's report as one HTML page that needs nothing else: no network, no other file."""

from __future__ import annotations

import base64
import io
import math
from html import escape
from pathlib import Path
from urllib.parse import quote

from matplotlib.figure import Figure

from lpet_sim.evaluation.charts import GRID, INK, PAPER, chart_style
from lpet_sim.evaluation.sheet import Cell, Heading, Sheet
from lpet_sim.outputs import whole_file
from lpet_sim.sweep.page_style import SCRIPT, STYLE, SWAP
from lpet_sim.sweep.sweep_report import Drawing, SweepReport

_TONES = {"shown": "good", "refuted": "bad", "not decided": "warn"}
_BADGES = {"shown": "Shown.", "refuted": "Refuted.", "not decided": "Not decided."}


def write_page(report: SweepReport, path: Path) -> None:
    """Write a report as an HTML page, whole or not at all.

    Raises:
        OutputError: The file cannot be written.
    """
    with whole_file(path) as temporary:
        temporary.write_text(page_of(report), encoding="utf-8")


def page_of(report: SweepReport) -> str:
    """Give the HTML of a report: the verdict first, then charts, tables and what was run."""
    title = escape(report.title)
    parts = [
        f"<header><h1>{title}</h1><p>{escape(report.scope)}</p></header>",
        _verdicts(report),
        _links(report),
        *(_charts(arm, drawings) for arm, drawings in report.drawings),
        _tables(report),
        _facts(report),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{title}: report of the sweep</title><style>{STYLE}</style></head>\n<body><main>\n"
        + "\n".join(parts)
        + f"\n</main><script>{SCRIPT}</script></body></html>\n"
    )


def svg_of(figure: Figure) -> str:
    """Draw a figure as SVG that follows the reader's choice of light or dark."""
    out = io.StringIO()
    with chart_style():
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    for colour, name in ((INK, "ink"), (PAPER, "paper"), (GRID, "grid")):
        text = text.replace(colour, f"var(--{name})")
    head, tag, rest = text.partition("<defs>")
    return head + SWAP % {"ink": INK, "grid": GRID} + tag + rest


def _verdicts(report: SweepReport) -> str:
    lines = [_sentence(text, _TONES[kind], _BADGES[kind]) for text, kind in report.verdicts]
    lines += [_sentence(text, "warn", "Check.") for text in report.warnings]
    return f'<section id="verdict"><h2>Verdict</h2>{"".join(lines)}</section>'


def _sentence(text: str, tone: str, badge: str) -> str:
    return f'<p class="verdict {tone}"><span class="badge">{badge}</span>{escape(text)}</p>'


def _links(report: SweepReport) -> str:
    targets = [(f"charts-{k}", f"Charts: {arm}") for k, arm in _numbered(report)]
    targets += [(sheet.key, sheet.title) for sheet in report.sheets]
    targets.append(("made", "What was run"))
    links = (f'<a href="#{escape(key)}">{escape(text)}</a>' for key, text in targets)
    return f'<nav aria-label="Contents">{"".join(links)}</nav>'


def _numbered(report: SweepReport) -> list[tuple[str, str]]:
    return [(drawings[0].key, arm) for arm, drawings in report.drawings if drawings]


def _charts(arm: str, drawings: tuple[Drawing, ...]) -> str:
    if not drawings:
        return ""
    cards = "".join(_chart(arm, drawing) for drawing in drawings)
    key = escape(f"charts-{drawings[0].key}")
    title = f"<h2>Charts: {escape(arm)}</h2>"
    return f'<section id="{key}">{title}<div class="charts">{cards}</div></section>'


def _chart(arm: str, drawing: Drawing) -> str:
    kind, image = _image_of(drawing)
    alt = escape(f"{drawing.title}, arm {arm}. {drawing.caption}", quote=True)
    return (
        f'<figure class="card"><h3>{escape(drawing.title)}</h3>'
        f'<img alt="{alt}" src="data:image/{kind};base64,{image}">'
        f"<figcaption>{escape(drawing.caption)}</figcaption></figure>"
    )


def _image_of(drawing: Drawing) -> tuple[str, str]:
    """Give the kind of a chart's image, and the image in the letters of a page."""
    if isinstance(drawing.figure, Path):
        return "png", base64.b64encode(drawing.figure.read_bytes()).decode()
    return "svg+xml", base64.b64encode(svg_of(drawing.figure).encode()).decode()


def _tables(report: SweepReport) -> str:
    search = (
        '<div class="tools"><label for="filter">Rows with</label>'
        '<input type="search" id="filter" placeholder="words, such as: ideal observable m10">'
        '<span class="soft">A click on a heading sorts.</span></div>'
    )
    return f"<h2>Tables</h2>{search}{''.join(_table(sheet) for sheet in report.sheets)}"


def _table(sheet: Sheet) -> str:
    head = "".join(_head(heading) for heading in sheet.headings)
    body = "".join(f"<tr>{''.join(map(_cell, row, sheet.headings))}</tr>\n" for row in sheet.rows)
    csv = f"data:text/csv;charset=utf-8,{quote(sheet.to_csv())}"
    return (
        f'<section class="card" id="{escape(sheet.key)}"><h3>{escape(sheet.title)}</h3>'
        f'<p class="note">{escape(sheet.note)} '
        f'<a download="{escape(sheet.key)}.csv" href="{csv}">CSV</a></p>'
        f'<div class="scroll" tabindex="0"><table><thead><tr>{head}</tr></thead>'
        f"<tbody>{body}</tbody></table></div></section>"
    )


def _head(heading: Heading) -> str:
    kind = ' class="words"' if heading.words else ""
    return f'<th scope="col"{kind}><button type="button">{escape(heading.text)}</button></th>'


def _cell(cell: Cell, heading: Heading) -> str:
    kinds = " ".join(filter(None, ["words" if heading.words else "", cell.tone]))
    kind = f' class="{kinds}"' if kinds else ""
    first = cell.values[0]
    value = "" if isinstance(first, str) else f' data-value="{_number(first)}"'
    return f"<td{kind}{value}>{escape(cell.text)}</td>"


def _number(value: float) -> str:
    """Write a number as a script reads it."""
    if math.isinf(value):
        return "Infinity" if value > 0 else "-Infinity"
    return "NaN" if math.isnan(value) else repr(float(value))


def _facts(report: SweepReport) -> str:
    blocks = "".join(
        f"<details><summary>{escape(name)}</summary><pre>{escape(text)}</pre></details>"
        for name, text in report.facts
    )
    said = blocks or '<p class="soft">The rows do not say how they were made.</p>'
    return f'<section class="card" id="made"><h3>What was run</h3>{said}</section>'
