"""The best odometry that a recording has, as increments from image to image."""

from __future__ import annotations

import numpy as np

from estimators import gaussian
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
    else from wheels alone. Before its first and after its last reading the rover is held to stand,
    with the error of having gone as fast as it ever did.

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


def motion_between(track: OdometryTrack, t_prev_ns: int, t_curr_ns: int) -> tuple[SE3, Array]:
    """Give a step by odometry at any times; see `image_odometry` for those it does not reach.

    Returns:
        ``T_prev_curr`` and the covariance of its right perturbation, Shape (6, 6).
    """
    edges_ns = np.array([t_prev_ns, t_curr_ns])
    known = track.trajectory.t_ns
    within = np.clip(edges_ns, known[0], known[-1])
    T_prev_curr, covariance = track.between(int(within[0]), int(within[1]))
    unseen = _unseen_variance(track.trajectory, edges_ns)[0]
    return T_prev_curr, gaussian.with_noise(covariance, unseen)


def _unseen_variance(track: Trajectory, edges_ns: Ints) -> Array:
    """Give the variance of ``xi`` for the parts of steps that odometry does not reach, (n, 6)."""
    known = track.t_ns
    within = np.clip(edges_ns, known[0], known[-1])
    unseen_s = (np.abs(np.diff(edges_ns)) - np.abs(np.diff(within))) / NS_PER_S
    if not unseen_s.any():
        return np.zeros((len(unseen_s), 6))
    return (unseen_s[:, None] * np.repeat(_fastest(track), 3)) ** 2


def _fastest(track: Trajectory) -> Array:
    """Give the highest speed [m/s] and rate of turn [rad/s] over about a second, Shape (2,)."""
    first, last = int(track.t_ns[0]), int(track.t_ns[-1])
    t_ns = np.linspace(first, last, max(2, (last - first) // NS_PER_S + 1)).astype(np.int64)
    poses = track.at(t_ns)
    steps = (poses[:-1].inverse() @ poses[1:]).log().reshape(-1, 2, 3)
    speeds = np.linalg.norm(steps, axis=2) / np.diff(t_ns)[:, None] * NS_PER_S
    return np.asarray(speeds.max(axis=0))


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
    edges_ns = np.concatenate([known[:1], t_ns])
    beside = _unseen_variance(track.trajectory, edges_ns)
    return _increments(t_ns, poses, spent, beside, track.scale_sigma)


def _resampled(stream: OdometryStream, t_ns: Ints) -> OdometryStream:
    known = stream.t_ns
    within = np.clip(t_ns, known[0], known[-1])
    chain = Trajectory(known.copy(), chained(stream, SE3.identity()))
    summed = np.cumsum(stream.variance, axis=0)
    spent = np.stack([np.interp(within, known, summed[:, i]) for i in range(6)], axis=1)
    poses = chain.at(np.concatenate([known[:1], within]))
    beside = _unseen_variance(chain, np.concatenate([known[:1], t_ns]))
    return _increments(t_ns, poses, spent, beside, stream.scale_sigma[0])


def _increments(
    t_ns: Ints, poses: SE3, spent: Array, beside: Array, scale_sigma: Array
) -> OdometryStream:
    """Give the steps between n + 1 poses, with what each adds to the variance spent and beside."""
    twist = (poses[:-1].inverse() @ poses[1:]).log()
    variance = np.diff(spent, axis=0, prepend=np.zeros((1, 6))) + beside
    return OdometryStream(np.array(t_ns), twist, variance, np.tile(scale_sigma, (len(t_ns), 1)))
