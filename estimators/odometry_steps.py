"""The best odometry that a recording has, as increments from image to image."""

from __future__ import annotations

import numpy as np

from estimators.fused_odometry import FusedOdometrySpec, odometry_track
from estimators.motion import OdometryTrack
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.streams import Measurements, OdometryStream
from lpet_sim.recording.trajectory import Trajectory


def image_odometry(
    measurements: Measurements, t_ns: Ints, spec: FusedOdometrySpec | None = None
) -> OdometryStream:
    """Give the motion between given times, such as those of the images.

    It comes from the recording's own odometry if there is one, else from wheels and inertial unit,
    else from wheels alone. Before its first and after its last reading the rover is held to stand.

    Args:
        measurements: Streams and declared calibration.
        t_ns: Times, increasing [ns], Shape (n,).
        spec: Parameters of the odometry from wheels; the defaults if None.

    Returns:
        Increments at these times; the first is the motion from the start of the odometry.

    Raises:
        RecordingError: The recording has neither odometry nor wheels.
    """
    stream = measurements.odometry
    if stream is not None:
        same = len(stream.t_ns) == len(t_ns) and bool(np.all(stream.t_ns == t_ns))
        return stream if same else _resampled(stream, t_ns)
    return _of_track(odometry_track(measurements, spec), t_ns)


def chained(stream: OdometryStream, start: SE3) -> SE3:
    """Chain increments onto the pose at the first time; gives poses, Shape (n,)."""
    poses = [start]
    steps = SE3.exp(stream.twist)
    for i in range(1, len(stream.t_ns)):
        poses.append(poses[-1] @ steps[i])
    return SE3.stack(poses)


def _of_track(track: OdometryTrack, t_ns: Ints) -> OdometryStream:
    known = track.trajectory.t_ns
    within = np.clip(t_ns, known[0], known[-1])
    rolled_m = np.interp(within, known, track.rolled_m)
    seconds = (within - known[0]) / NS_PER_S
    spent = np.outer(rolled_m, track.variance_per_m) + np.outer(seconds, track.variance_per_s)
    poses = track.trajectory.at(np.concatenate([known[:1], within]))
    return _increments(t_ns, poses, spent, track.scale_sigma)


def _resampled(stream: OdometryStream, t_ns: Ints) -> OdometryStream:
    known = stream.t_ns
    within = np.clip(t_ns, known[0], known[-1])
    chain = Trajectory(known.copy(), chained(stream, SE3.identity()))
    summed = np.cumsum(stream.variance, axis=0)
    spent = np.stack([np.interp(within, known, summed[:, i]) for i in range(6)], axis=1)
    poses = chain.at(np.concatenate([known[:1], within]))
    return _increments(t_ns, poses, spent, stream.scale_sigma[0])


def _increments(t_ns: Ints, poses: SE3, spent: Array, scale_sigma: Array) -> OdometryStream:
    """Give the steps between n + 1 poses and what each adds to the variance spent so far."""
    twist = (poses[:-1].inverse() @ poses[1:]).log()
    variance = np.diff(spent, axis=0, prepend=np.zeros((1, 6)))
    return OdometryStream(np.array(t_ns), twist, variance, np.tile(scale_sigma, (len(t_ns), 1)))
