"""Import of Starry Night: the file's own variances, landmarks and dead reckoning come out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from lpet_sim.datasets import DataError, data_path
from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.starry_night import (
    FILE,
    StarryNight,
    StarryNightSpec,
    import_starry_night,
    read_starry_night,
)
from lpet_sim.sweep.importing import import_starry_night as write_starry_night


@pytest.fixture(scope="module")
def folder() -> Path:
    """Find the data set."""
    try:
        return data_path("stereo/starry_night")
    except DataError as error:
        pytest.skip(f"the Starry Night data set is not here: {error}")


@pytest.fixture(scope="module")
def data(folder: Path) -> StarryNight:
    """Read it."""
    return read_starry_night(folder)


@pytest.fixture(scope="module")
def recording(folder: Path) -> Recording:
    """Import it."""
    return import_starry_night(folder)


def residuals_px(recording: Recording, data: StarryNight) -> np.ndarray:
    """Give measured less projected true landmarks at the true poses, Shape (k, 3)."""
    sightings = recording.measurements.sightings
    stereo = recording.measurements.calibration.stereo
    image = np.repeat(np.arange(len(sightings)), np.diff(sightings.offsets))
    T_world_camera = recording.truth.body.T_world_body @ stereo.T_body_camera.se3()
    p_world = data.p_world_landmark[sightings.landmark_id]
    return sightings.stereo_px - stereo.project(T_world_camera[image].inverse() @ p_world)


def test_true_landmarks_project_onto_their_sightings(
    recording: Recording, data: StarryNight
) -> None:
    """Poses, frames, camera and pairing fit: a frame turned round would be off by hundreds of px.

    The spread is that of motion capture against cameras, which is what the file declares.
    """
    residual = residuals_px(recording, data)
    assert len(residual) == 9410
    u_left, v_left, u_right, v_right = data.pixel_variance
    np.testing.assert_allclose(residual[:, 0].var(), u_left, rtol=2e-3)
    np.testing.assert_allclose(residual[:, 1].var(), u_right, rtol=2e-3)
    assert residual[:, 2].var() == pytest.approx((v_left + v_right) / 2, rel=0.02)
    assert np.abs(residual.mean(axis=0)).max() < 1.5
    assert np.abs(residual).max() < 60


def test_the_declared_image_variance_is_shared_by_both_eyes(
    recording: Recording, data: StarryNight
) -> None:
    """It is no white noise: of u most is common to the eyes, and rows differ by 1.8 px, not 16."""
    residual = residuals_px(recording, data)
    assert np.corrcoef(residual[:, 0], residual[:, 1])[0, 1] == pytest.approx(0.86, abs=0.01)
    seen = data.pixels[np.all(data.pixels >= 0, axis=-1)]
    assert np.std(seen[:, 1] - seen[:, 3]) == pytest.approx(1.81, abs=0.01)
    assert recording.measurements.calibration.stereo.sigma_px == pytest.approx(1.283, abs=1e-3)


def test_the_declared_variances_of_the_odometry_are_those_against_the_truth(
    recording: Recording, data: StarryNight
) -> None:
    """Each reading held until the next, as the importer does, gives the file's own figures."""
    T, dt_s = data.T_world_body, np.diff(data.t_ns)[:, None] / NS_PER_S
    step = T[:-1].inverse() @ T[1:]
    velocity = (data.v_body_mps[:-1] - step.translation / dt_s).var(axis=0)
    rate = (data.omega_body_radps[:-1] - so3.log(step.rotation) / dt_s).var(axis=0)
    np.testing.assert_allclose(velocity, data.v_variance, rtol=1e-3)
    np.testing.assert_allclose(rate, data.omega_variance, rtol=1e-3)
    declared = recording.measurements.odometry.variance[1:] / dt_s**2
    np.testing.assert_allclose(declared, np.tile([*velocity, *rate], (1899, 1)), rtol=1e-3)


def test_gyro_and_velocity_alone_end_where_they_are_known_to(recording: Recording) -> None:
    """3.9 m and 64 deg at the end of 44.3 m, RMS 1.45 m: within the last digit."""
    poses = [recording.measurements.calibration.T_world_body_start.se3()]
    for step in SE3.exp(recording.measurements.odometry.twist[1:]):
        poses.append(poses[-1] @ step)
    chained, true = SE3.stack(poses), recording.truth.body.T_world_body
    error_m = np.linalg.norm(chained.translation - true.translation, axis=1)
    turned = np.linalg.norm((chained[-1].inverse() @ true[-1]).log()[3:])
    assert error_m[-1] == pytest.approx(3.9, abs=0.05)
    assert np.sqrt(np.mean(error_m**2)) == pytest.approx(1.45, abs=0.005)
    assert np.degrees(turned) == pytest.approx(64, abs=0.5)
    assert recording.truth.trajectory.arc_length_m[-1] == pytest.approx(44.3, abs=0.05)


