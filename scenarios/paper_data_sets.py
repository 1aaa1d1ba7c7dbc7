"""The data sets of the paper's experiment: at least 30 m of ExoMars terrain, each with slips.

    python -m scenarios.paper_data_sets [--quick] [--count 100] [--out out/paper] [--workers 2]

Drives the traverses in physics, without images, and keeps each in ``out/paper/traverses`` as it
ends; one that is there is not driven again. A drive that gets stuck before it has covered 30 m is
listed, and a further seed takes its place.
"""

from __future__ import annotations

import argparse
import json
import math
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import asdict, dataclass
from itertools import count
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from lpet_sim.errors import LpetError
from lpet_sim.evaluation.errors import distance_driven_m
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.planning.clearance import RouteSpec
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.truth import Event, Truth
from lpet_sim.rng import stream
from lpet_sim.rover.spec import DriveSpec, ForcedSlip, Stop
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terminal import bar, say

OUT = Path("out/paper")
LENGTH_M = 30.2
MIN_PATH_M = 30.0
QUICK_LENGTH_M, QUICK_MIN_PATH_M, QUICK_COUNT = 3.0, 2.5, 4
QUICK_FIRST = 2
"""The way around the rocks of seed 1 is four times as long as straight ahead."""
STANDSTILL_S = 36.0
"""Fifty images at 0.72 s, in which an observable filter maps its anchors."""


def paper_traverse(seed: int, length_m: float = LENGTH_M) -> TraverseSpec:
    """Make the traverse of one data set; the seed chooses ground, path and slips.

    The rover stands for 36 s, then drives a planned path of at least `LENGTH_M` at 100 m/h with one
    forced slip of 5 s (the paper's) and short ones as a Poisson process: one in 60 s on average,
    each 0.3 to 1.5 s long (this project's choice of "stochastic slip"; what emerges from the soil
    comes on top).
    """
    rng = stream(seed, "paper", "traverse")
    bearing, aside = rng.uniform(-math.pi, math.pi), rng.uniform(-1.5, 1.5)
    ahead = np.array([math.cos(bearing), math.sin(bearing)])
    left = np.array([-ahead[1], ahead[0]])
    corners = (np.zeros(2), 0.5 * length_m * ahead + aside * left, length_m * ahead)
    drive = DriveSpec(
        waypoints_m=tuple((float(x), float(y)) for x, y in corners),
        stops=(Stop(at_m=0.0, duration_s=STANDSTILL_S),),
        forced_slips=_slips(
            rng, STANDSTILL_S + length_m / DriveSpec.model_fields["speed_mps"].default
        ),
    )
    return TraverseSpec(
        name=f"paper{seed:03d}",
        terrain="exomars",
        drive=drive,
        route=RouteSpec(obstacle_height_m=0.2, corner_cut_m=0.5),
        move_within_m=3.0,
        images=None,
    )


def _slips(rng: np.random.Generator, end_s: float) -> tuple[ForcedSlip, ...]:
    """Draw the forced slip of 5 s within the middle of the drive, and the short ones around it."""
    long = ForcedSlip(start_s=round(rng.uniform(STANDSTILL_S + 60.0, 0.9 * end_s), 2))
    slips, t_s = [long], STANDSTILL_S
    while (t_s := t_s + rng.exponential(60.0)) < end_s - 5.0:
        slip = ForcedSlip(start_s=round(t_s, 2), duration_s=round(rng.uniform(0.3, 1.5), 2))
        if all(_apart(slip, other) for other in slips):
            slips.append(slip)
    return tuple(sorted(slips, key=lambda slip: slip.start_s))


def _apart(a: ForcedSlip, b: ForcedSlip) -> bool:
    return a.start_s + a.duration_s < b.start_s - 1.0 or b.start_s + b.duration_s < a.start_s - 1.0


def traverse_file(folder: Path, seed: int) -> Path:
    """Say where the recording of a data set lies."""
    return folder / "traverses" / f"paper{seed:03d}.rrd"


@dataclass(frozen=True)
class DrivenSet:
    """What became of the drive of one data set.

    Attributes:
        seed: Its seed.
        path_m: Distance truly driven [m].
        ended: Kind of the event that ended the drive.
        slip_at_m: Distance driven when the long forced slip began [m]; NaN if it never did.
    """

    seed: int
    path_m: float
    ended: str
    slip_at_m: float = math.nan


