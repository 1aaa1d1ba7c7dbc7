"""One traverse: what it is, and how it becomes a recording."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, Field

import lpet_sim
from lpet_sim.errors import BlockedPlaceError
from lpet_sim.planning.clearance import RouteSpec
from lpet_sim.planning.route import nearest_clear, plan_route_over
from lpet_sim.recording.recording import Manifest
from lpet_sim.rover.spec import DriveSpec, RoverSpec
from lpet_sim.sensors.suite import SensorSuiteSpec
from lpet_sim.soil.load import soil_beside
from lpet_sim.spec import Spec, read_yaml
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

    @classmethod
    def from_yaml(cls, path: Path | str) -> Self:
        """Read the traverse from a YAML file; files of terrain and soils may lie beside it.

        That holds for the soil that stands for rocks (``rover.wheel_soil.rock``) too.

        Raises:
            SpecError: The file is missing, is not YAML, or holds an unknown key or a bad value.
        """
        mapping = files_beside(read_yaml(Path(path)), Path(path).parent)
        return cls.from_mapping(mapping, source=str(path))


def files_beside(mapping: object, folder: Path) -> object:
    """Find the files that a traverse as read from YAML names, where they lie in its folder.

    Args:
        mapping: The traverse, not yet validated.
        folder: Where its YAML file lies.
    """
    if isinstance(mapping, dict) and "terrain" in mapping:
        mapping |= {"terrain": terrain_beside(mapping["terrain"], folder)}
    _find_rock(mapping, folder)
    return mapping


def _find_rock(mapping: object, folder: Path) -> None:
    """Put the path of the soil that stands for rocks, if it is a file in the folder, in place."""
    inner = mapping
    for key in ("rover", "wheel_soil"):
        inner = inner.get(key) if isinstance(inner, dict) else None
    if isinstance(inner, dict) and "rock" in inner:
        inner["rock"] = soil_beside(inner["rock"], folder)


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
    versions = {name: version(name) for name in _PACKAGES} | {"lpet": lpet_sim.__version__}
    return Manifest(source="simulation", seed=seed, specs=specs, versions=versions)
