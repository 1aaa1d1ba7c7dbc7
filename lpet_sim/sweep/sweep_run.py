"""The driver of a sweep: it plans the runs, has them done, and puts their rows into one table."""

from __future__ import annotations

import fcntl
import os
import threading
import uuid
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Final

import lpet_sim
from lpet_sim.errors import LpetError, OutputError, SpecError
from lpet_sim.failures import EXCEPTION
from lpet_sim.outputs import output_folder
from lpet_sim.progress import Count, Progress, silent, uncounted
from lpet_sim.sweep.sweep_agenda import PlannedRow, jobs_of, plan_rows, rows_of
from lpet_sim.sweep.sweep_data import LIST, DataSet, find_data_sets, prepare_data_sets
from lpet_sim.sweep.sweep_job import Job, run_job
from lpet_sim.sweep.sweep_once import RunSettings, failure_row, now
from lpet_sim.sweep.sweep_plan import code_digest, expand
from lpet_sim.sweep.sweep_pool import Pool, WorkerDiedError
from lpet_sim.sweep.sweep_spec import SweepSpec
from lpet_sim.sweep.sweep_store import Journal, Redo, Row, RowStore, write_table

TABLE: Final = "rows.parquet"
JOURNALS: Final = "journal"
_LOOK_S: Final = 0.5
_DEATHS_MAX: Final = 3
_PACKAGES: Final = ("numpy", "scipy", "numba")


@dataclass(frozen=True)
class SweepResult:
    """A sweep that is done.

    Attributes:
        path: The table of rows.
        rows: The rows, by arm, variant and data set.
        data_sets: All data sets, those without runs too.
        ran: How many runs were run by this call.
    """

    path: Path
    rows: tuple[Row, ...]
    data_sets: tuple[DataSet, ...]
    ran: int


def run_sweep(
    spec: SweepSpec,
    folder: Path,
    pool: Pool | None = None,
    limit: int | None = None,
    retry_failed: bool = False,
    driving: Progress = silent,
    count: Count = uncounted,
) -> SweepResult:
    """Run what is missing of a sweep, and write the table of all its rows.

    A row is on the disk before the next run starts. The same call after a kill goes on where the
    sweep was, and a changed spec reruns only what depends on the change.

    Args:
        spec: The sweep.
        folder: Where its rows, its table and its drives go; workers on other machines must see it
            under the same name.
        pool: Who does the work; one process if None.
        limit: Use the first so many data sets only; None: all.
        retry_failed: Whether to run again what ended in an exception or a timeout.
        driving: Called with the share of the data sets that are ready.
        count: Called as runs end.

    Returns:
        The rows and where they are.

    Raises:
        LpetError: The spec or a data set cannot be used, the folder cannot be written, another
            sweep is writing to it, or no scheduler answers.
    """
    pool, variants = pool or Pool(), expand(spec.variants)
    found = find_data_sets(spec.data_sets, folder.resolve())[:limit]
    with _alone_in(output_folder(folder.resolve())) as home:
        data_sets = prepare_data_sets(spec.data_sets, found, home, pool, driving)
        used = [data_set for data_set in data_sets if not data_set.left_out]
        if not used:
            raise SpecError(f"no data set is left to run on: {home / LIST} says why")
        planned = list(plan_rows(spec, variants, used))
        redo = Redo(spec.time_limit_s, now() if retry_failed else "")
        settings = _settings(spec, redo, home, pool.is_local)
        store = RowStore(settings.folder).refresh()
        ran = len(store.missing([p.key for p in planned], redo))
        try:
            with _counting(settings.folder, planned, redo, count):
                _run_missing(spec, planned, settings, pool)
        finally:
            rows = rows_of(planned, store.refresh(), redo)
            if rows:
                write_table(home / TABLE, rows, _about(spec, data_sets))
    return SweepResult(home / TABLE, tuple(rows), tuple(data_sets), ran)


