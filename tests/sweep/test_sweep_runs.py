"""A sweep gives the same rows however it is run; what goes wrong in a run stays in its row."""

import json
import math
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from lpet_sim.errors import LpetError, SpecError
from lpet_sim.evaluation.rows import read_rows
from lpet_sim.sweep import sweep_run
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_run import SweepResult, run_sweep
from lpet_sim.sweep.sweep_spec import SweepSpec
from lpet_sim.sweep.sweep_store import Row, RowStore, read_table
from lpet_sim.sweep.time_limit import TimeLimitError, time_limit
from tests.command import TINY, runner
from tests.sweep.sweep_jobs import faulty_known, run_faulty_job
from tests.sweep.tiny_recordings import events, small_sweep, without_timing, write_sweep, write_tiny

_COLUMNS = """
run data_set seed arm estimator variant spec m n retention coupling observable formulation images
path_m completion failure failure_text end_error_m end_x_m end_y_m end_z_m end_percent
worst_percent end_roll_deg end_pitch_deg end_yaw_deg worst_roll_deg worst_pitch_deg worst_yaw_deg
ate_m drift_1m drift_2m drift_50m nees_position nees_attitude nees_pose nis_mean new_mean
matched_mean dropped_mean state_mean state_max anchors_seen_share bridged_share passed
pass_position_throughout pass_position_end pass_roll_throughout pass_roll_end
pass_pitch_throughout pass_pitch_end pass_yaw_throughout pass_yaw_end bound_m bound_rad
error_curve time_total_s time_per_image_ms worker started_at
"""
CONTRACT = set(_COLUMNS.split())


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make three recordings; one of them of a drive that got stuck."""
    folder = tmp_path_factory.mktemp("recordings")
    for seed in (1, 2):
        write_tiny(folder / f"set{seed}.rrd", seed)
    write_tiny(folder / "set3.rrd", 3, ended="stuck", duration_s=15.0)
    return folder


@pytest.fixture(scope="module")
def swept(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> SweepResult:
    """Run the small sweep with one worker and with bounds; not to be changed."""
    spec = SweepSpec.from_mapping(small_sweep(recordings, bounds=True))
    return run_sweep(spec, tmp_path_factory.mktemp("one"), Pool(1))


def test_rows_are_equal_to_the_bit_with_one_worker_and_with_two(
    swept: SweepResult, recordings: Path, tmp_path: Path
) -> None:
    """In every column but timing, and in their order."""
    spec = SweepSpec.from_mapping(small_sweep(recordings, bounds=True))
    seen: list[tuple[int, int, int]] = []
    both = run_sweep(spec, tmp_path, Pool(2), count=lambda *n: seen.append(n))
    assert without_timing(both.rows) == without_timing(swept.rows)
    assert len({row["worker"] for row in swept.rows}) >= 1
    assert seen[0] == (0, 18, 0)
    assert seen[-1] == (18, 18, 0)


def test_the_table_holds_every_column_in_order_of_arm_variant_and_data_set(
    swept: SweepResult,
) -> None:
    """And says what it was made of; the reader of reports takes it."""
    rows, about = read_table(swept.path)
    assert without_timing(rows) == without_timing(swept.rows)
    assert rows[0].keys() >= CONTRACT
    names = ["dead_reckoning", "m2-n9999-coupled-unobservable-invariant"]
    names.append(names[1].replace("m2", "m4"))
    places = [(row["arm"], row["variant"], row["data_set"]) for row in rows]
    sets = ("set1", "set2", "set3")
    assert places == [(a, v, d) for a in ("recorded", "biased") for v in names for d in sets]
    assert rows[3]["run"] == f"set1-recorded-{names[1]}"
    assert about["seeds"] == [1, 2, 3]
    assert about["sweep"]["name"] == "tiny"
    read = read_rows(swept.path)
    assert read["error_curve"].shape == (18, 51)
    assert read["passed"].dtype == bool


def test_a_row_tells_what_the_run_did(swept: SweepResult) -> None:
    """Wheels that read 2 % too much give 2 %; a bound lies below the error of the filter."""
    reckoned = next(row for row in swept.rows if row["variant"] == "dead_reckoning")
    assert reckoned["path_m"] == pytest.approx(3.0, abs=0.01)
    assert reckoned["end_percent"] == pytest.approx(2.0, abs=0.1)
    assert reckoned["drift_1m"] == pytest.approx(2.0, abs=0.1)
    assert math.isnan(reckoned["drift_50m"])
    assert math.isnan(reckoned["state_max"])
    assert not reckoned["passed"]
    assert reckoned["pass_yaw_end"]
    assert reckoned["error_curve"][0] == pytest.approx(0.0, abs=1e-3)
    assert reckoned["error_curve"][25] == pytest.approx(0.03, abs=0.002)
    assert reckoned["error_curve"][-1] == pytest.approx(reckoned["end_error_m"])
    filtered = next(row for row in swept.rows if row["m"] == 4)
    assert filtered["images"] == 31
    assert filtered["end_percent"] < 1.0
    assert 0 < filtered["bound_m"] < 0.05
    assert filtered["bound_m"] == reckoned["bound_m"]
    assert filtered["state_max"] >= filtered["state_mean"] > 10
    assert 0.5 < filtered["nis_mean"] < 1.5
    biased = next(row for row in swept.rows if row["m"] == 4 and row["arm"] == "biased")
    assert biased["bound_m"] != filtered["bound_m"]


def test_a_drive_that_failed_is_scored_over_what_it_drove_and_listed(swept: SweepResult) -> None:
    """It has rows like any other, and the list says how it ended."""
    failed = swept.data_sets[2]
    assert (failed.ended, failed.left_out) == ("stuck", "")
    assert failed.note == "the drive did not reach its goal: stuck"
    rows = [row for row in swept.rows if row["data_set"] == "set3"]
    assert len(rows) == 6
    assert rows[0]["path_m"] == pytest.approx(1.5, abs=0.01)
    listed = json.loads((swept.path.parent / "data_sets.json").read_text())
    assert listed[2]["note"] == failed.note


def test_short_paths_are_left_out_but_listed(recordings: Path, tmp_path: Path) -> None:
    """With the reason; asked for again without the limit, they are used."""
    sets = {"recordings": [str(recordings / "*.rrd")], "min_path_m": 2.0}
    one = [{"estimator": "dead_reckoning"}]
    spec = SweepSpec.from_mapping(small_sweep(recordings, data_sets=sets, variants=one))
    result = run_sweep(spec, tmp_path)
    assert [row["data_set"] for row in result.rows] == ["set1", "set2"] * 2
    listed = json.loads((tmp_path / "data_sets.json").read_text())
    assert listed[2]["left_out"] == "its path of 1.50 m is shorter than 2 m"
    assert listed[2]["note"] == "the drive did not reach its goal: stuck"
    spec = SweepSpec.from_mapping(small_sweep(recordings, variants=one))
    again = run_sweep(spec, tmp_path)
    assert (again.ran, len(again.rows)) == (2, 6)
    assert [data_set.left_out for data_set in again.data_sets] == [""] * 3
    assert run_sweep(spec, tmp_path, limit=1).ran == 0


def test_a_changed_variant_runs_again_and_nothing_else(recordings: Path, tmp_path: Path) -> None:
    """By the starts that the journals tell; a new name costs nothing."""
    one = {"estimator": "dead_reckoning", "name": "a"}
    other = {"estimator": "slam", "name": "b"}
    arms: dict[str, Any] = {"arms": {"recorded": None}}
    spec = small_sweep(recordings, variants=[one, other], **arms)
    assert run_sweep(SweepSpec.from_mapping(spec), tmp_path).ran == 6
    spec["variants"] = [one | {"name": "c"}, other | {"spec": {"retention": {"kind": "keep_all"}}}]
    changed = run_sweep(SweepSpec.from_mapping(spec), tmp_path)
    assert changed.ran == 3
    assert [row["variant"] for row in changed.rows] == ["c"] * 3 + ["b"] * 3
    assert {row["retention"] for row in changed.rows} == {"", "keep_all"}
    starts = [event["start"] for event in events(tmp_path) if "start" in event]
    assert len(starts) == len(set(starts)) == 9


def test_what_goes_wrong_in_a_run_is_a_kind_of_failure_of_its_row(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, swept: SweepResult
) -> None:
    """An exception, a broken filter, a hang, poses that are no numbers, a process that dies."""
    monkeypatch.setattr(sweep_run, "run_job", run_faulty_job)
    kinds = ["raises", "breaks", "hangs", "nan", "dies"]
    sets = {"recordings": [str(recordings / "set1.rrd")]}
    sick = {"estimator": "faulty", "sweep": {"how": kinds}}
    mapping = small_sweep(recordings, data_sets=sets, time_limit_s=5.0)
    mapping["variants"].insert(1, sick)
    with faulty_known():
        result = run_sweep(SweepSpec.from_mapping(mapping), tmp_path, Pool(2))
    rows: dict[str, Row] = {row["run"]: row for row in result.rows if row["arm"] == "recorded"}
    failures = [rows[f"set1-recorded-faulty-how{kind}"] for kind in kinds]
    assert [row["failure"] for row in failures] == [
        "exception", "bad_covariance", "timeout", "not_finite", "exception"
    ]  # fmt: skip
    assert failures[0]["failure_text"] == "ZeroDivisionError: over nothing"
    assert failures[1]["failure_text"] == "not positive definite at image 7"
    assert failures[2]["failure_text"] == "stopped after 5 s"
    assert "process died twice" in failures[4]["failure_text"]
    assert not any(row["passed"] for row in failures)
    assert failures[0]["end_percent"] == math.inf
    assert failures[3]["completion"] == pytest.approx(0.065, abs=0.01)
    healthy = [row for row in result.rows if row["estimator"] != "faulty"]
    undisturbed = [row for row in swept.rows if row["data_set"] == "set1"]
    bare = ("bound_m", "bound_rad", "time_limit_s", "variant_order")
    for row, twin in zip(healthy, undisturbed, strict=True):
        told, other = ({k: v for k, v in r.items() if k not in bare} for r in (row, twin))
        assert without_timing([told]) == without_timing([other])
    with faulty_known():
        again = run_sweep(SweepSpec.from_mapping(mapping), tmp_path, Pool(2))
        assert again.ran == 0
        longer = SweepSpec.from_mapping(mapping | {"time_limit_s": 5.1})
        retried = run_sweep(longer, tmp_path, Pool(2))
    assert retried.ran == 2
    assert {row["failure_text"] for row in retried.rows if row["failure"] == "timeout"} == {
        "stopped after 5.1 s"
    }


def test_failed_runs_are_run_again_only_when_asked(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What lacked something in its first run has a second chance; what went well has none."""
    monkeypatch.setattr(sweep_run, "run_job", run_faulty_job)
    sets = {"recordings": [str(recordings / "set1.rrd")]}
    mapping = small_sweep(recordings, data_sets=sets, arms={"a": None})
    mapping["variants"] = [{"estimator": "faulty"}, {"estimator": "dead_reckoning"}]
    with faulty_known():
        spec = SweepSpec.from_mapping(mapping)
        assert run_sweep(spec, tmp_path).ran == 2
        assert run_sweep(spec, tmp_path).ran == 0
        again = run_sweep(spec, tmp_path, retry_failed=True)
    assert (again.ran, len(again.rows)) == (1, 2)


