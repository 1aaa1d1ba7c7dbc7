"""A page opened in a real headless Chromium: what it does wrong, and how it stands."""

from __future__ import annotations

import html
import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome") or ""
needs_chromium = pytest.mark.skipif(not CHROMIUM, reason="there is no Chromium on this machine")
_FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-background-networking",
    "--window-size=1600,1200",
    "--virtual-time-budget=8000",
)
_LISTEN = """<script>window.wrong = [];
addEventListener("error", e => wrong.push(e.message || "cannot load " + e.target.src), true);
addEventListener("unhandledrejection", e => wrong.push(String(e.reason)));
const complain = console.error;
console.error = (...words) => { wrong.push(words.join(" ")); complain(...words); };</script>"""
_LOOK = """
frame.onload = () => setTimeout(() => {
  const inner = frame.contentWindow, page = inner.document, found = {};
  const text = row => row.cells[found.column].textContent;
  found.wide = page.documentElement.scrollWidth;
  found.images = page.images.length;
  found.broken = [...page.images].filter(i => !i.naturalWidth).length;
  found.asked = inner.performance.getEntriesByType("resource").map(e => e.name)
    .filter(name => !name.startsWith("data:"));
  found.narrow = [...page.querySelectorAll("p, td, th, li")].filter(e => e.offsetParent
    && parseFloat(inner.getComputedStyle(e).fontSize) < 11).length;
  const table = [...page.querySelectorAll("table")].find(t => t.tBodies[0].rows.length > 2);
  const heads = [...table.tHead.rows[0].cells];
  found.column = heads.findIndex((h, k) => new Set([...table.tBodies[0].rows].map(
    r => r.cells[k].textContent)).size > 2);
  const column = () => [...table.tBodies[0].rows].map(r => ({text: text(r),
    value: r.cells[found.column].dataset.value ?? null}));
  const press = () => heads[found.column].querySelector("button").click();
  press(); found.once = column(); press(); found.twice = column();
  found.wrong = inner.wrong;
  document.getElementById("found").textContent = JSON.stringify(found);
}, 300);
"""


@dataclass(frozen=True)
class Looked:
    """How a page stands in a window.

    Attributes:
        wide: Width that it takes up [px].
        images: How many images it has.
        broken: How many of them show nothing.
        asked: What it asked of anybody.
        narrow: How many visible words are set smaller than 11 px.
        once: A column of a table after a click on its heading: text and value of each cell.
        twice: After another one.
        wrong: What went wrong while it loaded or worked.
        column: Which column.
    """

    wide: int
    images: int
    broken: int
    asked: list[str]
    narrow: int
    once: list[dict[str, str | None]]
    twice: list[dict[str, str | None]]
    wrong: list[str]
    column: int


def look(page: Path, width_px: int, folder: Path) -> Looked:
    """Open a page in a window of a width, click on a heading twice, and say what is there.

    Chromium makes no window below 500 px: the page stands in a frame of the width asked for.
    """
    inner = page.read_text().replace("<head>", f"<head>{_LISTEN}", 1)
    source = json.dumps(inner).replace("</", "<\\/")
    outer = folder / f"frame_{width_px}.html"
    outer.write_text(
        f'<body><iframe id="frame" style="width:{width_px}px;height:1000px;border:0"></iframe>'
        f'<pre id="found"></pre><script>const frame = document.getElementById("frame");{_LOOK}'
        f"frame.srcdoc = {source};</script></body>"
    )
    seen = _chromium(folder, "--dump-dom", outer.as_uri())
    told = re.search(r'<pre id="found">(.*?)</pre>', seen, re.DOTALL)
    assert told and told[1], "the page did not load"
    return Looked(**json.loads(html.unescape(told[1])))


def _chromium(folder: Path, *words: str) -> str:
    command = [CHROMIUM, *_FLAGS, f"--user-data-dir={folder / 'profile'}", *words]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return done.stdout


def numbers(column: list[dict[str, str | None]]) -> list[float]:
    """Give what a column sorts by, as far as these are finite numbers."""
    values = [float(cell["value"] or "nan") for cell in column]
    return [value for value in values if abs(value) < float("inf")]
