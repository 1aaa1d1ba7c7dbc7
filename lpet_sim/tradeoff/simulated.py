"""Candidates simulated: recorded drives carry their sensors, and real estimators run on them."""

from __future__ import annotations

import math
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from lpet_sim.errors import LpetError
from lpet_sim.evaluation import EvaluationSpec
from lpet_sim.outputs import output_folder
from lpet_sim.progress import Count, uncounted
from lpet_sim.sweep.sweep_data import DataSet, find_data_sets, prepare_data_sets
from lpet_sim.sweep.sweep_once import PlannedRun, RunSettings
from lpet_sim.sweep.sweep_plan import Variant, code_digest, digest, expand
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_spec import DataSetsSpec
from lpet_sim.sweep.sweep_store import Redo, Row, RowStore
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.drives import Drive, missing_runs, run_drive
from lpet_sim.tradeoff.recommend import Efficiency, suite_of
from lpet_sim.tradeoff.spec import SimulationSpec, TradeoffSpec
from lpet_sim.tradeoff.static import predict, setting_of

JOURNALS = "journal"
_QUANTILE = 0.05


@dataclass(frozen=True)
class SimulatedCandidate:
    """What the simulation of one candidate gave.

    Attributes:
        rows: One for each run, with ``candidate``, ``data_set``, ``draw`` and ``variant`` beside
            the columns of a sweep.
        predicted_ratio: Predicted RMS position error over the distances of the recordings.
        predicted_attitude_rad: Predicted RMS angle of the attitude error [rad].
        lead: Label of the variant whose error decides.
    """

    rows: tuple[Row, ...]
    predicted_ratio: float
    predicted_attitude_rad: float
    lead: str

    def of(self, variant: str) -> tuple[Row, ...]:
        """Give the rows of one variant."""
        return tuple(row for row in self.rows if row["variant"] == variant)

    def error_ratio(self, variant: str | None = None) -> float:
        """Give the RMS of the end position error over the distance; infinite if a run failed."""
        return _rms([0.01 * row["end_percent"] for row in self.of(variant or self.lead)])

    def attitude_rad(self, variant: str | None = None) -> float:
        """Give the RMS angle of the attitude error at the end [rad]."""
        angles = [_angle_rad(row) for row in self.of(variant or self.lead)]
        return _rms(angles)

    @property
    def efficiency(self) -> Efficiency:
        """How much worse than its prediction the deciding variant is.

        The upper end is that of the chi-square interval of an RMS, 95 %, with one degree of freedom
        for each run.
        """
        rows = self.of(self.lead)
        ratio = self.error_ratio() / self.predicted_ratio
        turned = self.attitude_rad() / self.predicted_attitude_rad
        grown = math.sqrt(len(rows) / float(chi2.ppf(_QUANTILE, len(rows))))
        failed = sum(bool(row["failure"]) for row in rows)
        return Efficiency(ratio, grown * ratio, grown * turned, len(rows), failed)


@dataclass(frozen=True)
class _Planned:
    """A drive to come, with what its rows are called."""

    index: int
    data_set: DataSet
    variants: tuple[Variant, ...]
    drive: Drive


def simulate_candidates(
    spec: TradeoffSpec,
    candidates: Mapping[int, Candidate],
    folder: Path,
    seed: int,
    pool: Pool,
    count: Count = uncounted,
    bounds: bool = False,
) -> dict[int, SimulatedCandidate]:
    """Simulate candidates on the recordings of a trade-off, each with several draws.

    A row is on the disk before the next run starts; the same call after a kill goes on from there.

    Args:
        spec: The trade-off; it must have a simulation.
        candidates: The sensors by their index.
        folder: Where rows are kept.
        seed: First seed of the draws; all candidates share them.
        pool: Who does the work.
        count: Called as drives end.
        bounds: Whether each row is to hold the Cramer-Rao bound of its measurements, too.

    Returns:
        What came of each, by the index.

    Raises:
        LpetError: There is no simulation in the spec, or a recording cannot be used.
    """
    if spec.simulation is None:
        raise LpetError("the trade-off has no simulation: give its recordings")
    variants = expand(spec.simulation.variants)
    data_sets = _data_sets(spec.simulation, folder, pool)
    settings = _settings(spec, folder)
    planned = list(_plan(spec, candidates, data_sets, variants, settings, seed, bounds))
    store = RowStore(settings.folder).refresh()
    todo = [p.drive for p in planned if missing_runs(p.drive, store)]
    done = len(planned) - len(todo)
    count(done, len(planned), 0)
    for _ in pool.unordered(run_drive, todo):
        done += 1
        count(done, len(planned), 0)
    store.refresh()
    rows = [_named(p, run, v, store) for p in planned for run, v in _runs(p)]
    distances = [d.path_m for d in data_sets]
    return {i: _gathered(spec, i, c, rows, distances, seed) for i, c in candidates.items()}


