"""The ways that a study drives: the worst that reachability found, and others at random."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

import yaml

from lpet_sim.errors import PlanningError, SpecError
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.planning.worst_paths import WorstPath, drives_forwards, traverse_mapping
from lpet_sim.progress import Progress, silent
from lpet_sim.rng import stream
from lpet_sim.study.spec import DrivesSpec
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec

WORST, RANDOM = "worst", "random"
_SEED: Final = re.compile(r"_seed(\d+)$")
_RAMP_S: Final = 10.0


def chosen_ways(
    ranked: Sequence[WorstPath], spec: DrivesSpec, seed: int
) -> Iterator[tuple[str, WorstPath]]:
    """Pick the ways to drive, each with its name.

    Args:
        ranked: All ways, the worst first.
        spec: How many.
        seed: Of the random ones, which are drawn from all ways: a worst one may be among them.

    Raises:
        PlanningError: There is no way that can be driven forwards.
    """
    ways = [way for way in ranked if drives_forwards(way.start)]
    if not ways:
        raise PlanningError("no way to the goal was found that can be driven: nothing to study")
    for rank, way in enumerate(ways[: spec.worst], 1):
        yield f"{WORST}{rank}_seed{way.case.seed}", way
    order = stream(seed, "study", "random ways").permutation(len(ways))
    for rank, k in enumerate(order[: spec.random], 1):
        yield f"{RANDOM}{rank}_seed{ways[k].case.seed}", ways[k]


def save_ways(
    ranked: Sequence[WorstPath], mobility: MobilitySpec, spec: DrivesSpec, seed: int, folder: Path
) -> list[Path]:
    """Save the chosen ways as traverses for `lpet simulate`, each with its seed in its name."""
    output_folder(folder)
    return [
        _saved(folder / f"{name}.yaml", _traverse(name, way, mobility, spec, seed))
        for name, way in chosen_ways(ranked, spec, seed)
    ]


def _saved(path: Path, mapping: dict[str, Any]) -> Path:
    TraverseSpec.from_mapping(mapping, path.name)
    with whole_file(path) as temporary:
        temporary.write_text(yaml.safe_dump(mapping, sort_keys=False))
    return path


def _traverse(
    name: str, way: WorstPath, mobility: MobilitySpec, spec: DrivesSpec, seed: int
) -> dict[str, Any]:
    """Give a way as a traverse with its standstill and its forced slip."""
    mapping = traverse_mapping(way.start, way.case, mobility)
    drive = mapping["drive"] | {"speed_mps": spec.speed_mps}
    if spec.standstill_s > 0:
        drive["stops"] = [{"at_m": 0.0, "duration_s": spec.standstill_s}]
    driving_s = way.start.length_m / spec.speed_mps
    latest_s = driving_s - spec.forced_slip_s - _RAMP_S
    if spec.forced_slip_s > 0 and latest_s > driving_s / 2:
        at_s = stream(seed, "study", "slip", name).uniform(driving_s / 2, latest_s)
        start_s = round(spec.standstill_s + float(at_s), 2)
        drive["forced_slips"] = [{"start_s": start_s, "duration_s": spec.forced_slip_s}]
    return mapping | {"name": name, "drive": drive}


def seed_of(path: Path) -> int:
    """Read the seed that a traverse is driven with from its file's name.

    Raises:
        SpecError: The name has none.
    """
    told = _SEED.search(path.stem)
    if told is None:
        raise SpecError(
            f"{path.name} does not say its seed: call it NAME_seedN.yaml, N being the seed that "
            "its ground is made with"
        )
    return int(told[1])


def drive_ways(
    folder: Path, recordings: Path, workers: int, progress: Progress = silent
) -> list[Path]:
    """Drive every traverse of a folder, without images; what is driven already stays.

    Args:
        folder: Holds ``NAME_seedN.yaml``.
        recordings: Where the recordings go.
        workers: How many are driven at once.
        progress: Told the share that is driven.

    Raises:
        LpetError: A traverse cannot be read or driven; there is none.
    """
    found = sorted(folder.glob("*.yaml"))
    if not found:
        raise SpecError(f"{folder} holds no traverse: put NAME_seedN.yaml there")
    output_folder(recordings)
    wanted = {path: recordings / f"{path.stem}.rrd" for path in found}
    for path in found:
        TraverseSpec.from_yaml(path), seed_of(path)
    todo = [path for path, recording in wanted.items() if not recording.exists()]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        asked = [pool.submit(_drive, path, wanted[path]) for path in todo]
        for done, future in enumerate(as_completed(asked), len(found) - len(todo) + 1):
            future.result()
            progress(done / len(found))
    progress(1.0)
    return list(wanted.values())


def _drive(path: Path, recording: Path) -> None:
    simulate(TraverseSpec.from_yaml(path), seed_of(path), recording)
