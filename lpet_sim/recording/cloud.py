"""Where the landmarks lie: a sample of the sightings, placed by the poses of the rover."""

from __future__ import annotations

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.trajectory import Trajectory

MAX_ROWS = 20_000
# Beyond, stereo range says too little for a point to be drawn (see `StereoCalibration`).
FARTHEST_M = 15.0


class Reservoir:
    """An even sample of any number of rows in bounded memory.

    Every ``stride``-th row is kept; when there are too many, every second one leaves and the stride
    doubles.
    """

    def __init__(self, width: int, max_rows: int = MAX_ROWS) -> None:
        """Start empty.

        Args:
            width: Numbers in a row.
            max_rows: How many rows may be held.
        """
        self._rows = np.zeros((0, width))
        self._fresh: list[Array] = []
        self._fresh_count = 0
        self._max_rows = max_rows
        self._stride = 1
        self._seen = 0

    def add(self, rows: Array) -> None:
        """Add rows, Shape (n, width)."""
        kept = rows[-self._seen % self._stride :: self._stride]
        self._seen += len(rows)
        self._fresh.append(np.array(kept))
        self._fresh_count += len(kept)
        while len(self._rows) + self._fresh_count > self._max_rows:
            self._rows, self._fresh, self._fresh_count = self.rows()[::2], [], 0
            self._stride *= 2

    def rows(self) -> Array:
        """Give the sample in order, Shape (m, width)."""
        return np.concatenate([self._rows, *self._fresh])


class LandmarkCloud:
    """Collects poses and sightings, in any order, and puts the landmarks into the world."""

    def __init__(self) -> None:
        """Start without poses and sightings."""
        self._poses = Reservoir(13)
        self._landmarks = Reservoir(5)

    def add_poses(self, t_ns: Ints, T_world_body: SE3) -> None:
        """Add poses of the rover, Shape (n,), in order of time."""
        rotation = T_world_body.rotation.reshape(-1, 9)
        self._poses.add(np.column_stack([t_ns, T_world_body.translation, rotation]))

    def add_sightings(
        self, t_ns: int, landmark_id: Ints, stereo_px: Array, stereo: StereoCalibration
    ) -> None:
        """Add the sightings of an image pair."""
        focal_x_baseline = stereo.focal_px * stereo.baseline_m
        near = stereo_px[:, 0] - stereo_px[:, 1] > focal_x_baseline / FARTHEST_M
        p_camera = stereo.triangulate(stereo_px[near])
        p_body = stereo.T_body_camera.se3() @ p_camera
        times = np.full(len(p_body), float(t_ns))
        self._landmarks.add(np.column_stack([times, landmark_id[near], p_body]))

    def path(self) -> Array:
        """Give the rover's path [m], Shape (n, 3)."""
        return self._poses.rows()[:, 1:4]

    def landmarks(self) -> tuple[Ints, Array]:
        """Give landmark ids, Shape (m,), and their places in the world [m], Shape (m, 3)."""
        seen = self._landmarks.rows()
        trajectory = self._trajectory()
        if len(trajectory) < 2 or not len(seen):
            return np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        first, last = trajectory.t_ns[[0, -1]]
        seen = seen[(seen[:, 0] >= first) & (seen[:, 0] <= last)]
        T_world_body = trajectory.at(seen[:, 0].astype(np.int64))
        return seen[:, 1].astype(np.int64), T_world_body @ seen[:, 2:]

    def places(self, t_ns: Ints) -> Array:
        """Give where the rover was at some times, or nearest to them [m], Shape (n, 3)."""
        trajectory = self._trajectory()
        if len(trajectory) < 2:
            return np.zeros((len(t_ns), 3))
        return trajectory.at(np.clip(t_ns, *trajectory.t_ns[[0, -1]])).translation

    def _trajectory(self) -> Trajectory:
        rows = self._poses.rows()
        poses = SE3(rows[:, 4:].reshape(-1, 3, 3), rows[:, 1:4])
        return Trajectory(rows[:, 0].astype(np.int64), poses)
