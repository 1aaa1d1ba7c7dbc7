"""The slope rig: what it measures on the bed, how it ends, and that it goes on where it was."""

import csv
import dataclasses
import json
import math
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.rig import slope as slope_rig
from lpet_sim.rig.files import slope_header, write_slope_csv
from lpet_sim.rig.published import published_beside
from lpet_sim.rig.slope import (
    SlopeReport,
    SlopeSpec,
    drive_point,
    run_slope_rig,
    slope_spec,
    slopes_with_measured,
)
from lpet_sim.rig.slope_figure import plot_slope
from lpet_sim.rig.slope_point import SlopePoint
from lpet_sim.rover.model_spec import wheel_names
from lpet_sim.soil.load import load_soil, published_curves

SLOPES_DEG = (0.0, 8.0, 14.0)


def _spec(*slopes_deg: float, soil: str = "grc1_loose", speed_mps: float = 0.1) -> SlopeSpec:
    slopes_rad = tuple(math.radians(deg) for deg in slopes_deg)
    return slope_spec(load_soil(soil), speed_mps=speed_mps, slopes_rad=slopes_rad)


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> SlopeReport:
    """Drive three slopes in three directions, in this process."""
    return run_slope_rig(_spec(*SLOPES_DEG), tmp_path_factory.mktemp("rig"), workers=1)


def test_slip_rises_with_the_slope_going_up_and_falls_going_down(report: SlopeReport) -> None:
    """Every drive is steady, and level ground gives one slip whichever way."""
    up = [point.slip for point in report.along("up")]
    down = [point.slip for point in report.along("down")]
    assert up == sorted(up)
    assert down == sorted(down, reverse=True)
    assert all(point.ended == "steady" for point in report.points)
    assert up[0] == pytest.approx(down[0], abs=1e-3)


def test_a_cross_slope_makes_the_rover_drift_downhill(report: SlopeReport) -> None:
    """The drift is 0 on the level and grows with the slope; up and down there is none."""
    across = [point.drift_rad for point in report.along("across")]
    assert across[0] == pytest.approx(0.0, abs=2e-3)
    assert across[0] < across[1] < across[2]
    assert max(abs(p.drift_rad) for h in ("up", "down") for p in report.along(h)) < 5e-3


def test_each_wheel_supplies_the_tangent_of_the_slope(report: SlopeReport) -> None:
    """Going up, traction over load is ``tan(slope)`` for all; loads sum to ``W cos(slope)``."""
    for point in report.along("up"):
        mean = np.average(point.wheel_traction, weights=point.wheel_load_n)
        assert mean == pytest.approx(math.tan(point.slope_rad), abs=0.01)
    level, _, steep = report.along("up")
    ratio = sum(steep.wheel_load_n) / sum(level.wheel_load_n)
    assert ratio == pytest.approx(math.cos(steep.slope_rad), rel=0.01)
    assert steep.wheel_load_n[0] < level.wheel_load_n[0]
    assert steep.wheel_load_n[4] > level.wheel_load_n[4]


@pytest.mark.parametrize("index", [0, 2, 3, 4, 6])
def test_the_measured_soil_gives_its_own_curve_back(index: int) -> None:
    """Slip of a whole rover on the bed at slopes of the MGRU3 table, within 1 point of it."""
    soil = load_soil("grc1_loose")
    assert soil.kind == "table"
    spec = slope_spec(soil, speed_mps=0.2)
    point = drive_point(spec, soil.slope_rad[index], "up")
    assert point.ended == "steady"
    assert point.slip == pytest.approx(soil.slip[index], abs=0.01)


def test_a_slope_beyond_the_soil_is_a_result_and_no_error() -> None:
    """At 42 deg nothing holds on loose sand: the rover slides or goes backwards."""
    point = drive_point(_spec(42.0), math.radians(42), "up")
    assert point.ended in ("slides", "slides back", "unsteady")
    assert point.slip >= 1.0


def test_the_slopes_hold_those_that_were_measured() -> None:
    """A default slope close to a measured one gives way to it."""
    soil = load_soil("grc1_loose")
    assert soil.kind == "table"
    degrees = np.degrees(slopes_with_measured(soil))
    assert {0.0, 5.0, 15.0} <= set(degrees.round(6))
    assert not {10.0, 20.0, 25.0, 30.0} & set(degrees.round(6))
    assert np.degrees(soil.slope_rad) == pytest.approx(
        [d for d in degrees if round(d, 6) not in (0.0, 5.0, 15.0)]
    )
    plain = np.degrees(slopes_with_measured(load_soil("duricrust")))
    assert plain == pytest.approx([0, 5, 10, 15, 20, 25, 30])


