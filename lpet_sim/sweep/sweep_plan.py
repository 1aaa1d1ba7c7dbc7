"""From a sweep's spec to its runs: every variant written out, named, and with a key of its own."""

from __future__ import annotations

import ast
import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import lpet_sim
from estimators import build_estimator, estimator_kind
from lpet_sim.errors import SpecError
from lpet_sim.spec import Spec
from lpet_sim.sweep.sweep_spec import ArmSpec, SweepSpec, VariantSpec

_ROOT = Path(lpet_sim.__file__).resolve().parents[1]
_RUN_CODE = (
    "estimators/**/*.py",
    "lpet_sim/geometry/*.py",
    "lpet_sim/rng.py",
    *(
        f"lpet_sim/recording/{part}.py"
        for part in ("arrays", "calibration", "estimate", "streams", "trajectory", "truth")
    ),
    "lpet_sim/formats/*.py",
    "lpet_sim/plugins/*.py",
    "lpet_sim/evaluation/errors.py",
    "lpet_sim/evaluation/result.py",
    "lpet_sim/evaluation/requirement.py",
    "lpet_sim/evaluation/consistency.py",
    "lpet_sim/sweep/sweep_job.py",
    "lpet_sim/sweep/sweep_row.py",
    "lpet_sim/sweep/miscalibration.py",
)
_SENSING_CODE = (
    "lpet_sim/terrain/*.py",
    "lpet_sim/sensors/landmark*.py",
    "lpet_sim/sensors/i[mn]*.py",
    "lpet_sim/sensors/wheels.py",
    "lpet_sim/sweep/carried.py",
    "lpet_sim/sweep/sensing.py",
)
_BOUND_CODE = ("lpet_sim/evaluation/bounds.py", "lpet_sim/evaluation/*_model.py")


@dataclass(frozen=True)
class Variant:
    """One estimator with all its parameters.

    Attributes:
        order: Its place in the sweep.
        label: What it is called.
        estimator: The estimator's name.
        spec: Its whole spec, defaults written out.
    """

    order: int
    label: str
    estimator: str
    spec: dict[str, Any]


def expand(variants: Sequence[VariantSpec]) -> tuple[Variant, ...]:
    """Write out every combination of every variant, in the order of the spec.

    Raises:
        UnknownNameError: No estimator has the name.
        SpecError: An unknown field, a bad value, or two variants of one name.
        LpetError: An estimator's library is not installed.
    """
    drafts = [draft for number, v in enumerate(variants) for draft in _drafts(v, number)]
    twins = Counter(draft.label for draft in drafts)
    labels = [d.label if twins[d.label] == 1 else f"{d.label}{d.tail}" for d in drafts]
    _refuse_twins(labels)
    return tuple(
        Variant(order, label, draft.estimator, draft.spec)
        for order, (draft, label) in enumerate(zip(drafts, labels, strict=True))
    )


@dataclass(frozen=True)
class _Draft:
    """A variant whose label may still be that of another; the tail then tells them apart."""

    label: str
    tail: str
    estimator: str
    spec: dict[str, Any]


def _drafts(variant: VariantSpec, number: int) -> Iterator[_Draft]:
    source = f"variants[{number}] ({variant.estimator})"
    for values in product(*variant.sweep.values()):
        chosen = dict(zip(variant.sweep, values, strict=True))
        spec = _built(variant, chosen, source)
        tail = "".join(f"-{path.split('.')[-1]}{_short(v)}" for path, v in chosen.items())
        told = getattr(spec, "label", None)
        label = variant.name or told or variant.estimator
        if variant.name or told is None:
            label, tail = f"{label}{tail}", ""
        yield _Draft(label, tail, variant.estimator, spec.to_mapping())


def _built(variant: VariantSpec, chosen: Mapping[str, Any], source: str) -> Spec:
    """Put the chosen values into the spec, validate it, and see that the estimator can be built."""
    kind, _ = estimator_kind(variant.estimator)
    mapping, defaults = deepcopy(variant.spec), kind().to_mapping()
    for path, value in chosen.items():
        _put(mapping, defaults, path.split("."), value, f"{source}: sweep of '{path}'")
    spec = kind.from_mapping(mapping, source)
    build_estimator(variant.estimator, spec.to_mapping())
    return spec


def _put(
    mapping: dict[str, Any], defaults: object, path: list[str], value: object, source: str
) -> None:
    """Set a value at a path; parents that are not given are taken from the defaults."""
    key, *rest = path
    if not rest:
        mapping[key] = value
        return
    default = defaults.get(key) if isinstance(defaults, dict) else None
    inner = mapping.setdefault(key, deepcopy(default) if isinstance(default, dict) else {})
    if not isinstance(inner, dict):
        raise SpecError(f"{source}: '{key}' is {inner!r}, which has no fields; give a mapping")
    _put(inner, default, rest, value, source)


def _short(value: object) -> str:
    plain = isinstance(value, str | int | float | bool) or value is None
    return str(value) if plain else digest(value)[:6]


def _refuse_twins(labels: Iterable[str]) -> None:
    twins = [label for label, count in Counter(labels).items() if count > 1]
    if twins:
        raise SpecError(f"two variants are called '{twins[0]}': give each a name of its own")


def digest(value: object) -> str:
    """Give a name of 16 hexadecimal digits for a JSON-ready value; the order of keys is no part."""
    text = json.dumps(value, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def run_key(data_digest: str, arm: ArmSpec, variant: Variant, spec: SweepSpec) -> str:
    """Name a run by all that its row depends on, so that a change reruns only what depends on it.

    That is the recording's content, the arm, the variant, the odometry, the requirement, the
    evaluation and `code_digest`. The names of data set, arm and variant are no part of it, and
    neither are the time limit and the bounds.
    """
    held_to = [spec.odometry, spec.requirement.to_mapping(), spec.evaluation.to_mapping()]
    what = [data_digest, arm.to_mapping(), variant.estimator, variant.spec]
    return digest([*what, *held_to, code_digest(arm.sensor is not None)])


def job_key(data_digest: str, arm: ArmSpec, spec: SweepSpec) -> str:
    """Name what the runs on one data set in one arm have in common, such as their bound."""
    code = [code_digest(arm.sensor is not None), _digest_of(_BOUND_CODE)]
    return digest([data_digest, arm.to_mapping(), spec.odometry, *code])


def code_digest(sensing: bool) -> str:
    """Name the version and the source code that rows depend on.

    Docstrings, comments and layout are no part of it.

    Args:
        sensing: Whether the rows depend on the landmark sensor and its ground, too.
    """
    return _digest_of(_RUN_CODE + (_SENSING_CODE if sensing else ()))


@cache
def _digest_of(patterns: tuple[str, ...]) -> str:
    found = hashlib.sha256(lpet_sim.__version__.encode())
    for path in (path for pattern in patterns for path in sorted(_ROOT.glob(pattern))):
        found.update(f"{path.relative_to(_ROOT)}\0{_bare(path.read_text())}\0".encode())
    return found.hexdigest()[:16]


def _bare(text: str) -> str:
    """Give source code without its docstrings, comments and layout."""
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
            node.body = [part for part in node.body if not _is_text(part)]
    return ast.dump(tree)


def _is_text(node: ast.AST) -> bool:
    if not isinstance(node, ast.Expr) or not isinstance(node.value, ast.Constant):
        return False
    return isinstance(node.value.value, str)
