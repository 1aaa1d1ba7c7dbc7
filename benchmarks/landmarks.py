"""The landmark-level sensor against the bare projection of the points that it shows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.timing import Row, Samples
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.sensors.landmark_sensor import (
    ShownLandmarks,
    image_times,
    report_sightings,
    show_landmarks,
)
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.terrain.terrain import Terrain

_SPEED_MPS = 100.0 / 3600.0
_TRUTH_HZ = 10.0
_SEED = 7
_NOTE = (
    "{images} images 2 cm apart, {mean:.0f} landmarks shown in each; LPET draws the landmarks, "
    "samples ground and rocks, tests range, incidence, occlusion from both eyes, adds noise; bare "
    "is NumPy's projection of the points shown, one image after the other"
)


@dataclass(frozen=True)
class _Run:
    truth: BodyTruth
    terrain: Terrain
    calibration: StereoCalibration
    spec: LandmarkSensorSpec


def measure(terrain: Terrain, calibration: StereoCalibration, length_m: float) -> list[Row]:
    """Time the sensor along a straight drive, with its terrain and with the rocks known.

    Args:
        terrain: Fresh ground: no rock is known yet.
        calibration: The stereo pair.
        length_m: How far is driven [m].
    """
    spec = LandmarkSensorSpec()
    straight = _straight(terrain, length_m)
    compiled = _straight(terrain, 0.1)
    _sense(_Run(compiled, terrain, calibration, spec))
    run = _Run(straight, terrain, calibration, spec)
    first, again, bare = Samples(), Samples(), Samples()
    shown = first.time(lambda: _sense(run))
    again.time(lambda: _sense(run))
    poses = _camera_poses(run, shown)
    bare.time(lambda: _project_all(shown, poses, calibration))
    count = len(shown.t_ns)
    note = _NOTE.format(images=count, mean=len(shown.landmark_id) / count)
    return [
        _rate("landmark sensor, rocks unknown", first, bare, count, note),
        _rate("landmark sensor, rocks known", again, bare, count, "the same drive once more"),
    ]


def _rate(part: str, ours: Samples, bare: Samples, images: int, note: str) -> Row:
    return Row(
        part=part,
        ours=images / ours.median_s,
        bare=images / bare.median_s,
        unit="images/s",
        cost=ours.median_s / bare.median_s,
        cpu_cost=ours.median_cpu_s / bare.median_cpu_s,
        aim=">= 500 images/s",
        note=f"{note}; {images / ours.median_cpu_s:,.0f} images a second of processor time",
    )


def _sense(run: _Run) -> ShownLandmarks:
    shown = show_landmarks(run.truth, run.terrain, run.calibration, run.spec, _SEED)
    report_sightings(shown, run.calibration, run.spec, _SEED)
    return shown


def _straight(terrain: Terrain, length_m: float) -> BodyTruth:
    """Drive east over the ground, level, at 100 m/h."""
    n = int(length_m / _SPEED_MPS * _TRUTH_HZ) + 2
    t_ns = (np.arange(n) * NS_PER_S / _TRUTH_HZ).astype(np.int64)
    xy = np.column_stack([t_ns / NS_PER_S * _SPEED_MPS, np.zeros(n)])
    p_world = np.column_stack([xy, terrain.height(xy, 2.0) + 0.4])
    rotation = np.tile(np.eye(3), (n, 1, 1))
    return BodyTruth(t_ns, SE3(rotation, p_world), np.zeros((n, 3)), np.zeros((n, 3)))


def _camera_poses(run: _Run, shown: ShownLandmarks) -> SE3:
    assert np.array_equal(shown.t_ns, image_times(run.truth, run.spec.period_s))
    poses: SE3 = Trajectory(run.truth.t_ns, run.truth.T_world_body).at(shown.t_ns)
    T_world_camera: SE3 = poses @ run.calibration.T_body_camera.se3()
    return T_world_camera


def _project_all(shown: ShownLandmarks, poses: SE3, calibration: StereoCalibration) -> None:
    for image in range(len(shown.t_ns)):
        rows = slice(shown.offsets[image], shown.offsets[image + 1])
        p_camera = (shown.p_world[rows] - poses.translation[image]) @ poses.rotation[image]
        calibration.project(p_camera)
