"""The report of a sweep: a page that needs nothing else, from rows that are rows."""

from __future__ import annotations

import base64
import csv
import io
import json
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from lpet_sim.errors import SpecError
from lpet_sim.evaluation import Requirement
from lpet_sim.evaluation.rows import Rows, rows_of
from lpet_sim.sweep.page import page_of
from lpet_sim.sweep.sweep_report import SweepReport, build_report, hold_to
from tests.command import Lpet, runner
from tests.evaluation.made_rows import made_rows

NASTY = '<script>alert("x")</script> & Söhne'
VOID = {"meta", "img", "input", "br"}


def nasty_table() -> pa.Table:
    """Make rows whose names would break a page that does not escape them."""
    table = made_rows(data_sets=6, arms=("ideal", NASTY), failing=0.05)
    sweep = {"name": NASTY, "arms": ["ideal", NASTY], "evaluation": {"start_m": 5.0}}
    said = {"lpet.sweep": json.dumps(sweep), "lpet.seeds": "[0, 1]"}
    return table.replace_schema_metadata(said)


@pytest.fixture(scope="module")
def report() -> SweepReport:
    """Make a report of two arms."""
    return build_report(rows_of(nasty_table()))


@pytest.fixture(scope="module")
def page(report: SweepReport) -> str:
    """Write its page."""
    return page_of(report)


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run the command in this process."""
    return runner(monkeypatch, capsys)


class Reader(HTMLParser):
    """Collect elements, and hold every one of them to be closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.texts: dict[str, list[str]] = {}
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts.setdefault(self.open[-1], []).append(data)

    def all(self, tag: str) -> list[dict[str, str]]:
        """Give the attributes of every element of a kind."""
        return [attributes for name, attributes in self.elements if name == tag]


def test_the_page_asks_nothing_of_the_network(page: str) -> None:
    """Whatever it shows is within: images as data, one style, one script, no address."""
    read = Reader(page)
    links = [a.get(k, "") for _, a in read.elements for k in ("src", "href", "action", "srcset")]
    assert all(link.startswith(("#", "data:")) for link in links if link)
    assert read.all("link") == [] and read.all("iframe") == []
    assert [set(a) for a in read.all("script")] == [set()]
    assert "url(" not in page and "@import" not in page and "fetch(" not in page
    anchors = {a["href"][1:] for a in read.all("a") if a["href"].startswith("#")}
    assert anchors <= {a["id"] for _, a in read.elements if "id" in a}


def test_names_are_escaped_wherever_they_stand(page: str) -> None:
    """A script in a name stays text."""
    assert "<script>alert" not in page
    assert NASTY in "".join(Reader(page).texts["h1"])


def test_every_image_has_words_and_is_a_whole_drawing(page: str) -> None:
    """Six charts for each of two arms, in colours that follow light and dark."""
    images = Reader(page).all("img")
    assert len(images) == 12
    for image in images:
        assert len(image["alt"]) > 20
        kind, _, data = image["src"].partition(",")
        assert kind == "data:image/svg+xml;base64"
        drawing = base64.b64decode(data).decode()
        assert ElementTree.fromstring(drawing).tag.endswith("svg")
        assert "var(--ink)" in drawing and "prefers-color-scheme: dark" in drawing
        assert not re.search(r'(href|src)="(?!#)', drawing)


def test_the_verdict_stands_first_and_every_table_follows(page: str) -> None:
    """A sentence for each arm before any chart; then the tables, each with its CSV."""
    assert page.index('id="verdict"') < page.index("<img") < page.index("<table")
    read = Reader(page)
    titles = read.texts["h3"]
    for title in ("Who meets the requirement", "Position error", "Attitude error",
                  "Consistency and efficiency", "State, anchors and cost", "Failed runs by kind",
                  "Orderings, paired over data sets", "At equal state size"):  # fmt: skip
        assert title in titles
    downloads = [a for a in read.all("a") if "download" in a]
    assert len(downloads) == len(read.all("table")) >= 8
    assert sum(text.startswith("Arm ") for text in read.texts["p"]) == 2
    assert any("6 data sets, 2 arms, 24 variants" in text for text in read.texts["p"])


def test_the_csv_holds_the_numbers_in_full(report: SweepReport, page: str) -> None:
    """As many lines as rows, and the value from which the cell was rounded."""
    links = {a["download"]: a["href"] for a in Reader(page).all("a") if "download" in a}
    head, _, data = links["position.csv"].partition(",")
    assert head == "data:text/csv;charset=utf-8"
    lines = list(csv.DictReader(io.StringIO(unquote(data))))
    sheet = next(s for s in report.sheets if s.key == "position")
    assert len(lines) == len(sheet.rows) == 48
    rows = rows_of(nasty_table())
    for line in lines:
        errors = rows.select(arm=line["arm"], variant=line["variant"]).errors("end_percent")
        known = errors[np.isfinite(errors)]
        np.testing.assert_allclose(
            float(line["end RMS, completed [%]"]), np.sqrt(np.mean(known**2)), rtol=1e-12
        )
        assert float(line["end median [%] low"]) <= float(line["end median [%]"])


