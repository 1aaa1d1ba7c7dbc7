"""The map in the rover's frame beside the map in the world, as the paper's figure 6 has it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from estimators.slam import SlamRun, odometry_step
from estimators.slam_map import LandmarkMap
from estimators.slam_spec import SlamSpec
from lpet_sim.evaluation.errors import distance_driven_m
from lpet_sim.evaluation.figures import COLOURS
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.sweep.sweep_once import Scene

_ARROW = 20.0
_LOOKS_MIN = 5
_RANGE_M = 8.0


@dataclass(frozen=True, eq=False)
class WatchedMap:
    """A map as it was on the way.

    Attributes:
        distance_m: Distance driven at each image [m], Shape (n,).
        world_m: Median error of the landmarks in the map, in the world [m], Shape (n,).
        rover_m: The same in the rover's frame [m], Shape (n,).
        pose_m: Error of the position [m], Shape (n,).
        places: True and estimated places of the landmarks at the end in the world and in the
            rover's frame [m]: four of Shape (k, 3).
    """

    distance_m: Array
    world_m: Array
    rover_m: Array
    pose_m: Array
    places: tuple[Array, Array, Array, Array]


def watch_map(
    scene: Scene, places: Mapping[int, Sequence[float]], spec: Mapping[str, Any]
) -> WatchedMap:
    """Run the filter image by image and hold its near landmarks to where they truly are.

    Landmarks count from their fifth look on, and within 8 m of the rover.

    Args:
        scene: A data set as sensed.
        places: True places of the landmarks by name [m].
        spec: The filter: its landmarks must stand in the world.
    """
    told = scene.measurements
    sightings, odometry, stereo = told.sightings, told.odometry, told.calibration.stereo
    assert sightings is not None and odometry is not None and stereo is not None
    imu, start = told.calibration.imu, told.calibration.T_world_body_start.se3()
    bias_radps = 0.0 if imu is None else imu.gyro_bias_radps
    run = SlamRun(SlamSpec.from_mapping(dict(spec)), start, stereo, bias_radps)
    true = scene.truth.trajectory.at(sightings.t_ns)
    errors = []
    for k in range(len(sightings)):
        rows = sightings.rows(k)
        run.advance(odometry_step(odometry, k))
        seen = sightings.stereo_px[rows], sightings.sigma_px[rows]
        run.see(sightings.landmark_id[rows], *seen)
        four = _held_to(run.landmarks, start, run.state.pose, true[k], places)
        apart = [np.linalg.norm(a - b, axis=1) for a, b in (four[:2], four[2:])]
        off_m = float(np.linalg.norm(run.state.pose.translation - true[k].translation))
        errors.append((*(float(np.median(x)) if len(x) else np.nan for x in apart), off_m))
    driven_m = distance_driven_m(scene.truth.trajectory)
    at_m = np.interp(sightings.t_ns, scene.truth.trajectory.t_ns, driven_m)
    world_m, rover_m, pose_m = np.array(errors).T
    return WatchedMap(at_m, world_m, rover_m, pose_m, four)


def _held_to(
    landmarks: LandmarkMap,
    start: SE3,
    T_world_body: SE3,
    T_world_body_true: SE3,
    places: Mapping[int, Sequence[float]],
) -> tuple[Array, Array, Array, Array]:
    slots = _near(landmarks)
    p_world_est = _places(landmarks, slots) + start.translation
    p_world = np.array([places[i] for i in landmarks.id[slots].tolist()]).reshape(-1, 3)
    p_body, p_body_est = T_world_body_true.inverse() @ p_world, T_world_body.inverse() @ p_world_est
    near = np.linalg.norm(p_body, axis=1) < _RANGE_M
    return p_world[near], p_world_est[near], p_body[near], p_body_est[near]


def _near(landmarks: LandmarkMap) -> Ints:
    known = (landmarks.alive > 0) & (landmarks.far == 0) & (landmarks.looks >= _LOOKS_MIN)
    return np.flatnonzero(known)


def _places(landmarks: LandmarkMap, slots: Ints) -> Array:
    """Give the places of near landmarks, from where the run starts [m], Shape (k, 3)."""
    hosts = landmarks.host[slots]
    turned = np.einsum("kij,kj->ki", landmarks.R_world_host[hosts], landmarks.x[slots])
    return np.asarray(turned + landmarks.p_world_host[hosts])


def plot_relative_map(watched: WatchedMap) -> Figure:
    """Draw the errors of both maps against the distance, and the maps at the end."""
    figure = Figure(figsize=(8.0, 7.4), layout="constrained")
    parts = figure.subplot_mosaic([["errors", "errors"], ["world", "rover"]])
    _draw_errors(parts["errors"], watched)
    p_world, p_world_est, p_body, p_body_est = watched.places
    _draw_map(parts["world"], p_world, p_world_est, "in the world")
    _draw_map(parts["rover"], p_body, p_body_est, "in the rover's frame")
    parts["world"].set(xlabel="x, east [m]", ylabel="y, north [m]")
    parts["rover"].set(xlabel="x, forward [m]", ylabel="y, left [m]")
    return figure


def _draw_errors(axes: Axes, watched: WatchedMap) -> None:
    drawn = (
        (watched.pose_m, "rover's position", "black"),
        (watched.world_m, "landmarks in the world (median)", COLOURS[0]),
        (watched.rover_m, "landmarks in the rover's frame (median)", COLOURS[1]),
    )
    for error_m, name, colour in drawn:
        axes.plot(watched.distance_m, 100 * error_m, color=colour, lw=1.2, label=name)
    axes.set(xlabel="distance driven [m]", ylabel="error [cm]", ylim=(0, None))
    axes.grid(alpha=0.5)
    axes.legend(loc="upper left")


def _draw_map(axes: Axes, p_true: Array, p_est: Array, title: str) -> None:
    """Draw true places and arrows to the estimated ones, longer than life."""
    x, y = p_true[:, :2].T
    dx, dy = _ARROW * (p_est - p_true)[:, :2].T
    axes.plot(x, y, ".", color="black", ms=4)
    how: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.004}
    axes.quiver(x, y, dx, dy, color=COLOURS[0], **how)
    axes.set_title(f"{title} (errors x {_ARROW:g})", loc="left")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.1)
    axes.grid(alpha=0.5)