def _settings(spec: SweepSpec, redo: Redo, home: Path, is_local: bool) -> RunSettings:
    return RunSettings(
        requirement=spec.requirement,
        evaluation=spec.evaluation,
        odometry=spec.odometry,
        redo=redo,
        driver=uuid.uuid4().hex[:12],
        code=code_digest(True),
        folder=output_folder(home / JOURNALS),
        is_local=is_local,
    )


def _run_missing(
    spec: SweepSpec, planned: Sequence[PlannedRow], settings: RunSettings, pool: Pool
) -> None:
    """Have the missing runs done; one whose process dies is tried once more, alone, and fails."""
    jobs, deaths = jobs_of(spec, planned, settings, pool.workers), 0
    while jobs:
        try:
            for _ in pool.unordered(run_job, jobs):
                deaths = 0
        except WorkerDiedError:
            suspects, deaths = _suspects(jobs, settings), deaths + 1
            if not suspects and deaths >= _DEATHS_MAX:
                raise
            for job in suspects:
                _run_alone(job, pool)
        done, jobs = jobs, jobs_of(spec, planned, settings, pool.workers)
        if jobs == done and not deaths:
            raise LpetError(
                f"rows of {len(jobs)} jobs did not come to {settings.folder}: all workers must see "
                "the sweep's folder under the same name as the driver"
            )


def _suspects(jobs: Sequence[Job], settings: RunSettings) -> list[Job]:
    """Give the runs that were under way when a worker died, each as a job of its own."""
    store = RowStore(settings.folder).refresh()
    begun = {key for driver, key in store.starts if driver == settings.driver}
    ended = {key for key in begun if key in store.rows and store.rows[key] not in settings.redo}
    return [
        replace(job, runs=(run,), bound=False)
        for job in jobs
        for run in job.runs
        if run.key in begun - ended
    ]


def _run_alone(job: Job, pool: Pool) -> None:
    """Run one run with nothing beside it; if its process dies again, that is its failure."""
    try:
        for _ in pool.unordered(run_job, [job]):
            pass
    except WorkerDiedError:
        text = "the worker's process died twice in this run: killed, out of memory, or crashed"
        with Journal(job.settings.folder, job.key) as journal:
            journal.row(failure_row(job.runs[0], job.settings, EXCEPTION, text))


@contextmanager
def _alone_in(folder: Path) -> Iterator[Path]:
    """Hold the folder against other sweeps while the block runs; a kill lets go of it, too.

    Raises:
        OutputError: Another sweep is writing to it.
    """
    lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
    try:
        _take_lock(lock, folder)
        yield folder
    finally:
        os.close(lock)


def _take_lock(lock: int, folder: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise OutputError(
            f"another sweep is writing to {folder}; wait for it, or give another --out"
        ) from None


@contextmanager
def _counting(
    folder: Path, planned: Sequence[PlannedRow], redo: Redo, count: Count
) -> Iterator[None]:
    """Watch the rows come in while the block runs, and tell how many there are."""
    over, keys = threading.Event(), [p.key for p in planned]
    store = RowStore(folder)

    def tell() -> None:
        missing = set(store.refresh().missing(keys, redo))
        done = [store.rows[key] for key in keys if key not in missing]
        count(len(done), len(keys), sum(bool(row["failure"]) for row in done))

    def watch() -> None:
        while not over.wait(_LOOK_S):
            tell()

    tell()
    watcher = threading.Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        over.set()
        watcher.join()
        tell()


def _about(spec: SweepSpec, data_sets: Sequence[DataSet]) -> dict[str, object]:
    """Give what the table says of itself."""
    versions = {name: version(name) for name in _PACKAGES} | {"lpet": lpet_sim.__version__}
    return {
        "sweep": spec.to_mapping(),
        "data_sets": [asdict(data_set) for data_set in data_sets],
        "seeds": [data_set.seed for data_set in data_sets],
        "code": {"runs": code_digest(False), "sensing": code_digest(True)},
        "versions": versions,
    }
