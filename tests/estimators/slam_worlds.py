"""States of the SLAM filter in every form, and truths that are off them by given errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimators.slam_map import LASTING, POSE
from estimators.slam_spec import SlamSpec
from estimators.slam_state import SlamState
from estimators.slam_values import Step
from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rng import stream
from tests.estimators.stereo_traverse import stereo

FORMS = ("standard", "first_estimates", "right_invariant", "keyframe")
WORLD_FORMS = FORMS[:3]
CAMERA = stereo()
SIGHTINGS = np.array([[600.0, 560.0, 700.0], [300.0, 295.0, 520.0], [450.0, 430.0, 610.0]])
STEP = np.array([0.2, 0.01, -0.02, 0.01, 0.02, -0.03])
NO_CHECKS: dict[str, object] = {
    "association_check": "none",
    "gate_probability": 1.0 - 1e-12,
    "slip_probability": 0.0,
    "misfits_max": 9999,
}
"""Nothing is refused, so that only the filter itself is looked at."""


def spec(form: str, far: bool = False, **more: object) -> SlamSpec:
    """Make the spec of a form; far holds every landmark as image coordinates."""
    invariant = form in ("right_invariant", "keyframe")
    values: dict[str, object] = {
        "formulation": "right_invariant" if invariant else form,
        "landmark_frame": "keyframe" if form == "keyframe" else "world",
        "far_disparity_sigmas": 1e6 if far else 0.0,
    }
    return SlamSpec.from_mapping(values | more)


def on_its_way(form: str, far: bool = False, **more: object) -> SlamState:
    """Make a state with three landmarks that has moved on since it saw them.

    It is neither level nor at the origin, and its covariance is full over all that is alive.
    """
    state = SlamState(SE3.from_rpy([0.1, -0.2, 0.5], np.zeros(3)), CAMERA, spec(form, far, **more))
    state.p = np.array([3.0, 2.0, 1.0])
    state._predicted = state.R, state.p
    state.enter(np.array([10, 11, 12]), SIGHTINGS, np.ones(3))
    state.advance(still(STEP))
    state.P = covariance(state)
    return state


def still(twist: Array) -> Step:
    """Make a step without noise."""
    return Step(twist, np.zeros((0, 6)), np.zeros((LASTING, 6)))


def live(state: SlamState) -> Ints:
    """Give the rows where a variable of the state stands."""
    m = state.landmarks
    hosts = [np.arange(POSE) + POSE + 3 * k for k in m.keyframes]
    known = [np.arange(3) + POSE + 3 * s for s in sorted(m.slot_of.values())]
    return np.concatenate([np.arange(POSE + LASTING), *hosts, *known])


def spread(state: SlamState, part: Array) -> Array:
    """Put a vector over the live rows into one over all rows."""
    dx = np.zeros(len(state.P))
    dx[live(state)] = part
    return dx


def covariance(state: SlamState, size: float = 1e-2) -> Array:
    """Draw a covariance of a state that is full where something is alive, else zero."""
    rows, P = live(state), np.zeros_like(state.P)
    root = size * stream(0, "covariance").standard_normal((len(rows), len(rows) + 2))
    P[np.ix_(rows, rows)] = root @ root.T
    return P


@dataclass
class Truth:
    """What is true where a state is off by an error.

    Attributes:
        pose: Of the body, from where the run starts.
        lasting: Errors of odometry, Shape (4,).
        keyframes: Camera poses by slot.
        points: Of the landmarks, by slot [m].
    """

    pose: SE3
    lasting: Array
    keyframes: dict[int, SE3]
    points: dict[int, Array]


def off_by(state: SlamState, dx: Array) -> Truth:
    """Give what is true if the state's error is dx, Shape (n,)."""
    m, invariant = state.landmarks, state._invariant
    pose = moved(SE3(state.R, state.p), dx[:POSE], invariant)
    keyframes = {k: moved(host(state, k), block(dx, k, POSE), True) for k in m.keyframes}
    points = {}
    for slot in m.slot_of.values():
        frame = keyframes.get(int(m.host[slot]), host(state, slot))
        if m.keyframes == [] and invariant:
            frame = turned(frame, dx[3:POSE])
        points[slot] = frame @ place(state, slot, m.x[slot] + block(dx, slot, 3))
    return Truth(pose, state.lasting + dx[POSE : POSE + LASTING], keyframes, points)


