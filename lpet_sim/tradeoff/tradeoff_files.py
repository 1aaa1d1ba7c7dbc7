"""What a trade-off leaves behind: tables, rows, figures, and the recommended sensor as YAML."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from rich.table import Table

from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.spec import Spec
from lpet_sim.sweep.sweep_store import Row, write_table
from lpet_sim.tradeoff.candidate import PARAMETERS
from lpet_sim.tradeoff.recommend import Judged
from lpet_sim.tradeoff.run import TradeoffResult
from lpet_sim.tradeoff.simulated import SimulatedCandidate
from lpet_sim.tradeoff.tradeoff_figures import (
    plot_agreement,
    plot_pareto,
    plot_sensitivity,
    save,
)

SENSOR: Final = "recommended.yaml"
LANDMARKS: Final = "recommended_landmarks.yaml"
SUMMARY: Final = "tradeoff.json"
CANDIDATES: Final = "candidates"
RUNS: Final = "runs.parquet"
_SHOWN_MAX: Final = 12


def write_tradeoff(result: TradeoffResult, folder: Path) -> tuple[Path, ...]:
    """Write all that a trade-off has found.

    Args:
        result: The trade-off.
        folder: Where the files go: `SENSOR` is a `RecommendedSensor`, `LANDMARKS` what
            ``lpet sense --spec`` takes, `SUMMARY` figures and verdict, `CANDIDATES` one row for
            each candidate as CSV and Parquet, `RUNS` one for each simulated run, and the figures.

    Returns:
        The files, those of the recommended sensor first.

    Raises:
        OutputError: The folder cannot be written.
    """
    home = output_folder(folder)
    sensor = result.sensor
    paths = [_yaml(sensor, home / SENSOR), _yaml(sensor.landmarks, home / LANDMARKS)]
    paths += [_summary(result, home / SUMMARY), *_rows(result, home)]
    figures = {"pareto.png": plot_pareto(result)}
    if result.sensitivity:
        figures["sensitivity.png"] = plot_sensitivity(result.sensitivity)
    if result.simulated:
        figures["agreement.png"] = plot_agreement(*_agreement(result.simulated))
    for name, figure in figures.items():
        save(figure, home / name)
    return (*paths, *(home / name for name in figures))


def _yaml(spec: Spec, path: Path) -> Path:
    with whole_file(path) as temporary:
        temporary.write_text(yaml.safe_dump(spec.to_mapping(), sort_keys=False))
    return path


def _agreement(
    simulated: Mapping[int, SimulatedCandidate],
) -> tuple[list[float], dict[str, list[float]]]:
    ones = list(simulated.values())
    labels = dict.fromkeys(str(row["variant"]) for row in ones[0].rows)
    errors = {label: [one.error_ratio(label) for one in ones] for label in labels}
    return [one.predicted_ratio for one in ones], errors


def candidate_rows(result: TradeoffResult) -> list[Row]:
    """Give one flat row for each candidate: parameters, view, prediction, costs, what it is worth.

    Args:
        result: The trade-off.
    """
    allowed, front = set(result.allowed.tolist()), set(result.front.tolist())
    judged = {one.index: one for one in result.judged}
    return [
        {
            "candidate": i,
            **{name: getattr(p.candidate, name) for name in PARAMETERS},
            "near_m": p.footprint.near_m,
            "far_m": p.footprint.far_m,
            "width_m": p.footprint.width_m,
            "overlap": p.footprint.overlap,
            "sightings": p.sightings,
            "far_sightings": p.far_sightings,
            "range_m": p.range_m,
            "predicted_percent": 100.0 * p.error_ratio,
            **{f"predicted_{a}_deg": v for a, v in _degrees(p.attitude_rms_rad)},
            "data_bit_per_m": p.costs.data_bit_per_m,
            "compute_s_per_m": p.costs.compute_s_per_m,
            "mass_kg": p.costs.mass_kg,
            "allowed": i in allowed,
            "pareto": i in front,
            "recommended": i == result.recommendation.judged.index,
            **_worth(judged.get(i), result.simulated.get(i)),
        }
        for i, p in enumerate(result.predictions)
    ]


def _degrees(angles_rad: Sequence[float]) -> list[tuple[str, float]]:
    named = zip(("roll", "pitch", "yaw"), angles_rad, strict=True)
    return [(axis, math.degrees(angle)) for axis, angle in named]


def _worth(judged: Judged | None, simulated: SimulatedCandidate | None) -> Row:
    nan = math.nan
    return {
        "cost": nan if judged is None else judged.cost,
        "upper_percent": nan if judged is None else 100.0 * judged.upper_ratio,
        "meets": judged is not None and judged.meets,
        "simulated_percent": nan if simulated is None else 100.0 * simulated.error_ratio(),
        "predicted_there_percent": nan if simulated is None else 100.0 * simulated.predicted_ratio,
        "runs": 0 if simulated is None else simulated.efficiency.runs,
        "failed": 0 if simulated is None else simulated.efficiency.failed,
    }


def _rows(result: TradeoffResult, home: Path) -> list[Path]:
    rows = candidate_rows(result)
    csv_path, parquet = home / f"{CANDIDATES}.csv", home / f"{CANDIDATES}.parquet"
    with whole_file(csv_path) as temporary, temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    about = {"tradeoff": result.spec.to_mapping()}
    write_table(parquet, rows, about)
    runs = [row for one in result.simulated.values() for row in one.rows]
    if runs:
        write_table(home / RUNS, runs, about)
    return [csv_path, parquet, *([home / RUNS] if runs else [])]


def _summary(result: TradeoffResult, path: Path) -> Path:
    picked = result.recommendation
    p = picked.judged.prediction
    said: dict[str, Any] = {
        "name": result.spec.name,
        "verdict": "PASS" if picked.meets else "FAIL",
        "reason": picked.reason,
        "recommended": picked.candidate.to_mapping(),
        "predicted_percent": 100.0 * p.error_ratio,
        "upper_percent": 100.0 * picked.judged.upper_ratio,
        "upper_attitude_deg": [math.degrees(a) for a in picked.judged.upper_attitude_rad],
        "worst_line": picked.worst_line,
        "worst_use": picked.worst_use,
        "data_bit_per_m": p.costs.data_bit_per_m,
        "compute_s_per_m": p.costs.compute_s_per_m,
        "mass_kg": p.costs.mass_kg,
        "candidates": len(result.predictions),
        "allowed": len(result.allowed),
        "pareto": len(result.front),
        "simulated": len(result.simulated),
        "sensitivity": {
            one.parameter: {
                "rank_correlation": one.rank_correlation,
                "first_order": one.first_order,
                "values": list(one.values),
                "error_percent": (100.0 * one.error_ratio).tolist(),
            }
            for one in result.sensitivity
        },
    }
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(_finite(said), indent=1))
    return path


def _finite(value: Any) -> Any:
    """Put null in place of what JSON cannot say: infinite numbers and NaN."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def tradeoff_tables(result: TradeoffResult) -> list[Table]:
    """Give the tables that a terminal shows: Pareto set, sensitivity, recommendation."""
    return [_front_table(result), _sensitivity_table(result), _recommendation_table(result)]


