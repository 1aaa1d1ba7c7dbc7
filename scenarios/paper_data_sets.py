"""The data sets of the paper's experiment: at least 30 m of ExoMars terrain, each with slips.

    python -m scenarios.paper_data_sets [--count 100] [--out out/paper] [--workers 2]

Drives the traverses in physics, without images, and keeps each in ``out/paper/traverses`` as it
ends; one that is there is not driven again.
"""

from __future__ import annotations

import argparse
import math
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.progress import track

from lpet_sim.outputs import output_folder
from lpet_sim.planning.clearance import RouteSpec
from lpet_sim.rng import stream
from lpet_sim.rover.spec import DriveSpec, ForcedSlip, Stop
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec

OUT = Path("out/paper")
LENGTH_M = 30.2
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


def drive_data_set(folder: Path, seed: int) -> str:
    """Drive one data set unless it is there, and say how it ended."""
    path = traverse_file(folder, seed)
    if path.exists():
        return "there"
    result = simulate(paper_traverse(seed), seed, path)
    return next((event.kind for event in result.events if event.ends), "arrived")


def main() -> None:
    """Drive the data sets over the workers."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    output_folder(options.out / "traverses")
    with ProcessPoolExecutor(options.workers, mp_context=get_context("spawn")) as pool:
        done = {
            pool.submit(drive_data_set, options.out, seed): seed
            for seed in range(1, options.count + 1)
        }
        for future in track(as_completed(done), "driving", total=len(done)):
            print(f"data set {done[future]}: {future.result()}")


if __name__ == "__main__":
    main()
