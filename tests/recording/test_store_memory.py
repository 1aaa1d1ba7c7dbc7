"""Writing a long traverse takes no more memory than a short one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

SCRIPT = """
import sys
import numpy as np
from lpet_sim.geometry import SE3
from lpet_sim.recording.streams import ImuStream, SightingStream
from lpet_sim.recording.truth import BodyTruth, Truth
from lpet_sim.recording.writer import RecordingWriter
from tests.recording import synthetic

def resident_mb():
    pages = int(open("/proc/self/statm").read().split()[1])
    return pages * 4096 / 1e6

rng = np.random.default_rng(0)
whole = synthetic.recording(1.0)
rows, images = 2000, 20
poses = synthetic.drive_poses(np.arange(rows) / 100)
noise = rng.integers(0, 255, (240, 320), dtype=np.uint8)
levels = []
with RecordingWriter(sys.argv[1], whole.manifest, whole.measurements.calibration) as out:
    for chunk in range(48):
        t = (np.arange(rows) + chunk * rows) * 10_000_000
        v = rng.normal(size=(rows, 3))
        out.log_truth(Truth(BodyTruth(t, poses, v, v.copy())))
        out.log_imu(ImuStream(t.copy(), v.copy(), v.copy()))
        t_image = t[:: rows // images][:images].copy()
        for t_ns in t_image:
            out.log_images(int(t_ns), noise, noise)
        m = 100 * images
        px = rng.uniform(2, 60, (m, 3)) - [0, 5, 0]
        ids = np.concatenate([np.sort(rng.choice(400, 100, False)) for _ in range(images)])
        offsets, sigma = np.arange(images + 1) * 100, px[:, 0].copy()
        out.log_sightings(SightingStream(t_image.copy(), offsets, ids, px, sigma))
        levels.append(resident_mb())
print(levels[11], levels[-1])
"""


def test_memory_is_flat_over_many_chunks(tmp_path: Path) -> None:
    """From a quarter of the way to the end, resident memory grows by less than a tenth.

    The file itself grows by far more than that in the same time.
    """
    path = tmp_path / "long.rrd"
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(path)], capture_output=True, text=True, check=True
    )
    early_mb, late_mb = map(float, done.stdout.split())
    assert path.stat().st_size / 1e6 > 5 * (0.1 * early_mb)
    assert late_mb < 1.1 * early_mb
