"""Find out whether a rover's description and model are good to drive: look, park, and roll."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from lpet_sim.outputs import whole_file
from lpet_sim.planning.mobility import MobilitySpec
from lpet_sim.progress import Progress, silent
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.truth import Event, Truth
from lpet_sim.rig.bed import TiltBed
from lpet_sim.rover.clearance import belly_height_m
from lpet_sim.rover.drive import drive
from lpet_sim.rover.frames import RoverFrames, rover_frames
from lpet_sim.rover.picture import rover_picture
from lpet_sim.rover.scene import Scene, build_scene
from lpet_sim.rover.spec import DriveSpec, RoverSpec
from lpet_sim.rover.steering import Steering
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.spec import TerrainSpec
from lpet_sim.terrain.terrain import build_terrain

DRIVEN_M, SPEED_MPS = 2.0, 0.05
PARKED_RAD, PARKED_S = math.radians(10.0), 30.0
_SETTLE_S = 5.0
_PICTURE_TERRAIN, _PICTURE_SEED = "exomars", 1
_MOVED_M, _TILT_RAD, _LEAST_SHARE, _SHORT_M, _ASIDE_M = 0.005, math.radians(5.0), 0.2, 0.1, 0.1


@dataclass(frozen=True)
class RoverCheck:
    """What was found out about a rover.

    Attributes:
        rover: Which one.
        frames: Its frames.
        clearance_m: Height of its belly above flat ground.
        mobility: Its footprint, for planning.
        load_n: Load of each wheel at rest on the level [N], Shape (w,).
        tilt_rad: Its tilt there.
        crept_m: How far it moved, parked on a slope.
        driven_m: How far it drove on the level.
        aside_m: How far it strayed to the side meanwhile, signed to the left.
        slip: Mean slip of its wheels meanwhile.
        ending: How that drive ended.
        problems: What is wrong, a sentence each; none where it is good to drive.
    """

    rover: RoverSpec
    frames: RoverFrames
    clearance_m: float
    mobility: MobilitySpec
    load_n: Array
    tilt_rad: float
    crept_m: float
    driven_m: float
    aside_m: float
    slip: float
    ending: Event
    problems: tuple[str, ...]

    @property
    def steering(self) -> Steering:
        """What its steering can do."""
        return Steering(self.frames)


def check_rover(model: str, picture: Path, progress: Progress = silent) -> RoverCheck:
    """Load a rover, take its picture, park it on a slope, and drive it two metres on the level.

    Args:
        model: Name of a rover, or the path of its description.
        picture: The PNG to write: the rover at rest among rocks.
        progress: Called with the fraction done.

    Raises:
        LpetError: The rover cannot be loaded, or the picture cannot be written.
    """
    rover = RoverSpec(model=model)
    frames = rover_frames(rover)
    progress(0.1)
    _take_picture(rover, picture)
    progress(0.4)
    level = _at_rest(rover, 0.0)
    load_n, tilt = level.wheel_state().load_n, math.acos(min(1.0, level.up))
    crept_m = _crept(_at_rest(rover, PARKED_RAD))
    progress(0.7)
    truth = _driven(rover)
    way = truth[-1].body.T_world_body.translation[-1] - truth[0].body.T_world_body.translation[0]
    ending = next(event for piece in truth for event in piece.events if event.ends)
    found = (load_n, tilt, crept_m, float(way[0]), float(way[1]))
    clearance_m = belly_height_m(rover)
    check = RoverCheck(
        rover,
        frames,
        clearance_m,
        MobilitySpec.of_rover(frames, clearance_m),
        *found,
        slip=_mean_slip(truth),
        ending=ending,
        problems=tuple(_problems(frames, *found, ending)),
    )
    progress(1.0)
    return check


def _take_picture(rover: RoverSpec, path: Path) -> None:
    terrain = build_terrain(load_terrain_spec(_PICTURE_TERRAIN), _PICTURE_SEED)
    scene = build_scene(terrain, rover, (0.0, 0.0), 0.3)
    _wait(scene, 2.0)
    with whole_file(path) as temporary:
        Image.fromarray(rover_picture(scene)).save(temporary, format="PNG")


def _at_rest(rover: RoverSpec, slope_rad: float) -> Scene:
    """Set the rover down on a bed, and let it come to rest."""
    scene = build_scene(TiltBed(TerrainSpec(), slope_rad), rover)
    _wait(scene, _SETTLE_S)
    return scene


def _wait(scene: Scene, seconds: float) -> None:
    still = np.zeros(len(scene.frames.wheel_names))
    scene.command(still, still)
    for _ in range(round(seconds / scene.spec.physics_dt_s)):
        scene.step()


def _crept(scene: Scene) -> float:
    before = scene.body_row()[:3]
    _wait(scene, PARKED_S)
    return float(np.linalg.norm(scene.body_row()[:3] - before))


def _driven(rover: RoverSpec) -> list[Truth]:
    spec = DriveSpec(waypoints_m=((0.0, 0.0), (DRIVEN_M, 0.0)), speed_mps=SPEED_MPS)
    return list(drive(build_scene(TiltBed(TerrainSpec(), 0.0), rover), spec))


def _mean_slip(truth: list[Truth]) -> float:
    wheels = [piece.wheels for piece in truth if piece.wheels is not None]
    angle = np.concatenate([each.drive_angle_rad for each in wheels])
    turned = np.abs(np.diff(angle, axis=0))
    slip = np.concatenate([each.slip for each in wheels])[1:]
    return float((slip * turned).sum() / max(float(turned.sum()), 1e-9))


def _problems(
    frames: RoverFrames,
    load_n: Array,
    tilt_rad: float,
    crept_m: float,
    driven_m: float,
    aside_m: float,
    ending: Event,
) -> list[str]:
    """Say what is not as it should be."""
    share = load_n / frames.wheel_share_n
    light = int(share.argmin())
    said = {
        f"wheel {frames.wheel_names[light]} carries {share[light]:.0%} of an equal share of the "
        "weight at rest: look at the centre of mass, and at suspension joints that hang freely": (
            share[light] < _LEAST_SHARE
        ),
        f"stands tilted by {math.degrees(tilt_rad):.1f} deg on the level: look at the axes of "
        "body, and at the wheels' heights": tilt_rad > _TILT_RAD,
        f"parked on {math.degrees(PARKED_RAD):.0f} deg it moves by {1e3 * crept_m:.1f} mm in "
        f"{PARKED_S:g} s: look at masses and moments of inertia": crept_m > _MOVED_M,
        f"drives {driven_m:.2f} m of {DRIVEN_M:g} m, and ends so: {ending.text}": (
            abs(driven_m - DRIVEN_M) > _SHORT_M
        ),
        f"strays by {aside_m:+.2f} m to the left on a straight of {DRIVEN_M:g} m: look at the "
        "order of the wheels and their sides": abs(aside_m) > _ASIDE_M,
    }
    return [sentence for sentence, is_so in said.items() if is_so]