def test_the_csv_holds_every_point_with_units(report: SlopeReport, tmp_path: Path) -> None:
    """A row for each point; percent, degrees and millimetres come back to the values."""
    write_slope_csv(report, tmp_path / "slope.csv")
    with (tmp_path / "slope.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == slope_header(wheel_names("exomars"))
    assert len(rows) == len(report.points)
    for row, point in zip(rows, report.points, strict=True):
        assert float(row["slip_percent"]) / 100 == pytest.approx(point.slip, rel=1e-5)
        assert math.radians(float(row["slope_deg"])) == pytest.approx(point.slope_rad, rel=1e-5)
        sinkage_m = float(row["rear_right_sinkage_mm"]) / 1e3
        assert sinkage_m == pytest.approx(point.wheel_sinkage_m[5], rel=1e-5)
        assert float(row["front_left_load_N"]) == pytest.approx(point.wheel_load_n[0], rel=1e-5)


def test_the_figure_draws_what_was_published(report: SlopeReport) -> None:
    """A legend entry for each published curve, and one for each heading."""
    published = published_curves("grc1_loose")
    figure = plot_slope(report, published)
    legend = figure.axes[0].get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert [f"simulated, {heading}" for heading in ("up", "down", "across")] == labels[:3]
    assert {curve.label for curve in published} <= set(labels)
    assert [label for label in labels if "not steady" in label] == []


def test_the_figure_explains_a_hollow_mark_where_there_is_one(report: SlopeReport) -> None:
    """One drive that slid has its entry in the legend, which lies off the axes' inside."""
    slid = dataclasses.replace(report.points[0], ended="slides")
    figure = plot_slope(SlopeReport(report.spec, (slid, *report.points[1:])))
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert "not steady" in legend.get_texts()[-1].get_text()
    figure.draw_without_rendering()
    assert legend.get_window_extent().y0 >= figure.axes[0].get_window_extent().y1


def test_an_altered_copy_of_a_soil_has_no_published_points_beside_it() -> None:
    """Its name in the library is not enough, and a name that is a file's is none."""
    soil = load_soil("grc1_loose")
    assert soil.kind == "table"
    assert published_beside(soil) == published_curves("grc1_loose") != ()
    assert published_beside(soil.model_copy(update={"rolling_resistance": 0.3})) == ()
    assert published_beside(soil.model_copy(update={"name": "mine.yaml"})) == ()


def test_a_killed_run_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Points that were kept are not driven again, and no longer kept once all are there."""
    driven: list[float] = []

    def drive(spec: SlopeSpec, slope_rad: float, heading: str) -> SlopePoint:
        if len(driven) == 2 and not resumed:
            raise KeyboardInterrupt
        driven.append(slope_rad)
        six = (0.1,) * 6
        return SlopePoint(slope_rad, "up", "steady", 0.1, 0.0, 0.0, 0.0, 1.0, six, six, six, six)

    monkeypatch.setattr(slope_rig, "drive_point", drive)
    spec = _spec(1.0, 2.0, 3.0, 4.0).model_copy(update={"headings": ("up",)})
    resumed = False
    with pytest.raises(KeyboardInterrupt):
        run_slope_rig(spec, tmp_path, workers=1)
    kept = sorted(tmp_path.rglob("*.json"))
    assert len(kept) == 2
    assert json.loads(kept[0].read_text())["slip"] == 0.1
    resumed = True
    report = run_slope_rig(spec, tmp_path, workers=1)
    assert len(driven) == 4
    assert [point.slope_rad for point in report.points] == list(spec.slopes_rad)
    assert list(tmp_path.rglob("*")) == []


def test_points_of_others_stay_and_damaged_ones_are_driven_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run removes its own points alone, and reads no more than whole ones."""
    driven: list[float] = []

    def drive(spec: SlopeSpec, slope_rad: float, heading: str) -> SlopePoint:
        driven.append(slope_rad)
        six = (0.1,) * 6
        return SlopePoint(slope_rad, "up", "steady", 0.1, 0.0, 0.0, 0.0, 1.0, six, six, six, six)

    monkeypatch.setattr(slope_rig, "drive_point", drive)
    mine, other = (
        _spec(1.0, 2.0, speed_mps=speed).model_copy(update={"headings": ("up",)})
        for speed in (0.1, 0.2)
    )
    run_slope_rig(other, tmp_path, workers=1, keep=True)
    run_slope_rig(mine, tmp_path, workers=1)
    kept = sorted(tmp_path.rglob("*.json"))
    assert len(kept) == 2
    kept[0].write_text('{"slope_rad": 0.0')
    driven.clear()
    run_slope_rig(other, tmp_path, workers=1)
    assert driven == [other.slopes_rad[0]]
    assert list(tmp_path.rglob("*")) == []
