"""The drive of a KITTI sequence, and landmarks of its own along it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from lpet_sim.evaluation.noise_model import corrected
from lpet_sim.evaluation.sensor_fit import SensorFit
from lpet_sim.evaluation.sighting_tracks import CameraPath
from lpet_sim.evaluation.track_kernels import Flags
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.kitti import BASELINE_M, GRAVITY_MPS2
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream
from lpet_sim.sensors.landmark_sensor import ShownLandmarks
from lpet_sim.sweep.importing import import_kitti
from lpet_sim.sweep.sighting import sight_recording
from lpet_sim.vision.spec import FrontEndSpec

CACHE: Final = Path("out/real_stereo")
FIRST: Final = 20
DISPARITY_MIN_PX: Final = 0.5


@dataclass(frozen=True)
class Drive:
    """What is known of the piece of the sequence that is scored.

    Attributes:
        truth: True poses of the body at the images.
        stereo: The declared pair.
        sightings: What the front end saw in the real images.
    """

    truth: Trajectory
    stereo: StereoCalibration
    sightings: SightingStream

    def piece(self, first: int, last: int) -> Drive:
        """Give the images from one to before another."""
        rows = slice(first, last)
        cut = self.sightings.images(first, last)
        pose = self.truth.T_world_body[rows]
        return replace(self, truth=Trajectory(self.truth.t_ns[rows].copy(), pose), sightings=cut)


def sighted(folder: Path) -> Drive:
    """Import the sequence and run the front end over it, once."""
    run = CACHE / "kitti00_first100.rrd"
    done = run.exists() and read_recording(run).measurements.sightings is not None
    if not done:
        import_kitti(folder, run, baseline_m=BASELINE_M)
        sight_recording(run, run, FrontEndSpec())
    recording: Recording = read_recording(run)
    measurements = recording.measurements
    assert recording.truth is not None and measurements.sightings is not None
    assert measurements.calibration.stereo is not None
    drive = Drive(
        recording.truth.trajectory, measurements.calibration.stereo, measurements.sightings
    )
    return drive.piece(FIRST, len(drive.sightings))


def calibration_of(drive: Drive) -> Calibration:
    """Declare the pair, and the first true pose as the start."""
    start = PoseSpec.from_se3(drive.truth.T_world_body[0])
    return Calibration(stereo=drive.stereo, T_world_body_start=start, gravity_mps2=GRAVITY_MPS2)


def true_camera(drive: Drive, shared: Array) -> tuple[StereoCalibration, CameraPath]:
    """Give the pair as it is and its path, where the declared one has these errors."""
    declared = CameraPath.of(drive.truth, drive.truth.t_ns, drive.stereo)
    camera, path = corrected(shared, drive.stereo, declared)
    return drive.stereo.model_copy(update={"focal_px": camera[0], "baseline_m": camera[1]}), path


def in_view(p_camera: Array, pair: StereoCalibration) -> tuple[Array, Flags]:
    """Project points, Shape (m, 3), and tell which both images hold."""
    deep = np.where(p_camera[:, 2:] > 1.0, p_camera, [0.0, 0.0, 1.0])
    px = pair.project(deep)
    size = np.array([pair.width_px, pair.width_px, pair.height_px])
    inside = np.all((px >= 0) & (px <= size - 1), axis=1) & (p_camera[:, 2] > 1.0)
    return px, inside & (px[:, 0] - px[:, 1] >= DISPARITY_MIN_PX)


def measured_landmarks(
    drive: Drive, places_m: Array, shared: Array, seed: int
) -> tuple[ShownLandmarks, float]:
    """Show landmarks at the places of the real ones, in the images in which those were sighted."""
    seen = drive.sightings
    which = np.unique(seen.landmark_id, return_inverse=True)[1]
    image = np.repeat(np.arange(len(seen)), np.diff(seen.offsets))
    return shown(drive, places_m[which], which, image, shared, seed), 1.0


def strewn_landmarks(
    drive: Drive, fit: SensorFit, shared: Array, seed: int
) -> tuple[ShownLandmarks, float]:
    """Show landmarks of no real place: as many new ones, where new ones are, lost as often.

    A new landmark's image coordinates are drawn from those of all first sightings; it stays until
    it leaves the view or is lost, and is detected so often that as many are seen again in the next
    image as were.
    """
    rng = stream(seed, "kitti_prediction", "landmarks")
    seen = drive.sightings
    detection = min(fit.tracks.seen_next / (1.0 - fit.tracks.lost), 1.0)
    image = np.repeat(np.arange(len(seen)), np.diff(seen.offsets))
    first = np.unique(seen.landmark_id, return_index=True)[1]
    births = np.bincount(image[first], minlength=len(seen)) / detection
    born = np.repeat(np.arange(len(seen)), rng.poisson(births))
    pair, path = true_camera(drive, shared)
    drawn = np.where(born == 0, rng.integers(0, seen.offsets[1], len(born)), 0)
    later = first[image[first] > 0]
    drawn = np.where(born == 0, drawn, later[rng.integers(0, len(later), len(born))])
    p_camera = pair.triangulate(seen.stereo_px[drawn])
    places_m = path.T_camera_world[born].inverse() @ p_camera
    life = rng.geometric(max(fit.tracks.lost, 1e-6), len(born))
    which = np.repeat(np.arange(len(born)), np.minimum(life, len(seen) - born))
    age = np.arange(len(which)) - np.searchsorted(which, which)
    return shown(drive, places_m[which], which, born[which] + age, shared, seed), detection


def shown(
    drive: Drive, p_world: Array, which: Ints, image: Ints, shared: Array, seed: int
) -> ShownLandmarks:
    """Give the rows that are in view, by image, with a fixed error for each landmark."""
    pair, path = true_camera(drive, shared)
    px, seen = in_view(path.seen_from(image, p_world), pair)
    rows = np.flatnonzero(seen)
    rows = rows[np.lexsort((which[rows], image[rows]))]
    counts = np.bincount(image[rows], minlength=len(drive.truth))
    bias = stream(seed, "kitti_prediction", "fixed").standard_normal((int(which.max()) + 1, 3))
    return ShownLandmarks(
        drive.truth.t_ns.copy(),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        which[rows].astype(np.int64),
        np.zeros(len(rows), np.uint8),
        p_world[rows],
        px[rows],
        bias[which[rows]],
        path.T_camera_world.inverse(),
    )
