"""One run of an estimator as a flat row: the paper's log fields, errors, consistency and cost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from estimators.slam_spec import UNLIMITED
from lpet_sim.evaluation import EvaluationSpec, Requirement, RunResult
from lpet_sim.evaluation.consistency import BLOCKS
from lpet_sim.evaluation.requirement import AXES
from lpet_sim.recording.arrays import Array

CURVE_POINTS: Final = 51
"""Equally spaced shares of the distance, 0 to 1, at which a row tells the position error."""

_NAN = math.nan


def variant_columns(estimator: str, spec: Mapping[str, Any]) -> dict[str, Any]:
    """Give the columns that tell what a run was made with.

    Time to live m and queue size n read `UNLIMITED` where there is no limit, as the paper's names.
    What the paper's filter has is empty for any other estimator, whatever its fields are called.

    Args:
        estimator: The estimator's name.
        spec: Its whole spec.
    """
    filter_spec = spec if estimator == "slam" else {}
    retention = filter_spec.get("retention") or {}
    return {
        "estimator": estimator,
        "m": retention.get("images", UNLIMITED),
        "n": retention.get("size", UNLIMITED),
        "retention": retention.get("kind", ""),
        "coupling": filter_spec.get("coupling", ""),
        "observable": filter_spec.get("anchors") is not None,
        "formulation": filter_spec.get("formulation", ""),
    }


def score_columns(result: RunResult, spec: EvaluationSpec) -> dict[str, Any]:
    """Give the columns of a score: errors in metres, percent of the distance and degrees."""
    x, y, z = result.endpoint_error_m
    return {
        "completion": result.completion,
        "failure": result.failure or "",
        "failure_text": result.failure_text,
        "end_error_m": math.sqrt(x * x + y * y + z * z),
        "end_x_m": x,
        "end_y_m": y,
        "end_z_m": z,
        "end_percent": 100 * result.endpoint_ratio,
        "worst_percent": 100 * result.worst_ratio,
        **_by_axis("end", result.endpoint_attitude_rad),
        **_by_axis("worst", result.worst_attitude_rad),
        "ate_m": _rms_error_m(result),
        **_drifts(result, spec),
        **{f"nees_{block}": (result.nees_end or {}).get(block, _NAN) for block in BLOCKS},
        "error_curve": error_curve_m(result),
    }


def _by_axis(when: str, attitude_rad: tuple[float, float, float]) -> dict[str, float]:
    pairs = zip(AXES, attitude_rad, strict=True)
    return {f"{when}_{axis}_deg": math.degrees(angle) for axis, angle in pairs}


def _rms_error_m(result: RunResult) -> float:
    if result.series is None:
        return math.inf
    return float(np.sqrt(np.mean(np.sum(result.series.position_error_m**2, axis=1))))


def _drifts(result: RunResult, spec: EvaluationSpec) -> dict[str, float]:
    found = {s.length_m: 100 * s.translation_ratio for s in result.segments}
    return {f"drift_{length:g}m": found.get(length, _NAN) for length in spec.segment_lengths_m}


def error_curve_m(result: RunResult) -> list[float]:
    """Give the position error at `CURVE_POINTS` shares of the distance [m].

    It is NaN where the estimate does not reach; where the rover stood, the last error counts.
    """
    if result.series is None:
        return [_NAN] * CURVE_POINTS
    error_m = np.linalg.norm(result.series.position_error_m, axis=1)
    at_m = np.linspace(0.0, result.distance_m, CURVE_POINTS)
    curve = np.interp(at_m, result.series.distance_m, error_m, right=_NAN)
    if result.completion >= 1.0:
        curve[-1] = error_m[-1]
    return [float(value) for value in curve]


def verdict_columns(result: RunResult, requirement: Requirement) -> dict[str, bool]:
    """Give whether the run passed, as a whole and line by line.

    The lines are held to the limits both throughout and at the end, whichever the requirement as a
    whole asks for; a run that is broken or does not cover the traverse passes none of them.
    """
    both = requirement.model_copy(update={"throughout": True, "at_end": True}).check(result)
    completion, *lines = both.lines
    sound = both.broken is None and completion.passed
    said = {"passed": requirement.check(result).passed}
    for line in lines:
        what, when = line.quantity.split(", ")
        short = when.removeprefix("at the ")
        said[f"pass_{what}_{short}"] = sound and line.passed
    return said


def diagnostic_columns(diagnostics: Mapping[str, Array]) -> dict[str, float]:
    """Give what a filter says of itself, over its images; NaN where it says nothing."""
    return {
        "nis_mean": _nis_per_dof(diagnostics),
        "new_mean": _mean(diagnostics, "new"),
        "matched_mean": _mean(diagnostics, "matched"),
        "dropped_mean": _mean(diagnostics, "dropped"),
        "state_mean": _mean(diagnostics, "landmarks"),
        "state_max": float(np.max(diagnostics.get("landmarks", _NAN))),
        "anchors_seen_share": share_seen(diagnostics.get("anchors_seen")),
        "bridged_share": _share(diagnostics, "bridged"),
    }


def _mean(diagnostics: Mapping[str, Array], name: str) -> float:
    return float(np.mean(diagnostics.get(name, _NAN)))


def _share(diagnostics: Mapping[str, Array], name: str) -> float:
    return float(np.mean(diagnostics[name] > 0)) if name in diagnostics else _NAN


def share_seen(anchors_seen: Array | None) -> float:
    """Give the share of images that see an anchor, from the first one that does.

    Args:
        anchors_seen: How many each image sees, Shape (n,); None gives NaN.
    """
    if anchors_seen is None:
        return _NAN
    seen = anchors_seen > 0
    return float(np.mean(seen[np.argmax(seen) :])) if seen.any() else 0.0


def _nis_per_dof(diagnostics: Mapping[str, Array]) -> float:
    """Sum the NIS of all updates over the sum of their degrees of freedom."""
    if not {"nis", "nis_dof"} <= diagnostics.keys():
        return _NAN
    used = diagnostics["nis_dof"] > 0
    dof = float(np.sum(diagnostics["nis_dof"][used]))
    return float(np.sum(diagnostics["nis"][used])) / dof if dof else _NAN
