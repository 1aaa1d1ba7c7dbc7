"""A small made-up traverse with every stream, for tests of the store and of its pictures."""

from __future__ import annotations

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.calibration import (
    Calibration,
    ImuCalibration,
    PoseSpec,
    StereoCalibration,
    WheelCalibration,
)
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.recording import Manifest, Recording
from lpet_sim.recording.streams import (
    ImagesInMemory,
    ImuStream,
    Measurements,
    OdometryStream,
    SightingStream,
    WheelStream,
)
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth
from lpet_sim.rng import stream

WHEELS = ("front_left", "front_right", "middle_left", "middle_right", "rear_left", "rear_right")
NS = 1_000_000_000
MAST = SE3.from_rpy([0.0, 0.31, 0.0], [0.45, 0.075, 1.4]) @ SE3(
    np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]]), np.zeros(3)
)


def ground(xy: np.ndarray) -> np.ndarray:
    """Height of the made-up ground [m], Shape (n,)."""
    x, y = xy[..., 0], xy[..., 1]
    waves = 0.5 * np.sin(x / 6.0) * np.cos(y / 5.0) + 0.04 * np.sin(1.9 * x + 1.3 * y)
    return np.asarray(waves + 0.02 * np.sin(5 * x) * np.sin(4.3 * y))


def calibration(width: int = 64, height: int = 48) -> Calibration:
    """Make a declared calibration of a whole suite."""
    positions = tuple((x, y, 0.0) for x in (0.6, 0.0, -0.6) for y in (0.6, -0.6))
    stereo = StereoCalibration(
        width_px=width,
        height_px=height,
        focal_px=0.8 * width,
        cx_px=width / 2 - 0.5,
        cy_px=height / 2 - 0.5,
        baseline_m=0.15,
        T_body_camera=PoseSpec.from_se3(MAST),
    )
    imu = ImuCalibration(
        rate_hz=100.0,
        T_body_imu=PoseSpec(),
        gyro_random_walk_radps_rthz=1e-5,
        gyro_bias_radps=1e-5,
        accel_random_walk_mps2_rthz=1e-4,
        accel_bias_mps2=1e-3,
        accel_quantum_mps=5e-4,
    )
    wheels = WheelCalibration(
        names=WHEELS, position_body_m=positions, radius_m=0.1425, steerable=(True,) * 6
    )
    return Calibration(stereo=stereo, imu=imu, wheels=wheels)


def drive_poses(t_s: np.ndarray, speed_mps: float = 0.1) -> SE3:
    """Drive an S-curve over the ground."""
    s = speed_mps * t_s
    heading = 0.9 * np.sin(s / 4.0)
    xy = np.cumsum(np.stack([np.cos(heading), np.sin(heading)], -1) * np.gradient(s)[:, None], 0)
    xy -= xy[0]
    step = 0.3
    ahead = np.stack([np.cos(heading), np.sin(heading)], -1) * step
    side = np.stack([-np.sin(heading), np.cos(heading)], -1) * step
    pitch = -np.arctan2(ground(xy + ahead) - ground(xy - ahead), 2 * step)
    roll = np.arctan2(ground(xy + side) - ground(xy - side), 2 * step)
    position = np.concatenate([xy, ground(xy)[:, None] + 0.3], -1)
    return SE3.from_rpy(np.stack([roll, pitch, heading], -1), position)


