"""A study of reachability, terrain by terrain in parallel: what is done is kept and not redone."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from lpet_sim.errors import OutputError
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.planning.reach import check_goal, reach_on
from lpet_sim.planning.reach_result import ReachabilityReport, TerrainResult
from lpet_sim.planning.reach_spec import Case, ReachSpec, cases_of
from lpet_sim.progress import Progress, silent
from lpet_sim.terrain.terrain import build_terrain

REPORT_FILE = "reach.json"
_FOLDER = "terrains"


def run_reach(
    spec: ReachSpec, seed: int, folder: Path, workers: int = 1, progress: Progress = silent
) -> ReachabilityReport:
    """Run a study, or go on with it where it was stopped.

    Each terrain's result is a file of its own below ``folder``; one that was made with another
    spec or seed is made anew.

    Args:
        spec: The study.
        seed: Any integer; the same spec and seed give the same results, whatever the workers.
        folder: Where to keep the results.
        workers: Processes.
        progress: Called with the fraction of the terrains done, or of one terrain's starts.

    Returns:
        What was found; its summary stands in ``reach.json``.

    Raises:
        LpetError: A terrain cannot be built or mapped, the goal is blocked on every one, or the
            folder cannot be written.
    """
    cases = cases_of(spec, seed)
    _check_terrains(cases)
    output_folder(folder / _FOLDER)
    kept = {case.key: _read(case, spec, folder) for case in cases}
    done: dict[str, TerrainResult] = {key: one for key, one in kept.items() if one is not None}
    to_do = [case for case in cases if case.key not in done]
    for case, result in _run(to_do, spec, workers, progress):
        _write(result, case, spec, folder)
        done[case.key] = result
        progress(len(done) / len(cases))
    results = tuple(done[case.key] for case in cases)
    check_goal(results, spec)
    report = ReachabilityReport(spec.name, seed, spec.cell_m, results)
    write_json(report.to_mapping(), folder / REPORT_FILE)
    return report


def write_json(value: Any, path: Path) -> None:
    """Write plain values as JSON, whole or not at all."""
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(value, allow_nan=False, indent=1))


def _check_terrains(cases: tuple[Case, ...]) -> None:
    """Build one terrain of each kind, so that a spec that cannot be built is told at once."""
    for case in cases:
        if case.index == 0:
            build_terrain(case.terrain, case.seed)


def _run(
    cases: list[Case], spec: ReachSpec, workers: int, progress: Progress
) -> Iterator[tuple[Case, TerrainResult]]:
    if workers == 1 or len(cases) <= 1:
        # A single terrain may take a minute: its starts move the bar.
        within = progress if len(cases) == 1 else silent
        for case in cases:
            yield case, reach_on(case, spec, within)
        return
    # A forked process would share the locks of the planner's and the compiler's threads.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(workers, len(cases)), mp_context=context) as pool:
        asked = {pool.submit(reach_on, case, spec): case for case in cases}
        try:
            for future in as_completed(asked):
                yield asked[future], future.result()
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _fingerprint(case: Case, spec: ReachSpec) -> str:
    """Name all that a terrain's result depends on."""
    sweep = ("name", "terrain", "terrains", "rock_factors", "abundances")
    of_spec = {key: value for key, value in spec.to_mapping().items() if key not in sweep}
    whole = [case.terrain.to_mapping(), case.seed, of_spec]
    return hashlib.sha256(json.dumps(whole, sort_keys=True).encode()).hexdigest()


def _path(case: Case, folder: Path) -> Path:
    return folder / _FOLDER / f"{case.key}.json"


def _write(result: TerrainResult, case: Case, spec: ReachSpec, folder: Path) -> None:
    mapping = {"made_from": _fingerprint(case, spec), "result": result.to_mapping()}
    with whole_file(_path(case, folder)) as temporary:
        temporary.write_text(json.dumps(mapping))


def _read(case: Case, spec: ReachSpec, folder: Path) -> TerrainResult | None:
    """Read a result that is there and was made from the same; None: it is to be made."""
    try:
        mapping = json.loads(_path(case, folder).read_text())
        if mapping["made_from"] != _fingerprint(case, spec):
            return None
        return TerrainResult.from_mapping(mapping["result"])
    except FileNotFoundError:
        return None
    except OSError as error:
        raise OutputError(f"cannot read {_path(case, folder)}: {error.strerror}") from None
    except (ValueError, KeyError, TypeError):
        return None
