"""What really happened: the physics' own record of a traverse, for evaluation only."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import NS_PER_S, Array, ArrayStruct, Ints
from lpet_sim.recording.trajectory import Trajectory

CONTACT_NONE, CONTACT_SOIL, CONTACT_ROCK = 0, 1, 2


@dataclass(frozen=True, eq=False)
class BodyTruth(ArrayStruct):
    """Motion of the body at the rate of the inertial unit.

    Attributes:
        t_ns: Times since the start [ns], Shape (n,).
        T_world_body: Poses, Shape (n,).
        v_world_body_mps: Velocity of the body's origin in the world [m/s], Shape (n, 3).
        omega_body_radps: Body rate in the body [rad/s], Shape (n, 3).
    """

    t_ns: Ints
    T_world_body: SE3
    v_world_body_mps: Array
    omega_body_radps: Array

    @classmethod
    def from_poses(cls, t_ns: Ints, T_world_body: SE3) -> BodyTruth:
        """Add velocities by central differences of the poses, Shape (n,), one-sided at the ends."""
        row = np.arange(len(t_ns))
        before, after = np.maximum(row - 1, 0), np.minimum(row + 1, len(t_ns) - 1)
        span_s = np.maximum((t_ns[after] - t_ns[before]) / NS_PER_S, 1e-9)[:, None]
        R, p = T_world_body.rotation, T_world_body.translation
        turned = so3.log(np.swapaxes(R[before], -1, -2) @ R[after])
        return cls(t_ns.copy(), T_world_body, (p[after] - p[before]) / span_s, turned / span_s)


@dataclass(frozen=True, eq=False)
class WheelTruth(ArrayStruct):
    """State of the wheels at the rate of the encoders.

    Attributes:
        t_ns: Times since the start [ns], Shape (n,).
        drive_angle_rad: True accumulated angle of each wheel [rad], Shape (n, w).
        steer_angle_rad: True steering angle [rad], Shape (n, w).
        slip: ``1 - v / (r omega)`` of each wheel, the mean since the sample before, 0 where it does
            not turn, Shape (n, w).
        load_n: Normal force on each wheel [N], Shape (n, w).
        traction_n: Force of the ground on each wheel along its heading, positive where it pushes
            the rover forward [N], Shape (n, w).
        sinkage_m: How deep each wheel's lowest point lies below the ground's surface [m],
            Shape (n, w).
        slip_angle_rad: Direction of each wheel's motion against its plane, positive to the left,
            the mean since the sample before, 0 where it does not move, Shape (n, w).
        contact: `CONTACT_NONE`, `CONTACT_SOIL` or `CONTACT_ROCK`, Shape (n, w), uint8.
        joint_angle_rad: Suspension joints, for drawing the rover [rad], Shape (n, j).
    """

    t_ns: Ints
    drive_angle_rad: Array
    steer_angle_rad: Array
    slip: Array
    load_n: Array
    traction_n: Array
    sinkage_m: Array
    slip_angle_rad: Array
    contact: NDArray[np.uint8]
    joint_angle_rad: Array


@dataclass(frozen=True)
class Event:
    """Something that happened on the traverse.

    Attributes:
        t_ns: When it began since the start [ns].
        kind: Its kind, such as ``forced_slip``, ``stop`` or ``goal``.
        duration_s: How long it lasted [s].
        text: One sentence for the reader of the recording.
        ends: Whether it ended the traverse; one event at most does.
    """

    t_ns: int
    kind: str
    duration_s: float = 0.0
    text: str = ""
    ends: bool = False


@dataclass(frozen=True)
class Truth:
    """The truth of a traverse, or of one piece of it.

    Attributes:
        body: Motion of the body.
        wheels: State of the wheels, None where it is not known (imported data).
        events: What happened, in order of time.
    """

    body: BodyTruth
    wheels: WheelTruth | None = None
    events: tuple[Event, ...] = ()

    @property
    def trajectory(self) -> Trajectory:
        """The body's poses over time."""
        return Trajectory(self.body.t_ns, self.body.T_world_body)

    @property
    def ending(self) -> Event | None:
        """The event that ended the traverse, None where that is not known (imported data)."""
        return next((event for event in self.events if event.ends), None)


def in_order(events: Iterable[Event]) -> tuple[Event, ...]:
    """Put events in order of time; of several at one time, the one that ends the drive is last."""
    return tuple(sorted(events, key=lambda event: (event.t_ns, event.ends)))