def _data_sets(spec: SimulationSpec, folder: Path, pool: Pool) -> list[DataSet]:
    told = DataSetsSpec(recordings=spec.recordings)
    home = output_folder(folder.resolve())
    return prepare_data_sets(told, find_data_sets(told, home), home, pool)


def _settings(spec: TradeoffSpec, folder: Path) -> RunSettings:
    assert spec.simulation is not None
    return RunSettings(
        requirement=spec.requirement,
        evaluation=EvaluationSpec(),
        odometry="fused",
        redo=Redo(spec.simulation.time_limit_s),
        driver=uuid.uuid4().hex[:12],
        code=code_digest(True),
        folder=output_folder(folder.resolve() / JOURNALS),
    )


def _plan(
    spec: TradeoffSpec,
    candidates: Mapping[int, Candidate],
    data_sets: Sequence[DataSet],
    variants: tuple[Variant, ...],
    settings: RunSettings,
    seed: int,
    bounds: bool,
) -> Iterator[_Planned]:
    assert spec.simulation is not None
    for draw in range(seed, seed + spec.simulation.draws):
        for data_set in data_sets:
            for index, candidate in candidates.items():
                key = _key(candidate, spec, data_set, draw, settings)
                runs = tuple(
                    PlannedRun(digest([key, v.estimator, v.spec]), v.estimator, v.spec)
                    for v in variants
                )
                told = (Path(data_set.path), candidate, spec.site, draw, runs, settings, bounds)
                yield _Planned(index, data_set, variants, Drive(key, *told))


def _key(
    candidate: Candidate, spec: TradeoffSpec, data_set: DataSet, draw: int, settings: RunSettings
) -> str:
    """Name what the runs on one drive depend on, so that a change reruns only these."""
    site = spec.site
    sensed = candidate.landmark_sensor(site.landmarks, site.speed_mps).to_mapping()
    held = [suite_of(candidate, site).to_mapping(), sensed, spec.requirement.to_mapping()]
    return digest([data_set.digest, draw, settings.code, *held])


def _runs(planned: _Planned) -> Iterator[tuple[PlannedRun, Variant]]:
    return iter(zip(planned.drive.runs, planned.variants, strict=True))


def _named(planned: _Planned, run: PlannedRun, variant: Variant, store: RowStore) -> Row:
    """Give the row of a run with what it is called."""
    drive = planned.drive
    names = {
        "candidate": planned.index,
        "data_set": planned.data_set.name,
        "draw": drive.draw,
        "variant": variant.label,
        "variant_order": variant.order,
    }
    none = {"bound_m": math.nan, "bound_rad": math.nan, "bound_text": ""}
    bound = store.bounds.get(drive.key, none)
    return names | store.rows[run.key] | {name: bound[name] for name in none}


def _gathered(
    spec: TradeoffSpec,
    index: int,
    candidate: Candidate,
    rows: Sequence[Row],
    distances_m: Sequence[float],
    seed: int,
) -> SimulatedCandidate:
    own = tuple(row for row in rows if row["candidate"] == index)
    told = []
    for distance_m in distances_m:
        site = spec.site.model_copy(update={"distance_m": distance_m})
        setting = setting_of(spec.model_copy(update={"site": site}), seed)
        told.append(predict(candidate, setting))
    attitude = _rms([float(np.linalg.norm(p.attitude_rms_rad)) for p in told])
    lead = next(row["variant"] for row in own if row["variant_order"] == 0)
    return SimulatedCandidate(own, _rms([p.error_ratio for p in told]), attitude, lead)


def _angle_rad(row: Row) -> float:
    return math.radians(math.hypot(*(row[f"end_{axis}_deg"] for axis in ("roll", "pitch", "yaw"))))


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(float(np.mean(np.square(values)))) if values else math.nan
