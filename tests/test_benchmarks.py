"""The arithmetic of the benchmarks' table; what they measure is measured by `make bench`."""

import pytest

from benchmarks.pipeline import BareParts
from benchmarks.timing import Samples, compare_ms, in_turn


def test_ways_take_turns_and_the_warm_up_is_dropped() -> None:
    """Each item goes through each way before the next item comes."""
    calls: list[tuple[str, int]] = []
    ours, bare = in_turn(
        range(3),
        lambda item: calls.append(("ours", item)),
        lambda item: calls.append(("bare", item)),
    )
    assert calls == [(way, item) for item in range(3) for way in ("ours", "bare")]
    assert len(ours.wall_s) == len(bare.wall_s) == len(bare.cpu_s) == 2


def test_a_row_compares_medians() -> None:
    """One slow sample changes nothing."""
    ours, bare = Samples([2.0, 3.0, 90.0], [4.0] * 3), Samples([1.5, 1.5, 1.5], [2.0] * 3)
    row = compare_ms("x", ours, bare)
    assert (row.ours, row.bare, row.cost, row.cpu_cost) == (3000.0, 1500.0, 2.0, 2.0)


def test_bare_parts_add_up_to_a_traverse() -> None:
    """7.2 s on Mars are 1440 steps of 5 ms and ten pairs, 0.72 s apart."""
    step = Samples([1e-4], [2e-4])
    pair = (Samples([0.05], [0.1]), Samples([0.03], [0.03]))
    spent = BareParts(step, pair, physics_hz=200.0).sum(mars_s=7.2)
    assert (spent.wall_s, spent.cpu_s) == (pytest.approx(0.944), pytest.approx(1.588))
