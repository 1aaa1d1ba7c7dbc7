"""Whatever an estimator that is not ours does, it is its own run's failure and nothing else's."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from estimators import build_estimator
from lpet_sim.errors import SpecError, UnknownNameError
from lpet_sim.failures import FAULTS
from lpet_sim.recording.reader import read_measurements
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.sweep_run import run_sweep
from lpet_sim.sweep.sweep_spec import SweepSpec
from tests.plugins.examples import straight
from tests.sweep.tiny_recordings import without_timing, write_tiny

WRONG = "tests.plugins.wrongdoers:Wrong"
LIMITS = {"time_limit_s": 20.0, "memory_limit_mib": 600, "output_limit_mib": 20}
KINDS = {
    "crash": "crash",
    "raises": "exception",
    "hang": "timeout",
    "nan": "not_finite",
    "wrong_length": "wrong_length",
    "wrong_covariance_length": "wrong_length",
    "unordered": "unordered_times",
    "covariance": "bad_covariance",
    "memory_hog": "memory_limit",
    "floods": "output_limit",
    "no_output": "no_output",
    "nothing": "malformed_output",
    "empty": "no_output",
    "wrong_frame": "wrong_frame",
    "giant_file": "output_limit",
    "seeks_truth": "truth_sought",
    "opens_truth": "truth_sought",
}
"""Ways of going wrong, and the failures that they are."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write a recording of three metres."""
    return write_tiny(tmp_path_factory.mktemp("truths") / "tiny.rrd", 1)


def rows_of(recording: Path, variants: list[dict[str, Any]], folder: Path) -> list[dict[str, Any]]:
    """Run a sweep of some variants on one recording."""
    mapping = {
        "name": "wrongdoers",
        "data_sets": {"recordings": [str(recording)]},
        "variants": variants,
    }
    return list(run_sweep(SweepSpec.from_mapping(mapping), folder, Pool(1)).rows)


def test_each_way_of_going_wrong_has_its_failure_and_the_other_rows_are_untouched(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Seventeen wrongdoers between two runs that are as they are without them."""
    straight(monkeypatch)
    places = {"seeks_truth": recording.parent, "opens_truth": recording}
    wrong = [
        {
            "estimator": WRONG,
            "name": how,
            "spec": {
                **LIMITS,
                "how": how,
                "place": str(places.get(how, "/")),
                "time_limit_s": 8.0 if how == "hang" else 60.0,
            },
        }
        for how in KINDS
    ]
    good: list[dict[str, Any]] = [
        {"estimator": "dead_reckoning"},
        {"estimator": "straight:Straight", "name": "straight"},
    ]
    alone = rows_of(recording, good, tmp_path / "alone")
    among = rows_of(recording, [good[0], *wrong, good[1]], tmp_path / "among")
    failures = {row["variant"]: (row["failure"], row["failure_text"]) for row in among}
    assert {how: failures[how][0] for how in KINDS} == KINDS, failures
    untouched = [row for row in among if row["variant"] not in KINDS]
    for row in [*untouched, *alone]:
        del row["variant_order"]
    assert without_timing(untouched) == without_timing(alone)
    assert all(row["failure"] not in FAULTS for row in alone)
    assert str(recording.parent) in failures["seeks_truth"][1]
    assert re.match(r"wrongdoers.py, line \d+: ZeroDivisionError: ", failures["raises"][1])


def test_a_plug_in_does_what_it_does_here(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its parameters reach it, and its estimate comes back to the bit."""
    here, measurements = straight(monkeypatch)(0.5), read_measurements(recording)
    apart = build_estimator("straight:Straight", {"scale": 0.5})
    assert apart.needs == ("wheels",)
    found = apart.estimate(measurements)
    assert found.trajectory.equals(here.estimate(measurements).trajectory)


def test_what_is_no_estimator_is_told_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    """A module that is not there, a class that is not, and a parameter that is not."""
    straight(monkeypatch)
    with pytest.raises(SpecError, match="there is no module 'nowhere': install it, or run where"):
        build_estimator("nowhere:Thing")
    with pytest.raises(SpecError, match=r"straight:Crooked.*has no attribute 'Crooked'"):
        build_estimator("straight:Crooked")
    with pytest.raises(SpecError, match=r"unknown key 'size'; valid keys are .*scale"):
        build_estimator("straight:Straight", {"size": 2})
    module = "tests.plugins.wrongdoers"
    for kind, needs in (("OneName", "'wheels'"), ("UnknownName", r"\('wheel',\)")):
        with pytest.raises(SpecError, match=f"'needs' is {needs}, not a tuple of some of imu,"):
            build_estimator(f"{module}:{kind}")
    with pytest.raises(UnknownNameError, match="choose one of dead_reckoning"):
        build_estimator("crooked")
