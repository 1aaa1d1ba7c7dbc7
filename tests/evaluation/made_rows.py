"""Rows of a sweep that was never run: the columns of a real one, with numbers from a rule."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pyarrow as pa

from lpet_sim.rng import stream

UNLIMITED = 9999
AXES = ("roll", "pitch", "yaw")
MANNERS = {"decoupled": (2.2, False), "coupled": (1.2, False), "observable": (0.6, True)}
"""How much worse each manner is [%], and whether it has anchors."""
M_SWEPT = (1, 2, 5, 10)
N_SWEPT = (10, 40, 160)


def variants() -> list[dict[str, Any]]:
    """List the variants: three manners, each with full SLAM, four times to live, three queues."""
    kept = [(UNLIMITED, UNLIMITED, "keep_all")]
    kept += [(m, UNLIMITED, "time_to_live") for m in M_SWEPT]
    kept += [(UNLIMITED, n, "bounded_queue") for n in N_SWEPT]
    out = []
    for manner, (scale, observable) in MANNERS.items():
        for m, n, retention in kept:
            coupling = "decoupled" if manner == "decoupled" else "coupled"
            label = f"m{m}-n{n}-{coupling}-{'' if observable else 'un'}observable-standard"
            facts = {"variant": label, "m": m, "n": n, "retention": retention, "scale": scale}
            facts |= {"coupling": coupling, "observable": observable, "formulation": "standard"}
            out.append(facts | {"estimator": "slam"})
    return out


def made_rows(
    data_sets: int = 12, arms: tuple[str, ...] = ("ideal", "biased"), failing: float = 0.03
) -> pa.Table:
    """Make the rows of a sweep over all variants, a few of them failed."""
    rows = [
        _row(k, arm, variant, failing)
        for arm in arms
        for variant in variants()
        for k in range(data_sets)
    ]
    metadata = {
        "lpet_spec": json.dumps({"name": "made up", "data_sets": data_sets, "arms": arms}),
        "lpet_versions": json.dumps({"lpet": "0.1.0", "numpy": np.__version__}),
    }
    return pa.Table.from_pylist(rows).replace_schema_metadata(metadata)


def state_size(variant: dict[str, Any]) -> float:
    """Give the largest state of a variant [landmarks]."""
    if variant["retention"] == "keep_all":
        return 900.0
    return float(variant["n"]) if variant["n"] < UNLIMITED else 30.0 * float(variant["m"]) ** 0.7


def _row(k: int, arm: str, variant: dict[str, Any], failing: float) -> dict[str, Any]:
    rng = stream(k, arm, str(variant["variant"]))
    common = float(np.exp(stream(k, arm, "common").normal(0, 0.3)))
    size = state_size(variant)
    scale = variant["scale"] * (1.6 if arm == "biased" else 0.8) * (size / 100) ** -0.15
    percent = scale * common * float(np.exp(rng.normal(0, 0.15)))
    failure = str(rng.choice(["lost", "timeout"])) if rng.uniform() < failing else ""
    path = 30.0 + 4 * float(stream(k, "path").uniform())
    attitude = percent * np.abs(rng.normal(0, 0.4, 3))
    passes = {"completion": not failure}
    passes |= {f"position_{when}": percent < 1 for when in ("throughout", "end")}
    for axis, degrees in zip(AXES, attitude, strict=True):
        passes |= {f"{axis}_{when}": bool(degrees < 1) for when in ("throughout", "end")}
    lost = failure == "timeout"
    row = {name: variant[name] for name in variant if name != "scale"}
    row |= {"run": f"set{k:03d}-{arm}-{variant['variant']}", "data_set": f"set{k:03d}"}
    row |= {"seed": k, "arm": arm, "spec": "{}", "images": 1500, "path_m": path}
    row |= {"completion": 0.4 if failure else 1.0, "failure": failure, "failure_text": failure}
    row |= _errors(percent, attitude, path, lost, variant["observable"])
    row |= {f"pass_{line}": bool(ok and not failure) for line, ok in passes.items()}
    row["passed"] = all(row[f"pass_{line}"] for line in passes)
    row |= {f"nees_{b}": float(rng.chisquare(d)) for b, d in (("position", 3), ("attitude", 3))}
    row |= {"nees_pose": float(rng.chisquare(6)) * (4 if variant["coupling"] == "decoupled" else 1)}
    row |= {"nis_mean": 1 + float(rng.normal(0, 0.01)), "new_mean": 4.0, "matched_mean": 36.0}
    row |= {"dropped_mean": 3.9, "state_mean": 0.8 * size, "state_max": size, "worker": "w0"}
    row |= {"anchors_seen_share": 0.7 * variant["observable"], "bridged_share": 0.01}
    row |= {"bound_m": path * percent / 100 / 1.15, "bound_rad": float("nan")}
    row |= {"time_total_s": 9.0, "time_per_image_ms": 2 + 0.0001 * size**2}
    return row | {"started_at": "2026-01-01T00:00:00"}


def _errors(
    percent: float, attitude: Any, path: float, lost: bool, observable: bool
) -> dict[str, Any]:
    inf = float("inf") if lost else 1.0
    share = np.linspace(0, 1, 51)
    growth = np.minimum(share * 3, 1) if observable else share**1.3
    curve = growth * percent / 100 * path * (1 + 0.1 * np.sin(40 * share))
    out = {"end_error_m": inf * percent / 100 * path, "end_percent": inf * percent}
    out |= {"worst_percent": inf * 1.4 * percent, "ate_m": inf * percent * 0.6}
    out |= {f"drift_{length}m": percent * 1.5 for length in (1, 2, 5, 10, 20)}
    out |= {"drift_50m": float("nan")}
    for axis, degrees in zip(AXES, attitude, strict=True):
        out |= {f"end_{axis}_deg": inf * degrees, f"worst_{axis}_deg": inf * 1.3 * degrees}
    return out | {"error_curve": None if lost else curve.tolist()}
