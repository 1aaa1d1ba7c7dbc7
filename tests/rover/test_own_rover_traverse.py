"""Rovers of one's own end to end: driven, sensed, seen, estimated, scored, and on record."""

import json
import shutil
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lpet_sim.errors import SpecError
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.rover.model_spec import models_folder
from lpet_sim.sweep.score import Score, estimate_recording, score_recording
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import TraverseSpec, manifest_of

SMALL_CAMERA = {
    "width_px": 640,
    "height_px": 480,
    "focal_px": 502.0,
    "ground": {
        "levels": 4,
        "supersampling": 1,
        "rock_faces": 20_000,
    },
}


def _spec(model: str, **more: Any) -> TraverseSpec:
    given = {
        "name": "own",
        "terrain": {"relief": {"rms_slope_rad": 0.03}, "craters": None},
        "rover": {"model": model},
        "drive": {"waypoints_m": [[0, 0], [1.2, 0.1]], "speed_mps": 0.1, "settle_s": 2.0},
        "route": None,
        "images": {"period_s": 1.0},
        "sensors": {"stereo": SMALL_CAMERA},
    }
    return TraverseSpec.from_mapping(given | more)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Drive the four-wheel rover once, with a camera pair a second."""
    path = tmp_path_factory.mktemp("own") / "run.rrd"
    simulate(_spec("prospector"), 3, path)
    return path


@pytest.fixture(scope="module")
def recording(run: Path) -> Recording:
    """Read it back."""
    return read_recording(run)


@pytest.fixture(scope="module")
def score(run: Path) -> Score:
    """Estimate by wheels and by landmarks, and score both."""
    estimate_recording(run, ["dead_reckoning", "frame_to_frame", "slam"])
    return score_recording(run)


def test_the_recording_has_four_wheels_and_this_rovers_calibration(recording: Recording) -> None:
    """Names, places and radius of its own wheels, its own gravity, and its own mast."""
    calibration = recording.measurements.calibration
    wheels, stereo = calibration.wheels, calibration.stereo
    assert wheels is not None
    assert stereo is not None
    assert wheels.names == ("front_left", "front_right", "rear_left", "rear_right")
    assert wheels.radius_m == 0.25
    assert wheels.steerable == (True,) * 4
    assert calibration.gravity_mps2 == 1.62
    np.testing.assert_allclose(stereo.T_body_camera.translation_m, [0.5, 0.2, 1.78], atol=1e-9)
    assert recording.measurements.wheels is not None
    assert recording.measurements.wheels.drive_angle_rad.shape[1] == 4
    assert recording.truth is not None
    assert recording.truth.wheels is not None
    assert recording.truth.wheels.slip.shape[1] == 4
    assert recording.truth.wheels.joint_angle_rad.shape[1] == 2
    assert recording.truth.ending is not None
    assert recording.truth.ending.kind == "goal"


def test_its_inertial_unit_feels_its_own_gravity(recording: Recording) -> None:
    """At rest the mean specific force is 1.62 m/s2 within a milli-g of Earth's."""
    imu = recording.measurements.imu
    assert imu is not None
    felt = np.linalg.norm(imu.accel_mps2.mean(axis=0))
    assert felt == pytest.approx(1.62, abs=0.01)


def test_its_cameras_see_landmarks_again(recording: Recording) -> None:
    """Dozens in every pair, many of them seen in the one before."""
    sightings = recording.measurements.sightings
    assert sightings is not None
    ids = [
        set(sightings.landmark_id[a:b].tolist())
        for a, b in zip(sightings.offsets[:-1], sightings.offsets[1:], strict=True)
    ]
    assert len(ids) >= 10
    assert np.median([len(seen) for seen in ids]) > 50
    again = [len(a & b) / len(b) for a, b in pairwise(ids)]
    assert np.median(again) > 0.4


def test_every_estimator_localizes_it(score: Score) -> None:
    """Landmarks within half a per cent of the distance, wheels within the noise of their scale."""
    metres = {r.name: float(np.linalg.norm(r.endpoint_error_m)) for r in score.results}
    assert set(metres) == {"dead_reckoning", "frame_to_frame", "slam"}
    assert metres["frame_to_frame"] < 0.01
    assert metres["slam"] < 0.01
    assert 0.01 < metres["dead_reckoning"] < 0.15


def test_a_rover_of_ones_own_is_named_in_the_manifest(tmp_path: Path) -> None:
    """With its description and the hash of its model; ours is known by its name."""
    for file in ("scout.yaml", "scout.urdf"):
        shutil.copy(models_folder() / file, tmp_path)
    mapping = _spec("exomars").to_mapping() | {"rover": {"model": "scout.yaml"}}
    del mapping["terrain"]
    (tmp_path / "traverse.yaml").write_text(json.dumps(mapping | {"terrain": "exomars"}))
    spec = TraverseSpec.from_yaml(tmp_path / "traverse.yaml")
    assert spec.rover.model == str(tmp_path / "scout.yaml")
    said = manifest_of(spec, spec.drive, 0).specs["rover_model"]
    assert said["model"] == "scout.urdf"
    assert len(said["sha256"]) == 64
    assert "rover_model" not in manifest_of(_spec("exomars"), spec.drive, 0).specs


def test_a_small_skidding_rover_is_recorded_too(tmp_path: Path) -> None:
    """From the URDF, without images; its steering reads nothing and is said not to steer."""
    simulate(_spec("scout", images=None, sensors={"stereo": None}), 1, tmp_path / "run.rrd")
    recording = read_recording(tmp_path / "run.rrd")
    wheels = recording.measurements.calibration.wheels
    assert wheels is not None
    assert wheels.steerable == (False,) * 4
    assert recording.measurements.wheels is not None
    np.testing.assert_array_equal(recording.measurements.wheels.steer_angle_rad, 0.0)
    (estimate,) = estimate_recording(tmp_path / "run.rrd", ["dead_reckoning"])
    assert recording.truth is not None
    moved = estimate.trajectory.T_world_body.translation[-1]
    assert np.linalg.norm(moved - recording.truth.trajectory.T_world_body.translation[-1]) < 0.25


def test_a_wheel_to_be_stuck_is_one_of_this_rovers() -> None:
    """Told when the traverse is read, with the names of this rover's wheels."""
    drive = {
        "waypoints_m": [[0, 0], [1, 0]],
        "stuck_wheels": [{"wheel": "middle_left", "start_s": 1}],
    }
    with pytest.raises(SpecError, match=r"'middle_left': .* front_left, front_right, rear_left"):
        _spec("prospector", drive=drive)
    assert _spec("exomars", drive=drive).drive.stuck_wheels[0].wheel == "middle_left"
