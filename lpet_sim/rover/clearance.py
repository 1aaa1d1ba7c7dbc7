"""How high a rover's belly stands."""

from __future__ import annotations

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.rover.drawing import rover_drawing
from lpet_sim.rover.frames import rover_frames
from lpet_sim.rover.mjcf import bare_model
from lpet_sim.rover.spec import RoverSpec


def belly_height_m(spec: RoverSpec) -> float:
    """Give the height above flat ground of the lowest part between the wheels [m].

    That is the belly that rests on rocks or, where it has none, the lowest shape that is fixed to
    the body; wheels and what swings with them do not count.
    """
    model, ride_height_m = bare_model(spec.model), rover_frames(spec).ride_height_m
    names = [model.geom(k).name for k in range(model.ngeom)]
    if "belly" in names:
        belly = model.geom("belly")
        return ride_height_m + float(belly.pos[2] - belly.size[2])
    return ride_height_m + _lowest_shape_m(spec)


def _lowest_shape_m(spec: RoverSpec) -> float:
    lowest, poses = 0.0, dict[str, SE3]()
    for link in rover_drawing(spec).links:
        if link.parent is None:
            poses[link.name] = SE3.identity()
        elif link.parent in poses and link.joint is None:
            poses[link.name] = poses[link.parent] @ link.T_parent_link
        if link.name in poses:
            heights = [(poses[link.name] @ mesh.vertices)[:, 2].min() for mesh in link.meshes]
            lowest = float(np.min([lowest, *heights]))
    return lowest
