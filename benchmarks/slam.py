"""The SLAM filter against the bare BLAS of its covariance update, over time, and against GTSAM.

BLAS takes the number of its threads when NumPy is loaded, so all is measured in a process of its
own that has one.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict

import numpy as np
from scipy.linalg import blas, lapack

from benchmarks.slam_world import Drive
from benchmarks.timing import Row, Samples, tell
from estimators.peers.fixed_lag import GtsamFixedLag
from estimators.peers.peer_spec import GtsamFixedLagSpec
from estimators.slam import SlamRun, odometry_step
from estimators.slam_map import LASTING, POSE
from estimators.slam_spec import BoundedQueue, Retention, SlamSpec, TimeToLive
from lpet_sim.errors import LpetError
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.streams import Measurements, OdometryStream
from lpet_sim.rng import stream

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
SIZES = (50, 100, 200, 400)
SIGHTINGS = 40
_SEED = 7
_WARM = 200
"""Images before the state is full and its first landmarks have left."""
_NOTE = (
    "bounded queue of {n} landmarks, {rows:.0f} rows of the state and {seen:.0f} of sightings; "
    "LPET predicts, gates, checks together, updates, lets enter and leave; bare is dpotrf, dtrsm "
    "and dsyrk of a covariance update of these sizes; one BLAS thread"
)


def measure(images: int, sizes: tuple[int, ...] = SIZES) -> list[Row]:
    """Time the filter in a process with one BLAS thread.

    Args:
        images: Length of each drive, more than the warm-up of 200.
        sizes: Landmarks in the state.
    """
    command = [sys.executable, "-m", "benchmarks.slam", str(images), *map(str, sizes)]
    env = {**os.environ, **dict.fromkeys(THREADS, "1")}
    done = subprocess.run(command, env=env, stdout=subprocess.PIPE, check=True, text=True)
    return [Row(**row) for row in json.loads(done.stdout.splitlines()[-1])]


def rows(images: int, sizes: tuple[int, ...]) -> list[Row]:
    """Time the filter in this process, whose BLAS must have one thread."""
    assert all(os.environ.get(name) == "1" for name in THREADS), "BLAS must have one thread"
    timed("compile", SlamSpec(), Drive(40).measurements(_SEED))
    out = [against_blas(n, min(images, _WARM + 200)) for n in sizes]
    drive = Drive(images, visible=80, sightings=SIGHTINGS)
    given = drive.measurements(_SEED)
    retentions: dict[str, Retention] = {
        "bounded queue of 80": BoundedQueue(size=80, waiting_images=100),
        "multiframe, M = 10": TimeToLive(images=10),
    }
    for name, retention in retentions.items():
        out.append(over_time(name, SlamSpec(retention=retention), given))
    return out + against_gtsam(given)


def timed(
    name: str, spec: SlamSpec, given: Measurements, beside: Callable[[], None] | None = None
) -> tuple[Samples, Array, Samples]:
    """Run the filter, and something beside it after each image.

    Returns:
        Times of the images, rows of the state and of the sightings in each, Shape (n, 2), and times
        of what is done beside.
    """
    tell(f"slam: {name} ...")
    stereo, start = given.calibration.stereo, given.calibration.T_world_body_start.se3()
    assert given.sightings is not None and stereo is not None
    run, ours, theirs, rows_of_state = SlamRun(spec, start, stereo, 1e-5), Samples(), Samples(), []
    for k in range(len(given.sightings)):
        ours.time(lambda k=k: take(run, given, k))  # type: ignore[misc]
        hosts = len(run.landmarks.keyframes)
        rows_of_state.append(POSE + LASTING + POSE * hosts + 3 * len(run.landmarks))
        if beside is not None:
            theirs.time(beside)
    seen = 3 * run.diagnostics()["accepted"]
    return ours, np.column_stack([rows_of_state, seen]), theirs


def take(run: SlamRun, given: Measurements, k: int) -> None:
    """Take in one image, as the estimator does."""
    seen, odometry = given.sightings, given.odometry
    assert seen is not None and odometry is not None
    run.advance(odometry_step(odometry, k))
    image = seen.rows(k)
    run.see(seen.landmark_id[image], seen.stereo_px[image], seen.sigma_px[image])
    run.state.pose_covariance()


def against_blas(n: int, images: int) -> Row:
    """Compare an image at a full queue of n landmarks with the bare update of its sizes."""
    given = Drive(images, visible=n, sightings=SIGHTINGS).measurements(_SEED)
    spec = SlamSpec(retention=BoundedQueue(size=n, waiting_images=100))
    _, sizes, _ = timed(f"{n} landmarks, for its sizes", spec, given)
    rows_of_state, seen = sizes[_WARM:].mean(axis=0)
    update = bare_update(round(rows_of_state), round(seen))
    ours, _, bare = timed(f"{n} landmarks", spec, given, update)
    ours, bare = ours.after(_WARM), bare.after(_WARM)
    return Row(
        part=f"SLAM, {n} landmarks in the state",
        ours=1e3 * ours.median_cpu_s,
        bare=1e3 * bare.median_cpu_s,
        unit="ms of processor",
        cost=ours.median_s / bare.median_s,
        cpu_cost=ours.median_cpu_s / bare.median_cpu_s,
        aim="< 2",
        note=_NOTE.format(n=n, rows=rows_of_state, seen=seen),
    )


def bare_update(n: int, m: int) -> Callable[[], None]:
    """Make ``P - W' W`` with ``W = L^-1 H P`` and ``L L' = S`` for n states and m measurements."""
    HP = np.asfortranarray(stream(_SEED, "bare").standard_normal((n, m)))
    S = np.asfortranarray(HP.T @ HP + n * np.eye(m))
    P = np.asfortranarray(1e9 * np.eye(n))

    def update() -> None:
        L, _ = lapack.dpotrf(S, lower=1)
        W_T = blas.dtrsm(1.0, L, HP, side=1, lower=1, trans_a=1)
        blas.dsyrk(-1.0, W_T, beta=1.0, c=P, lower=0, overwrite_c=1)

    return update


def over_time(name: str, spec: SlamSpec, given: Measurements) -> Row:
    """Compare the last images of a drive with the first ones after the warm-up."""
    samples, _, _ = timed(name, spec, given)
    span = min(200, (len(samples.wall_s) - _WARM) // 2)
    first = Samples(samples.wall_s[_WARM:][:span], samples.cpu_s[_WARM:][:span])
    last = samples.after(len(samples.wall_s) - span)
    note = (
        f"images {len(samples.wall_s) - span} to {len(samples.wall_s)} of a drive over images "
        f"{_WARM} to {_WARM + span} of it, {SIGHTINGS} sightings in each"
    )
    return Row(
        part=f"SLAM over time, {name}",
        ours=1e3 * last.median_cpu_s,
        bare=1e3 * first.median_cpu_s,
        unit="ms of processor",
        cost=last.median_s / first.median_s,
        cpu_cost=last.median_cpu_s / first.median_cpu_s,
        aim="about 1",
        note=note,
    )


def against_gtsam(given: Measurements, images: int = 150) -> list[Row]:
    """Compare the filter that remembers ten images with GTSAM's fixed lag of ten, where it is."""
    short = first_images(given, images)
    ours, _, _ = timed("against GTSAM", SlamSpec(retention=TimeToLive(images=10)), short)
    mine = Samples([ours.mean_s], [float(np.mean(ours.cpu_s))])
    return [_peer(mine, short, images, covariances) for covariances in ("every_image", "none")]