def truth(duration_s: float = 20.0, seed: int = 0) -> Truth:
    """Make the truth of the drive with a slip and a stop."""
    rng = stream(seed, "synthetic", "truth")
    t_ns = np.arange(int(duration_s * 100) + 1) * (NS // 100)
    body = BodyTruth(
        t_ns,
        drive_poses(t_ns / NS),
        rng.normal(size=(len(t_ns), 3)),
        rng.normal(size=(len(t_ns), 3)),
    )
    t_w = t_ns[::5].copy()
    n = len(t_w)
    slip = (
        0.05
        + 0.05 * rng.random((n, 6))
        + 0.9 * ((t_w > t_w[n // 2]) & (t_w < t_w[n // 2] + 5 * NS))[:, None]
    )
    wheels = WheelTruth(
        t_w,
        np.cumsum(rng.random((n, 6)) * 0.01, 0),
        0.1 * rng.normal(size=(n, 6)),
        slip,
        100.0 + 20.0 * rng.normal(size=(n, 6)),
        10.0 * rng.normal(size=(n, 6)),
        0.01 * rng.random((n, 6)),
        0.02 * rng.normal(size=(n, 6)),
        rng.integers(0, 3, (n, 6)).astype(np.uint8),
        0.1 * rng.normal(size=(n, 3)),
    )
    events = (
        Event(0, "stop", 1.0, "standing before the start"),
        Event(int(t_w[n // 2]), "forced_slip", 5.0, "wheels turn, the rover stands"),
    )
    return Truth(body, wheels, events)


def image_times(duration_s: float, rate_hz: float = 2.0) -> np.ndarray:
    """Give the times of the image pairs [ns]."""
    return np.arange(int(duration_s * rate_hz) + 1) * int(NS / rate_hz)


def sightings(
    duration_s: float = 20.0, seed: int = 0, width: int = 64, height: int = 48
) -> SightingStream:
    """Make drifting sightings; the third image and the last but one see nothing."""
    rng = stream(seed, "synthetic", "sightings")
    t_ns = image_times(duration_s)
    home = rng.uniform([0, 0], [width, height], (400, 2))
    velocity = rng.normal((0, 0.03 * height), 0.02 * width, (400, 2))
    ids, rows = [], []
    for i in range(len(t_ns)):
        uv = home + velocity * np.arange(i, i - 400, -1)[:, None] % 12
        seen = np.flatnonzero(rng.random(400) < 0.1)
        seen = seen[:0] if i in (2, len(t_ns) - 2) else seen
        ids.append(seen)
        disparity = rng.uniform(1, 10, len(seen))
        rows.append(np.stack([uv[seen, 0], uv[seen, 0] - disparity, uv[seen, 1]], -1))
    offsets = np.concatenate([[0], np.cumsum([len(r) for r in ids])]).astype(np.int64)
    count = int(offsets[-1])
    return SightingStream(
        t_ns,
        offsets,
        np.concatenate(ids).astype(np.int64),
        np.concatenate(rows).reshape(-1, 3),
        rng.uniform(0.3, 0.7, count),
    )


def odometry(duration_s: float = 20.0, seed: int = 0) -> OdometryStream:
    """Make motion increments of a tenth of a second."""
    rng = stream(seed, "synthetic", "odometry")
    t_ns = np.arange(int(duration_s * 10) + 1) * (NS // 10)
    twist = rng.normal(0.0, 0.01, (len(t_ns), 6))
    twist[0] = 0.0
    return OdometryStream(t_ns, twist, rng.random((len(t_ns), 6)), np.full((len(t_ns), 6), 0.03))


def images(
    duration_s: float = 20.0, bits: int = 8, width: int = 64, height: int = 48
) -> ImagesInMemory:
    """Make image pairs of noise on a gradient."""
    rng = stream(bits, "synthetic", "images")
    t_ns = image_times(duration_s)
    kind = np.uint8 if bits == 8 else np.uint16
    shape = (2, len(t_ns), height, width)
    ramp = np.linspace(0.2, 0.7, height)[:, None] * (2**bits - 1)
    left, right = np.clip(ramp + 0.05 * 2**bits * rng.normal(size=shape), 0, 2**bits - 1).astype(
        kind
    )
    return ImagesInMemory(t_ns, left, right)


def recording(duration_s: float = 20.0, seed: int = 0, bits: int = 8) -> Recording:
    """Make a whole recording."""
    rng = stream(seed, "synthetic", "measurements")
    truth_ = truth(duration_s, seed)
    t_imu, t_w = truth_.body.t_ns[1:].copy(), truth_.wheels.t_ns.copy()
    imu = ImuStream(t_imu, rng.normal(size=(len(t_imu), 3)), rng.normal(size=(len(t_imu), 3)))
    wheels = WheelStream(t_w, rng.normal(size=(len(t_w), 6)), rng.normal(size=(len(t_w), 6)))
    manifest = Manifest("simulation", seed, {"drive": {"speed_mps": 0.1}}, {"lpet": "0.1.0"})
    measurements = Measurements(
        calibration(),
        imu,
        wheels,
        sightings(duration_s, seed),
        images(duration_s, bits),
        odometry(duration_s, seed),
    )
    return Recording(manifest, measurements, truth_)


def estimate(
    name: str = "frame_to_frame", duration_s: float = 20.0, scale: float = 1.01, seed: int = 0
) -> Estimate:
    """Make an estimate that drifts away from the truth."""
    rng = stream(seed, "synthetic", "estimate", name)
    t_ns = image_times(duration_s)
    poses = truth(duration_s).trajectory.at(t_ns)
    drift = np.cumsum(rng.normal(0, 0.002, (len(t_ns), 6)), 0)
    drift[:, 0] += (scale - 1.0) * np.arange(len(t_ns)) * 0.05
    cov = np.einsum("n,ij->nij", 1e-4 * np.arange(1, len(t_ns) + 1), np.eye(6))
    return Estimate(
        name,
        Trajectory(t_ns, poses @ SE3.exp(drift)),
        cov,
        {"inliers": rng.integers(20, 80, len(t_ns)).astype(float)},
    )
