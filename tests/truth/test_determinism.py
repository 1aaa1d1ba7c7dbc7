"""The same spec and seed give the same arrays to the bit, in any process; another seed others."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from estimators import ESTIMATORS, build_estimator
from lpet_sim.recording.arrays import ArrayStruct
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import ImagesSpec, TraverseSpec
from tests.truth.drives import GROUND, traverse_spec

STREAMS = ("imu", "wheels", "sightings", "truth of the body", "truth of the wheels")


def short_spec() -> TraverseSpec:
    """Make a traverse of 30 cm with three small image pairs."""
    spec = traverse_spec(0.3, ImagesSpec(period_s=2.5))
    stereo = spec.sensors.stereo
    assert stereo is not None
    small = {"width_px": 320, "height_px": 240, "focal_px": 250.0, "ground": GROUND}
    sensors = spec.sensors.model_copy(update={"stereo": stereo.model_copy(update=small)})
    drive = spec.drive.model_copy(update={"waypoints_m": ((0.0, 0.0), (0.3, 0.0))})
    return spec.model_copy(update={"drive": drive, "sensors": sensors})


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Drive with seed 7."""
    return read_recording(simulate(short_spec(), 7, tmp_path_factory.mktemp("a") / "run.rrd").path)


def streams(recording: Recording) -> dict[str, ArrayStruct]:
    """Give every stream of arrays of a recording."""
    measured, truth = recording.measurements, recording.truth
    assert truth is not None
    found = (measured.imu, measured.wheels, measured.sightings, truth.body, truth.wheels)
    assert all(stream is not None and len(stream) >= 3 for stream in found)
    return dict(zip(STREAMS, found, strict=True))  # type: ignore[arg-type]


def pairs(recording: Recording) -> list[np.ndarray[Any, Any]]:
    """Give all image pairs, each as Shape (2, h, w)."""
    images = recording.measurements.images
    assert images is not None and len(images) >= 3
    return [np.stack(images.pair(index)) for index in range(len(images))]


def test_another_process_makes_the_same_recording_to_the_bit(
    first: Recording, tmp_path: Path
) -> None:
    """The command, in a process with another hash seed, makes equal streams, images, estimates."""
    spec, run = tmp_path / "spec.yaml", tmp_path / "run.rrd"
    short_spec().to_yaml(spec)
    command = [sys.executable, "-c", "from lpet_sim.cli import main; main()", "simulate"]
    arguments = [str(spec), "--seed", "7", "--out", str(run)]
    environment = {**os.environ, "PYTHONHASHSEED": "12345"}
    subprocess.run([*command, *arguments], check=True, env=environment, capture_output=True)
    second = read_recording(run)
    assert second.manifest == first.manifest
    assert second.measurements.calibration == first.measurements.calibration
    again = streams(second)
    assert [name for name, stream in streams(first).items() if not stream.equals(again[name])] == []
    assert second.truth is not None and first.truth is not None
    assert second.truth.events == first.truth.events
    assert all(np.array_equal(a, b) for a, b in zip(pairs(first), pairs(second), strict=True))
    for name in (n for n in ESTIMATORS if "odometry" not in build_estimator(n).needs):
        a, b = (build_estimator(name).estimate(r.measurements) for r in (first, second))
        assert a.trajectory.equals(b.trajectory)
        assert a.covariance is not None and b.covariance is not None
        assert a.covariance.tobytes() == b.covariance.tobytes()


def test_another_seed_makes_another_recording(first: Recording, tmp_path: Path) -> None:
    """No stream and no image stays as it was."""
    other = read_recording(simulate(short_spec(), 8, tmp_path / "run.rrd").path)
    again = streams(other)
    assert [name for name, stream in streams(first).items() if stream.equals(again[name])] == []
    assert not any(np.array_equal(a, b) for a, b in zip(pairs(first), pairs(other), strict=False))