def test_the_report_is_the_same_every_time(page: str) -> None:
    """To the byte: the draws are by name, and drawings carry no date."""
    assert page_of(build_report(rows_of(nasty_table()))) == page


def test_an_error_below_its_bound_is_warned_of() -> None:
    """Rows whose truth leaked say so on top."""
    rows = rows_of(made_rows(data_sets=20, arms=("ideal",), failing=0.0))
    low = rows.with_columns(bound_m=2 * rows["end_error_m"])
    assert build_report(rows, charts=False).warnings == ()
    warned = build_report(low, charts=False).warnings
    assert len(warned) == 24 and "below its Cramer-Rao bound (0.50" in warned[0]


def test_another_requirement_is_held_to_the_rows_own_numbers() -> None:
    """The paper's one gives what the rows were made with; a wider one lets more pass."""
    rows = rows_of(made_rows(data_sets=10, failing=0.1))
    strict = hold_to(rows, Requirement(throughout=False))
    line = rows["failure"] == ""
    expected = line & (rows["end_percent"] <= 1)
    np.testing.assert_array_equal(strict["pass_position_end"], expected)
    whole = expected & np.all([rows[f"end_{a}_deg"] <= 1 for a in ("roll", "pitch", "yaw")], axis=0)
    np.testing.assert_array_equal(strict["passed"], whole)
    wide = Requirement(position_ratio=10, roll_rad=1, pitch_rad=1, yaw_rad=1)
    np.testing.assert_array_equal(hold_to(rows, wide)["passed"], line)
    with pytest.raises(SpecError, match="start_m must be 5, got 2"):
        hold_to(rows, Requirement(start_m=2))


def test_the_command_writes_page_and_charts_and_tells_the_verdict(
    lpet: Lpet, tmp_path: Path
) -> None:
    """Beside the rows unless told; a folder stands for the rows in it."""
    pq.write_table(made_rows(data_sets=3, arms=("ideal",)), tmp_path / "rows.parquet")
    ended = lpet("report", tmp_path, "--figures", tmp_path / "charts")
    assert (ended.code, ended.err) == (0, "")
    assert "Who meets the requirement" in ended.out and "Arm ideal: none of 24" in ended.out
    assert "m9999-n9999-decoupled-unobservable-standard" in ended.out
    assert (tmp_path / "report.html").read_text().startswith("<!DOCTYPE html>")
    charts = sorted(path.name for path in (tmp_path / "charts").iterdir())
    assert len(charts) == 6 and "ideal-error-over-memory.png" in charts
    assert ended.out.count("wrote ") == 7


@pytest.mark.parametrize("kind", ["missing", "garbage", "other table", "empty folder"])
def test_what_is_no_table_of_runs_ends_with_2(kind: str, lpet: Lpet, tmp_path: Path) -> None:
    """One sentence names the file and where such a file comes from; nothing is written."""
    given = tmp_path / "given"
    if kind == "garbage":
        given.write_bytes(b"nothing" * 50)
    elif kind == "other table":
        pq.write_table(pa.table({"a": [1]}), given)
    elif kind == "empty folder":
        given.mkdir()
    ended = lpet("report", given)
    assert ended.code == 2 and ended.out == ""
    assert len(ended.err.splitlines()) == 1
    assert str(given) in ended.err and "lpet sweep" in ended.err
    assert not (tmp_path / "report.html").exists()


def test_a_sweep_of_one_run_has_a_report() -> None:
    """Nothing to compare and no interval to speak of, and yet a page with its tables."""
    rows = rows_of(made_rows(data_sets=1, arms=("ideal",), failing=0.0).slice(0, 1))
    page = page_of(build_report(rows, "one"))
    assert "1 run: 1 data set, 1 arm, 1 variant; 0 failed" in page
    assert len(Reader(page).all("table")) == 7


def test_rows_of_baselines_alone_have_a_report() -> None:
    """Without landmarks in a state there is no memory to draw over, and no pair of the paper's."""
    rows = rows_of(made_rows(data_sets=4, arms=("ideal",))).select(retention="keep_all")
    n = len(rows)
    bare = {
        "retention": np.full(n, "", dtype=object),
        "coupling": np.full(n, "", dtype=object),
        **{name: np.full(n, np.nan) for name in ("nees_pose", "nis_mean", "state_max", "bound_m")},
    }
    made = build_report(Rows({**rows.columns, **bare}), "odometry")
    assert [d.key for d in made.drawings[0][1]] == ["ideal-growth", "ideal-pass-rates"]
    assert {"orderings", "equal_size"}.isdisjoint(sheet.key for sheet in made.sheets)
