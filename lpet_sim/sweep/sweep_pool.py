"""Where a sweep's work is done: processes of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

import joblib
from joblib.externals.loky.process_executor import BrokenProcessPool

from lpet_sim.errors import LpetError

Work = TypeVar("Work")
Done = TypeVar("Done")


class WorkerDiedError(LpetError):
    """A worker's process ended in the midst of its work: killed, out of memory, or crashed."""


@dataclass(frozen=True)
class Pool:
    """Who does the work.

    Attributes:
        workers: Processes of this machine at work at once.
        scheduler: Address of a Dask scheduler whose workers do it instead; None: this machine.
    """

    workers: int = 1
    scheduler: str | None = None

    @property
    def is_local(self) -> bool:
        """Whether this machine's processes do the work."""
        return self.scheduler is None

    def unordered(self, do: Callable[[Work], Done], items: Sequence[Work]) -> Iterator[Done]:
        """Do all items and give what comes of each, as each is done.

        Workers of this machine have one thread each, so that sums do not depend on how many there
        are; a Dask worker started by ``dask worker`` has one by default, too. A single worker is a
        process of its own as well.

        Args:
            do: What to do with an item; found by its name in the workers.
            items: The items.

        Raises:
            WorkerDiedError: A worker's process ended; what is not given is not done.
            LpetError: There is no such scheduler, or Dask is not installed.
        """
        if not items:
            return
        # A process that has grown by 300 MB is replaced between two items, which harms nothing.
        warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
        with self._backend() as (jobs, ahead):
            parallel = joblib.Parallel(
                n_jobs=jobs, return_as="generator_unordered", batch_size=1, pre_dispatch=ahead
            )
            try:
                yield from parallel(joblib.delayed(do)(item) for item in items)
            except _deaths() as error:
                said = " ".join(str(error).split())
                raise WorkerDiedError(f"a worker's process died: {said}") from None

    @contextmanager
    def _backend(self) -> Iterator[tuple[int, int | str]]:
        """Choose joblib's backend; gives its number of jobs, and how many are sent ahead."""
        if self.scheduler is None:
            # With one job joblib would work in this process, with its threads: two processes then,
            # of which one at a time has anything to do.
            jobs, ahead = max(2, self.workers), 1 if self.workers == 1 else "2*n_jobs"
            with joblib.parallel_config("loky", inner_max_num_threads=1):
                yield jobs, ahead
            return
        with _connected(self.scheduler), joblib.parallel_config("dask"):
            yield -1, "2*n_jobs"


@contextmanager
def _connected(address: str) -> Iterator[Any]:
    """Connect to a Dask scheduler.

    Raises:
        LpetError: Dask is not installed, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise LpetError(
            "--scheduler needs Dask: install it with pip install 'lpet[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=10)
    except (OSError, ValueError) as error:
        raise LpetError(
            f"no Dask scheduler answers at {address} ({error}); start one with 'dask scheduler' "
            "and workers with 'dask worker', and give its address as tcp://HOST:PORT"
        ) from None
    with client:
        yield client


def _deaths() -> tuple[type[BaseException], ...]:
    """Give the errors that say that a worker died."""
    try:
        from distributed import KilledWorker
    except ImportError:
        return (BrokenProcessPool,)
    return BrokenProcessPool, KilledWorker
