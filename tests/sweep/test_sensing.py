"""Landmarks sensed along a recorded traverse, through the library and the command."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.reader import read_measurements, read_recording
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.truth import Truth
from lpet_sim.recording.writer import write_recording
from lpet_sim.rover.spec import DriveSpec
from lpet_sim.sensors.landmark_sensor import sense_landmarks
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec, VisibilitySpec
from lpet_sim.sweep.sensing import sense_recording, terrain_of
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.terrain import build_terrain
from tests.command import Lpet, runner
from tests.sensors.landmark_worlds import CAMERA, straight_drive

SEED = 11
SPEC = LandmarkSensorSpec(period_s=2.0, visibility=VisibilitySpec(range_max_m=8.0))
TRAVERSE = TraverseSpec(
    name="short",
    terrain="exomars",  # type: ignore[arg-type]
    drive=DriveSpec(waypoints_m=((0.0, 0.0), (1.0, 0.0))),
    route=None,
    images=None,
)


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run the command in this process."""
    return runner(monkeypatch, capsys)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Make a recording of a short drive without sensors."""
    terrain = build_terrain(TRAVERSE.terrain, SEED)
    truth = Truth(straight_drive(1.0, terrain))
    manifest = Manifest("simulation", SEED, {"traverse": TRAVERSE.to_mapping()})
    return Recording(manifest, Measurements(Calibration(stereo=CAMERA)), truth)


def test_a_recording_is_sensed_on_its_own_terrain(recording: Recording) -> None:
    """The same as sensing its truth on the terrain of its spec and seed; another seed differs."""
    assert recording.truth is not None
    terrain = terrain_of(recording.manifest)
    expected = sense_landmarks(recording.truth.body, terrain, CAMERA, SPEC, SEED)
    assert sense_recording(recording, SPEC).equals(expected)
    other = sense_recording(recording, SPEC, seed=SEED + 1)
    assert not set(other.landmark_id) & set(expected.landmark_id)


def test_progress_reaches_the_end(recording: Recording) -> None:
    """Each image is told of."""
    told: list[float] = []
    sensed = sense_recording(recording, SPEC, progress=told.append)
    assert len(told) == len(sensed)
    assert told[-1] == 1.0


def test_what_cannot_be_sensed_is_refused(recording: Recording) -> None:
    """An imported recording, one without truth, and one without cameras."""
    blind = replace(recording, measurements=Measurements(Calibration()))
    imported = replace(recording, manifest=Manifest("kitti"))
    for bad, word in (
        (imported, "kitti"),
        (replace(recording, truth=None), "truth"),
        (blind, "stereo"),
    ):
        with pytest.raises(RecordingError, match=word):
            sense_recording(bad, SPEC)


def test_the_command_lays_sightings_over_the_recording(
    lpet: Lpet, recording: Recording, tmp_path: Path
) -> None:
    """In place or beside it, with a count of what was seen; truth and manifest stay."""
    run, beside, spec = (tmp_path / name for name in ("run.rrd", "sensed.rrd", "sensor.yaml"))
    write_recording(run, recording)
    SPEC.to_yaml(spec)
    ended = lpet("sense", run, "--spec", spec, "--out", beside)
    assert ended.code == 0
    assert "6 image pairs" in ended.out
    sightings = read_measurements(beside).sightings
    assert sightings is not None
    assert sightings.equals(sense_recording(recording, SPEC))
    assert read_measurements(run).sightings is None
    again = read_recording(beside)
    assert again.truth is not None
    assert recording.truth is not None
    assert again.truth.body.equals(recording.truth.body)
    assert lpet("sense", run, "--spec", spec, "--seed", "3").code == 0
    in_place = read_measurements(run).sightings
    assert in_place is not None
    assert not np.isin(in_place.landmark_id, sightings.landmark_id).any()


def test_the_command_refuses_a_bad_sensor(lpet: Lpet, tmp_path: Path) -> None:
    """One sentence that names the valid keys."""
    spec = tmp_path / "sensor.yaml"
    spec.write_text("detection: 0.5\n")
    ended = lpet("sense", tmp_path / "run.rrd", "--spec", spec)
    assert ended.code == 2
    assert "detection_probability" in ended.err