def _peer(mine: Samples, given: Measurements, images: int, covariances: str) -> Row:
    part = f"SLAM M = 10 against GTSAM lag 10, covariances of {covariances.replace('_', ' ')}"
    try:
        peer = GtsamFixedLag(GtsamFixedLagSpec.from_mapping({"covariances": covariances}))
    except LpetError as error:
        return Row(part, 1e3 * mine.median_cpu_s, None, "ms of processor", None, note=str(error))
    tell(f"slam: {part} ...")
    whole = Samples()
    whole.time(lambda: peer.estimate(given))
    theirs = whole.shared_by(images)
    return Row(
        part=part,
        ours=1e3 * mine.median_cpu_s,
        bare=1e3 * theirs.median_cpu_s,
        unit="ms of processor",
        cost=mine.median_s / theirs.median_s,
        cpu_cost=mine.median_cpu_s / theirs.median_cpu_s,
        aim="< 1 / 3",
        note=f"mean over the first {images} images of one drive, one thread each; the filter gives "
        "a covariance at every image in both rows",
    )


def first_images(given: Measurements, images: int) -> Measurements:
    """Keep the first images of a recording."""
    seen, odometry = given.sightings, given.odometry
    assert seen is not None and odometry is not None
    sightings, o = seen.images(0, images), odometry
    twist, variance = o.twist[:images], o.variance[:images]
    short = OdometryStream(o.t_ns[:images], twist, variance, o.scale_sigma[:images])
    return Measurements(given.calibration, sightings=sightings, odometry=short)


def main() -> None:
    """Time all and print the rows as one line of JSON."""
    images, *sizes = (int(word) for word in sys.argv[1:])
    print(json.dumps([asdict(row) for row in rows(images, tuple(sizes))]))


if __name__ == "__main__":
    main()
