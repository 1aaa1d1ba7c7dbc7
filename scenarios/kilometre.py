"""Drive a kilometre without images and watch the memory: what it takes must not grow.

    python -m scenarios.kilometre --out out/km [--length 1000] [--seed 1] [--quick]

Prints the resident memory each 100 m, and the real-time factor of the whole drive.
"""

from __future__ import annotations

import argparse
import math
import os
import time
from pathlib import Path

from lpet_sim.outputs import output_folder
from lpet_sim.study.one_traverse import SCENARIOS
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec

_MARK_M = 100.0


def resident_mb() -> float:
    """Give the resident memory of this process [MB] (Linux)."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


class MemoryLog:
    """Notes the largest resident memory of each 100 m."""

    def __init__(self, length_m: float) -> None:
        """Start at the start of a drive of the given length [m]."""
        self._length_m, self._began = length_m, time.perf_counter()
        self.peaks_mb = [0.0]

    def note(self, fraction: float) -> None:
        """Look at the memory; print it when another 100 m are done."""
        driven_m = fraction * self._length_m
        mark = math.ceil(driven_m / _MARK_M)
        if mark > len(self.peaks_mb):
            self.peaks_mb.append(0.0)
            elapsed = time.perf_counter() - self._began
            print(f"{driven_m:7.1f} m {elapsed:7.1f} s {resident_mb():8.1f} MB")
        self.peaks_mb[-1] = max(self.peaks_mb[-1], resident_mb())


def main() -> None:
    """Drive and report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=Path("out/kilometre"))
    parser.add_argument("--length", type=float, default=1000.0, help="metres to drive")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="10 m only")
    options = parser.parse_args()
    length_m = 10.0 if options.quick else options.length
    spec = TraverseSpec.from_yaml(SCENARIOS / "kilometre.yaml")
    corners = ((-length_m / 2, 0.0), (length_m / 2, 0.0))
    drive = spec.drive.model_copy(update={"waypoints_m": corners})
    log = MemoryLog(length_m)
    run = output_folder(options.out) / f"kilometre_seed{options.seed}.rrd"
    began, cpu_began = time.perf_counter(), time.process_time()
    simulate(spec.model_copy(update={"drive": drive}), options.seed, run, log.note)
    wall_s, cpu_s = time.perf_counter() - began, time.process_time() - cpu_began
    driven_s = length_m / drive.speed_mps
    print(f"{driven_s / wall_s:.1f} times real time: {driven_s:.0f} s in {wall_s:.0f} s")
    print(f"of which {cpu_s:.0f} s of processor time: {driven_s / cpu_s:.1f} times real time")
    print(f"peak memory by 100 m: {', '.join(f'{mb:.0f}' for mb in log.peaks_mb)} MB")
    print(f"wrote {run} ({run.stat().st_size / 1e6:.0f} MB)")


if __name__ == "__main__":
    main()
