"""A sweep says what is wrong with it before anything runs, and names its runs by what they are."""

import re
from pathlib import Path
from typing import Any

import pytest

from lpet_sim.errors import LpetError, SpecError, UnknownNameError
from lpet_sim.sweep import sweep_plan
from lpet_sim.sweep.sweep_data import find_data_sets
from lpet_sim.sweep.sweep_plan import Variant, expand, run_key
from lpet_sim.sweep.sweep_spec import ArmSpec, SweepSpec, VariantSpec
from tests.command import TINY, runner
from tests.sweep.tiny_recordings import small_sweep, write_sweep, write_tiny


def _expanded(*variants: dict[str, Any]) -> tuple[Variant, ...]:
    return expand([VariantSpec.from_mapping(variant) for variant in variants])


def test_a_sweep_block_makes_every_combination_in_order() -> None:
    """The field named last turns fastest; what is not swept has its default, written out."""
    block = {"retention.images": [1, 20], "formulation": ["standard", "first_estimates"]}
    found = _expanded({"estimator": "slam", "spec": {"gate_probability": 0.9}, "sweep": block})
    values = [(v.spec["retention"]["images"], v.spec["formulation"]) for v in found]
    assert values == [
        (1, "standard"), (1, "first_estimates"), (20, "standard"), (20, "first_estimates")
    ]  # fmt: skip
    assert [v.order for v in found] == [0, 1, 2, 3]
    assert {v.spec["gate_probability"] for v in found} == {0.9}
    assert found[0].spec["coupling"] == "coupled"
    assert found[0].label == "m1-n9999-coupled-unobservable-standard"


def test_a_swept_field_may_lie_in_a_part_that_is_null_or_of_another_kind() -> None:
    """Anchors are null by default; a queue has other fields than a time to live."""
    queue = {"retention": {"kind": "bounded_queue"}}
    anchored = {"estimator": "slam", "sweep": {"anchors.count_max": [10]}}
    found = _expanded(
        {"estimator": "slam", "spec": queue, "sweep": {"retention.size": [10, 20]}}, anchored
    )
    assert [v.spec["retention"].get("size") for v in found] == [10, 20, None]
    assert found[2].spec["anchors"]["count_max"] == 10


def test_labels_tell_variants_apart() -> None:
    """By their spec's own label, their name, or the values that were swept."""
    found = _expanded(
        {"estimator": "slam", "sweep": {"noise_scale": [0.5, 2.0]}},
        {"estimator": "slam", "name": "ours", "sweep": {"retention.images": [3]}},
        {"estimator": "frame_to_frame"},
        {"estimator": "dead_reckoning", "sweep": {"tilt_sigma_rad": [0.1, 0.2]}},
    )
    base = "m10-n9999-coupled-unobservable-invariant"
    assert [v.label for v in found] == [
        f"{base}-noise_scale0.5", f"{base}-noise_scale2.0", "ours-images3", "frame_to_frame",
        "dead_reckoning-tilt_sigma_rad0.1", "dead_reckoning-tilt_sigma_rad0.2",
    ]  # fmt: skip
    with pytest.raises(SpecError, match="two variants are called 'slam1'"):
        _expanded(*[{"estimator": "slam", "name": "slam1"}] * 2)


