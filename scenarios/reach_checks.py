"""Is reachability right? A thousand terrains, rates against K and abundance, and the time it takes.

    python -m scenarios.reach_checks [--quick] [--out docs/results] [--workers 2]

Writes ``reach.md`` and ``reach_rates.csv``. What is done is kept below ``out/experiments/reach``,
so a killed run goes on where it was.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import math
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final

from rich.progress import track

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.planning.mobility_map import map_mobility
from lpet_sim.planning.reach import ROCKS, Reacher
from lpet_sim.planning.reach_figures import draw_rates
from lpet_sim.planning.reach_result import RateResult, ReachabilityReport
from lpet_sim.planning.reach_run import run_reach
from lpet_sim.planning.reach_spec import Case, ReachSpec, cases_of
from lpet_sim.planning.search import search_straights
from lpet_sim.sweep.kept_runs import code_key
from lpet_sim.terrain.terrain import build_terrain
from scenarios.reach.swept_body import disc_gets_there, touched

Row = dict[str, Any]

COMMAND: Final = "python -m scenarios.reach_checks"
SEED: Final = 1
CACHE: Final = Path("out/experiments/reach")
LONGER: Final = 10
COLUMNS: Final = (
    *("study", "k", "K", "terrains", "starts", "reachable", "low", "high", "undecided"),
    *("length_ratio_median", "length_ratio_mean", "length_ratio_largest"),
)
COUNTS: Final = (
    *("starts", "reachable", "undecided", "unreachable"),
    *("touching", "reached_longer", "walled", "disc_there"),
)
ROUGH: Final = {
    "name": "rough",
    "relief": {"rms_slope_rad": 0.1222},  # 7 deg at 1 m
    "craters": None,
    "far": None,
    "rocks": {"kind": "abundance", "k": 0.07},
}


def thousand(quick: bool, straddles: bool) -> ReachSpec:
    """Lay out small terrains, from easy ones to such where most starts are walled in."""
    return ReachSpec.from_mapping(
        {
            "name": "straddling" if straddles else "not straddling",
            "terrain": ROUGH,
            "size_m": 16.0,
            "goal_m": [0.0, 0.0],
            "goal_radius_m": 2.0,
            "starts": 3,
            "start_distances_m": [4.0, 12.0],
            "terrains": 1 if quick else 63,
            "abundances": [0.05, 0.19] if quick else [0.05, 0.1, 0.15, 0.19],
            "rock_factors": [1.0] if quick else [1.0, 1.25],
            "mobility": {} if straddles else {"straddle_width_m": 0.0, "climb_height_m": 0.1},
            "search": {"iterations": 2000},
        }
    )


def sweep(quick: bool, abundances: bool) -> ReachSpec:
    """Lay out the sweep over the paper's K on ExoMars-like ground, or over abundance."""
    varied: Row = {"rock_factors": [0.5, 2.0] if quick else [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]}
    if abundances:
        varied = {"abundances": [0.03, 0.15] if quick else [0.03, 0.07, 0.11, 0.15, 0.19]}
    basic: Row = {
        "name": "by abundance" if abundances else "by K",
        "terrain": "exomars",
        "size_m": 20.0 if quick else 50.0,
        "goal_m": [0.0, 0.0],
        "starts": 3 if quick else 10,
        "terrains": 1 if quick else 8,
        "search": {"iterations": 5000},
    }
    return ReachSpec.from_mapping(basic | varied)


def check_terrain(case: Case, spec: ReachSpec) -> Row:
    """Answer for one terrain, and hold the answers to the independent tests."""
    ground = build_terrain(case.terrain, case.seed)
    here = map_mobility(ground, spec.box, spec.mobility, spec.cell_m)
    reacher = Reacher(here, spec, case.seed)
    # A rock that is higher than what is driven over is wider than that.
    rocks = ground.rocks(spec.box.grown(4.0), spec.mobility.climb_height_m)
    row: Row = dict.fromkeys(COUNTS, 0)
    for start in reacher.all():
        row["starts"] += 1
        row[start.outcome] += 1
        if start.path_m:
            row["touching"] += bool(touched(start.path, rocks, spec.mobility))
        if start.outcome == "unreachable":
            # That map knows no slopes.
            row["walled"] += start.reason == ROCKS
            row["disc_there"] += start.reason == ROCKS and disc_gets_there(
                start.start_m, rocks, spec
            )
            row["reached_longer"] += any(
                search_straights(
                    here, start.start_m, goal, LONGER * spec.search.iterations, 12.0, 7
                )
                for goal in reacher.goal_places
            )
    return row


def _checked(case: Case, spec: ReachSpec, folder: Path) -> Row:
    """Check a terrain once; its row is kept."""
    code = code_key("lpet_sim/planning", "lpet_sim/terrain")
    digest = hashlib.sha256(f"{spec.model_dump_json()}{case.seed}{code}".encode()).hexdigest()
    path = folder / f"{case.key}_{digest[:12]}.json"
    if not path.exists():
        row = check_terrain(case, spec)
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(row))
    return dict(json.loads(path.read_text()))


