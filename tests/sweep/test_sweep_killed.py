"""A sweep that is killed, or loses a worker, ends with the rows of an undisturbed one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from lpet_sim.errors import LpetError, OutputError
from lpet_sim.sweep import sweep_run
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_run import SweepResult, run_sweep
from lpet_sim.sweep.sweep_spec import SweepSpec
from lpet_sim.sweep.sweep_store import read_table
from tests.sweep.sweep_jobs import run_slow_job
from tests.sweep.tiny_recordings import (
    events,
    small_sweep,
    without_timing,
    write_sweep,
    write_tiny,
)

ROOT = Path(__file__).parents[2]
COMMAND = """
import sys
from lpet_sim.cli import main
from lpet_sim.sweep import sweep_run
from tests.sweep.sweep_jobs import run_slow_job
sweep_run.run_job = run_slow_job
sys.argv = ["lpet", "sweep", *sys.argv[1:]]
main()
"""
ENOUGH = 5


@pytest.fixture(scope="module")
def mapping(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Make two recordings and a sweep of 16 runs over them."""
    folder = tmp_path_factory.mktemp("recordings")
    for seed in (1, 2):
        write_tiny(folder / f"set{seed}.rrd", seed, duration_s=10.0)
    variants = [
        {"estimator": "dead_reckoning"},
        {"estimator": "slam", "sweep": {"retention.images": [1, 2, 4]}},
    ]
    return small_sweep(folder, variants=variants)


@pytest.fixture(scope="module")
def undisturbed(mapping: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> SweepResult:
    """Run the sweep without a kill; not to be changed."""
    return run_sweep(SweepSpec.from_mapping(mapping), tmp_path_factory.mktemp("calm"), Pool(2))


def _wait_for(what: Callable[[], bool], limit_s: float = 120.0) -> None:
    end_s = time.monotonic() + limit_s
    while not what():
        assert time.monotonic() < end_s, "it did not come to that"
        time.sleep(0.02)


def _rows_in(folder: Path) -> list[dict[str, Any]]:
    return [event["row"] for event in events(folder) if "row" in event]


def _assert_nothing_run_twice(folder: Path, under_way: int) -> None:
    """Every run has one row; none but those under way at the kill was started again."""
    assert set(Counter(row["key"] for row in _rows_in(folder)).values()) == {1}
    starts = Counter(event["start"] for event in events(folder) if "start" in event)
    assert sum(count - 1 for count in starts.values()) <= under_way


def test_a_sweep_killed_half_way_ends_with_the_rows_of_an_undisturbed_one(
    mapping: dict[str, Any], undisturbed: SweepResult, tmp_path: Path
) -> None:
    """SIGKILL to the command, then the same command again; two runs were under way at most."""
    spec, out = write_sweep(tmp_path / "sweep.yaml", mapping), tmp_path / "out"
    command = [sys.executable, "-c", COMMAND, str(spec), "--out", str(out), "--workers", "2"]
    first = subprocess.Popen(command, cwd=ROOT, start_new_session=True)
    _wait_for(lambda: len(_rows_in(out)) >= ENOUGH)
    first.send_signal(signal.SIGKILL)
    assert first.wait() == -signal.SIGKILL
    assert not (out / "rows.parquet").exists()
    again = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    rows, _ = read_table(out / "rows.parquet")
    assert without_timing(rows) == without_timing(undisturbed.rows)
    _assert_nothing_run_twice(out, under_way=2)
    assert "ran 16 runs" not in again.stdout


def test_a_dask_cluster_that_loses_a_worker_gives_the_same_rows(
    mapping: dict[str, Any],
    undisturbed: SweepResult,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two worker processes of a real cluster, one of them killed in the midst of a job."""
    dask = pytest.importorskip("dask")
    distributed = pytest.importorskip("distributed")
    monkeypatch.setattr(sweep_run, "run_job", run_slow_job)
    found: list[SweepResult] = []
    with (
        dask.config.set({"temporary-directory": str(tmp_path / "dask")}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
    ):
        pool = Pool(scheduler=cluster.scheduler_address)
        spec, out = SweepSpec.from_mapping(mapping), tmp_path / "out"
        sweep = threading.Thread(target=lambda: found.append(run_sweep(spec, out, pool)))
        sweep.start()
        _wait_for(lambda: len(_rows_in(out)) >= ENOUGH)
        victim = int(_rows_in(out)[-1]["worker"].split(":")[1])
        os.kill(victim, signal.SIGKILL)
        sweep.join(120.0)
    assert without_timing(found[0].rows) == without_timing(undisturbed.rows)
    _assert_nothing_run_twice(out, under_way=1)
    workers = {row["worker"] for row in found[0].rows}
    assert len(workers) >= 2


def test_a_scheduler_that_is_not_there_is_named(mapping: dict[str, Any], tmp_path: Path) -> None:
    """With what to start."""
    pytest.importorskip("distributed")
    pool = Pool(scheduler="udp-ish://nowhere")
    with pytest.raises(LpetError, match="no Dask scheduler answers at udp-ish://nowhere"):
        run_sweep(SweepSpec.from_mapping(mapping), tmp_path, pool)


def test_two_sweeps_do_not_write_to_one_folder(
    mapping: dict[str, Any], undisturbed: SweepResult
) -> None:
    """The second one is told to wait."""
    folder = undisturbed.path.parent
    with (
        sweep_run._alone_in(folder),
        pytest.raises(OutputError, match="another sweep is writing to"),
    ):
        run_sweep(SweepSpec.from_mapping(mapping), folder)