def drive_data_set(folder: Path, seed: int, length_m: float = LENGTH_M) -> DrivenSet:
    """Drive one data set unless it is there, and say how it ended."""
    path = traverse_file(folder, seed)
    if not path.exists():
        try:
            simulate(paper_traverse(seed, length_m), seed, path)
        except LpetError as error:
            return _keep(path, DrivenSet(seed, 0.0, f"not driven: {error}"))
    return look_over(path, seed)


def look_over(path: Path, seed: int) -> DrivenSet:
    """Read how far a drive came; kept beside the recording, which takes a while to read."""
    kept = path.with_suffix(".json")
    if path.exists() and (not kept.exists() or kept.stat().st_mtime < path.stat().st_mtime):
        truth = read_recording(path).truth
        assert truth is not None
        return _keep(path, _driven(truth, seed))
    return DrivenSet(**json.loads(kept.read_text()))


def _keep(path: Path, driven: DrivenSet) -> DrivenSet:
    with whole_file(path.with_suffix(".json")) as temporary:
        temporary.write_text(json.dumps(asdict(driven)))
    return driven


def _driven(truth: Truth, seed: int) -> DrivenSet:
    so_far_m = distance_driven_m(truth.trajectory)
    ended = "" if truth.ending is None else truth.ending.kind
    slip = max(
        (event for event in truth.events if event.kind == "forced_slip"),
        key=lambda event: event.duration_s,
        default=None,
    )
    at_m = math.nan if slip is None else float(np.interp(*_when(slip, truth), so_far_m))
    return DrivenSet(seed, float(so_far_m[-1]), ended, at_m)


def _when(event: Event, truth: Truth) -> tuple[float, np.ndarray]:
    return event.t_ns / NS_PER_S, truth.body.t_ns / NS_PER_S


def driven_sets(folder: Path) -> list[DrivenSet]:
    """Look over all data sets that were driven, or could not be, by seed."""
    found = {path.stem for path in (folder / "traverses").glob("paper*.*")}
    seeds = sorted(int(stem.removeprefix("paper")) for stem in found)
    return [look_over(traverse_file(folder, seed), seed) for seed in seeds]


def drive_until(
    folder: Path,
    wanted: int,
    workers: int,
    length_m: float = LENGTH_M,
    min_path_m: float = MIN_PATH_M,
    first: int = 1,
    progress: Progress = silent,
) -> list[DrivenSet]:
    """Drive data sets from the first seed on until so many are long enough; those there are kept.

    For each that falls short one more seed is driven, so that the seeds do not depend on the order
    in which drives end.

    Args:
        folder: Where they go.
        wanted: How many data sets are to be long enough.
        workers: How many are driven at once.
        length_m: Length of the planned path [m].
        min_path_m: Shorter paths do not count [m].
        first: The first seed.
        progress: Told the share of those wanted that are there.

    Returns:
        All that were driven, by seed, those that fell short too.
    """
    seeds, driven = count(first), list[DrivenSet]()
    output_folder(folder / "traverses")
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:

        def begin() -> Future[DrivenSet]:
            return pool.submit(drive_data_set, folder, next(seeds), length_m)

        under_way = {begin() for _ in range(wanted)}
        while under_way:
            ended, under_way = wait(under_way, return_when=FIRST_COMPLETED)
            driven += (new := [future.result() for future in ended])
            under_way |= {begin() for drive in new if drive.path_m < min_path_m}
            progress(1.0 - len(under_way) / wanted)
    return sorted(driven, key=lambda drive: drive.seed)


def main() -> None:
    """Drive the data sets over the workers, and list those that fell short."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--count", type=int, default=100, help="so many that cover 30 m")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="four of 3 m")
    options = parser.parse_args()
    lengths = (QUICK_LENGTH_M, QUICK_MIN_PATH_M) if options.quick else (LENGTH_M, MIN_PATH_M)
    wanted = min(options.count, QUICK_COUNT) if options.quick else options.count
    first = QUICK_FIRST if options.quick else 1
    with bar("driving") as progress:
        driven = drive_until(options.out, wanted, options.workers, *lengths, first, progress)
    for drive in driven:
        short = f"; left out: shorter than {lengths[1]:g} m" if drive.path_m < lengths[1] else ""
        say(f"data set {drive.seed}: {drive.path_m:.1f} m, {drive.ended}{short}")
    say(f"wrote {options.out / 'traverses'}")


if __name__ == "__main__":
    main()