def test_a_worker_without_the_files_or_the_code_of_the_driver_ends_the_sweep(
    recordings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row must not tell of code that it was not made by."""
    sets = {"recordings": [str(recordings / "set1.rrd")]}
    spec = SweepSpec.from_mapping(small_sweep(recordings, data_sets=sets))
    monkeypatch.setattr(sweep_run, "code_digest", lambda sensing: "another")
    with pytest.raises(LpetError, match="has other source code than the driver"):
        run_sweep(spec, tmp_path / "code")
    monkeypatch.setattr(sweep_run, "JOURNALS", "gone")
    monkeypatch.setattr(sweep_run, "output_folder", lambda path: path)
    (tmp_path / "files").mkdir()
    with pytest.raises(LpetError, match=r"sees no .*gone"):
        run_sweep(spec, tmp_path / "files")
    short = {"recordings": sets["recordings"], "min_path_m": 9.0}
    none = SweepSpec.from_mapping(small_sweep(recordings, data_sets=short))
    with pytest.raises(SpecError, match=r"no data set is left to run on: .*data_sets.json"):
        run_sweep(none, tmp_path / "files")


def test_a_time_limit_stops_work_in_any_thread_and_leaves_what_is_in_time_alone() -> None:
    """Work that ends in time is never hit afterwards."""
    stopped = []

    def spin() -> None:
        try:
            with time_limit(0.05):
                while True:
                    time.sleep(0.001)
        except TimeLimitError:
            stopped.append(True)

    thread = threading.Thread(target=spin)
    thread.start()
    thread.join(10.0)
    assert stopped == [True]
    for _ in range(200):
        with time_limit(0.005):
            pass
    time.sleep(0.05)


def test_torn_lines_are_passed_over(tmp_path: Path) -> None:
    """A kill may leave half a line; what comes in another file counts all the same."""
    row = {"key": "a", "failure": "", "started_at": "1"}
    (tmp_path / "j-1.jsonl").write_text(json.dumps({"row": row}) + '\n{"row": {"key": "b", "fai')
    (tmp_path / "j-2.jsonl").write_text(json.dumps({"row": row | {"started_at": "2"}}) + "\n")
    store = RowStore(tmp_path).refresh()
    assert list(store.rows) == ["a"]
    assert store.rows["a"]["started_at"] == "2"
    with (tmp_path / "j-1.jsonl").open("a") as file:
        file.write('lure": "", "started_at": "3"}}\n')
    assert set(store.refresh().rows) == {"a", "b"}


def test_the_command_drives_senses_and_sweeps(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two drives in physics, sensed without images in three draws; again there is nothing to do."""
    (tmp_path / "drive.yaml").write_text(TINY.replace("sensors: {stereo: null}", ""))
    mapping = small_sweep(
        tmp_path,
        data_sets={"traverse": "drive.yaml", "count": 2},
        arms={
            "sensed": {"period_s": 0.5},
            "same": {"sensor": {"period_s": 0.5}, "draw": 0},
            "drawn": {"sensor": {"period_s": 0.5}, "draw": 1},
        },
        variants=[{"estimator": "slam", "name": "slam"}],
    )
    spec = write_sweep(tmp_path / "sweep.yaml", mapping)
    lpet = runner(monkeypatch, capsys)
    first = lpet("sweep", spec, "--out", tmp_path / "out")
    assert first.code == 0
    assert "ran 4 runs, 2 were there" in first.out
    rows, _ = read_table(tmp_path / "out" / "rows.parquet")
    assert [(row["data_set"], row["seed"]) for row in rows] == 3 * [("tiny001", 1), ("tiny002", 2)]
    assert all(row["failure"] == "" and row["images"] > 5 for row in rows)
    ends = {(row["arm"], row["seed"]): row["end_error_m"] for row in rows}
    assert all(ends["same", seed] == ends["sensed", seed] for seed in (1, 2))
    assert len(set(ends.values())) == 4
    assert "ran 0 runs, 6 were there" in lpet("sweep", spec, "--out", tmp_path / "out").out
    (tmp_path / "drive.yaml").write_text(TINY.replace("[0.3, 0]", "[0.4, 0]"))
    other = lpet("sweep", spec, "--out", tmp_path / "out")
    assert other.code == 2
    assert "was driven by another traverse, rover or seed" in other.err
