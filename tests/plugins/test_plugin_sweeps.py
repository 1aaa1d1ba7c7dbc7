"""Estimators that are not ours, in sweeps: their names, files and changes are their own."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from estimators import build_estimator
from lpet_sim.errors import EstimatorFaultError, LpetError, SpecError
from lpet_sim.plugins import python_plugin
from lpet_sim.plugins.limits import LimitSpec
from lpet_sim.plugins.supervise import Confinement, supervise
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_run import SweepResult, run_sweep
from lpet_sim.sweep.sweep_spec import SweepSpec
from tests.sweep.tiny_recordings import write_tiny

SCALED = """


class Scaled(Straight):
    def __init__(self, retention: int = 10, coupling: float = 0.5, weights: str = "") -> None:
        super().__init__(float(open(weights).read()) if weights else 1.0)
"""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Start in a folder with a recording and a module."""
    write_tiny(tmp_path / "tiny.rrd", 1)
    examples = Path(__file__).parents[2] / "docs" / "examples"
    straight = (examples / "straight.py").read_text()
    (tmp_path / "scaled.py").write_text(straight + SCALED)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def swept(home: Path, variants: list[dict[str, Any]]) -> SweepResult:
    """Run variants on the recording."""
    mapping = {
        "name": "own",
        "data_sets": {"recordings": [str(home / "tiny.rrd")]},
        "variants": variants,
    }
    return run_sweep(SweepSpec.from_mapping(mapping), home / "out", Pool(1))


def test_parameters_may_be_called_as_those_of_our_filter(home: Path) -> None:
    """Numbers for what are mappings and words there; its columns tell of the filter alone."""
    rows = swept(home, [{"estimator": "slam"}, {"estimator": "scaled:Scaled"}]).rows
    assert [row["failure"] for row in rows] == ["", "diverged"]
    assert [row["coupling"] for row in rows] == ["coupled", ""]
    assert [row["retention"] for row in rows] == ["time_to_live", ""]


def test_files_that_it_may_read_are_found_from_here_and_rows_hang_on_them(home: Path) -> None:
    """A relative path works, other weights are other runs, and a file that is not there is told."""
    (home / "weights.txt").write_text("0.5")
    spec = {"readable": ["weights.txt"], "weights": str(home / "weights.txt")}
    variants = [{"estimator": "scaled:Scaled", "spec": spec}]
    first = swept(home, variants)
    assert first.rows[0]["failure"] == "diverged"
    assert swept(home, variants).ran == 0
    (home / "weights.txt").write_text("0.1")
    again = swept(home, variants)
    assert again.ran == 1
    assert again.rows[0]["end_error_m"] > first.rows[0]["end_error_m"] + 0.5
    with pytest.raises(SpecError, match=r"there is no .*nowhere; give files and folders that are"):
        build_estimator("scaled:Scaled", {"readable": ["nowhere"]})


def test_a_sweep_ends_where_an_estimator_is_changed_on_the_way(
    home: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A row must not tell of code that it was not made by."""
    monkeypatch.setattr(python_plugin, "_digest", lambda value: "what it was at the start")
    with pytest.raises(LpetError, match="'scaled:Scaled' was changed while the sweep ran"):
        swept(home, [{"estimator": "scaled:Scaled"}])


@pytest.mark.parametrize(("mib", "held"), [(0, True), (2, False)])
def test_what_it_is_given_is_none_of_its_output(tmp_path: Path, mib: int, held: bool) -> None:
    """Three mebibytes of measurements under a limit of one."""
    work = tmp_path / "work"
    work.mkdir()
    (work / "images.npy").write_bytes(b"0" * (3 << 20))
    body = f"open('out', 'wb').write(b'0' * ({mib} << 20))"
    command = [sys.executable, "-I", "-c", body]
    limits = LimitSpec(output_limit_mib=1, time_limit_s=20.0)
    run = (command, work, limits, Confinement(), {})
    if held:
        supervise(*run)
        return
    with pytest.raises(EstimatorFaultError, match=r"more than its 1 MiB|larger than its 1 MiB"):
        supervise(*run)
