"""Charts of a sweep draw what the rows say, failures and missing parts included."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from lpet_sim.errors import RowsError
from lpet_sim.evaluation import charts
from lpet_sim.evaluation.charts.growth import curve_quartiles
from lpet_sim.evaluation.rows import Rows, rows_of
from tests.evaluation.made_rows import M_SWEPT, N_SWEPT, made_rows


@pytest.fixture(scope="module")
def rows() -> Rows:
    """Make the rows of one arm."""
    return rows_of(made_rows(data_sets=9, arms=("ideal",), failing=0.1))


def _curves(figure: Figure, panel: int) -> dict[str, np.ndarray]:
    lines = figure.axes[panel].get_lines()
    return {str(line.get_label()): np.asarray(line.get_xydata()) for line in lines}


def test_error_is_drawn_over_m_and_n_for_each_manner(rows: Rows) -> None:
    """The points are the medians over all runs; full SLAM is a dashed line for each manner."""
    figure = charts.plot_error_over_memory(rows)
    for panel, swept, column in ((0, M_SWEPT, "m"), (1, N_SWEPT, "n")):
        curves = _curves(figure, panel)
        drawn = curves["coupled, observable"]
        np.testing.assert_array_equal(drawn[:, 0], swept)
        of = rows.select(coupling="coupled", observable=True, **{column: float(swept[1])})
        np.testing.assert_allclose(drawn[1, 1], np.median(of.errors("end_percent")))
        assert {"decoupled, unobservable", "coupled, unobservable"} <= curves.keys()
        dashed = [line for line in figure.axes[panel].get_lines() if line.get_linestyle() == "--"]
        assert len(dashed) >= 3


def test_a_variant_that_fails_mostly_leaves_through_the_top(rows: Rows) -> None:
    """Its median is infinite: the point lies above the axis, and the others stay in view."""
    doomed = (rows["m"] == 1) & rows["observable"]
    failed = rows.with_columns(failure=np.where(doomed, "lost", rows["failure"]).astype(object))
    figure = charts.plot_error_over_memory(failed)
    drawn = _curves(figure, 0)["coupled, observable"][:, 1]
    low, high = figure.axes[0].get_ylim()
    assert drawn[0] > high
    assert (drawn[1:] > low).all() and (drawn[1:] < high).all()


def test_error_over_size_has_a_panel_for_each_manner(rows: Rows) -> None:
    """Multiframe and bounded in each, by their median sizes."""
    figure = charts.plot_error_over_size(rows)
    assert len(figure.axes) == 3
    curves = _curves(figure, 2)
    np.testing.assert_allclose(curves["bounded (N)"][:, 0], N_SWEPT)
    assert len(curves["multiframe (M)"]) == len(M_SWEPT)


def test_growth_shows_the_middle_half_of_the_runs(rows: Rows) -> None:
    """A run that gave no poses has an infinite error throughout."""
    figure = charts.plot_error_growth(rows)
    names = list(_curves(figure, 0))
    assert names == [f"{manner} (full SLAM)" for manner in (
        "decoupled, unobservable", "coupled, unobservable", "coupled, observable")]  # fmt: skip
    curves = np.vstack([np.full(4, v) for v in (1.0, 2.0, 3.0, 4.0, np.nan)])
    failure = np.array(["", "", "", "", "timeout"], dtype=object)
    low, middle, high = curve_quartiles(Rows({"error_curve": curves, "failure": failure}))
    assert (low[0], middle[0], high[0]) == (2.0, 3.0, 4.0)
    short = np.array([[1.0, 2.0, np.nan], [1.0, 2.0, np.nan]])
    ended = Rows({"error_curve": short, "failure": np.array(["", "lost"], dtype=object)})
    np.testing.assert_array_equal(curve_quartiles(ended.where([0]))[1], [1.0, 2.0, 2.0])
    np.testing.assert_array_equal(curve_quartiles(ended.where([1]))[1], [1.0, 2.0, np.inf])
    chosen = charts.plot_error_growth(rows, variants=rows.values("variant")[:2])
    assert list(_curves(chosen, 0)) == rows.values("variant")[:2]


def test_passes_and_nees_have_a_line_for_each_variant(rows: Rows) -> None:
    """The bars are the counts over all runs."""
    axes = charts.plot_pass_rates(rows).axes[0]
    labels = [text.get_text() for text in axes.get_yticklabels()]
    assert sorted(labels) == sorted(rows.values("variant"))
    counts = [text.get_text() for text in axes.texts]
    for label, count in zip(labels, counts, strict=True):
        assert count == f"{int(rows.select(variant=label)['passed'].sum())}/9"
    boxes = charts.plot_nees(rows).axes[0]
    assert len(boxes.get_yticklabels()) == len(labels)


def test_what_the_rows_do_not_hold_is_not_drawn(rows: Rows) -> None:
    """Each chart says so, and can be asked beforehand."""
    full = rows.select(retention="keep_all")
    bare = Rows({k: v for k, v in full.columns.items() if k not in ("error_curve", "nees_pose")})
    assert not (charts.has_memory(bare) or charts.has_growth(bare) or charts.has_nees(bare))
    for plot in (
        charts.plot_error_over_memory,
        charts.plot_cost_over_memory,
        charts.plot_error_over_size,
        charts.plot_error_growth,
        charts.plot_nees,
    ):
        with pytest.raises(RowsError):
            plot(bare)
    assert charts.has_memory(rows) and charts.has_cost(rows) and charts.has_growth(rows)
    charts.plot_pass_rates(bare)