def _front_table(result: TradeoffResult) -> Table:
    rows = candidate_rows(result)
    shown = [r for r in rows if (r["pareto"] or r["recommended"] or r["runs"])]
    shown.sort(key=lambda r: r["predicted_percent"])
    if len(shown) > _SHOWN_MAX:
        kept = {int(k) for k in np.linspace(0, len(shown) - 1, _SHOWN_MAX).round()}
        shown = [r for k, r in enumerate(shown) if k in kept or r["recommended"] or r["runs"]]
    count = f"{len(result.front)} of {len(result.allowed)} allowed, {len(rows)} drawn"
    table = Table(title=f"{result.spec.name}: Pareto set ({count})")
    heads = ("", "fov deg", "px", "base m", "mast m", "down deg", "step m", "sigma px", "unit")
    for name in (*heads, "seen", "predicted %", "upper %", "simulated %", "Mbit/m", "s/m", "kg"):
        table.add_column(name, justify="left" if name in ("", "unit") else "right")
    for r in shown:
        table.add_row("*" if r["recommended"] else "", *_parameters(r), *_figures(r))
    return table


def _parameters(r: Row) -> list[str]:
    return [
        f"{math.degrees(r['field_of_view_rad']):.0f}",
        str(r["resolution_px"]),
        f"{r['baseline_m']:.2f}",
        f"{r['mast_height_m']:.2f}",
        f"{math.degrees(r['depression_rad']):.0f}",
        f"{r['image_interval_m']:.2f}",
        f"{r['matching_sigma_px']:.2f}",
        str(r["imu"]),
    ]


def _figures(r: Row) -> list[str]:
    simulated = r["simulated_percent"]
    return [
        f"{r['sightings']:.0f}",
        f"{r['predicted_percent']:.3f}",
        "–" if math.isnan(r["upper_percent"]) else f"{r['upper_percent']:.3f}",
        "–" if math.isnan(simulated) else f"{simulated:.3f}",
        f"{1e-6 * r['data_bit_per_m']:.1f}",
        f"{r['compute_s_per_m']:.2f}",
        f"{r['mass_kg']:.1f}",
    ]


def _sensitivity_table(result: TradeoffResult) -> Table:
    table = Table(title="what matters for the predicted error")
    table.add_column("parameter")
    for name in ("rank correlation", "share of variance", "best value", "error there %"):
        table.add_column(name, justify="right")
    for one in sorted(result.sensitivity, key=lambda one: -one.first_order):
        best = int(np.argmin(one.error_ratio))
        value = one.values[best]
        shown = value if isinstance(value, str) else f"{value:.4g}"
        figures = f"{one.rank_correlation:+.2f}", f"{one.first_order:.2f}"
        table.add_row(one.parameter, *figures, shown, f"{100 * one.error_ratio[best]:.3f}")
    return table


def _recommendation_table(result: TradeoffResult) -> Table:
    picked, spec = result.recommendation, result.spec
    verdict = "PASS" if picked.meets else "FAIL"
    table = Table(title=f"recommended sensor after {spec.site.distance_m:g} m: {verdict}")
    for name in ("line", "upper end", "limit less margin", "verdict"):
        table.add_column(name, justify="left" if name in ("line", "verdict") else "right")
    room, judged = 1.0 - spec.rule.margin, picked.judged
    lines = [("position", judged.upper_ratio, spec.requirement.position_ratio, 100.0, "%")]
    angles = zip(
        ("roll", "pitch", "yaw"),
        judged.upper_attitude_rad,
        spec.requirement.attitude_rad,
        strict=True,
    )
    lines += [(axis, value, limit, 180.0 / math.pi, "deg") for axis, value, limit in angles]
    for name, value, limit, scale, unit in lines:
        word = "PASS" if value <= room * limit else "FAIL"
        table.add_row(
            name, f"{scale * value:.3g} {unit}", f"{scale * room * limit:.3g} {unit}", word
        )
    return table
