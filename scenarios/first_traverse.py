"""Drive a rover among rocks, localize it by every estimator, and score it: the demo as a script.

python -m scenarios.first_traverse --out out/first --seed 1 [--quick]
"""

from __future__ import annotations

import argparse
from pathlib import Path

from rich.console import Console

from lpet_sim.rover.spec import DriveSpec, ForcedSlip
from lpet_sim.sensors.camera_spec import LOCCAM_FOCAL_PX, GroundDetailSpec, StereoCameraSpec
from lpet_sim.study.one_traverse import SCENARIOS, run_traverse
from lpet_sim.sweep.report import score_tables
from lpet_sim.sweep.traverse import ImagesSpec, TraverseSpec


def quick(
    spec: TraverseSpec,
    waypoints_m: tuple[tuple[float, float], ...] = ((0.0, 0.0), (2.0, 2.0)),
    slip_s: float = 20.0,
) -> TraverseSpec:
    """Shorten a traverse to a few metres at twice the speed, and its images to a sixth."""
    drive = DriveSpec(
        waypoints_m=waypoints_m,
        speed_mps=2 * spec.drive.speed_mps,
        settle_s=2.0,
        forced_slips=(ForcedSlip(start_s=slip_s),),
    )
    stereo = StereoCameraSpec(
        width_px=480,
        height_px=360,
        focal_px=LOCCAM_FOCAL_PX * 480 / 1024,
        ground=GroundDetailSpec(supersampling=1, texel_m=0.00625, cell_m=0.08, levels=7),
    )
    sensors = spec.sensors.model_copy(update={"stereo": stereo})
    images = ImagesSpec(period_s=3.0)
    changed = {"name": "quick", "drive": drive, "sensors": sensors, "images": images}
    return spec.model_copy(update=changed)


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
