"""A landmark sensor is measured on its own sightings, and comes back; through the command too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.truth import Truth
from lpet_sim.recording.writer import write_recording
from lpet_sim.rng import stream
from lpet_sim.rover.spec import DriveSpec
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec, SightingNoiseSpec, VisibilitySpec
from lpet_sim.sweep.calibrate import Calibrated, calibrate_sensor, chances
from lpet_sim.sweep.sensing import sense_recording
from lpet_sim.sweep.traverse import TraverseSpec
from lpet_sim.terrain.terrain import build_terrain
from tests.command import runner
from tests.sensors.landmark_worlds import CAMERA, straight_drive

SEED = 11
LENGTH_M = 6.0
NOISE = SightingNoiseSpec(
    sigma_left_px=0.3, sigma_right_px=0.4, sigma_v_px=0.2, declared_sigma_px=0.35
)
SPEC = LandmarkSensorSpec(
    period_s=2.0,
    noise=NOISE,
    visibility=VisibilitySpec(range_max_m=10.0, sightings_max=80),
    detection_probability=0.75,
    misclassification_probability=0.05,
    disparity_bias_px=0.3,
)
TRAVERSE = TraverseSpec(
    name="short",
    terrain="exomars",
    drive=DriveSpec(waypoints_m=((0.0, 0.0), (LENGTH_M, 0.0))),
    route=None,
    images=None,
)


@pytest.fixture(scope="module")
def recording() -> Recording:
    """Make a recording whose sightings are those of the landmark sensor."""
    terrain = build_terrain(TRAVERSE.terrain, SEED)
    truth = Truth(straight_drive(LENGTH_M, terrain))
    manifest = Manifest("simulation", SEED, {"traverse": TRAVERSE.to_mapping()})
    bare = Recording(manifest, Measurements(Calibration(stereo=CAMERA)), truth)
    sightings = sense_recording(bare, SPEC)
    return replace(bare, measurements=replace(bare.measurements, sightings=sightings))


@pytest.fixture(scope="module")
def found(recording: Recording) -> Calibrated:
    """Measure once."""
    return calibrate_sensor(recording)


def test_the_sensors_noise_comes_back(found: Calibrated) -> None:
    """White noise of each coordinate to 6 %, no fixed error to speak of, and what was declared."""
    noise = found.spec.noise
    measured = [noise.sigma_left_px, noise.sigma_right_px, noise.sigma_v_px]
    np.testing.assert_allclose(measured, [0.3, 0.4, 0.2], rtol=0.06)
    assert noise.bias_sigma_px < 0.15
    assert noise.declared_sigma_px == pytest.approx(0.35)


def test_the_sensors_chances_come_back(found: Calibrated) -> None:
    """Detection and wrong names to four sigma of their counts, the period, the sightings."""
    count = found.fit.tracks.sightings.sum()
    chances = ("detection_probability", "misclassification_probability")
    for name in chances:
        p = getattr(SPEC, name)
        assert abs(getattr(found.spec, name) - p) < 4 * np.sqrt(p * (1 - p) / count) + 0.01, name
    assert found.spec.period_s == pytest.approx(2.0)
    shown = found.fit.tracks.sightings.mean() / SPEC.detection_probability
    assert found.spec.visibility.sightings_max == pytest.approx(shown, abs=2)


def test_the_sensors_systematic_errors_come_back(found: Calibrated) -> None:
    """The disparity bias to four standard errors; scales that are right stay right."""
    off = found.fit.shared[:3] - [SPEC.disparity_bias_px, 0.0, 0.0]
    assert np.all(np.abs(off) < 4.5 * found.fit.shared_se[:3])
    assert found.spec.disparity_bias_px == pytest.approx(0.3, abs=0.1)


def test_the_new_sensor_sees_as_much_and_as_far_as_the_old(found: Calibrated) -> None:
    """Number of sightings to a tenth, range to a fifth, share of far ones, and the same noise."""
    assert found.sensed is not None
    old, new = found.fit, found.sensed
    assert new.tracks.sightings.mean() == pytest.approx(old.tracks.sightings.mean(), rel=0.1)
    np.testing.assert_allclose(new.tracks.range_m[2:4], old.tracks.range_m[2:4], rtol=0.2)
    assert new.tracks.far == pytest.approx(old.tracks.far, abs=0.06)
    np.testing.assert_allclose(new.noise.sigma_px, old.noise.sigma_px, rtol=0.1)


def test_chances_of_detection_and_loss_are_those_of_what_follows_a_sighting() -> None:
    """Against 200,000 landmarks that are always in view, followed for 60 images."""
    detection, loss = chances(0.6, 0.1)
    rng = stream(4, "chances")
    there = np.cumprod(rng.random((200_000, 60)) >= loss, axis=1) > 0
    seen = there & (rng.random(there.shape) < detection)
    assert seen[:, 0].mean() == pytest.approx(0.6, abs=0.005)
    assert 1.0 - seen.any(axis=1).mean() == pytest.approx(0.1, abs=0.005)
    assert chances(0.7, 0.0) == (0.7, 0.0)


def test_tracks_that_slide_and_are_lost_come_back(recording: Recording) -> None:
    """Drift to a tenth; what pairs differ by, image for image, in the new sensor as in the old."""
    noise = NOISE.model_copy(update={"drift_px": 0.6, "declared_drift_px": 0.5})
    spec = SPEC.model_copy(update={"noise": noise, "period_s": 1.0, "loss_probability": 0.1})
    sightings = sense_recording(recording, spec)
    slid = replace(recording, measurements=replace(recording.measurements, sightings=sightings))
    found = calibrate_sensor(slid)
    old, new = found.fit.drift, found.sensed.drift if found.sensed is not None else None
    assert old is not None and new is not None
    assert old.drift_px.value == pytest.approx(0.6, rel=0.1)
    assert found.spec.noise.declared_drift_px == 0.5
    assert found.spec.loss_probability == pytest.approx(0.1, abs=0.04)
    np.testing.assert_allclose(new.by_mean_px, old.by_mean_px, rtol=0.1)
    np.testing.assert_allclose(new.by_median_px, old.by_median_px, rtol=0.1)


def test_the_command_writes_a_sensor_that_loads_and_a_picture(
    recording: Recording,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The table names the figures; the YAML is a sensor that can be sensed with."""
    run, out = tmp_path / "run.rrd", tmp_path / "sensor.yaml"
    write_recording(run, recording)
    ended = runner(monkeypatch, capsys)("calibrate-sensor", run, "--out", out)
    assert ended.code == 0, ended.err
    assert "disparity bias [px]" in ended.out and "landmark sensor" in ended.out
    spec = LandmarkSensorSpec.from_yaml(out)
    assert spec.detection_probability == pytest.approx(0.75, abs=0.03)
    assert out.with_suffix(".png").stat().st_size > 10_000


def test_what_is_missing_is_named(recording: Recording) -> None:
    """No truth; no sightings; no camera."""
    with pytest.raises(RecordingError, match="no truth"):
        calibrate_sensor(replace(recording, truth=None))
    blind = replace(recording, measurements=replace(recording.measurements, sightings=None))
    with pytest.raises(RecordingError, match="no stream 'sightings'"):
        calibrate_sensor(blind)
    no_camera = replace(recording.measurements, calibration=Calibration())
    with pytest.raises(RecordingError, match="no stereo camera"):
        calibrate_sensor(replace(recording, measurements=no_camera))
