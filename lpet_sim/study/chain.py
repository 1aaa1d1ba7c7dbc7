"""The chain of a study, from requirement to verdict, stage by stage."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from lpet_sim.evaluation.rows import Rows
from lpet_sim.outputs import output_folder
from lpet_sim.planning.reach_outputs import write_reach
from lpet_sim.planning.reach_result import ReachabilityReport
from lpet_sim.planning.reach_run import run_reach
from lpet_sim.planning.worst_paths import drives_forwards, rank_worst
from lpet_sim.progress import Count, Progress, silent, uncounted
from lpet_sim.study.drives import drive_ways, save_ways
from lpet_sim.study.runs import study_rows, sweep_of
from lpet_sim.study.spec import StudySpec
from lpet_sim.study.stages import Products, Stage, StageResult, run_stages
from lpet_sim.sweep.sweep_data import DataSet, find_data_sets, prepare_data_sets
from lpet_sim.sweep.sweep_plan import expand
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_run import TABLE, run_sweep
from lpet_sim.sweep.sweep_spec import DataSetsSpec
from lpet_sim.tradeoff.recommend import RecommendedSensor
from lpet_sim.tradeoff.run import run_tradeoff
from lpet_sim.tradeoff.spec import SimulationSpec, TradeoffSpec
from lpet_sim.tradeoff.tradeoff_files import write_tradeoff

REACH: Final = "reachability"
WAYS: Final = "ways"
DRIVES: Final = "drives"
SENSOR: Final = "sensor"
RUNS: Final = "runs"


Show = Callable[[str], AbstractContextManager[tuple[Progress, Count]]]
"""Shows how far a stage is while a block runs, by its share done or by its runs."""


@contextmanager
def unshown(title: str) -> Iterator[tuple[Progress, Count]]:
    """Show nothing."""
    del title
    yield silent, uncounted


@dataclass(frozen=True)
class Hands:
    """What the stages work with.

    Attributes:
        workers: Processes.
        show: Shows how far a stage is.
    """

    workers: int = 1
    show: Show = unshown


@dataclass(frozen=True, eq=False)
class StudyResult:
    """What a study's stages left.

    Attributes:
        spec: The study.
        seed: Its seed.
        folder: Its folder.
        stages: What became of each stage that there was need for.
        reach: What reachability found.
        sensor: The sensor that the algorithms ran with; None where no way leads to the goal.
        rows: Their runs; None likewise.
    """

    spec: StudySpec
    seed: int
    folder: Path
    stages: tuple[StageResult, ...]
    reach: ReachabilityReport
    sensor: RecommendedSensor | None
    rows: Rows | None


def run_study(spec: StudySpec, folder: Path, seed: int, hands: Hands) -> StudyResult:
    """Bring a study up to date: the same call after a kill, or with a changed spec, goes on.

    Args:
        spec: The study.
        folder: Its folder; each stage's product in it may be replaced by one's own.
        seed: Any integer.
        hands: Workers and progress.

    Raises:
        LpetError: There is no such algorithm, the goal lies in a rock, the space of sensors is
            empty, a product that was put in place of a stage's own cannot be read, or the folder
            cannot be written.
    """
    # What cannot be built is told before hours are spent.
    for variants in (spec.algorithms, spec.sensors.estimators):
        expand(variants)
    home = output_folder(folder).resolve()
    first = [_reachability(spec, seed, hands)]
    (reached,) = run_stages(first, home)
    report = _report(spec, seed, reached.path)
    if not any(drives_forwards(way.start) for way in rank_worst(report, spec.reach)):
        return StudyResult(spec, seed, home, (reached,), report, None, None)
    done = [reached, *run_stages([*first, *_later(spec, seed, hands)], home)[1:]]
    at = {stage.name: stage.path for stage in done}
    sensor = RecommendedSensor.from_yaml(at[SENSOR])
    return StudyResult(spec, seed, home, tuple(done), report, sensor, study_rows(at[RUNS]))


def _report(spec: StudySpec, seed: int, path: Path) -> ReachabilityReport:
    return run_reach(spec.reach, seed, path)


def _later(spec: StudySpec, seed: int, hands: Hands) -> list[Stage]:
    return [
        _ways(spec, seed),
        _drives(hands),
        _sensor(spec, seed, hands),
        _runs(spec, hands),
    ]


def _reachability(spec: StudySpec, seed: int, hands: Hands) -> Stage:
    def make(products: Products, path: Path) -> None:
        del products
        with hands.show("planning from the starts") as (progress, _):
            report = run_reach(spec.reach, seed, path, hands.workers, progress)
        write_reach(report, spec.reach, path, 0)

    return Stage(REACH, "reachability", (), [spec.parts("reach"), seed], make)


def _ways(spec: StudySpec, seed: int) -> Stage:
    def make(products: Products, path: Path) -> None:
        ranked = rank_worst(_report(spec, seed, products[REACH]), spec.reach)
        save_ways(ranked, spec.reach.mobility, spec.drives, seed, path)

    return Stage(WAYS, "ways", (REACH,), [spec.parts("reach", "drives"), seed], make)


def _drives(hands: Hands) -> Stage:
    def make(products: Products, path: Path) -> None:
        with hands.show("driving the ways") as (progress, _):
            drive_ways(products[WAYS], path, hands.workers, progress)

    return Stage(DRIVES, "drives", (WAYS,), None, make)


def _sensor(spec: StudySpec, seed: int, hands: Hands) -> Stage:
    def make(products: Products, path: Path) -> None:
        folder = path.parent / "tradeoff"
        told = tradeoff_of(spec, data_sets(products[DRIVES], folder))
        with hands.show("choosing the sensor") as (progress, count):
            pool = Pool(hands.workers)
            found = run_tradeoff(told, folder, seed, pool, progress=progress, count=count)
        write_tradeoff(found, folder)
        found.sensor.to_yaml(path)

    parts = spec.parts("sensors", "requirement", "distance_m", "drives", "reach")
    return Stage(SENSOR, "sensor.yaml", (DRIVES,), [parts, seed], make)


def _runs(spec: StudySpec, hands: Hands) -> Stage:
    def make(products: Products, path: Path) -> None:
        sensor = RecommendedSensor.from_yaml(products[SENSOR])
        sweep = sweep_of(spec, sensor, products[DRIVES])
        with hands.show("running the algorithms") as (_, count):
            run_sweep(sweep, path.parent, Pool(hands.workers), count=count)

    parts = spec.parts("algorithms", "requirement", "draws")
    return Stage(RUNS, f"algorithms/{TABLE}", (DRIVES, SENSOR), parts, make)


def data_sets(drives: Path, folder: Path) -> list[DataSet]:
    """Look over the drives of a study."""
    told = DataSetsSpec(recordings=(str(drives / "*.rrd"),))
    home = output_folder(folder)
    return prepare_data_sets(told, find_data_sets(told, home), home, Pool())


def tradeoff_of(spec: StudySpec, drives: list[DataSet]) -> TradeoffSpec:
    """Give a study's choice of sensor as a trade-off over its drives."""
    chosen = spec.sensors
    distance_m = spec.distance_m or float(np.mean([drive.path_m for drive in drives]))
    simulation = SimulationSpec(
        recordings=tuple(drive.path for drive in drives),
        survivors_max=max(chosen.survivors, 1),
        draws=chosen.draws,
        variants=chosen.estimators,
    )
    shared = {name: getattr(chosen, name) for name in _SHARED}
    return TradeoffSpec(
        name=spec.name,
        site=spec.site(max(distance_m, 2.0)),
        requirement=spec.requirement,
        simulation=simulation if chosen.survivors > 0 else None,
        **shared,
    )


_SHARED: Final = ("space", "sampling", "static", "proxies", "constraints", "rule")
