"""Whether another seed recommends another sensor.

    python -m scenarios.tradeoff_stability [--quick] [--out DIR] [--data-sets DIR]

The same trade-off (scenarios/tradeoff/stability.yaml: 216 sensors, the survivors simulated on one
drive of the paper's experiment) with five seeds: each draws its own static landmarks, and
landmarks, noise and odometry of the simulation. The same command goes on where a run was stopped.
The drive is made unless the folder of data sets holds it.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Sequence
from pathlib import Path

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.terminal import say, two_bars, wrote
from lpet_sim.tradeoff.candidate import PARAMETERS
from lpet_sim.tradeoff.recommend import Recommendation
from lpet_sim.tradeoff.run import run_tradeoff
from lpet_sim.tradeoff.spec import TradeoffSpec
from scenarios.tradeoff_check import recording_of

SPEC = Path(__file__).parent / "tradeoff" / "stability.yaml"
OUT = Path("out/tradeoff_stability")
SEEDS = 5


def prepared(drive: Path, quick: bool) -> TradeoffSpec:
    """Give the trade-off on a drive; the quick one has four sensors and one draw."""
    spec = TradeoffSpec.from_yaml(SPEC)
    assert spec.simulation is not None
    runs: dict[str, object] = {"recordings": (str(drive),)}
    if not quick:
        return spec.model_copy(update={"simulation": spec.simulation.model_copy(update=runs)})
    one = {"field_of_view_rad": 1.2, "baseline_m": 0.12, "depression_rad": 0.5, "imu": "ln200"}
    few = {"space": spec.space.to_mapping() | one | {"image_interval_m": [0.25, 0.5]}}
    few["simulation"] = spec.simulation.to_mapping() | runs | {"draws": 1, "survivors_max": 2}
    return TradeoffSpec.from_mapping(spec.to_mapping() | few)


def row_of(seed: int, found: Recommendation) -> dict[str, object]:
    """Give what one seed recommends, and how it stands."""
    judged = found.judged
    return {
        "seed": seed,
        **{name: getattr(found.candidate, name) for name in PARAMETERS},
        "cost": f"{judged.cost:.4f}",
        "upper_percent": f"{100 * judged.upper_ratio:.4f}",
        "worst_line": found.worst_line,
        "worst_use": f"{found.worst_use:.3f}",
        "meets": judged.meets,
    }


def line_of(rows: Sequence[dict[str, object]]) -> str:
    """Say how many seeds recommend the same sensor, and what the others would cost."""
    sensors = [tuple(row[name] for name in PARAMETERS) for row in rows]
    most = max(set(sensors), key=sensors.count)
    costs = [float(str(row["cost"])) for row in rows]
    return (
        f"{sensors.count(most)} of {len(rows)} seeds recommend the same sensor; the dearest of "
        f"their sensors costs {max(costs) / min(costs):.3f} times the cheapest"
    )


def write_table(rows: Sequence[dict[str, object]], path: Path) -> Path:
    """Write one row for each seed."""
    with whole_file(path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return path


def main() -> None:
    """Recommend a sensor with each seed."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--quick", action="store_true", help="two sensors and seeds, three metres")
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--data-sets", type=Path, help="where the paper's traverses are")
    parser.add_argument("--workers", type=int, default=1)
    told = parser.parse_args()
    folder = output_folder(told.out)
    spec = prepared(recording_of(folder, told.data_sets, told.quick), told.quick)
    rows = []
    for seed in range(2 if told.quick else SEEDS):
        with two_bars(f"predicting {seed}", f"drives {seed}") as (progress, count):
            home, pool = folder / f"seed{seed}", Pool(told.workers)
            result = run_tradeoff(spec, home, seed, pool, progress=progress, count=count)
        rows.append(row_of(seed, result.recommendation))
    say(line_of(rows))
    wrote(write_table(rows, folder / "tradeoff_stability.csv"))


if __name__ == "__main__":
    main()
