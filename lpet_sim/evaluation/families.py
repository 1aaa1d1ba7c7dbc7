"""Which variants of a sweep belong together: by memory, by manner, and as the paper's pairs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lpet_sim.evaluation.rows import Rows

UNLIMITED = 9999
"""Reads as "no limit" in the columns m and n."""
KEEP_ALL, TIME_TO_LIVE, BOUNDED = "keep_all", "time_to_live", "bounded_queue"
DECOUPLED, COUPLED = "decoupled", "coupled"


@dataclass(frozen=True)
class Variant:
    """What the columns say of a variant.

    Attributes:
        label: Its label.
        estimator: The estimator.
        retention: Kind of memory: one of `KEEP_ALL`, `TIME_TO_LIVE`, `BOUNDED`, or empty for an
            estimator without landmarks in its state.
        leave: Who leaves a full queue; empty without a queue.
        m: Time to live [images].
        n: Size of the queue [landmarks].
        coupling: How correlations are kept; empty where there are none.
        observable: Whether landmarks mapped at standstill tie the map to the world.
        formulation: In what coordinates errors are.
    """

    label: str
    estimator: str
    retention: str
    leave: str
    m: float
    n: float
    coupling: str
    observable: bool
    formulation: str

    @property
    def memory(self) -> tuple[str, str, float, float]:
        """What tells its memory from others."""
        return self.retention, self.leave, self.m, self.n

    @property
    def manner(self) -> str:
        """How it treats correlations, such as ``coupled, observable``; a baseline's own label."""
        if not self.retention:
            return self.label
        tied = "observable" if self.observable else "unobservable"
        return f"{self.coupling.replace('_', ' ')}, {tied}"


def variants_of(rows: Rows) -> list[Variant]:
    """Describe every variant of the rows, in natural order of the labels."""
    return [_describe(label, group) for (label,), group in rows.groups("variant")]


def manners(variants: Sequence[Variant]) -> dict[str, list[Variant]]:
    """Give the variants with a memory by manner, the worst of the paper's three first.

    Where one manner comes in several formulations, queues or estimators, these are in the name.
    """
    out: dict[str, list[Variant]] = {}
    for variant in sorted(variants, key=_by_manner):
        if variant.retention:
            out.setdefault(_told_apart(variant, variants), []).append(variant)
    return out


def paper_pairs(rows: Rows) -> list[tuple[str, str]]:
    """Pair the variants that the paper orders, (worse, better), each with the same memory.

    Decoupled against coupled, both unobservable; coupled unobservable against coupled observable.
    All else is equal; where a variant has no partner in its own formulation, it meets those in
    others.
    """
    known = [variant for variant in variants_of(rows) if variant.retention]
    steps = (((DECOUPLED, False), (COUPLED, False)), ((COUPLED, False), (COUPLED, True)))
    pairs = []
    for worse_kind, better_kind in steps:
        for worse in known:
            if (worse.coupling, worse.observable) == worse_kind:
                pairs += [(worse.label, b.label) for b in _partners(worse, better_kind, known)]
    return pairs


def size_families(rows: Rows) -> list[tuple[str, list[str], list[str]]]:
    """Give manner, multiframe variants and bounded variants wherever both were swept."""
    out = []
    for manner, variants in manners(variants_of(rows)).items():
        kinds = [
            [v.label for v in variants if v.retention == kind] for kind in (TIME_TO_LIVE, BOUNDED)
        ]
        if all(len(labels) > 1 for labels in kinds):
            out.append((manner, kinds[0], kinds[1]))
    return out


def _describe(label: str, group: Rows) -> Variant:
    observable = group.columns.get("observable", np.zeros(1, dtype=bool))
    return Variant(
        label=label,
        estimator=str(group.texts("estimator")[0]),
        retention=str(group.texts("retention")[0]),
        leave=_leave(str(group.texts("spec")[0])),
        m=float(group.numbers("m")[0]),
        n=float(group.numbers("n")[0]),
        coupling=str(group.texts("coupling")[0]),
        observable=bool(observable[0]),
        formulation=str(group.texts("formulation")[0]),
    )


def _leave(spec: str) -> str:
    """Read from the spec who leaves a full queue."""
    try:
        return str(json.loads(spec)["retention"].get("leave", ""))
    except (ValueError, KeyError, TypeError, AttributeError):
        return ""


def _by_manner(variant: Variant) -> tuple[bool, bool, str, float, float]:
    """Sort decoupled before coupled, unobservable before observable, small before large."""
    coupled = not variant.coupling.startswith(DECOUPLED)
    return coupled, variant.observable, variant.manner, variant.m, variant.n


def _told_apart(variant: Variant, among: Sequence[Variant]) -> str:
    alike = [v for v in among if v.retention and v.manner == variant.manner]
    parts = [variant.manner]
    for name in ("formulation", "estimator"):
        if len({getattr(v, name) for v in alike}) > 1:
            parts.append(str(getattr(variant, name)).replace("_", " "))
    if len({v.leave for v in alike if v.leave}) > 1 and variant.leave:
        parts.append(variant.leave.replace("_", " "))
    return ", ".join(parts)


def _partners(
    variant: Variant, kind: tuple[str, bool], among: Sequence[Variant]
) -> Sequence[Variant]:
    found = [
        v
        for v in among
        if (v.coupling, v.observable) == kind
        and (v.estimator, v.memory) == (variant.estimator, variant.memory)
    ]
    return [v for v in found if v.formulation == variant.formulation] or found
