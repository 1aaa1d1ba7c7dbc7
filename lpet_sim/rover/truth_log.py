"""The truth of a drive, gathered row by row and given out in chunks of arrays."""

from __future__ import annotations

import numpy as np

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.truth import BodyTruth, Event, Truth, WheelTruth

_TURNING_RAD = 1e-5  # per sample; a wheel that turned by less is called still
_MOVING_M = 2e-5  # per sample; the direction of less is that of noise


class TruthLog:
    """Rows of the body and the wheels since the last chunk.

    Attributes:
        events: What happened since the last chunk.
    """

    def __init__(self, wheel_radius_m: float) -> None:
        """Start with nothing."""
        self.events: list[Event] = []
        self._radius_m = wheel_radius_m
        self._body: list[Array] = []
        self._wheels: list[Array] = []
        self._body_t_ns: list[int] = []
        self._wheel_t_ns: list[int] = []
        self._wheel_before: Array | None = None

    def add_body(self, t_ns: int, row: Array) -> None:
        """Add a row of `Scene.body_row`."""
        self._body_t_ns.append(t_ns)
        self._body.append(row)

    def add_wheels(self, t_ns: int, row: Array) -> None:
        """Add a row of `Scene.wheel_row`."""
        self._wheel_t_ns.append(t_ns)
        self._wheels.append(row)

    def take(self) -> Truth:
        """Give everything since the last chunk, and forget it."""
        truth = Truth(self._take_body(), self._take_wheels(), tuple(self.events))
        self._body, self._wheels, self.events = [], [], []
        self._body_t_ns, self._wheel_t_ns = [], []
        return truth

    def _take_body(self) -> BodyTruth:
        rows = np.array(self._body).reshape(-1, 13)
        return BodyTruth(
            t_ns=np.array(self._body_t_ns, dtype=np.int64),
            T_world_body=SE3.from_quat_wxyz(rows[:, 3:7], rows[:, :3]),
            v_world_body_mps=rows[:, 7:10].copy(),
            omega_body_radps=rows[:, 10:13].copy(),
        )

    def _take_wheels(self) -> WheelTruth | None:
        if not self._wheels:
            return None
        rows = np.array(self._wheels)
        before = rows[:1] if self._wheel_before is None else self._wheel_before[None]
        self._wheel_before = rows[-1]
        slip, slip_angle = slip_between(np.concatenate([before, rows]), self._radius_m)
        return WheelTruth(
            t_ns=np.array(self._wheel_t_ns, dtype=np.int64),
            drive_angle_rad=rows[:, :6].copy(),
            steer_angle_rad=rows[:, 6:12].copy(),
            slip=slip,
            load_n=rows[:, 12:18].copy(),
            traction_n=rows[:, 66:72].copy(),
            sinkage_m=rows[:, 72:78].copy(),
            slip_angle_rad=slip_angle,
            contact=rows[:, 18:24].astype(np.uint8),
            joint_angle_rad=rows[:, 78:].copy(),
        )


def slip_between(rows: Array, radius_m: float) -> tuple[Array, Array]:
    """Give the mean slip and slip angle of each wheel from each sample to the next.

    ``s = 1 - v / (r omega)``: v is how far the wheel's centre moved across its axle, and r omega
    how far its rim turned against the world, which is the drive angle and the pitching of the leg
    that carries it. A wheel that does not turn has slip 0. Sinking is no travel: the centre is
    taken as high as it would stand on the surface. The slip angle is ``atan2(left, |v|)``.

    Args:
        rows: Rows of `Scene.wheel_row`, Shape (n + 1, 78 + j).
        radius_m: Radius of the wheels [m].

    Returns:
        Slip and slip angle [rad], Shape (n, 6) each.
    """
    n = len(rows)
    centre = rows[:, 24:42].reshape(n, 6, 3).copy()
    centre[..., 2] += rows[:, 72:78]
    R_world_leg = so3.from_quat_wxyz(rows[:, 42:66].reshape(n, 6, 4))
    turn_in_leg = so3.log(np.swapaxes(R_world_leg[:-1], -1, -2) @ R_world_leg[1:])
    turned = np.diff(rows[:, :6], axis=0) + turn_in_leg[..., 1]
    moved_in_leg = np.einsum("nwji,nwj->nwi", R_world_leg[:-1], np.diff(centre, axis=0))
    moved = np.hypot(moved_in_leg[..., 0], moved_in_leg[..., 2])
    moved = np.copysign(moved, moved_in_leg[..., 0])
    still = np.abs(turned) < _TURNING_RAD
    slip = np.where(still, 0.0, 1.0 - moved / np.where(still, 1.0, radius_m * turned))
    angle = np.arctan2(moved_in_leg[..., 1], np.abs(moved))
    resting = np.linalg.norm(moved_in_leg, axis=-1) < _MOVING_M
    return slip, np.where(resting, 0.0, angle)
