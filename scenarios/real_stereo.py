"""Run the front end and frame-to-frame motion estimation on real stereo images of a car.

    python -m scenarios.real_stereo [--quick] [--data DIR] [--out DIR]

Scored from images 20, 30 and 40 to the end, for five seeds of the RANSAC; the sequence's truth is
off by over a metre before image 20. libviso2's poses, where they lie beside the images, are scored
in the same way.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from estimators.frame_to_frame import FrameToFrame
from lpet_sim.datasets import data_folder
from lpet_sim.evaluation import evaluate
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.kitti import BASELINE_M, body_poses
from lpet_sim.recording.reader import read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.sweep.importing import import_kitti
from lpet_sim.sweep.sighting import sight_recording
from lpet_sim.vision.spec import FrontEndSpec

STARTS = (20, 30, 40)


def frame_to_frame(recording: Recording, seed: int) -> Estimate:
    """Estimate with the defaults and one seed of the RANSAC."""
    return FrameToFrame(ransac_seed=seed).estimate(recording.measurements)


def libviso2(folder: Path, recording: Recording) -> Estimate | None:
    """Read libviso2's poses of the sequence, where they are there."""
    path = folder / "libviso2_poses.txt"
    if not path.exists() or recording.truth is None:
        return None
    poses = body_poses(np.loadtxt(path))
    return Estimate("libviso2", Trajectory(recording.truth.body.t_ns, poses))


def row(name: str, estimate: Estimate, recording: Recording) -> list[str]:
    """Score an estimate from each of the starts."""
    assert recording.truth is not None
    times = recording.truth.body.t_ns
    cells = [name]
    for start in STARTS:
        result = evaluate(estimate, recording.truth, anchor_t_ns=int(times[start]))
        angle = np.degrees(np.linalg.norm(result.endpoint_attitude_rad))
        cells.append(f"{100 * result.endpoint_ratio:.3f} %, {angle:.3f} deg")
    lost = estimate.diagnostics.get("bridged", np.zeros(1))
    return [*cells, f"{int(np.sum(lost))}"]


def main() -> None:
    """Import, sight, estimate and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--data", type=Path, default=None, help="folder of the sequence")
    parser.add_argument("--out", type=Path, default=Path("out/real_stereo"))
    parser.add_argument("--quick", action="store_true", help="one seed instead of five")
    options = parser.parse_args()
    folder = options.data or data_folder() / "stereo" / "kitti00_first100"
    run = options.out / "kitti00_first100.rrd"
    import_kitti(folder, run, baseline_m=BASELINE_M)
    print(sight_recording(run, run, FrontEndSpec()))
    recording = read_recording(run)
    table = Table(title="end error: share of the distance, rotation")
    table.add_column("estimator", no_wrap=True)
    for heading in (*(f"from image {start}" for start in STARTS), "images not seen"):
        table.add_column(heading)
    for seed in range(1 if options.quick else 5):
        estimate = frame_to_frame(recording, seed)
        table.add_row(*row(f"frame_to_frame, seed {seed}", estimate, recording))
    peer = libviso2(folder, recording)
    if peer is not None:
        table.add_row(*row("libviso2", peer, recording))
    Console().print(table)


if __name__ == "__main__":
    main()
