"""GTSAM's batch solution: all poses and landmarks of a recording at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from estimators.odometry_steps import chained
from estimators.peers.graph import GraphMaker, from_pose3, swapped, to_pose3
from estimators.peers.inputs import PeerInputs, peer_inputs
from estimators.peers.library import load_gtsam
from estimators.peers.peer_spec import GtsamBatchSpec
from lpet_sim.errors import BrokenFilterError
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.trajectory import Trajectory


@dataclass(frozen=True)
class GtsamBatch:
    """Nonlinear least squares over everything: what an estimator without limits would find.

    Every pose knows all images, those after it too. Landmarks seen once say nothing and are left
    out. A Geman-McClure kernel sees nothing far off, so its solution starts from that with Huber's.

    Attributes:
        spec: Its parameters.
        name: The name under which results are reported.
        needs: The streams without which it cannot run; it needs odometry of some kind, too.
    """

    spec: GtsamBatchSpec = field(default_factory=GtsamBatchSpec)
    name: str = "gtsam_batch"
    needs: ClassVar[tuple[str, ...]] = ("sightings",)

    def __post_init__(self) -> None:
        """Fail at once where GTSAM is not installed."""
        load_gtsam()

    def estimate(self, measurements: Measurements) -> Estimate:
        """Solve for all poses and landmarks; see `Estimator`.

        Raises:
            BrokenFilterError: The system is singular.
        """
        inputs = peer_inputs(measurements)
        make, rows = GraphMaker(inputs, self.spec), tracked_rows(inputs, self.spec)
        images = len(inputs.sightings)
        start = start_values(make, rows)
        values = start
        stages = ["huber"] if self.spec.robust == "geman_mcclure" else []
        try:
            for robust in [*stages, self.spec.robust]:
                graph = make_graph(make, rows, start, robust)
                values, iterations = self._solve(make.gtsam, graph, values)
            covariance = self._covariances(make, graph, values)
        except RuntimeError as error:
            reason = str(error).strip().splitlines()[0]
            raise BrokenFilterError(f"GTSAM's batch solution: {reason}") from None
        poses = SE3.stack(from_pose3(values.atPose3(make.pose_key(k))) for k in range(images))
        trajectory = Trajectory(inputs.sightings.t_ns.copy(), poses)
        return Estimate(self.name, trajectory, covariance, _diagnostics(inputs, rows, iterations))

    def _solve(self, gtsam: Any, graph: Any, values: Any) -> tuple[Any, int]:
        optimizer, parameters = {
            "levenberg_marquardt": (
                gtsam.LevenbergMarquardtOptimizer,
                gtsam.LevenbergMarquardtParams,
            ),
            "gauss_newton": (gtsam.GaussNewtonOptimizer, gtsam.GaussNewtonParams),
            "dogleg": (gtsam.DoglegOptimizer, gtsam.DoglegParams),
        }[self.spec.method]
        chosen = parameters()
        chosen.setMaxIterations(self.spec.iterations_max)
        chosen.setRelativeErrorTol(self.spec.tolerance)
        chosen.setAbsoluteErrorTol(self.spec.tolerance)
        solver = optimizer(graph, values, chosen)
        return solver.optimize(), int(solver.iterations())

    def _covariances(self, make: GraphMaker, graph: Any, values: Any) -> Array | None:
        """Give the marginal covariances of the poses, Shape (n, 6, 6)."""
        if self.spec.covariances == "none":
            return None
        images = len(make.inputs.sightings)
        first = 0 if self.spec.covariances == "every_image" else images - 1
        marginals = make.gtsam.Marginals(graph, values)
        out = np.full((images, 6, 6), np.nan)
        for image in range(first, images):
            out[image] = swapped(marginals.marginalCovariance(make.pose_key(image)))
        return out


def tracked_rows(inputs: PeerInputs, spec: GtsamBatchSpec) -> Ints:
    """Give the rows of landmarks that are seen twice, and once with enough disparity."""
    _, which = np.unique(inputs.sightings.landmark_id, return_inverse=True)
    well_seen = inputs.well_seen(spec.disparity_sigmas_min)
    enters = np.bincount(which, weights=well_seen) > 0
    return np.flatnonzero((enters & (np.bincount(which) > 1))[which])


def start_values(make: GraphMaker, rows: Ints) -> Any:
    """Put the poses where odometry has them, and each landmark where most of its views do."""
    inputs, values = make.inputs, make.gtsam.Values()
    poses = chained(inputs.odometry, inputs.T_world_body_start)
    for image in range(len(poses)):
        values.insert(make.pose_key(image), to_pose3(poses[image]))
    for number, point in _points(inputs, rows, poses).items():
        values.insert(make.landmark_key(number), point)
    return values


def make_graph(make: GraphMaker, rows: Ints, start: Any, robust: str) -> Any:
    """Make the graph of everything, with landmarks that enter where they start."""
    graph, inputs = make.gtsam.NonlinearFactorGraph(), make.inputs
    graph.add(make.prior())
    for image in range(1, len(inputs.sightings)):
        graph.add(make.motion(image))
    for number in np.unique(inputs.sightings.landmark_id[rows]).tolist():
        key = make.landmark_key(number)
        graph.add(make.entry(key, start.atPoint3(key)))
    image_of, landmark_id = image_of_rows(inputs), inputs.sightings.landmark_id
    for row in rows.tolist():
        key = make.landmark_key(int(landmark_id[row]))
        graph.add(make.sighting(int(image_of[row]), key, row, robust))
    return graph


def _points(inputs: PeerInputs, rows: Ints, poses: SE3) -> dict[int, Array]:
    """Give the median of what each landmark's sightings say of its place, false ones or not [m]."""
    rows = rows[inputs.well_seen(0.0)[rows]]
    if not len(rows):
        return {}
    p_world = poses[image_of_rows(inputs)[rows]] @ inputs.points_in_body(rows)
    number = inputs.sightings.landmark_id[rows]
    order = np.argsort(number, kind="stable")
    numbers, first = np.unique(number[order], return_index=True)
    parts = np.split(p_world[order], first[1:])
    return {int(n): np.median(p, axis=0) for n, p in zip(numbers, parts, strict=True)}


def image_of_rows(inputs: PeerInputs) -> Ints:
    """Give the image of every sighting, Shape (m,)."""
    return np.repeat(np.arange(len(inputs.sightings)), np.diff(inputs.sightings.offsets))


def _diagnostics(inputs: PeerInputs, rows: Ints, iterations: int) -> dict[str, Array]:
    images = len(inputs.sightings)
    accepted = np.bincount(image_of_rows(inputs)[rows], minlength=images).astype(float)
    landmarks = len(np.unique(inputs.sightings.landmark_id[rows]))
    return {
        "sightings": np.diff(inputs.sightings.offsets).astype(float),
        "accepted": accepted,
        "landmarks": np.full(images, float(landmarks)),
        "iterations": np.full(images, float(iterations)),
        "bridged": (accepted == 0).astype(float),
    }