def check_all(spec: ReachSpec, folder: Path, workers: int) -> Row:
    """Check every terrain of a study and add up."""
    cases = cases_of(spec, SEED)
    work = partial(_checked, spec=spec, folder=folder)
    if workers == 1:
        rows = [work(case) for case in track(cases, "checking")]
    else:
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
            rows = list(track(pool.map(work, cases, chunksize=8), "checking", len(cases)))
    return {"terrains": len(rows)} | {name: sum(row[name] for row in rows) for name in COUNTS}


def checks_table(totals: list[Row]) -> list[str]:
    """Say what the checks found, for each rover."""
    said = {
        "terrains": "random terrains of 16 x 16 m (relief 7 deg at 1 m, k 5 to 19 %, K 1 and 1.25)",
        "starts": "starts",
        "reachable": "ways found",
        "touching": "of them touching a rock by the test of polygons every 1 cm",
        "undecided": "starts left undecided",
        "unreachable": "starts called unreachable",
        "reached_longer": f"of them reached by a search {LONGER} times as long",
        "walled": "of those called unreachable walled in by rocks",
        "disc_there": "of them from which a disc 4 cm larger than the inscribed one gets to the "
        "goal on another map",
    }
    lines = ["| what | straddles | does not, and climbs 10 cm | both |", "|---|---|---|---|"]
    for name, words in said.items():
        counts = [total[name] for total in totals]
        lines.append(f"| {words} | {counts[0]} | {counts[1]} | {sum(counts)} |")
    return lines


def rate_lines(rates: tuple[RateResult, ...]) -> list[str]:
    """Give the rates as a table."""
    head = ("k", "K", "starts", "reachable", "95 %", "unreachable", "undecided", "length ratio")
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for rate in rates:
        found, (median, mean, largest) = rate.reachable, rate.length_ratio
        cells = (
            f"{rate.abundance:.0%}",
            f"{rate.factor:g}",
            f"{rate.starts}",
            f"{found.value:.1%}",
            f"{found.low:.1%} to {found.high:.1%}",
            f"{rate.unreachable:.1%}",
            f"{rate.undecided:.1%}",
            "-" if math.isnan(median) else f"{median:.2f}, {mean:.2f}, {largest:.2f}",
        )
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def falls(rates: tuple[RateResult, ...]) -> bool:
    """Tell whether no rate lies above the interval of one with fewer rocks."""
    pairs = [(a, b) for k, a in enumerate(rates) for b in rates[k + 1 :]]
    return all(more.reachable.low <= fewer.reachable.high for fewer, more in pairs)


def write_rates(reports: list[ReachabilityReport], path: Path) -> None:
    """Write all rates as one table of numbers."""
    with whole_file(path) as temporary, temporary.open("w", newline="") as file:
        sheet = csv.writer(file)
        sheet.writerow(COLUMNS)
        for report in reports:
            for r in report.rates:
                found = (r.reachable.value, r.reachable.low, r.reachable.high, r.undecided)
                numbers = (f"{value:.4f}" for value in (*found, *r.length_ratio))
                sheet.writerow([report.name, r.abundance, r.factor, r.terrains, r.starts, *numbers])


def main() -> None:
    """Run all parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="small, to see that it runs")
    parser.add_argument("--out", type=Path, default=Path("docs/results"))
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    quick, workers, folder = arguments.quick, arguments.workers, output_folder(arguments.out)
    cache = folder / "cache" if quick else CACHE
    totals = [
        check_all(thousand(quick, straddles), cache / f"checks{straddles:d}", workers)
        for straddles in (True, False)
    ]
    text = ["# Reachability", "", f"By `{COMMAND}`, seed {SEED}.", "", "## Is it right?", ""]
    text += checks_table(totals)
    swept = [
        run_reach(sweep(quick, by), SEED, cache / ("by_k" if by else "by_K_factor"), workers)
        for by in (False, True)
    ]
    for report in swept:
        said = "within the intervals it falls" if falls(report.rates) else "it does NOT fall"
        text += [
            "",
            f"## Rate {report.name}: {said} with more rocks",
            "",
            *rate_lines(report.rates),
        ]
    whole = ReachSpec.from_yaml(Path(__file__).parent / "reach" / "exomars.yaml")
    whole = whole.model_copy(update={"starts": 5, "size_m": 40.0}) if quick else whole
    large = run_reach(whole, SEED, cache / "exomars", 1)
    text += ["", f"## {whole.size_m:g} x {whole.size_m:g} m of `exomars`", ""]
    text += [f"{whole.starts} starts: {large.cpu_s:.0f} s of processor time, terrain included.", ""]
    text += rate_lines(large.rates)
    text += ["", "Length ratio: median, mean and largest; Perseverance drove 1.46."]
    for report, name in zip(swept, ("reach_by_factor.png", "reach_by_abundance.png"), strict=True):
        draw_rates(report, folder / name)
    write_rates([*swept, large], folder / "reach_rates.csv")
    with whole_file(folder / "reach.md") as temporary:
        temporary.write_text("\n".join(text) + "\n")
    print("\n".join(text))
    names = ("reach.md", "reach_rates.csv", "reach_by_factor.png", "reach_by_abundance.png")
    print("\n".join(f"wrote {folder / name}" for name in names))


if __name__ == "__main__":
    main()
