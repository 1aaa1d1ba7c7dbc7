"""Drive a rover among rocks, localize it by every estimator, and score it: the demo as a script.

python scenarios/first_traverse.py --out out/first --seed 1 [--quick]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from lpet_sim.study import SCENARIOS, run_traverse
from lpet_sim.sweep.report import score_tables
from lpet_sim.sweep.traverse import TraverseSpec


def quick(spec: TraverseSpec) -> TraverseSpec:
    """Shorten a traverse to its first metres and its cameras to a quarter of the pixels."""
    drive = spec.drive.model_copy(update={"waypoints_m": ((0.0, 0.0), (3.0, 0.5))})
    slips = tuple(slip.model_copy(update={"start_s": 40.0}) for slip in spec.drive.forced_slips)
    return spec.model_copy(
        update={"drive": drive.model_copy(update={"forced_slips": slips}), "name": "quick"}
    )


def main() -> None:
    """Parse the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--out", type=Path, default=Path("out/first_traverse"))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--quick", action="store_true", help="a few metres only")
    options = parser.parse_args()
    spec = TraverseSpec.from_yaml(SCENARIOS / "demo.yaml")
    study = run_traverse(quick(spec) if options.quick else spec, options.seed, options.out)
    for table in score_tables(study.score, study.requirement):
        Console().print(table)
    for path in study.written:
        print(f"wrote {path}")


if __name__ == "__main__":
    main()
