"""What the paper's experiment runs: sensor arms and variants, in parts by what matters most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from lpet_sim.evaluation import EvaluationSpec, Requirement
from lpet_sim.sweep.sweep_plan import expand
from lpet_sim.sweep.sweep_spec import SweepSpec

TIMES_TO_LIVE: Final = (1, 2, 3, 5, 10, 20)
QUEUES: Final = (10, 20, 40, 80, 160)
M, N = 10, 40
"""Time to live [images] and queue [landmarks] at which variants are compared."""
KEEP_ALL_SETS: Final = 20
"""Data sets on which full SLAM runs: a run of it takes as long as thirty others."""
ANCHORS: Final[Mapping[str, Any]] = {}
"""The usual anchors."""
KINDS: Final[Mapping[str, Mapping[str, Any]]] = {
    "decoupled": {"coupling": "decoupled"},
    "coupled unobservable": {},
    "coupled observable": {"anchors": ANCHORS},
}
"""The paper's three, the worst first."""
BASELINES: Final = ("dead_reckoning", "odometry", "frame_to_frame")
WRONG: Final[Mapping[str, Mapping[str, Any]]] = {
    "disparity_bias": {"disparity_bias_px": 0.2},
    "misclassified": {"misclassification_probability": 0.1},
    "focal_error": {"focal_scale_error": 0.002},
    "half_detected": {"detection_probability": 0.6},
    "landmark_bias": {"noise": {"bias_sigma_px": 0.3}},
}
"""Arms with one thing wrong each; the forced slip is in every data set."""
SPOILT: Final = {"disparity_bias_px": 0.2, "misclassification_probability": 0.05}
_STANDARD: Final = {"formulation": "standard"}
Mapped = dict[str, Any]


@dataclass(frozen=True, eq=False)
class Part:
    """Variants that run in the same arms.

    Attributes:
        name: Its name, for ``--only`` and its folder.
        arms: Sensors by the name of their arm.
        variants: As in `SweepSpec`.
        data_sets: Only the first so many; None: all.
    """

    name: str
    arms: Mapping[str, Mapping[str, Any]]
    variants: Sequence[Mapped]
    data_sets: int | None = None

    def sweep(self, recordings: Sequence[Path], shortest_m: float, start_m: float) -> SweepSpec:
        """Make the sweep of this part.

        Args:
            recordings: The data sets.
            shortest_m: Shorter ones are left out [m].
            start_m: Distance after which a share of the distance counts [m].
        """
        paths = [str(path) for path in recordings[: self.data_sets]]
        return SweepSpec.from_mapping(
            {
                "name": f"paper_{self.name}",
                "data_sets": {"recordings": paths, "min_path_m": shortest_m},
                "arms": {name: dict(sensor) for name, sensor in self.arms.items()},
                "variants": list(self.variants),
                "bounds": True,
                "evaluation": EvaluationSpec(start_m=start_m),
                "requirement": Requirement(start_m=start_m),
            }
        )


def multiframe(images: int, **spec: Any) -> Mapped:
    """Give a filter whose landmarks live on for so many images."""
    return _slam({"kind": "time_to_live", "images": images}, spec)


def bounded(size: int, leave: str = "first_in_first_out", **spec: Any) -> Mapped:
    """Give a filter whose queue holds so many landmarks."""
    return _slam({"kind": "bounded_queue", "size": size, "leave": leave}, spec)


def _slam(retention: Mapped, spec: Mapped) -> Mapped:
    return {"estimator": "slam", "spec": {"retention": retention, **spec}}


def _three(make: Any, size: int) -> list[Mapped]:
    return [make(size, **_STANDARD, **kind) for kind in KINDS.values()]


def parts() -> tuple[Part, ...]:
    """Give the parts of the whole experiment, those that matter most first."""
    baselines = [{"estimator": name} for name in BASELINES]
    at_m, at_n = _three(multiframe, M), _three(bounded, N)
    invariant = [
        *(multiframe(M), multiframe(M, anchors=ANCHORS)),
        *(bounded(N), bounded(N, anchors=ANCHORS)),
    ]
    few = [invariant[0], at_m[2], baselines[2]]
    swept = [v for m in TIMES_TO_LIVE if m != M for v in _three(multiframe, m)]
    swept += [v for n in QUEUES if n != N for v in _three(bounded, n)]
    policies = [
        bounded(N, leave, **_STANDARD) for leave in ("shortest_time_to_live", "least_confidence")
    ]
    kept = multiframe(M, **_STANDARD, coupling="decoupled_pose_kept")
    whole = _three(lambda _, **spec: _slam({"kind": "keep_all"}, spec), 0)
    return (
        Part("ideal", {"ideal": {}}, [*baselines, *at_m, *at_n, *invariant]),
        Part("spoilt", {"spoilt": SPOILT}, [baselines[2], *at_m, *at_n, *invariant[:2]]),
        Part("wrong", WRONG, few),
        Part("memory", {"ideal": {}}, [kept, *policies, *swept]),
        Part("keep_all", {"ideal": {}}, whole, KEEP_ALL_SETS),
    )


def quick_parts() -> tuple[Part, ...]:
    """Give a few variants in two arms, and two sizes of each memory, for a quick look."""
    baselines = [{"estimator": name} for name in BASELINES[1:]]
    ideal = [*baselines, *_three(multiframe, M), multiframe(M)]
    pairs = [
        multiframe(2, **_STANDARD),
        *(bounded(size, **_STANDARD) for size in (20, N)),
    ]
    return (
        Part("ideal", {"ideal": {}}, [*ideal, *pairs]),
        Part("spoilt", {"spoilt": SPOILT}, [baselines[1], ideal[-1]]),
    )


def label_order(chosen: Sequence[Part]) -> dict[str, int]:
    """Give each variant's place in tables: baselines, then by memory, kind and formulation."""
    labels = {}
    for part in chosen:
        specs = SweepSpec.model_validate(
            {"name": "any", "data_sets": {"recordings": ("any",)}, "variants": list(part.variants)}
        )
        labels.update({v.label: _place(v.estimator, v.spec) for v in expand(specs.variants)})
    return {label: k for k, label in enumerate(sorted(labels, key=lambda name: labels[name]))}


def _place(estimator: str, spec: Mapped) -> tuple[Any, ...]:
    retention = spec.get("retention") or {}
    memory = ("", "time_to_live", "bounded_queue", "keep_all").index(retention.get("kind", ""))
    size = retention.get("images", retention.get("size", 0))
    base = BASELINES.index(estimator) if estimator in BASELINES else 0
    manner = (str(spec.get("coupling", "")) == "coupled", spec.get("anchors") is not None)
    return (memory, base, str(retention.get("leave", "")), size, *manner, str(spec))
