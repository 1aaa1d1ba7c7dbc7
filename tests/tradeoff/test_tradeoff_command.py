"""The command: predict, simulate, recommend; and what it says of input that cannot be used."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from lpet_sim.recording.reader import read_recording
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.sweep_pool import Pool
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.terrain import build_terrain
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.drives import carried_scene
from lpet_sim.tradeoff.kept_terrain import KeptTerrain
from lpet_sim.tradeoff.recommend import RecommendedSensor
from lpet_sim.tradeoff.simulated import simulate_candidates
from lpet_sim.tradeoff.spec import TradeoffSpec
from tests.command import TINY, Lpet, runner
from tests.tradeoff.tradeoffs import FLAT, SENSOR, spec_of

SPACE: dict[str, Any] = {"baseline_m": [0.1, 0.3], "image_interval_m": 0.4, "resolution_px": 512}


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run the command in this process."""
    return runner(monkeypatch, capsys)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Drive 0.3 m."""
    path = tmp_path_factory.mktemp("drive") / "tiny.rrd"
    simulate(TraverseSpec.from_mapping(yaml.safe_load(TINY)), 1, path)
    return path


def written(folder: Path, **more: Any) -> Path:
    """Write a small trade-off to a file."""
    told = {"name": "small", "space": SPACE, "sampling": {"kind": "grid"}, **more}
    told["site"] = {"terrain": FLAT, "distance_m": 6.0, **more.get("site", {})}
    path = folder / "small.yaml"
    path.write_text(yaml.safe_dump(told))
    return path


def test_a_space_is_predicted_and_one_sensor_recommended(lpet: Lpet, tmp_path: Path) -> None:
    """Tables, rows and figures are there, and what is recommended is read by the rest."""
    out = tmp_path / "out"
    requirement = {"position_ratio": 0.5, "roll_rad": 1.0, "pitch_rad": 1.0, "yaw_rad": 1.0}
    spec = written(tmp_path, requirement=requirement)
    ended = lpet("tradeoff", spec, "--out", out, "--static-only", "--check")
    assert ended.code == 0, ended.err
    assert "PASS: 2 of 2 candidates meet the requirement" in ended.out
    sensor = RecommendedSensor.from_yaml(out / "recommended.yaml")
    assert sensor.candidate.baseline_m in (0.1, 0.3)
    assert LandmarkSensorSpec.from_yaml(out / "recommended_landmarks.yaml") == sensor.landmarks
    rows = list(csv.DictReader((out / "candidates.csv").read_text().splitlines()))
    assert sum(row["recommended"] == "True" for row in rows) == 1
    assert json.loads((out / "tradeoff.json").read_text())["verdict"] == "PASS"
    for name in ("pareto.png", "sensitivity.png"):
        assert (out / name).stat().st_size > 10_000


def test_an_impossible_requirement_is_an_honest_fail(lpet: Lpet, tmp_path: Path) -> None:
    """Exit code 1 where asked for, with the most accurate sensor all the same."""
    spec = written(tmp_path, requirement={"position_ratio": 1e-6})
    ended = lpet("tradeoff", spec, "--out", tmp_path / "out", "--static-only", "--check")
    assert ended.code == 1
    assert "FAIL: none of 2 candidates meets the requirement" in ended.out
    sensor = RecommendedSensor.from_yaml(tmp_path / "out" / "recommended.yaml")
    assert sensor.candidate.baseline_m == 0.3
    assert lpet("tradeoff", spec, "--out", tmp_path / "out", "--static-only").code == 0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"space": {"baseline_m": []}}, "is empty: give a number, a list of numbers"),
        ({"constraints": {"mass_kg": 0.1}}, "no sensor of the space is left"),
        ({"space": {"colour": 3}}, "unknown key 'space.colour'; valid keys are field_of_view_rad"),
        ({"simulation": {"recordings": ["no.rrd"]}}, "give paths or globs of .rrd files"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(
    lpet: Lpet, tmp_path: Path, more: dict[str, Any], said: str
) -> None:
    """Exit code 2, without a traceback."""
    ended = lpet("tradeoff", written(tmp_path, **more), "--out", tmp_path / "out")
    assert ended.code == 2
    assert ended.err.startswith("lpet: ") and said in ended.err
    assert len(ended.err.strip().splitlines()) == 1


def test_simulated_runs_are_kept_and_only_what_is_missing_runs(
    recording: Path, tmp_path: Path
) -> None:
    """The same call again runs nothing; another candidate runs alone."""
    spec = simulated_spec(recording)
    calls: list[tuple[int, int, int]] = []

    def count(*told: int) -> None:
        calls.append((told[0], told[1], told[2]))

    first = simulate_candidates(spec, {0: SENSOR}, tmp_path, 5, Pool(1), count, bounds=True)
    assert calls[0] == (0, 2, 0) and calls[-1] == (2, 2, 0)
    again = simulate_candidates(spec, {7: SENSOR}, tmp_path, 5, Pool(1), count, bounds=True)
    assert calls[-1] == (2, 2, 0) and calls[-2] != (1, 2, 0)
    assert again[7].error_ratio() == first[0].error_ratio() > 0.0
    assert {row["draw"] for row in first[0].rows} == {5, 6}
    assert first[0].efficiency.runs == 2
    assert all(np.isfinite(row["bound_m"]) for row in first[0].rows)


def simulated_spec(recording: Path) -> TradeoffSpec:
    """Make a trade-off that simulates one estimator on a recording, twice."""
    runs = {
        "recordings": [str(recording)],
        "draws": 2,
        "variants": [{"estimator": "dead_reckoning"}],
    }
    return spec_of(simulation=runs, site={"speed_mps": 0.1})


def test_a_carried_camera_is_declared_and_draws_are_independent(recording: Path) -> None:
    """Calibration, noise and unit are the candidate's; a draw gives the same bits twice."""
    site = spec_of(site={"speed_mps": 0.1}).site
    candidate = Candidate(baseline_m=0.31, image_interval_m=0.05, imu="tactical_mems")
    one, same, other = (carried_scene(recording, candidate, site, draw) for draw in (1, 1, 2))
    declared = one.measurements.calibration
    assert declared.stereo is not None and declared.imu is not None
    assert declared.stereo.baseline_m == 0.31
    assert declared.imu.gyro_random_walk_radps_rthz == pytest.approx(np.radians(0.15) / 60)
    seen = [scene.measurements.sightings for scene in (one, same, other)]
    assert seen[0] is not None and seen[1] is not None and seen[2] is not None
    np.testing.assert_array_equal(seen[0].stereo_px, seen[1].stereo_px)
    assert not np.array_equal(seen[0].stereo_px, seen[2].stereo_px)
    gyros = [s.measurements.imu.gyro_radps for s in (one, same, other) if s.measurements.imu]
    np.testing.assert_array_equal(gyros[0], gyros[1])
    assert not np.array_equal(gyros[0], gyros[2])


def test_a_terrain_that_keeps_patches_gives_the_same_bits(recording: Path) -> None:
    """A patch inside, one that overlaps, and one far away."""
    traverse = read_recording(recording).manifest.specs["traverse"]
    terrain = TraverseSpec.from_mapping(traverse).terrain
    plain, kept = build_terrain(terrain, 3), KeptTerrain(terrain, 3)
    for x0, y0 in ((0, 0), (10, -7), (30, 20), (500, 900), (0, 0)):
        expected = plain.patch(x0, y0, (30, 25), 0.2)
        np.testing.assert_array_equal(kept.patch(x0, y0, (30, 25), 0.2), expected)
