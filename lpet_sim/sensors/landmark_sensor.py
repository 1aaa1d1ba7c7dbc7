"""The landmark-level sensor: sightings of a traverse without images.

What a front end would report is drawn around the true projection of fixed points of the world.
Every random number belongs to a landmark, or to a landmark in an image, and is hashed from the
seed, its name and the image's time. So two sensors that differ in one parameter share all that the
parameter does not touch: the same landmarks, the same chances, the same noise in other sizes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3
from lpet_sim.progress import Progress, silent, track
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.rng import stream
from lpet_sim.sensors.landmark_drift import sizes, slide, walks
from lpet_sim.sensors.landmark_kernels import draw_names, draw_sightings
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec, SightingNoiseSpec
from lpet_sim.sensors.landmark_view import LandmarkView
from lpet_sim.terrain.terrain import Terrain


@dataclass(frozen=True, eq=False)
class ShownLandmarks:
    """All landmarks that the images of a traverse show, as they truly project.

    Attributes:
        t_ns: Times of the image pairs since the start [ns], Shape (n,).
        offsets: Row offsets of the images, Shape (n + 1,).
        landmark_id: Names, Shape (m,).
        kind: `landmark_field.GROUND`, `ROCK` or `FAR`, Shape (m,), uint8.
        p_world: Places [m], Shape (m, 3).
        stereo_px: True (u_left, u_right, v) [px], Shape (m, 3).
        bias: The landmark's fixed errors over their 1 sigma, Shape (m, 3).
        T_world_camera: True poses of the left eye in the images, Shape (n,).
    """

    t_ns: Ints
    offsets: Ints
    landmark_id: Ints
    kind: NDArray[np.uint8]
    p_world: Array
    stereo_px: Array
    bias: Array
    T_world_camera: SE3

    @property
    def image(self) -> Ints:
        """Image of each row, Shape (m,)."""
        return np.repeat(np.arange(len(self.t_ns)), np.diff(self.offsets))


def sense_landmarks(
    truth: BodyTruth,
    terrain: Terrain,
    calibration: StereoCalibration,
    spec: LandmarkSensorSpec,
    seed: int,
    progress: Progress = silent,
) -> SightingStream:
    """Sense the landmarks along a traverse.

    Args:
        truth: Motion of the body.
        terrain: What carries the landmarks, and hides them.
        calibration: The declared pair; the spec says how the true one differs.
        spec: The sensor.
        seed: The run's seed; equal arguments give equal arrays to the bit.
        progress: Called after each image.

    Returns:
        Sightings, the first image at the truth's first time. Names are below 2^53 and belong to
        the places, not to the traverse.
    """
    shown = show_landmarks(truth, terrain, calibration, spec, seed, progress)
    return report_sightings(shown, calibration, spec, seed)


def show_landmarks(
    truth: BodyTruth,
    terrain: Terrain,
    calibration: StereoCalibration,
    spec: LandmarkSensorSpec,
    seed: int,
    progress: Progress = silent,
) -> ShownLandmarks:
    """Project the landmarks that the images of a traverse show; see `sense_landmarks`."""
    t_ns = image_times(truth, spec.period_s)
    view = LandmarkView(terrain, true_camera(calibration, spec), spec, seed)
    poses = Trajectory(truth.t_ns, truth.T_world_body).at(t_ns)
    T_world_camera: SE3 = poses @ calibration.T_body_camera.se3()
    images = list(track(view.look(T_world_camera), len(t_ns), progress))
    picked = {
        name: np.concatenate([getattr(image.landmarks, name)[image.rows] for image in images])
        for name in ("id", "kind", "p_world", "bias")
    }
    offsets = np.concatenate([[0], np.cumsum([len(image.rows) for image in images])])
    stereo_px = np.concatenate([image.stereo_px for image in images])
    names = picked.pop("id")
    return ShownLandmarks(
        t_ns,
        offsets.astype(np.int64),
        names,
        stereo_px=stereo_px,
        T_world_camera=T_world_camera,
        **picked,
    )


def image_times(truth: BodyTruth, period_s: float) -> Ints:
    """Give the times of the images: from the truth's first time on, by the period [ns]."""
    period_ns = round(period_s * NS_PER_S)
    return np.arange(truth.t_ns[0], truth.t_ns[-1] + 1, period_ns, dtype=np.int64)


def true_camera(calibration: StereoCalibration, spec: LandmarkSensorSpec) -> StereoCalibration:
    """Give the pair as it truly is: for both its scales ``declared = true (1 + error)``."""
    return calibration.model_copy(
        update={
            "focal_px": calibration.focal_px / (1.0 + spec.focal_scale_error),
            "baseline_m": calibration.baseline_m / (1.0 + spec.baseline_scale_error),
        }
    )


