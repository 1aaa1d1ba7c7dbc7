"""Import of Starry Night: stereo sightings of known landmarks, gyro, velocity and motion capture.

A sensor head carried by hand over 20 landmarks on a floor. The body here is the data set's vehicle
frame, in which the cameras look along -x; the world is that of the motion capture, z up.

What its declared variances are, checked against the file: each equals the variance of the
difference between a sensor and the motion capture, to 0.1 %. That of the image coordinates, 38 and
130 px^2, is therefore no image noise: the two eyes share it (correlation 0.86 in u, 0.99 in v), as
neighbouring images do, so it is the motion capture against the cameras. Image noise is measured
here as the difference between the rows of the two eyes; where these differ by more than a pixel or
two, in 9 % of the sightings, all those of an image do: its eyes were not exposed at one time.

The motion capture turns by 37 deg and back at the image of 9.97 s. Images are missing for up to
0.73 s, over which a reading held until the next one errs by up to 30 deg.

Reference:
    Barfoot, State Estimation for Robotics (2017), sec. 8.2.6 [recalled]; University of Toronto.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from lpet_sim.errors import RecordingError
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.calibration import Calibration, PoseSpec, StereoCalibration
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import Measurements, OdometryStream, SightingStream
from lpet_sim.recording.truth import BodyTruth, Truth
from lpet_sim.spec import Spec

FILE = "dataset3.mat"
GRAVITY_MPS2 = 9.81

_POINTS, _ROWS = (3, "n"), (1, "n")
_SHAPES: dict[str, tuple[int | str, ...]] = {
    "t": _ROWS,
    "theta_vk_i": _POINTS,
    "r_i_vk_i": _POINTS,
    "w_vk_vk_i": _POINTS,
    "v_vk_vk_i": _POINTS,
    "rho_i_pj_i": (3, "m"),
    "y_k_j": (4, "n", "m"),
    "C_c_v": (3, 3),
    "rho_v_c_v": (3, 1),
    **dict.fromkeys(("w_var", "v_var"), (3, 1)),
    "y_var": (4, 1),
    **dict.fromkeys(("fu", "fv", "cu", "cv", "b"), (1, 1)),
}
"""The arrays that the file must hold: n images, m landmarks."""


class StarryNightSpec(Spec):
    """What the data set does not say.

    Attributes:
        sigma_px: Declared noise of one image coordinate [px]; None measures it from the rows of the
            two eyes, see `row_noise_px`.
        epipolar_px: Sightings whose rows in the two eyes differ by more are left out [px], as a
            stereo front end would do; None keeps all.
    """

    sigma_px: float | None = Field(default=None, gt=0)
    epipolar_px: float | None = Field(default=None, gt=0)


@dataclass(frozen=True, eq=False)
class StarryNight:
    """The data set in our names; n images, m landmarks.

    Attributes:
        t_ns: Times of images, readings and poses since the first [ns], Shape (n,).
        T_world_body: Pose by motion capture, Shape (n,).
        p_world_landmark: Landmarks by motion capture [m], Shape (m, 3).
        omega_body_radps: Gyro readings, Shape (n, 3).
        v_body_mps: Velocity readings in the body, Shape (n, 3).
        omega_variance: Of one gyro reading [rad^2/s^2], Shape (3,).
        v_variance: Of one velocity reading [m^2/s^2], Shape (3,).
        pixels: (u_left, v_left, u_right, v_right) [px], Shape (n, m, 4); -1 where unseen.
        pixel_variance: Of each of these against the motion capture [px^2], Shape (4,).
        T_body_camera: Pose of the left camera in the body.
        pinhole: Focal length, principal point along u and v [px], baseline [m].
    """

    t_ns: Ints
    T_world_body: SE3
    p_world_landmark: Array
    omega_body_radps: Array
    v_body_mps: Array
    omega_variance: Array
    v_variance: Array
    pixels: Array
    pixel_variance: Array
    T_body_camera: SE3
    pinhole: tuple[float, float, float, float]


def import_starry_night(folder: Path | str, spec: StarryNightSpec | None = None) -> Recording:
    """Make a recording of the data set.

    Args:
        folder: Where its MATLAB file lies, or the file itself.
        spec: What the data set does not say; the defaults if None.

    Raises:
        RecordingError: There is no such file, or it does not hold what it should.
    """
    spec, data = spec or StarryNightSpec(), read_starry_night(folder)
    seen = _seen(data, spec.epipolar_px)
    sigma_px = spec.sigma_px or row_noise_px(data.pixels[seen])
    calibration = Calibration(
        stereo=_stereo(data, sigma_px),
        T_world_body_start=PoseSpec.from_se3(data.T_world_body[0]),
        gravity_mps2=GRAVITY_MPS2,
    )
    measurements = Measurements(
        calibration, sightings=_sightings(data, seen, sigma_px), odometry=motion_increments(data)
    )
    truth = Truth(BodyTruth.from_poses(data.t_ns, data.T_world_body))
    return Recording(
        Manifest("starry night", None, {"import": spec.to_mapping()}), measurements, truth
    )


def read_starry_night(folder: Path | str) -> StarryNight:
    """Read the data set's MATLAB file.

    Raises:
        RecordingError: There is no such file, or it does not hold what it should.
    """
    held = _load(Path(folder))
    rotation = so3.exp(held["theta_vk_i"].T)
    C_camera_body = held["C_c_v"]
    fu, fv, cu, cv, b = (float(held[name][0, 0]) for name in ("fu", "fv", "cu", "cv", "b"))
    if not np.isclose(fu, fv, rtol=1e-9):
        raise RecordingError(
            f"fu = {fu} and fv = {fv} differ: the cameras must have one focal length"
        )
    return StarryNight(
        np.rint((held["t"][0] - held["t"][0, 0]) * NS_PER_S).astype(np.int64),
        SE3(rotation, held["r_i_vk_i"].T),
        held["rho_i_pj_i"].T,
        held["w_vk_vk_i"].T,
        held["v_vk_vk_i"].T,
        held["w_var"][:, 0],
        held["v_var"][:, 0],
        np.moveaxis(held["y_k_j"], 0, -1),
        held["y_var"][:, 0],
        SE3(C_camera_body.T, held["rho_v_c_v"][:, 0]),
        (fu, cu, cv, b),
    )


def motion_increments(data: StarryNight) -> OdometryStream:
    """Make motion increments of gyro and velocity, each reading held until the next.

    ``R_prev_curr = exp(omega_k dt)``, ``p_prev_curr = v_k dt``: with this reading of the file its
    declared variances of velocity and rate equal those of the differences to the motion capture.
    Each part of a step has the variance of its reading times ``dt^2``.
    """
    dt_s = np.diff(data.t_ns)[:, None] / NS_PER_S
    steps = SE3(so3.exp(data.omega_body_radps[:-1] * dt_s), data.v_body_mps[:-1] * dt_s)
    declared = np.concatenate([data.v_variance, data.omega_variance])
    rest = np.zeros((1, 6))
    return OdometryStream(
        data.t_ns.copy(),
        np.concatenate([rest, steps.log()]),
        np.concatenate([rest, dt_s**2 * declared]),
        np.zeros((len(data.t_ns), 6)),
    )


def row_noise_px(pixels: Array) -> float:
    """Give the noise of an image coordinate: the RMS of ``v_left - v_right`` over root 2 [px].

    Rows of a rectified pair are equal but for noise. It needs neither landmarks nor motion capture.

    Args:
        pixels: (u_left, v_left, u_right, v_right) of sightings, Shape (k, 4).
    """
    return float(np.sqrt(np.mean((pixels[:, 1] - pixels[:, 3]) ** 2) / 2.0))


def _load(path: Path) -> dict[str, Array]:
    file = path / FILE if path.is_dir() else path
    if not file.is_file():
        raise RecordingError(f"there is no {file}; give the folder of Starry Night, with {FILE}")
    try:
        held: dict[str, Any] = loadmat(file)
    except (OSError, ValueError, NotImplementedError, MatReadError) as error:
        raise RecordingError(
            f"cannot read {file}: {error}; give the folder of Starry Night, with {FILE}"
        ) from None
    missing = [name for name in _SHAPES if name not in held]
    if missing:
        raise RecordingError(
            f"{file} lacks {', '.join(missing)}; Starry Night holds {', '.join(_SHAPES)}"
        )
    arrays = {name: np.asarray(held[name], dtype=float) for name in _SHAPES}
    sizes = {"n": arrays["t"].size, "m": arrays["rho_i_pj_i"].shape[-1]}
    for name, shape in _SHAPES.items():
        wanted = tuple(sizes[s] if isinstance(s, str) else s for s in shape)
        if arrays[name].shape != wanted:
            raise RecordingError(f"{file}: {name} has shape {arrays[name].shape}, not {wanted}")
    return arrays


def _seen(data: StarryNight, epipolar_px: float | None) -> NDArray[np.bool_]:
    """Tell which landmark is sighted in which image, Shape (n, m), bool."""
    seen = np.all(data.pixels >= 0, axis=-1)
    if epipolar_px is not None:
        seen &= np.abs(data.pixels[..., 1] - data.pixels[..., 3]) <= epipolar_px
    return seen


def _sightings(data: StarryNight, seen: NDArray[np.bool_], sigma_px: float) -> SightingStream:
    """Take sightings over, v being the mean of both eyes' weighted by their declared variances."""
    counts = seen.sum(axis=1)
    u_left, v_left, u_right, v_right = data.pixels[seen].T
    weight = 1.0 / data.pixel_variance[[1, 3]]
    v = (weight[0] * v_left + weight[1] * v_right) / weight.sum()
    return SightingStream(
        data.t_ns.copy(),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.nonzero(seen)[1].astype(np.int64),
        np.stack([u_left, u_right, v], axis=-1),
        np.full(int(counts.sum()), sigma_px),
    )


def _stereo(data: StarryNight, sigma_px: float) -> StereoCalibration:
    """Declare the cameras; the size of the images, not given, is the smallest that holds all."""
    focal_px, cx_px, cy_px, baseline_m = data.pinhole
    u, v = data.pixels[..., ::2].max(), data.pixels[..., 1::2].max()
    return StereoCalibration(
        width_px=int(np.ceil(u)) + 1,
        height_px=int(np.ceil(v)) + 1,
        focal_px=focal_px,
        cx_px=cx_px,
        cy_px=cy_px,
        baseline_m=baseline_m,
        T_body_camera=PoseSpec.from_se3(data.T_body_camera),
        sigma_px=sigma_px,
    )
