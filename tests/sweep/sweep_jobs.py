"""Jobs with estimators that go wrong, for workers that find them by their names."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import ClassVar

import numpy as np

import estimators
from estimators.dead_reckoning import DeadReckoning
from lpet_sim.errors import BrokenFilterError
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.spec import Spec
from lpet_sim.sweep.sweep_job import Job, run_job


class FaultySpec(Spec):
    """What goes wrong: ``raises``, ``breaks``, ``hangs``, ``nan`` or ``dies``."""

    how: str = "raises"


class Faulty:
    """An estimator that goes wrong."""

    needs: ClassVar[tuple[str, ...]] = ("wheels",)
    name = "faulty"

    def __init__(self, spec: FaultySpec) -> None:
        self.how = spec.how

    def estimate(self, measurements: Measurements) -> Estimate:
        """Go wrong."""
        if self.how == "raises":
            raise ZeroDivisionError("over\nnothing")
        if self.how == "breaks":
            raise BrokenFilterError("not positive definite at image 7")
        if self.how == "dies":
            os._exit(1)
        while self.how == "hangs":
            try:
                time.sleep(0.01)
            except Exception:
                continue
        good = DeadReckoning().estimate(measurements)
        poses = good.trajectory.T_world_body
        poses.translation.flags.writeable = True
        poses.translation[40:] = np.nan
        return Estimate(self.name, Trajectory(good.trajectory.t_ns, poses), good.covariance)


@contextmanager
def faulty_known() -> Iterator[None]:
    """Have the faulty estimator among those there are."""
    estimators.ESTIMATORS["faulty"] = (FaultySpec, Faulty)
    try:
        yield
    finally:
        del estimators.ESTIMATORS["faulty"]


def run_faulty_job(job: Job) -> int:
    """Run a job with the faulty estimator among those there are."""
    with faulty_known():
        return run_job(job)


def run_slow_job(job: Job) -> int:
    """Run a job as if each run took a little longer, so that it can be killed half-way."""
    from lpet_sim.sweep import sweep_job

    plain = sweep_job.run_row

    def slow(*arguments: object) -> object:
        time.sleep(0.15)
        return plain(*arguments)  # type: ignore[arg-type]

    sweep_job.run_row = slow  # type: ignore[assignment]
    try:
        return run_job(job)
    finally:
        sweep_job.run_row = plain