@pytest.mark.parametrize(
    ("variant", "kind", "says"),
    [
        ({"estimator": "slamm"}, UnknownNameError, "unknown estimator 'slamm': choose one of"),
        (
            {"estimator": "slam", "sweep": {"retention.imagez": [1]}},
            SpecError,
            r"variants\[0\] \(slam\): unknown key 'retention.imagez'; valid keys are kind, images",
        ),
        ({"estimator": "slam", "sweep": {"gates": [1]}}, SpecError, "unknown key 'gates'"),
        (
            {"estimator": "slam", "spec": {"retention": 3}, "sweep": {"retention.images": [1]}},
            SpecError,
            "'retention' is 3, which has no fields",
        ),
        ({"estimator": "slam", "sweep": {"retention.images": [0]}}, SpecError, "greater than or"),
    ],
)
def test_a_variant_that_cannot_be_is_refused(
    variant: dict[str, Any], kind: type[LpetError], says: str
) -> None:
    """One sentence that names what would have been valid."""
    with pytest.raises(kind, match=says):
        _expanded(variant)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"variants": []}, "'variants'"),
        ({"arms": {}}, "'arms'"),
        (
            {"arms": {"a": {"periods": 1}}},
            r"unknown key 'arms.a.sensor.periods'; valid .* period_s",
        ),
        ({"arms": {"a": "none.yaml"}}, "cannot read .*none.yaml"),
        ({"data_sets": {}}, "give either recordings or a traverse"),
        ({"data_sets": {"recordings": ["none*.rrd"]}}, "there is no .*none.*rrd"),
        ({"data_sets": {"traverse": {"terrain": "moon"}}}, "moon"),
        ({"requirment": {}}, "unknown key 'requirment'; valid keys are name, data_sets"),
        ({"time_limit_s": 0}, "'time_limit_s'"),
        ({"odometry": "visual"}, "'odometry'"),
        ({"variants": [{"estimator": "slam", "sweep": {"formulation": ["odd"]}}]}, "formulation"),
    ],
)
def test_the_command_refuses_a_sweep_before_anything_runs(
    change: dict[str, Any],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 2, one sentence, and nothing written."""
    write_tiny(tmp_path / "one.rrd", 1, duration_s=2.0)
    spec = write_sweep(tmp_path / "sweep.yaml", small_sweep(tmp_path) | change)
    ended = runner(monkeypatch, capsys)("sweep", spec, "--out", tmp_path / "out")
    assert ended.code == 2
    assert len(ended.err.splitlines()) == 1
    assert not (tmp_path / "out").exists()
    assert re.search(says, ended.err)


def test_files_are_looked_for_beside_the_yaml(tmp_path: Path) -> None:
    """Recordings, a traverse and a sensor, wherever the command is called."""
    (tmp_path / "sensor.yaml").write_text("{period_s: 2.0}")
    (tmp_path / "drive.yaml").write_text(TINY)
    sets = {"traverse": "drive.yaml", "first": 7, "count": 2}
    arms = {"a": "sensor.yaml", "b": {"sensor": "sensor.yaml"}, "c": {"period_s": 3.0}, "d": None}
    mapping = small_sweep(tmp_path, data_sets=sets, arms=arms)
    spec = SweepSpec.from_yaml(write_sweep(tmp_path / "sweep.yaml", mapping))
    periods = [arm.sensor and arm.sensor.period_s for arm in spec.arms.values()]
    assert periods == [2.0, 2.0, 3.0, None]
    found = find_data_sets(spec.data_sets, tmp_path / "out")
    assert [(d.name, d.seed) for d in found] == [("tiny007", 7), ("tiny008", 8)]
    write_tiny(tmp_path / "one.rrd", 1, duration_s=1.0)
    mapping = small_sweep(tmp_path, data_sets={"recordings": ["*.rrd"]})
    spec = SweepSpec.from_yaml(write_sweep(tmp_path / "sweep.yaml", mapping))
    found = find_data_sets(spec.data_sets, tmp_path)
    assert [d.path for d in found] == [str(tmp_path / "one.rrd")]
    assert SweepSpec.from_mapping(spec.to_mapping()) == spec


def test_a_run_is_named_by_what_its_row_depends_on() -> None:
    """By nothing that is only a name, and by everything that changes a number."""
    spec = SweepSpec.from_mapping(small_sweep(Path()))
    arm, biased = spec.arms.values()
    variant, other, _ = expand(spec.variants)
    key = run_key("d", arm, variant, spec)
    renamed = Variant(9, "renamed", variant.estimator, variant.spec)
    more = spec.model_copy(update={"bounds": True, "time_limit_s": 3.0, "name": "x"})
    assert run_key("d", arm, renamed, more) == key
    held = spec.requirement.model_copy(update={"position_ratio": 0.02})
    changed = {
        run_key("e", arm, variant, spec),
        run_key("d", biased, variant, spec),
        run_key("d", ArmSpec.from_mapping({"sensor": {}}), variant, spec),
        run_key("d", arm, other, spec),
        run_key("d", arm, variant, spec.model_copy(update={"odometry": "wheels"})),
        run_key("d", arm, variant, spec.model_copy(update={"requirement": held})),
    }
    assert len(changed | {key}) == 7


def test_comments_and_docstrings_are_no_part_of_the_code_that_rows_depend_on() -> None:
    """So that a sweep survives a better comment, but not another number."""
    bare = sweep_plan._bare
    text = 'def f(x):\n    """Double."""\n    return 2 * x  # twice\n'
    assert bare(text) == bare("def f(x):\n    return (2 *\n        x)\n")
    assert bare(text) != bare(text.replace("2", "3"))
    assert sweep_plan.code_digest(True) != sweep_plan.code_digest(False)
