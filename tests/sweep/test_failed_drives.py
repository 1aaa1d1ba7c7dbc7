"""A drive that fails on the way is recorded, localized and scored like any other."""

from pathlib import Path

import pytest
import yaml

from lpet_sim.evaluation import Requirement
from lpet_sim.evaluation.tables import event_table
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.truth import Event
from lpet_sim.sweep.report import score_tables
from lpet_sim.sweep.score import estimate_recording, score_recording
from lpet_sim.sweep.simulate import SimulateResult, simulate
from lpet_sim.sweep.traverse import TraverseSpec
from tests.command import TINY, runner

FAULTS = {
    "time_limit_s": 30.0,
    "stuck_wheels": [
        {"wheel": f"{row}_{side}", "start_s": 3.0}
        for row in ("front", "middle", "rear")
        for side in ("left", "right")
    ],
    "failures": {"ends_on": ["stuck"], "stuck_window_s": 4.0},
}


def _spec() -> dict[str, object]:
    spec = yaml.safe_load(TINY)
    spec["drive"] |= {"waypoints_m": [[0, 0], [2, 0]], **FAULTS}
    return spec


@pytest.fixture(scope="module")
def failed(tmp_path_factory: pytest.TempPathFactory) -> SimulateResult:
    """Drive with every wheel locked after 3 s; not to be changed."""
    path = tmp_path_factory.mktemp("failed") / "run.rrd"
    return simulate(TraverseSpec.from_mapping(_spec()), 1, path)


def test_the_events_of_a_failed_drive_come_back_from_its_recording(failed: SimulateResult) -> None:
    """In order of time, each with its duration, and the one that ended it marked."""
    truth = read_recording(failed.path).truth
    assert truth is not None
    assert truth.events == failed.events
    assert truth.ending is not None
    assert truth.ending.kind == "stuck"
    times = [event.t_ns for event in truth.events]
    assert times == sorted(times)
    assert [event.kind for event in truth.events].count("stuck_wheel") == 6
    end_s = truth.body.t_ns[-1] / 1e9
    for event in truth.events[1:]:
        assert event.t_ns / 1e9 + event.duration_s == pytest.approx(end_s)


def test_a_failed_drive_is_scored_over_what_it_drove(failed: SimulateResult) -> None:
    """Both odometries cover all of it, and the tables say how it ended."""
    estimate_recording(failed.path)
    score = score_recording(failed.path)
    assert all(result.completion == 1.0 for result in score.results)
    # Locked after 3 s of speeding up by 0.02 m/s2: a t^2 / 2.
    assert score.results[0].distance_m == pytest.approx(0.09, abs=0.01)
    first, *_ = score_tables(score, Requirement())
    assert str(first.title) == "The drive, ended by stuck"
    assert first.row_count == 7


def test_the_commands_take_a_failed_drive(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Simulating and estimating end well; a check of the verdict ends in 0 or 1, as it comes."""
    lpet = runner(monkeypatch, capsys)
    (tmp_path / "spec.yaml").write_text(yaml.safe_dump(_spec()))
    run = tmp_path / "run.rrd"
    simulated = lpet("simulate", tmp_path / "spec.yaml", "--out", run)
    assert simulated.code == 0
    assert "ended by stuck" in simulated.out
    assert "front left wheel's drive is locked" in simulated.out
    assert lpet("estimate", run).code == 0
    scored = lpet("evaluate", run, "--check")
    assert scored.code in (0, 1)
    assert (scored.code == 1) == ("FAIL" in scored.out)


def test_the_table_of_events_leaves_out_routine() -> None:
    """Start, stops and turns are on the timeline only; the end is in the title."""
    events = (
        Event(0, "start"),
        Event(5, "stop", 3.0),
        Event(6, "point_turn", 3.0),
        Event(7_000_000_000, "sliding", 1.25, "slides"),
        Event(9_000_000_000, "goal", 0.0, "there", ends=True),
    )
    table = event_table(events)
    assert table.row_count == 2
    assert list(table.columns[0].cells) == ["7.0", "9.0"]
    assert list(table.columns[1].cells) == ["1.2", ""]
    assert str(event_table(events[:2]).title) == "The drive"
