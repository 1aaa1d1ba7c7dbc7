"""GTSAM's incremental fixed-lag smoother on stereo sightings and odometry."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from estimators.peers.graph import GraphMaker, from_pose3, swapped, to_pose3
from estimators.peers.inputs import PeerInputs, peer_inputs
from estimators.peers.library import load_gtsam
from estimators.peers.peer_spec import GtsamFixedLagSpec
from lpet_sim.errors import BrokenFilterError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.trajectory import Trajectory

COUNTS = ("sightings", "accepted", "new", "matched", "dropped", "landmarks", "bridged")


@dataclass(frozen=True)
class GtsamFixedLag:
    """Poses and landmarks of the last images, re-linearised as they change; older ones are a prior.

    Each pose of the estimate is the one that stood when its image was the newest, as a rover would
    have had it.

    Attributes:
        spec: Its parameters.
        name: The name under which results are reported.
        needs: The streams without which it cannot run; it needs odometry of some kind, too.
    """

    spec: GtsamFixedLagSpec = field(default_factory=GtsamFixedLagSpec)
    name: str = "gtsam_fixed_lag"
    needs: ClassVar[tuple[str, ...]] = ("sightings",)

    def __post_init__(self) -> None:
        """Fail at once where GTSAM is not installed."""
        load_gtsam()

    def estimate(self, measurements: Measurements) -> Estimate:
        """Take in image after image; see `Estimator`.

        Raises:
            BrokenFilterError: The smoother's system became singular.
        """
        inputs = peer_inputs(measurements)
        window, t_ns = _Window(inputs, self.spec), inputs.sightings.t_ns
        for image in range(len(t_ns)):
            window.take(image)
        counts = np.array(window.counts, dtype=float).reshape(-1, len(COUNTS))
        return Estimate(
            self.name,
            Trajectory(t_ns.copy(), SE3.stack(window.poses)),
            None if self.spec.covariances == "none" else np.array(window.covariances),
            {name: counts[:, i] for i, name in enumerate(COUNTS)},
        )


class _Window:
    """The smoother with what is in it.

    A landmark that comes back after it has left is a new one: its key is used once.
    """

    def __init__(self, inputs: PeerInputs, spec: GtsamFixedLagSpec) -> None:
        self._make, self._inputs, self._spec = GraphMaker(inputs, spec), inputs, spec
        self._smoother = _smoother(spec)
        self._well_seen = inputs.well_seen(spec.disparity_sigmas_min)
        self._keys: dict[int, int] = {}
        self._last_seen: dict[int, int] = {}
        self._entered = 0
        self.poses: list[SE3] = []
        self.covariances: list[Array] = []
        self.counts: list[tuple[int, ...]] = []

    def take(self, image: int) -> None:
        """Add an image's pose and sightings, and note what the smoother says of the pose."""
        rows = self._inputs.sightings.rows(image)
        ids = self._inputs.sightings.landmark_id[rows]
        known = np.array([int(i) in self._keys for i in ids], dtype=bool)
        entering = ~known & self._well_seen[rows]
        used = np.flatnonzero(known | entering) + rows.start
        factors, values, times = self._pose_of(image)
        self._enter(image, np.flatnonzero(entering) + rows.start, factors, values)
        for row in used:
            self._see(image, int(row), factors, times)
        self._update(image, factors, values, times)
        new, matched, dropped = int(entering.sum()), int(known.sum()), self._forget(image)
        lost = int(matched == 0 and image > 0)
        self.counts.append((len(ids), len(used), new, matched, dropped, len(self._keys), lost))

    def _pose_of(self, image: int) -> tuple[Any, Any, dict[int, float]]:
        """Begin with the image's pose where odometry puts it, and the factor that says so."""
        gtsam, key = self._make.gtsam, self._make.pose_key(image)
        factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        factors.add(self._make.motion(image) if image else self._make.prior())
        values.insert(key, to_pose3(self._predicted(image)))
        return factors, values, {key: float(image)}

    def _predicted(self, image: int) -> SE3:
        if image == 0:
            return self._inputs.T_world_body_start
        return self.poses[-1] @ self._inputs.motion(image)[0]

    def _enter(self, image: int, rows: Ints, factors: Any, values: Any) -> None:
        """Name the landmarks that come in, and put each where its sighting has it."""
        p_world = self._predicted(image) @ self._inputs.points_in_body(rows)
        for row, point in zip(rows, p_world, strict=True):
            key = self._make.landmark_key(self._entered)
            self._keys[int(self._inputs.sightings.landmark_id[row])] = key
            values.insert(key, point)
            factors.add(self._make.entry(key, point))
            self._entered += 1

    def _see(self, image: int, row: int, factors: Any, times: dict[int, float]) -> None:
        landmark = int(self._inputs.sightings.landmark_id[row])
        key = self._keys[landmark]
        factors.add(self._make.sighting(image, key, row, self._spec.robust))
        self._last_seen[landmark] = image
        times[key] = float(image)

    def _update(self, image: int, factors: Any, values: Any, times: dict[int, float]) -> None:
        key = self._make.pose_key(image)
        try:
            self._smoother.update(factors, values, times)
            for _ in range(self._spec.extra_iterations):
                self._smoother.update()
            self.poses.append(from_pose3(self._smoother.calculateEstimatePose3(key)))
            self.covariances.append(self._covariance_of(image, key))
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[0]
            raise BrokenFilterError(f"GTSAM's smoother at image {image}: {reason}") from None

    def _covariance_of(self, image: int, key: int) -> Array:
        last = image == len(self._inputs.sightings) - 1
        if self._spec.covariances == "every_image" or (
            last and self._spec.covariances == "last_image"
        ):
            return swapped(self._smoother.marginalCovariance(key))
        return np.full((6, 6), np.nan)

    def _forget(self, image: int) -> int:
        """Forget the landmarks that the smoother has marginalised out, as it does those older."""
        oldest = image - self._spec.lag_images
        gone = [landmark for landmark, seen in self._last_seen.items() if seen < oldest]
        for landmark in gone:
            del self._last_seen[landmark], self._keys[landmark]
        return len(gone)


def _smoother(spec: GtsamFixedLagSpec) -> Any:
    gtsam = load_gtsam()
    parameters = gtsam.ISAM2Params()
    parameters.setRelinearizeThreshold(spec.relinearize_threshold)
    parameters.relinearizeSkip = 1
    parameters.setFactorization(spec.factorization.upper())
    return gtsam.IncrementalFixedLagSmoother(float(spec.lag_images), parameters)
