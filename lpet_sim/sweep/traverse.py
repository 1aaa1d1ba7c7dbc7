"""One traverse: what it is, and how it becomes a recording."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field, model_validator

import lpet_sim
from lpet_sim.errors import BlockedPlaceError, LpetError
from lpet_sim.planning.clearance import RouteSpec
from lpet_sim.planning.route import nearest_clear, plan_route_over
from lpet_sim.recording.recording import Manifest
from lpet_sim.rover.faults import check_stuck_wheels
from lpet_sim.rover.model_spec import identity_of, rover_beside, wheel_names
from lpet_sim.rover.spec import DriveSpec, RoverSpec
from lpet_sim.sensors.suite import SensorSuiteSpec
from lpet_sim.soil.load import soil_beside
from lpet_sim.spec import Spec
from lpet_sim.terrain.load import named_terrain, terrain_beside
from lpet_sim.terrain.spec import TerrainSpec
from lpet_sim.terrain.terrain import Terrain
from lpet_sim.vision.spec import FrontEndSpec

_PACKAGES = ("numpy", "scipy", "mujoco", "opencv-python-headless", "rerun-sdk", "ompl", "numba")


_WAYS_OUT = (
    "move the waypoint, let it be moved (move_within_m), raise route.obstacle_height_m, or drive "
    "straight on (route: null)"
)


class ImagesSpec(Spec):
    """When image pairs are taken, and how many of them are kept.

    Attributes:
        period_s: Time between pairs, a multiple of the inertial unit's; 0.72 s is 2 cm at
            100 m/h (the paper).
        keep_every: 1 keeps all pairs in the recording, n every n-th, 0 none; the front end sees
            them all.
        front_end: Parameters of the vision front end; None leaves sighting for later.
    """

    period_s: Annotated[float, Field(gt=0)] = 0.72
    keep_every: Annotated[int, Field(ge=0)] = 1
    front_end: FrontEndSpec | None = FrontEndSpec()


class TraverseSpec(Spec):
    """A whole traverse: ground, rover, path, sensors.

    Attributes:
        name: What the traverse is called.
        terrain: The ground, or the name of a preset, or the path of a YAML file.
        rover: Which rover.
        drive: Path, speed, stops and forced slips; a planned route brings its own rounding of
            corners.
        route: How to plan a path among the rocks from the drive's first waypoint over the others
            to the last; None drives straight from waypoint to waypoint.
        move_within_m: How far, along x and y, a waypoint that is not clear of rocks may be moved
            before the route is planned; 0 holds the waypoints to be clear.
        sensors: What the rover carries.
        images: When images are taken; None: no images are rendered.
    """

    name: str = "traverse"
    terrain: Annotated[TerrainSpec, BeforeValidator(named_terrain)]
    rover: RoverSpec = RoverSpec()
    drive: DriveSpec
    route: RouteSpec | None = RouteSpec()
    move_within_m: Annotated[float, Field(ge=0)] = 0.0
    sensors: SensorSuiteSpec = SensorSuiteSpec()
    images: ImagesSpec | None = ImagesSpec()

    @model_validator(mode="after")
    def _wheels_of_the_rover(self) -> Self:
        """Hold the wheels that are to be stuck to be the rover's; without any it is not read."""
        try:
            names = wheel_names(self.rover.model) if self.drive.stuck_wheels else ()
        except LpetError:
            return self  # a rover that is not there is told when it is to drive
        try:
            check_stuck_wheels(self.drive, names)
        except LpetError as error:
            raise ValueError(str(error)) from None
        return self

    @classmethod
    def files_beside(cls, mapping: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Find the files of terrain, soils (that which stands for rocks too) and rover."""
        found = dict(mapping)
        if "terrain" in mapping:
            found["terrain"] = terrain_beside(mapping["terrain"], folder)
        if "rover" in mapping:
            found["rover"] = rover_beside(_rock_beside(mapping["rover"], folder), folder)
        return found


def _rock_beside(rover: object, folder: Path) -> object:
    """Find the file of the soil that stands for rocks (``wheel_soil.rock``)."""
    ground = rover.get("wheel_soil") if isinstance(rover, dict) else None
    if not isinstance(rover, dict) or not isinstance(ground, dict) or "rock" not in ground:
        return rover
    return rover | {"wheel_soil": ground | {"rock": soil_beside(ground["rock"], folder)}}


def planned_drive(spec: TraverseSpec, terrain: Terrain, seed: int) -> DriveSpec:
    """Put the path among the rocks in place of the drive's waypoints.

    Raises:
        PlanningError: There is no path from one waypoint to the next.
    """
    if spec.route is None:
        return spec.drive
    route, corners = spec.route, spec.drive.waypoints_m
    if spec.move_within_m > 0:
        corners = tuple(nearest_clear(terrain, c, spec.move_within_m, route) for c in corners)
    try:
        path = plan_route_over(terrain, corners, route, seed)
    except BlockedPlaceError as error:
        raise BlockedPlaceError(f"{error}; {_WAYS_OUT}") from None
    # The route is clear of rocks only if it is driven with the rounding it was planned for.
    rounding = {name: getattr(route, name) for name in ("corner_cut_m", "min_turn_radius_m")}
    return spec.drive.model_copy(update={"waypoints_m": path, **rounding})


def manifest_of(spec: TraverseSpec, drive: DriveSpec, seed: int) -> Manifest:
    """Say where a simulated recording comes from: specs as given, the path as planned, versions."""
    specs: dict[str, Any] = {"traverse": spec.to_mapping(), "drive": drive.to_mapping()}
    rover = identity_of(spec.rover.model)
    if rover is not None:
        specs["rover_model"] = rover
    versions = {name: version(name) for name in _PACKAGES} | {"lpet": lpet_sim.__version__}
    return Manifest(source="simulation", seed=seed, specs=specs, versions=versions)