def error_of(state: SlamState, true: Truth) -> Array:
    """Give the error dx of a state, Shape (n,): the inverse of `off_by` to first order."""
    m, dx = state.landmarks, np.zeros(len(state.P))
    dx[:POSE] = difference(SE3(state.R, state.p), true.pose, state._invariant)
    dx[POSE : POSE + LASTING] = true.lasting - state.lasting
    for k, T in true.keyframes.items():
        block(dx, k, POSE)[:] = difference(host(state, k), T, True)
    for slot, point in true.points.items():
        frame = true.keyframes.get(int(m.host[slot]), host(state, slot))
        if m.keyframes == [] and state._invariant:
            frame = turned(frame, dx[3:POSE])
        block(dx, slot, 3)[:] = numbers(state, slot, frame.inverse() @ point) - m.x[slot]
    return dx


def moved(T: SE3, xi: Array, invariant: bool) -> SE3:
    """Put an error in the world onto a pose."""
    if invariant:
        return SE3.exp(xi) @ T
    return SE3(so3.exp(xi[3:]) @ T.rotation, T.translation + xi[:3])


def difference(T: SE3, true: SE3, invariant: bool) -> Array:
    """Give the error in the world of a pose, Shape (6,)."""
    if invariant:
        return np.asarray((true @ T.inverse()).log())
    turn = so3.log(true.rotation @ T.rotation.T)
    return np.concatenate([true.translation - T.translation, turn])


def turned(T: SE3, phi: Array) -> SE3:
    """Turn a pose about the origin."""
    return SE3(so3.exp(phi), np.zeros(3)) @ T


def host(state: SlamState, slot: int) -> SE3:
    """Give the host camera in a slot."""
    m = state.landmarks
    return SE3(m.R_world_host[slot].copy(), m.p_world_host[slot].copy())


def block(dx: Array, slot: int, size: int) -> Array:
    """Give the part of a vector over the state that belongs to a slot."""
    return dx[POSE + 3 * slot : POSE + 3 * slot + size]


def place(state: SlamState, slot: int, x: Array) -> Array:
    """Give the point in the host camera that three numbers stand for."""
    return np.asarray(CAMERA.triangulate(x) if state.landmarks.far[slot] else x)


def numbers(state: SlamState, slot: int, point: Array) -> Array:
    """Give the three numbers that stand for a point in the host camera."""
    return np.asarray(CAMERA.project(point) if state.landmarks.far[slot] else point)


def eye(pose: SE3) -> SE3:
    """Give the camera's pose of a body's."""
    return pose @ CAMERA.T_body_camera.se3()


def seen(true: Truth, slots: list[int]) -> Array:
    """Project the true points of slots into the camera of the true pose [px], Shape (m, 3)."""
    camera = eye(true.pose).inverse()
    return np.array([CAMERA.project(camera @ true.points[s]) for s in slots])


def dense(state: SlamState, rows: tuple[Ints, Ints], H: Array, G: Array) -> Array:
    """Spread the derivatives of sightings over the state, Shape (3 m, n)."""
    out = np.zeros((3 * len(H), len(state.P)))
    for i in range(len(H)):
        mine = slice(3 * i, 3 * i + 3)
        out[mine, :POSE] += H[i]
        out[mine, rows[0][i] : rows[0][i] + 3] += G[i]
        if rows[1][i] >= 0:
            out[mine, rows[1][i] : rows[1][i] + POSE] -= H[i]
    return out
