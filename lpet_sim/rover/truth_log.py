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

    def __init__(self, wheel_radius_m: float, wheels: int) -> None:
        """Start with nothing.

        Args:
            wheel_radius_m: Radius of the wheels.
            wheels: Number of wheels.
        """
        self.events: list[Event] = []
        self._radius_m, self._count = wheel_radius_m, wheels
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
        slip, slip_angle = slip_between(np.concatenate([before, rows]), self._radius_m, self._count)
        at = row_columns(self._count)
        return WheelTruth(
            t_ns=np.array(self._wheel_t_ns, dtype=np.int64),
            drive_angle_rad=rows[:, at["drive"]].copy(),
            steer_angle_rad=rows[:, at["steer"]].copy(),
            slip=slip,
            load_n=rows[:, at["load"]].copy(),
            traction_n=rows[:, at["traction"]].copy(),
            sinkage_m=rows[:, at["sinkage"]].copy(),
            slip_angle_rad=slip_angle,
            contact=rows[:, at["contact"]].astype(np.uint8),
            joint_angle_rad=rows[:, at["joints"]].copy(),
        )


def row_columns(wheels: int) -> dict[str, slice]:
    """Give where the parts of `Scene.wheel_row` stand, for so many wheels."""
    widths = {"drive": 1, "steer": 1, "load": 1, "contact": 1, "centre": 3, "leg": 4}
    widths |= {"traction": 1, "sinkage": 1}
    ends = np.cumsum([0, *widths.values()]) * wheels
    found = {
        name: slice(int(a), int(b)) for name, a, b in zip(widths, ends, ends[1:], strict=False)
    }
    return found | {"joints": slice(int(ends[-1]), None)}


def slip_between(rows: Array, radius_m: float, wheels: int) -> tuple[Array, Array]:
    """Give the mean slip and slip angle of each wheel from each sample to the next.

    ``s = 1 - v / (r omega)``: v is how far the wheel's centre moved across its axle, and r omega
    how far its rim turned against the world, which is the drive angle and the pitching of the leg
    that carries it. A wheel that does not turn has slip 0. Sinking is no travel: the centre is
    taken as high as it would stand on the surface. The slip angle is ``atan2(left, |v|)``.

    Args:
        rows: Rows of `Scene.wheel_row`, Shape (n + 1, 13 w + j).
        radius_m: Radius of the wheels [m].
        wheels: Number of wheels w.

    Returns:
        Slip and slip angle [rad], Shape (n, w) each.
    """
    n, at = len(rows), row_columns(wheels)
    centre = rows[:, at["centre"]].reshape(n, wheels, 3).copy()
    centre[..., 2] += rows[:, at["sinkage"]]
    R_world_leg = so3.from_quat_wxyz(rows[:, at["leg"]].reshape(n, wheels, 4))
    turn_in_leg = so3.log(np.swapaxes(R_world_leg[:-1], -1, -2) @ R_world_leg[1:])
    turned = np.diff(rows[:, at["drive"]], axis=0) + turn_in_leg[..., 1]
    moved_in_leg = np.einsum("nwji,nwj->nwi", R_world_leg[:-1], np.diff(centre, axis=0))
    moved = np.hypot(moved_in_leg[..., 0], moved_in_leg[..., 2])
    moved = np.copysign(moved, moved_in_leg[..., 0])
    still = np.abs(turned) < _TURNING_RAD
    slip = np.where(still, 0.0, 1.0 - moved / np.where(still, 1.0, radius_m * turned))
    angle = np.arctan2(moved_in_leg[..., 1], np.abs(moved))
    resting = np.linalg.norm(moved_in_leg, axis=-1) < _MOVING_M
    return slip, np.where(resting, 0.0, angle)
