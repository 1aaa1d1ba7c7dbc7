"""Export of a recording as an ASL folder, the form of the EuRoC data sets.

Reference:
    Burri et al., The EuRoC micro aerial vehicle datasets (2016), section 4.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from lpet_sim.errors import RecordingError
from lpet_sim.formats import asl
from lpet_sim.formats.clock import EPOCH_NS
from lpet_sim.formats.csv_files import write_csv, write_names, write_stream
from lpet_sim.formats.kalibr import write_kalibr
from lpet_sim.formats.rows import each_row
from lpet_sim.formats.sensor_yaml import camera_mappings, imu_mapping, pose_mapping, write_yaml
from lpet_sim.geometry import SE3
from lpet_sim.outputs import whole_folder
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import NS_PER_S, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.png import encode_png
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import ImuStream, Measurements, SightingStream, StereoImages
from lpet_sim.recording.truth import BodyTruth, Truth

_TABLES = 0.3
"""Share of the work that tables are, about, where there are images."""


def export_euroc(recording: Recording, folder: Path, progress: Progress = silent) -> None:
    """Write a recording as an ASL folder, images one pair at a time.

    Args:
        recording: What to write.
        folder: A folder that is made; ``mav0`` and Kalibr's files lie in it.
        progress: Called after the tables, then after each pair.

    Raises:
        OutputError: The folder is there already, or cannot be written.
    """
    with whole_folder(folder) as out:
        write_kalibr(recording.measurements.calibration, out)
        if recording.truth is not None:
            _write_truth(recording.truth, recording.manifest, out / asl.ROOT)
            progress(_TABLES / 2)
        write_measurements(recording.measurements, out, progress)


def write_measurements(
    measurements: Measurements, folder: Path, progress: Progress = silent
) -> None:
    """Write what an estimator may know into a folder, and nothing else.

    Args:
        measurements: What to write.
        folder: A folder that exists; ``mav0`` is made in it.
        progress: Called after the tables, then after each image pair.

    Raises:
        RecordingError: There are images, but no stereo camera is declared.
    """
    if measurements.images is not None and measurements.calibration.stereo is None:
        raise RecordingError("the recording has images but declares no stereo camera")
    root = folder / asl.ROOT
    root.mkdir(exist_ok=True)
    declared = measurements.calibration
    write_yaml(root / asl.ABOUT, asl.AboutSpec.of(declared, EPOCH_NS).to_mapping())
    if declared.stereo is not None:
        _write_cameras(declared.stereo, _rate_hz(measurements), root)
    if declared.imu is not None:
        write_yaml(_made(root / asl.IMU) / asl.SENSOR, imu_mapping(declared.imu))
    if declared.wheels is not None:
        write_yaml(_made(root / asl.WHEELS) / asl.SENSOR, asl.wheel_mapping(declared.wheels))
    _write_streams(measurements, root)
    progress(_TABLES)
    if measurements.images is not None:
        rest = 1.0 - _TABLES
        _write_images(measurements.images, root, lambda done: progress(_TABLES + rest * done))
    progress(1.0)


def _write_streams(measurements: Measurements, root: Path) -> None:
    if measurements.imu is not None:
        _write_imu(measurements.imu, _made(root / asl.IMU))
    if measurements.wheels is not None:
        write_stream(_made(root / asl.WHEELS) / asl.DATA, EPOCH_NS, measurements.wheels)
    if measurements.odometry is not None:
        write_stream(_made(root / asl.ODOMETRY) / asl.DATA, EPOCH_NS, measurements.odometry)
    if measurements.sightings is not None:
        _write_sightings(measurements.sightings, _made(root / asl.SIGHTINGS))


def _write_cameras(stereo: StereoCalibration, rate_hz: float, root: Path) -> None:
    for eye, mapping in zip(asl.EYES, camera_mappings(stereo, rate_hz), strict=True):
        write_yaml(_made(root / eye) / asl.SENSOR, mapping)


def _write_images(images: StereoImages, root: Path, progress: Progress) -> None:
    stamps = images.t_ns + EPOCH_NS
    names = [asl.image_name(int(stamp)) for stamp in stamps]
    for eye in asl.EYES:
        _made(root / eye / "data")
        write_names(root / eye / asl.DATA, asl.NAMES, stamps, names)
    for index, name in track(enumerate(names), len(names), progress):
        for eye, image in zip(asl.EYES, images.pair(index), strict=True):
            (root / eye / "data" / name).write_bytes(encode_png(image))


def _write_imu(imu: ImuStream, folder: Path) -> None:
    values = np.concatenate([imu.gyro_radps, imu.accel_mps2], axis=1)
    write_csv(folder / asl.DATA, asl.IMU_COLUMNS, imu.t_ns + EPOCH_NS, values)


def _write_sightings(sightings: SightingStream, folder: Path) -> None:
    stamps = sightings.t_ns + EPOCH_NS
    write_csv(folder / asl.SIGHTED_IMAGES, asl.IMAGE_COLUMNS, stamps, sightings.drift_px[:, None])
    each = np.repeat(stamps, np.diff(sightings.offsets))
    rows = each_row(each, sightings.landmark_id, sightings.stereo_px, sightings.sigma_px)
    with (folder / asl.DATA).open("w") as file:
        file.write(f"#{','.join(asl.SIGHTING_COLUMNS)}\n")
        for t, landmark, (u_left, u_right, v), sigma in rows:
            file.write(f"{t},{landmark},{u_left!r},{u_right!r},{v!r},{sigma!r}\n")


def _write_truth(truth: Truth, manifest: Manifest, root: Path) -> None:
    _write_body(truth.body, _made(root / asl.BODY_TRUTH))
    own = _made(root / asl.OWN_TRUTH)
    rate_columns = (asl.STAMP, *(f"w_body_{axis} [rad s^-1]" for axis in "xyz"))
    write_csv(
        own / asl.BODY_RATE, rate_columns, truth.body.t_ns + EPOCH_NS, truth.body.omega_body_radps
    )
    if truth.wheels is not None:
        write_stream(own / asl.WHEEL_TRUTH, EPOCH_NS, truth.wheels)
    (own / asl.EVENTS).write_text(json.dumps([asdict(event) for event in truth.events], indent=1))
    (own / asl.MANIFEST).write_text(json.dumps(asdict(manifest), indent=1))


def _write_body(body: BodyTruth, folder: Path) -> None:
    poses = body.T_world_body
    parts = [poses.translation, poses.quat_wxyz(), body.v_world_body_mps, np.zeros((len(body), 6))]
    write_csv(
        folder / asl.DATA, asl.BODY_COLUMNS, body.t_ns + EPOCH_NS, np.concatenate(parts, axis=1)
    )
    comment = "pose and velocity of the body as they were; the biases are not known, zeros stand"
    identity = pose_mapping(SE3.identity())
    mapping = {"sensor_type": "ground_truth", "comment": comment, "T_BS": identity}
    write_yaml(folder / asl.SENSOR, mapping)


def _rate_hz(measurements: Measurements) -> float:
    """Give the image pairs a second, as the median step says it; 0 where there are none."""
    seen = measurements.images or measurements.sightings
    times: Ints = np.zeros(0, np.int64) if seen is None else seen.t_ns
    return float(NS_PER_S / np.median(np.diff(times))) if len(times) > 1 else 0.0


def _made(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder
