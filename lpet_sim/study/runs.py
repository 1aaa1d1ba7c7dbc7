"""The runs of a study: its algorithms with the chosen sensor on its drives, as a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from lpet_sim.evaluation.rows import Rows, read_rows
from lpet_sim.study.spec import StudySpec
from lpet_sim.sweep.sweep_spec import SweepSpec
from lpet_sim.tradeoff.recommend import RecommendedSensor

ARM: Final = "chosen sensor"
DRIVE: Final = "drive"


def sweep_of(spec: StudySpec, sensor: RecommendedSensor, drives: Path) -> SweepSpec:
    """Give the sweep of a study: one arm for each draw of the chosen sensor.

    Args:
        spec: The study.
        sensor: The sensor.
        drives: Folder of the drives.
    """
    return SweepSpec(
        name=spec.name,
        data_sets={"recordings": (str(drives / "*.rrd"),)},
        arms={f"draw{k}": _arm(sensor, k) for k in range(1, spec.draws + 1)},
        variants=spec.algorithms,
        requirement=spec.requirement,
        evaluation={"start_m": spec.requirement.start_m},
        bounds=True,
    )


def _arm(sensor: RecommendedSensor, draw: int) -> dict[str, Any]:
    return {"sensor": sensor.landmarks, "sensors": sensor.sensors, "draw": draw}


def study_rows(path: Path) -> Rows:
    """Read the runs of a study, its draws as runs of one arm, each on a data set of its own.

    Raises:
        RowsError: The file is no table of runs.
    """
    rows = read_rows(path)
    drives, draws = rows["data_set"], rows["arm"]
    named = [f"{drive}-{draw}" for drive, draw in zip(drives, draws, strict=True)]
    return rows.with_columns(
        drive=drives,
        data_set=np.array(named, dtype=object),
        arm=np.full(len(rows), ARM, dtype=object),
    )
