"""Rows of a sweep: read whole, refused with a sentence, and grouped in natural order."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from lpet_sim.errors import RowsError
from lpet_sim.evaluation.families import manners, paper_pairs, size_families, variants_of
from lpet_sim.evaluation.rows import Rows, read_rows, rows_of
from tests.evaluation.made_rows import made_rows


@pytest.fixture(scope="module")
def table() -> pa.Table:
    """Make the rows of a small sweep."""
    return made_rows(data_sets=3)


def test_rows_come_back_with_their_kinds(table: pa.Table, tmp_path: Path) -> None:
    """Text, flags, numbers with NaN for null, lists filled up, and what the file says of itself."""
    pq.write_table(table, tmp_path / "rows.parquet")
    rows = read_rows(tmp_path / "rows.parquet")
    assert len(rows) == table.num_rows
    assert rows["passed"].dtype == bool
    assert rows["m"].dtype == float
    assert rows["error_curve"].shape == (len(rows), 51)
    lost = rows["failure"] == "timeout"
    assert (
        np.isnan(rows["error_curve"][lost]).all() and np.isfinite(rows["error_curve"][~lost]).all()
    )
    assert "made up" in rows.metadata["lpet_spec"]
    assert rows["variant"].tolist() == table["variant"].to_pylist()


def test_what_is_no_table_of_runs_is_refused(table: pa.Table, tmp_path: Path) -> None:
    """A missing file, one that is no Parquet, other columns, no rows, and a run told twice."""
    bad = tmp_path / "bad.parquet"
    with pytest.raises(RowsError, match=r"bad\.parquet.*lpet sweep"):
        read_rows(bad)
    bad.write_bytes(b"no parquet" * 100)
    with pytest.raises(RowsError, match=r"bad\.parquet.*lpet sweep"):
        read_rows(bad)
    pq.write_table(pa.table({"run": ["a"], "colour": ["red"]}), bad)
    with pytest.raises(RowsError, match="lacks the columns data_set, arm, variant"):
        read_rows(bad)
    with pytest.raises(RowsError, match="no run"):
        rows_of(table.slice(0, 0))
    with pytest.raises(RowsError, match=r"run set000-ideal.* twice"):
        rows_of(pa.concat_tables([table, table.slice(0, 1)]))
    with pytest.raises(RowsError, match="no column 'colour'; they have"):
        rows_of(table)["colour"]


def test_an_error_of_a_failed_run_is_infinite() -> None:
    """Whatever number it has; a run without a number has an infinite one too."""
    columns = {"failure": np.array(["", "lost", ""]), "end_percent": np.array([-2.0, 3.0, np.nan])}
    np.testing.assert_array_equal(Rows(columns).errors("end_percent"), [2.0, np.inf, np.inf])


def test_groups_come_in_natural_order(table: pa.Table) -> None:
    """The ideal arm first, m2 before m10, and every row in one group."""
    rows = rows_of(table)
    keys = [key for key, _ in rows.groups("arm", "variant")]
    assert [arm for arm, _ in keys] == ["ideal"] * 24 + ["biased"] * 24
    of_m = [label.split("-")[0] for _, label in keys[:24:3]]
    assert of_m == ["m1", "m2", "m5", "m10", "m9999", "m9999", "m9999", "m9999"]
    assert sum(len(group) for _, group in rows.groups("arm", "variant")) == len(rows)
    labels = rows.values("variant")
    backwards = np.array([-labels.index(label) for label in rows["variant"]], dtype=float)
    assert rows.with_columns(variant_order=backwards).values("variant") == labels[::-1]


def test_the_papers_pairs_differ_in_one_thing(table: pa.Table) -> None:
    """Decoupled against coupled, unobservable against observable, each with the same memory."""
    rows = rows_of(table)
    pairs = paper_pairs(rows)
    assert len(pairs) == 16
    assert (
        "m2-n9999-decoupled-unobservable-standard",
        "m2-n9999-coupled-unobservable-standard",
    ) in pairs
    assert (
        "m9999-n40-coupled-unobservable-standard",
        "m9999-n40-coupled-observable-standard",
    ) in pairs
    assert list(manners(variants_of(rows))) == [
        "decoupled, unobservable",
        "coupled, unobservable",
        "coupled, observable",
    ]
    assert [(name, len(a), len(b)) for name, a, b in size_families(rows)] == [
        ("decoupled, unobservable", 4, 3),
        ("coupled, unobservable", 4, 3),
        ("coupled, observable", 4, 3),
    ]


def test_formulations_are_told_apart_and_pairs_keep_to_theirs(table: pa.Table) -> None:
    """A second formulation of the coupled filter is a family of its own, not a second partner."""
    rows = rows_of(table).select(m=2.0)
    other = rows.select(coupling="coupled").with_columns()
    n = len(other)
    renamed = other.with_columns(
        formulation=np.full(n, "right_invariant", dtype=object),
        variant=np.char.replace(other["variant"].astype(str), "standard", "invariant"),
    )
    both = Rows({k: np.concatenate([rows[k], renamed[k]]) for k in rows.columns})
    assert "coupled, observable, right invariant" in manners(variants_of(both))
    kinds = [(a.rsplit("-", 1)[1], b.rsplit("-", 1)[1]) for a, b in paper_pairs(both)]
    assert sorted(kinds) == [
        ("invariant", "invariant"),
        ("standard", "standard"),
        ("standard",) * 2,
    ]
    alone = Rows({k: np.concatenate([rows.select(coupling="decoupled")[k], renamed[k]])
                  for k in rows.columns})  # fmt: skip
    kinds = [(a.rsplit("-", 1)[1], b.rsplit("-", 1)[1]) for a, b in paper_pairs(alone)]
    assert sorted(kinds) == [("invariant", "invariant"), ("standard", "invariant")]