def test_the_data_set_is_sparse_where_it_is_said_to_be(recording: Recording) -> None:
    """36 % of the images see fewer than three landmarks; before it moves there is only one."""
    count = np.diff(recording.measurements.sightings.offsets)
    assert np.mean(count < 3) == pytest.approx(0.36, abs=0.005)
    seen = recording.measurements.sightings.landmark_id
    standing = int(count[recording.truth.body.t_ns < 7.9 * NS_PER_S].sum())
    assert standing > 50 and set(seen[:standing]) == {3}


def test_the_motion_capture_jumps_once_and_the_gyro_errs_over_gaps(recording: Recording) -> None:
    """The pose of one image is turned by 37 deg; missing images make the other large steps."""
    T, odometry = recording.truth.body.T_world_body, recording.measurements.odometry
    read, t_s = SE3.exp(odometry.twist), recording.truth.body.t_s
    misfit = (read[1:].inverse() @ (T[:-1].inverse() @ T[1:])).log()
    turn_deg = np.degrees(np.linalg.norm(misfit[:, 3:], axis=1))
    over_two = (read[91] @ read[92]).inverse() @ (T[90].inverse() @ T[92])
    assert turn_deg[90] == pytest.approx(37, abs=0.5) and turn_deg[91] > 37
    assert np.degrees(np.linalg.norm(over_two.log()[3:])) < 5
    large = np.setdiff1d(np.flatnonzero(turn_deg > 10), [90, 91])
    assert np.diff(t_s)[large].min() > 0.2
    assert turn_deg[large].max() == pytest.approx(30, abs=0.5)
    assert np.diff(t_s).max() == pytest.approx(0.735, abs=0.001)


def test_rows_that_differ_can_be_left_out(folder: Path, recording: Recording) -> None:
    """A front end's epipolar limit takes away sightings, and what is left is less noisy."""
    limited = import_starry_night(folder, StarryNightSpec(epipolar_px=1.5)).measurements
    kept = len(limited.sightings.landmark_id)
    assert 0.89 < kept / len(recording.measurements.sightings.landmark_id) < 0.92
    assert limited.calibration.stereo.sigma_px < 0.5
    told = import_starry_night(folder, StarryNightSpec(sigma_px=2.0)).measurements
    assert set(told.sightings.sigma_px) == {2.0}


def test_the_recording_comes_back_from_its_file(
    folder: Path, recording: Recording, tmp_path: Path
) -> None:
    """What the command writes is what the importer gives, to the bit."""
    write_starry_night(folder, tmp_path / "night.rrd")
    back = read_recording(tmp_path / "night.rrd")
    assert back.measurements.odometry.equals(recording.measurements.odometry)
    assert back.measurements.sightings.equals(recording.measurements.sightings)
    assert back.truth.body.equals(recording.truth.body)
    assert back.manifest.source == "starry night"


def test_what_is_no_starry_night_is_refused(tmp_path: Path) -> None:
    """A missing file, one of something else and one cut short, each in a sentence."""
    with pytest.raises(RecordingError, match=f"give the folder of Starry Night, with {FILE}"):
        import_starry_night(tmp_path)
    (tmp_path / FILE).write_text("no matrix")
    with pytest.raises(RecordingError, match="give the folder of Starry Night"):
        import_starry_night(tmp_path)
    savemat(tmp_path / FILE, {"t": np.zeros((1, 4))})
    with pytest.raises(RecordingError, match="lacks theta_vk_i, r_i_vk_i"):
        import_starry_night(tmp_path)


def test_arrays_that_do_not_fit_together_are_refused(folder: Path, tmp_path: Path) -> None:
    """The sentence names the array and the shape it should have."""
    from scipy.io import loadmat

    held = {k: v for k, v in loadmat(folder / FILE).items() if not k.startswith("__")}
    savemat(tmp_path / "a.mat", held | {"w_vk_vk_i": np.zeros((3, 7))})
    with pytest.raises(RecordingError, match=r"w_vk_vk_i has shape \(3, 7\), not \(3, 1900\)"):
        import_starry_night(tmp_path / "a.mat")
    savemat(tmp_path / "b.mat", held | {"fv": np.array([[1.0]])})
    with pytest.raises(RecordingError, match="must have one focal length"):
        import_starry_night(tmp_path / "b.mat")
