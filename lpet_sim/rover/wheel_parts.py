"""Where a compiled rover keeps its wheels, whatever its links and joints are called."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lpet_sim.errors import SpecError
from lpet_sim.recording.arrays import Array, Ints
from lpet_sim.rover.mjcf import bare_model, is_hinge
from lpet_sim.rover.model_parts import link_pose
from lpet_sim.rover.model_spec import wheel_names


@dataclass(frozen=True)
class WheelParts:
    """Indices into a compiled model, in the order of the wheels.

    Attributes:
        names: Names of the wheels.
        geom: Cylinders that touch the ground, Shape (w,).
        body: Links of the wheels, Shape (w,).
        leg: Links that carry them, Shape (w,).
        drive: Joints that they roll about, Shape (w,).
        steer: Joints that steer them, -1 where there is none, Shape (w,).
        drive_act: Motors of the drives, Shape (w,).
        steer_act: Motors of the steering, of the wheels that steer, Shape (s,).
        R_leg_ahead: Axes of the body in the link that carries each wheel, at rest, Shape
            (w, 3, 3); None where they are the link's own.
        suspension: Names of all other hinges, in the model's order.
    """

    names: tuple[str, ...]
    geom: Ints
    body: Ints
    leg: Ints
    drive: Ints
    steer: Ints
    drive_act: Ints
    steer_act: Ints
    R_leg_ahead: Array | None
    suspension: tuple[str, ...]

    @property
    def steered(self) -> NDArray[np.bool_]:
        """Whether each wheel steers, Shape (w,)."""
        return self.steer >= 0


def parts_of(model: Any, names: tuple[str, ...]) -> WheelParts:
    """Find the wheels in a compiled model.

    Args:
        model: With geoms ``wheel_<name>`` and motors ``drive_<name>``, ``steer_<name>``.
        names: Of the wheels.
    """
    motors = {model.actuator(k).name: k for k in range(model.nu)}
    geom = np.array([model.geom(f"wheel_{name}").id for name in names])
    body = model.geom_bodyid[geom].astype(np.int64)
    drive_act = np.array([model.actuator(f"drive_{name}").id for name in names])
    acts = [motors.get(f"steer_{name}", -1) for name in names]
    steer = np.array([model.actuator_trnid[k, 0] if k >= 0 else -1 for k in acts])
    drive = model.actuator_trnid[drive_act, 0].astype(np.int64)
    leg = model.body_parentid[body].astype(np.int64)
    return WheelParts(
        names=names,
        geom=geom,
        body=body,
        leg=leg,
        drive=drive,
        steer=steer,
        drive_act=drive_act,
        steer_act=np.array([k for k in acts if k >= 0], dtype=np.int64),
        R_leg_ahead=_ahead(model, leg),
        suspension=_others(model, {*drive.tolist(), *steer.tolist()}),
    )


@lru_cache(maxsize=8)
def wheel_parts(model: str) -> WheelParts:
    """Find the wheels of a rover by itself; see `parts_of`."""
    return parts_of(bare_model(model), wheel_names(model))


def _ahead(model: Any, legs: Ints) -> Array | None:
    root = model.body("body").id
    turn = np.array([link_pose(model, int(leg), root).rotation.T for leg in legs])
    return None if np.array_equal(turn, np.broadcast_to(np.eye(3), turn.shape)) else turn


def _others(model: Any, wheels: set[int]) -> tuple[str, ...]:
    """Name the joints of the suspension.

    Raises:
        SpecError: One of them is no hinge.
    """
    free = int(model.body("body").jntadr[0])
    left = [k for k in range(model.njnt) if k != free and k not in wheels]
    for k in left:
        if not is_hinge(model, k):
            raise SpecError(
                f"joint '{model.joint(k).name.removeprefix('own/')}' is no hinge; a suspension has "
                "hinges only"
            )
    return tuple(model.joint(k).name for k in left)
