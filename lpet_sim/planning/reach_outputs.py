"""What a study of reachability leaves beside its results: pictures, and the worst ways."""

from __future__ import annotations

from pathlib import Path

from lpet_sim.planning.reach_figures import draw_rates, draw_reach_map
from lpet_sim.planning.reach_result import ReachabilityReport
from lpet_sim.planning.reach_run import REPORT_FILE
from lpet_sim.planning.reach_spec import ReachSpec, cases_of
from lpet_sim.planning.worst_paths import WorstPath, rank_worst, save_worst

WORST_FOLDER = "worst"


def write_reach(
    report: ReachabilityReport, spec: ReachSpec, folder: Path, worst: int = 5
) -> tuple[list[WorstPath], list[Path]]:
    """Draw a study and save its worst ways.

    Args:
        report: What the study found.
        spec: The study.
        folder: Where `run_reach` kept its results.
        worst: How many ways to save as traverses.

    Returns:
        The worst ways, and all files, the summary of `run_reach` first.

    Raises:
        OutputError: The folder cannot be written.
    """
    paths = [folder / REPORT_FILE]
    cases = {case.key: case for case in cases_of(spec, report.seed)}
    for terrain in report.terrains:
        if terrain.index == 0:
            paths.append(folder / f"map_{terrain.key}.png")
            draw_reach_map(terrain, cases[terrain.key], spec, paths[-1])
    if len(report.rates) > 1:
        paths.append(folder / "rates.png")
        draw_rates(report, paths[-1])
    ranked = rank_worst(report, spec)
    saved = save_worst(ranked, spec.mobility, folder / WORST_FOLDER, worst)
    return ranked[:worst], paths + saved
