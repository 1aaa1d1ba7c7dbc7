"""The table of the hundred ideal metres: errors over the bound, consistency, time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from lpet_sim.evaluation.consistency import anees
from lpet_sim.evaluation.statistics import Interval, bootstrap
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.sensors.s_curve import SCurveSpec

Row = dict[str, Any]

DOF: Final = {"position": 3, "attitude": 3, "pose": 6}


def rms(values: Array, axis: int = -1) -> Array:
    """Give the root of the mean square."""
    return np.asarray(np.sqrt(np.mean(np.square(values), axis=axis)))


def markdown(
    rows: list[Row], spec: SCurveSpec, command: str, names: Sequence[str], peers: Sequence[str]
) -> list[str]:
    """Write the table of all methods beside the bound.

    Args:
        rows: One for each seed and method.
        spec: The set-up.
        command: What made the rows.
        names: The methods in the order of their lines.
        peers: Those whose time stands beside each other one's.
    """
    seeds = len({row["seed"] for row in rows})
    bound = {row["seed"]: row for row in rows}.values()
    percent = 100 * float(rms(np.array([row["bound_m"] / row["distance_m"] for row in bound])))
    degrees = float(rms(np.array([row["bound_deg"] for row in bound])))
    sighted = float(np.mean([row["sightings"] for row in bound]))
    bands = "; ".join(
        f"{name} {_band(anees(np.ones(seeds), dof).low, anees(np.ones(seeds), dof).high)}"
        for name, dof in DOF.items()
    )
    lines = [
        "# A hundred ideal metres",
        "",
        f"`{command}`, {seeds} seeds, {spec.images} images, {sighted:.0f} sightings an image; see "
        "`lpet_sim/sensors/s_curve.py` for the set-up. Errors at the end of the run, RMS over the "
        f"seeds. Cramer-Rao bound at the truth: {percent:.4f} % of the distance, {degrees:.4f} "
        "deg. Efficiency is the RMS of error over bound, seed by seed; below 1 beyond its interval "
        "an estimator would have seen the truth. Intervals are 95 % bootstraps over seeds. ANEES "
        f"of a consistent estimator, 95 % band for {seeds} seeds: {bands}. Time is that of the "
        "processor on one thread, the median over seeds; beside it how many times as long GTSAM's "
        "fixed lag takes, with a covariance of every image, as the filters give it, and without.",
        "",
        "| estimator | seeds | failed | end % | attitude deg | efficiency, position | attitude "
        "| ANEES position | attitude | pose | ms/image | GTSAM's over it | landmarks held |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    groups = [[row for row in rows if row["method"] == name] for name in names]
    spent = [[row["ms_per_image"] for row in rows if row["method"] == peer] for peer in peers]
    peer_ms = [float(np.median(times)) if times else math.nan for times in spent]
    return lines + [_line(group, peer_ms) for group in groups if group]


def _line(rows: list[Row], peer_ms: list[float]) -> str:
    """Write one method's line."""
    rng = stream(0, "hundred_metres", "bootstrap")

    def interval(name: str, over: str, factor: float = 1.0) -> str:
        values = np.array([factor * row[name] / row[over] for row in rows])
        return _text(bootstrap(values, rng, rms)) if np.isfinite(values).all() else "inf"

    attitude = float(rms(np.array([row["end_deg"] for row in rows])))
    spent, landmarks = _median(rows, "ms_per_image"), _median(rows, "landmarks")
    cells = [
        rows[0]["method"],
        str(len(rows)),
        str(sum(bool(row["failure"]) for row in rows)),
        interval("end_m", "distance_m", 100.0),
        f"{attitude:.4f}",
        interval("end_m", "bound_m"),
        interval("end_deg", "bound_deg"),
        *(_consistency(rows, name) for name in DOF),
        f"{spent:.2f}",
        " / ".join(f"{peer / spent:.1f}" for peer in peer_ms),
        f"{landmarks:.0f}" if math.isfinite(landmarks) else "-",
    ]
    return "| " + " | ".join(cells) + " |"


def _consistency(rows: list[Row], name: str) -> str:
    """Write an ANEES, in bold where it is inside its band."""
    found = anees([row[f"nees_{name}"] for row in rows], DOF[name])
    return f"**{found.value:.2f}**" if found.is_consistent else f"{found.value:.2f}"


def _median(rows: list[Row], name: str) -> float:
    return float(np.median([row[name] for row in rows]))


def _band(low: float, high: float) -> str:
    return f"{low:.2f} to {high:.2f}"


def _text(interval: Interval) -> str:
    return f"{interval.value:.3f} ({_band(interval.low, interval.high)})"
