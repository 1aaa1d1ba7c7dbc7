"""What a sweep has to do: its rows to come, the jobs that make them, and what is there of them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from lpet_sim.sweep.sweep_data import DataSet
from lpet_sim.sweep.sweep_job import Job
from lpet_sim.sweep.sweep_once import PlannedRun, RunSettings
from lpet_sim.sweep.sweep_plan import Variant, job_key, run_key
from lpet_sim.sweep.sweep_spec import SweepSpec
from lpet_sim.sweep.sweep_store import Redo, Row, RowStore


@dataclass(frozen=True)
class PlannedRow:
    """One row to come: a run by its place in the sweep.

    Attributes:
        arm: Name of the arm.
        variant: The estimator with its parameters.
        data_set: On what.
        key: Names the run by all that its row depends on.
        job: Names what it has in common with the other runs on this data set in this arm.
    """

    arm: str
    variant: Variant
    data_set: DataSet
    key: str
    job: str


def plan_rows(
    spec: SweepSpec, variants: Sequence[Variant], data_sets: Sequence[DataSet]
) -> Iterator[PlannedRow]:
    """Give all rows of a sweep, in the order of its table."""
    for arm, sensed in spec.arms.items():
        for variant in variants:
            for data_set in data_sets:
                key = run_key(data_set.digest, sensed, variant, spec)
                job = job_key(data_set.digest, sensed, spec)
                yield PlannedRow(arm, variant, data_set, key, job)


def jobs_of(
    spec: SweepSpec, planned: Sequence[PlannedRow], settings: RunSettings, workers: int
) -> list[Job]:
    """Put missing runs together by data set and arm, and split jobs where workers would wait.

    Args:
        spec: The sweep.
        planned: All rows to come.
        settings: What all runs have in common.
        workers: How many work at once.
    """
    store = RowStore(settings.folder).refresh()
    missing = set(store.missing([p.key for p in planned], settings.redo))
    jobs = {}
    for p in planned:
        if p.job not in jobs:
            recording, arm = Path(p.data_set.path), spec.arms[p.arm]
            wants_bound = spec.bounds and p.job not in store.bounds
            jobs[p.job] = Job(p.job, recording, arm, (), settings, wants_bound)
        if p.key in missing:
            missing.remove(p.key)
            run = PlannedRun(p.key, p.variant.estimator, p.variant.spec)
            jobs[p.job] = replace(jobs[p.job], runs=(*jobs[p.job].runs, run))
    wanted = [job for job in jobs.values() if job.runs or job.bound]
    pieces = -(-2 * workers // len(wanted)) if wanted and workers > 1 else 1
    return [piece for job in wanted for piece in _pieces(job, pieces)]


def _pieces(job: Job, count: int) -> Iterator[Job]:
    """Deal the runs of a job out to several; its bound goes with the first."""
    count = max(1, min(count, len(job.runs)))
    for first in range(count):
        yield replace(job, runs=job.runs[first::count], bound=job.bound and first == 0)


def rows_of(planned: Sequence[PlannedRow], store: RowStore, redo: Redo) -> list[Row]:
    """Give the rows there are in the order of the plan, with what each run is called in it."""
    missing = set(store.missing([p.key for p in planned], redo))
    return [_named(p, store) for p in planned if p.key not in missing]


def _named(planned: PlannedRow, store: RowStore) -> Row:
    names = {
        "run": f"{planned.data_set.name}-{planned.arm}-{planned.variant.label}",
        "data_set": planned.data_set.name,
        "seed": planned.data_set.seed,
        "ended": planned.data_set.ended,
        "arm": planned.arm,
        "variant": planned.variant.label,
        "variant_order": planned.variant.order,
        "spec": json.dumps(planned.variant.spec),
    }
    none = {"bound_m": math.nan, "bound_rad": math.nan, "bound_text": ""}
    bound = store.bounds.get(planned.job, none)
    return names | store.rows[planned.key] | {name: bound[name] for name in none}