def report_sightings(
    shown: ShownLandmarks, calibration: StereoCalibration, spec: LandmarkSensorSpec, seed: int
) -> SightingStream:
    """Draw what a front end reports of the landmarks that are shown.

    ``z = h(p) + bias + white noise``, the disparity's bias taken off ``u_right``, rounded; p is
    where the landmark has slid to, and one that has slid out of the images is not reported.

    Args:
        shown: What the images show.
        calibration: The declared pair.
        spec: The sensor.
        seed: The run's seed.
    """
    key = int(stream(seed, "landmarks", "sightings").integers(2**62))
    uniforms, normals = draw_sightings(key, shown.t_ns[shown.image], shown.landmark_id)
    found = uniforms[:, 0] < spec.detection_probability
    if spec.loss_probability > 0:
        shown = _lost(shown, uniforms[:, 3] < spec.loss_probability)
    noise, true_px = spec.noise, shown.stereo_px
    if noise.drift_px > 0:
        true_px, seen = _slid(shown, calibration, spec, seed)
        found &= seen
    names = _misnamed(shown, found, uniforms, spec.misclassification_probability)
    sigma = np.array([noise.sigma_left_px, noise.sigma_right_px, noise.sigma_v_px])
    stereo_px = true_px + noise.bias_sigma_px * shown.bias + sigma * normals
    stereo_px[:, 1] -= spec.disparity_bias_px
    if noise.resolution_px > 0:
        stereo_px = np.round(stereo_px / noise.resolution_px) * noise.resolution_px
    counts = np.bincount(shown.image[found], minlength=len(shown.t_ns))
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    declared = np.full(int(offsets[-1]), declared_sigma_px(noise, calibration))
    drift_px = np.full(len(shown.t_ns), declared_drift_px(noise))
    return SightingStream(
        shown.t_ns.copy(), offsets, names[found], stereo_px[found], declared, drift_px
    )


def _lost(shown: ShownLandmarks, lost: NDArray[np.bool_]) -> ShownLandmarks:
    """Give landmarks another name from each showing on at which they are lost; the first is none.

    Args:
        shown: What the images show.
        lost: Which showings a landmark is lost before, Shape (m,).
    """
    order = np.lexsort((shown.image, shown.landmark_id))
    _, first = np.unique(shown.landmark_id[order], return_index=True)
    so_far = np.cumsum(lost[order], dtype=np.int64)
    before = np.repeat(so_far[first], np.diff(first, append=len(order)))
    life = np.empty(len(order), np.int64)
    life[order] = so_far - before
    return replace(shown, landmark_id=draw_names(shown.landmark_id, life))


def _slid(
    shown: ShownLandmarks, calibration: StereoCalibration, spec: LandmarkSensorSpec, seed: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Give where landmarks are seen that walk [px], Shape (m, 3), and whether they are, (m,)."""
    T_world_body = shown.T_world_camera @ calibration.T_body_camera.se3().inverse()
    driven_m = Trajectory(shown.t_ns, T_world_body).arc_length_m
    key = int(stream(seed, "landmarks", "drift").integers(2**62))
    walk = walks(shown.landmark_id, shown.image, shown.t_ns, driven_m, key)
    own_px = spec.noise.drift_px * sizes(shown.landmark_id, spec.noise.drift_spread, key)
    return slide(
        shown.stereo_px,
        shown.landmark_id,
        shown.image,
        shown.T_world_camera,
        own_px[:, None] * walk,
        true_camera(calibration, spec),
    )


def declared_drift_px(noise: SightingNoiseSpec) -> float:
    """Give what an estimator is told of how tracks slide, 1 sigma [px/sqrt(m)]."""
    return noise.drift_px if noise.declared_drift_px is None else noise.declared_drift_px


def declared_sigma_px(noise: SightingNoiseSpec, calibration: StereoCalibration) -> float:
    """Give what an estimator is told of the noise of an image coordinate, 1 sigma [px]."""
    if noise.declared_sigma_px is not None:
        return noise.declared_sigma_px
    white = np.array([noise.sigma_left_px, noise.sigma_right_px, noise.sigma_v_px])
    return float(np.sqrt(np.mean(white**2))) or calibration.sigma_px


def _misnamed(
    shown: ShownLandmarks, found: NDArray[np.bool_], uniforms: Array, share: float
) -> Ints:
    """Swap names within images: those drawn pass theirs on in a ring of random order.

    One alone takes the name of a landmark that is shown but not found; where there is none it
    keeps its own.
    """
    names = shown.landmark_id.copy()
    drawn = np.flatnonzero(found & (uniforms[:, 1] < share))
    for image in np.unique(shown.image[drawn]):
        rows = drawn[(drawn >= shown.offsets[image]) & (drawn < shown.offsets[image + 1])]
        if len(rows) == 1:
            missed = np.arange(shown.offsets[image], shown.offsets[image + 1])
            missed = missed[~found[missed]]
            rows = np.concatenate([rows, missed[np.argsort(uniforms[missed, 2])][:1]])
        rows = rows[np.argsort(uniforms[rows, 2])]
        names[rows] = np.roll(shown.landmark_id[rows], 1)
    return names
