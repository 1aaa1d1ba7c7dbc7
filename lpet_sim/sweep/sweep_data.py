"""The data sets of a sweep: found or driven, looked over once, and listed with what they are."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from lpet_sim.errors import LpetError, RecordingError, SpecError
from lpet_sim.evaluation.errors import distance_driven_m
from lpet_sim.outputs import whole_file
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.rover.model_spec import identity_of
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_spec import DataSetsSpec
from lpet_sim.sweep.traverse import TraverseSpec

LIST = "data_sets.json"
_GOAL = "goal"


@dataclass(frozen=True, slots=True)
class DataSet:
    """A recording to run on.

    Attributes:
        name: What it is called in run names.
        path: Where it is.
        seed: The seed it was driven with, None for real data.
        digest: Names its content.
        path_m: Distance truly driven [m].
        ended: Kind of the event that ended the drive, empty where that is not known.
        note: One sentence where the drive did not go as planned.
        left_out: Why no runs are made on it; empty where they are.
        stamp: Size and time of the file that was looked over.
        origin: Names the traverse, rover and seed that drove it, where a sweep did.
    """

    name: str
    path: str
    seed: int | None = None
    digest: str = ""
    path_m: float = 0.0
    ended: str = ""
    note: str = ""
    left_out: str = ""
    stamp: tuple[int, int] = (0, 0)
    origin: str = ""


@dataclass(frozen=True, slots=True)
class _ToPrepare:
    """A data set that may still have to be driven."""

    data_set: DataSet
    traverse: TraverseSpec | None


def find_data_sets(spec: DataSetsSpec, folder: Path) -> list[DataSet]:
    """Name the data sets and where they are or will be, in order; no file is read.

    Args:
        spec: The data sets.
        folder: The sweep's own folder, where drives are kept.

    Raises:
        SpecError: A glob finds nothing, or two recordings have one name.
    """
    if spec.traverse is not None:
        seeds = range(spec.first, spec.first + spec.count)
        names = [f"{spec.traverse.name}{seed:03d}" for seed in seeds]
        paths = [folder / "data_sets" / f"{name}.rrd" for name in names]
        return [DataSet(n, str(p), s) for n, p, s in zip(names, paths, seeds, strict=True)]
    found = dict.fromkeys(path for pattern in spec.recordings for path in _globbed(pattern))
    twins = [name for name, n in Counter(Path(path).stem for path in found).items() if n > 1]
    if twins:
        raise SpecError(f"two recordings are called '{twins[0]}': their runs need different names")
    return [DataSet(Path(path).stem, path) for path in found]


def _globbed(pattern: str) -> list[str]:
    path = Path(pattern)
    inner = str(path.relative_to(path.anchor))
    found = [path] if path.is_file() else sorted(Path(path.anchor).glob(inner))
    if not found:
        raise SpecError(
            f"data_sets.recordings: there is no {pattern}; give paths or globs of .rrd files, "
            "beside the YAML file"
        )
    return [str(path.resolve()) for path in found]


def prepare_data_sets(
    spec: DataSetsSpec,
    data_sets: Sequence[DataSet],
    folder: Path,
    pool: Pool,
    progress: Progress = silent,
) -> list[DataSet]:
    """Drive what is not there, look every recording over, and list them all in `LIST`.

    A drive that failed on the way is a data set like any other. One that could not start, or that
    is shorter than asked for, is listed with the reason and not used.

    Args:
        spec: The data sets.
        data_sets: As found.
        folder: The sweep's own folder.
        pool: Who drives.
        progress: Called after each data set.

    Raises:
        RecordingError: A file is no recording, holds no truth, or was driven by another traverse.
    """
    known = {held.path: held for held in _listed(folder / LIST)}
    wanted = [replace(d, origin=_origin(spec.traverse, d.seed)) for d in data_sets]
    current = [_if_current(known.get(d.path), d) for d in wanted]
    stale = [
        _ToPrepare(d, spec.traverse) for d, held in zip(wanted, current, strict=True) if not held
    ]
    ready = {held.path: held for held in current if held}
    progress(len(ready) / len(data_sets))
    problems = []
    for done in pool.unordered(_prepare, stale):
        if isinstance(done, str):
            problems.append(done)
        else:
            ready[done.path] = done
        progress((len(ready) + len(problems)) / len(data_sets))
    if problems:
        raise RecordingError(min(problems))
    chosen = [_long_enough(ready[d.path], spec.min_path_m) for d in data_sets]
    with whole_file(folder / LIST) as temporary:
        temporary.write_text(json.dumps([asdict(d) for d in chosen], indent=1))
    return chosen


def _listed(path: Path) -> list[DataSet]:
    """Read the list of an earlier call; one that cannot be read is made anew."""
    try:
        listed: list[dict[str, Any]] = json.loads(path.read_text())
        return [DataSet(**(held | {"stamp": tuple(held["stamp"])})) for held in listed]
    except (OSError, ValueError, TypeError, KeyError):
        return []


def _if_current(held: DataSet | None, data_set: DataSet) -> DataSet | None:
    """Give what is known of a data set, if file and origin are still those looked over."""
    if held is None or not held.digest:
        return None
    if (held.name, held.origin) != (data_set.name, data_set.origin):
        return None
    path = Path(data_set.path)
    return held if path.exists() and _stamp(path) == held.stamp else None


def _stamp(path: Path) -> tuple[int, int]:
    seen = path.stat()
    return seen.st_size, seen.st_mtime_ns


def _prepare(item: _ToPrepare) -> DataSet | str:
    """Drive a data set unless it is there, and look it over; gives a sentence if it cannot be."""
    data_set, path = item.data_set, Path(item.data_set.path)
    if item.traverse is not None and not path.exists():
        assert data_set.seed is not None
        try:
            simulate(item.traverse, data_set.seed, path)
        except LpetError as error:
            return replace(data_set, left_out=f"it could not be driven: {error}")
    try:
        return _looked_over(data_set, read_recording(path), item.traverse)
    except RecordingError as error:
        return str(error)


def _looked_over(data_set: DataSet, recording: Recording, traverse: TraverseSpec | None) -> DataSet:
    path, truth = Path(data_set.path), recording.truth
    if truth is None:
        raise RecordingError(f"{path} holds no truth to score against; give one that does")
    if traverse is not None:
        _check_origin(path, recording.manifest, traverse, data_set.seed)
    ended = "" if truth.ending is None else truth.ending.kind
    with path.open("rb") as file:
        content = hashlib.file_digest(file, "sha256").hexdigest()[:16]
    return replace(
        data_set,
        seed=recording.manifest.seed,
        digest=content,
        path_m=float(distance_driven_m(truth.trajectory)[-1]),
        ended=ended,
        note="" if ended in ("", _GOAL) else f"the drive did not reach its goal: {ended}",
        stamp=_stamp(path),
    )


def _check_origin(path: Path, manifest: Manifest, traverse: TraverseSpec, seed: int | None) -> None:
    said = [manifest.specs.get("traverse"), manifest.specs.get("rover_model"), manifest.seed]
    if said != _made_by(traverse, seed):
        raise RecordingError(
            f"{path} was driven by another traverse, rover or seed; remove it, or give the sweep "
            "another folder"
        )


def _made_by(traverse: TraverseSpec, seed: int | None) -> list[Any]:
    """Say what a drive hangs on, as its manifest does."""
    return [traverse.to_mapping(), identity_of(traverse.rover.model), seed]


def _origin(traverse: TraverseSpec | None, seed: int | None) -> str:
    if traverse is None:
        return ""
    told = json.dumps(_made_by(traverse, seed), sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()[:16]


def _long_enough(data_set: DataSet, min_path_m: float) -> DataSet:
    if not data_set.digest:
        return data_set
    is_short = data_set.path_m < min_path_m
    text = f"its path of {data_set.path_m:.2f} m is shorter than {min_path_m:g} m"
    return replace(data_set, left_out=text if is_short else "")
