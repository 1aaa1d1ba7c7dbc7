"""The slope rig: a rover on a tilt bed at many slopes, up, down and across."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from shutil import rmtree
from typing import Annotated, Final

from pydantic import Field, TypeAdapter, ValidationError

import lpet_sim
from lpet_sim.outputs import output_folder, whole_file
from lpet_sim.progress import Progress, silent, track
from lpet_sim.rig.bed import TiltBed
from lpet_sim.rig.published import published_beside
from lpet_sim.rig.slope_drive import drive_on_bed
from lpet_sim.rig.slope_point import Heading, SlopePoint
from lpet_sim.rover.model_spec import identity_of, load_rover_model, models_folder
from lpet_sim.rover.spec import RoverSpec
from lpet_sim.soil.published import ReferenceWheelSpec
from lpet_sim.soil.spec import MeasuredSoilSpec, SoilSpec
from lpet_sim.spec import Spec
from lpet_sim.terrain.spec import SoilClass, TerrainSpec

DEFAULT_SLOPES_RAD: Final = tuple(math.radians(deg) for deg in range(0, 31, 5))
SLOPE_MAX_DEG: Final = 45.0
HEADINGS: Final[tuple[Heading, ...]] = ("up", "down", "across")
_SAME_SLOPE_RAD: Final = math.radians(0.25)
_MODELS: Final = (".xml", ".urdf", ".yaml")
_Key = tuple[float, Heading]
_POINT: Final = TypeAdapter(SlopePoint)


class SlopeSpec(Spec):
    """A rover, a soil, and the slopes to drive it on.

    Attributes:
        soil: The soil of the bed.
        rover: The rover, with its physics step.
        wheel: A tested wheel whose law each wheel of the rover follows, with the tested wheel's
            load standing for the rover wheel's share of the weight; None for the rover's own. The
            rover's body stands on its own wheels either way.
        speed_mps: Speed of the wheels' rims.
        slopes_rad: Tilts of the bed.
        headings: Which ways to drive.
    """

    soil: SoilSpec
    rover: RoverSpec = RoverSpec()
    wheel: ReferenceWheelSpec | None = None
    speed_mps: Annotated[float, Field(gt=0.0, le=0.5)] = 0.05
    slopes_rad: Annotated[
        tuple[Annotated[float, Field(ge=0.0, le=math.radians(SLOPE_MAX_DEG))], ...],
        Field(min_length=1),
    ] = DEFAULT_SLOPES_RAD
    headings: Annotated[tuple[Heading, ...], Field(min_length=1)] = HEADINGS


def slope_spec(
    soil: SoilSpec,
    wheel: ReferenceWheelSpec | None = None,
    rover: str = "exomars",
    speed_mps: float = 0.05,
    dt_s: float = 0.005,
    slopes_rad: tuple[float, ...] | None = None,
) -> SlopeSpec:
    """Put a slope rig together.

    Args:
        soil: The soil.
        wheel: The tested wheel whose law is taken; None for the rover's own.
        rover: Name of the rover model.
        speed_mps: Speed of the wheels' rims [m/s].
        dt_s: Physics step [s].
        slopes_rad: Tilts of the bed [rad]; None for `slopes_with_measured`.

    Raises:
        UnknownNameError: There is no such rover model.
        SpecError: A value out of its range.
    """
    load_rover_model(rover)
    values = {
        "soil": soil,
        "rover": {"model": rover, "physics_dt_s": dt_s},
        "wheel": wheel,
        "speed_mps": speed_mps,
        "slopes_rad": slopes_with_measured(soil) if slopes_rad is None else slopes_rad,
    }
    return SlopeSpec.from_mapping(values, "slope rig")


@dataclass(frozen=True)
class SlopeReport:
    """The points of a slope rig, by heading and then by slope.

    Attributes:
        spec: What was run.
        points: The points.
    """

    spec: SlopeSpec
    points: tuple[SlopePoint, ...]

    def along(self, heading: Heading) -> tuple[SlopePoint, ...]:
        """Give the points of one heading, by slope."""
        return tuple(point for point in self.points if point.heading == heading)


def slopes_with_measured(soil: SoilSpec) -> tuple[float, ...]:
    """Give the default slopes and those at which slip on this soil was measured [rad].

    They are the soil's own where it is a measured curve, else those of the longest published curve.
    A default slope within 0.25 deg of a measured one is left out.
    """
    published = (curve.slope_rad for curve in published_beside(soil))
    longest = max(published, key=len, default=())
    measured = soil.slope_rad if isinstance(soil, MeasuredSoilSpec) else longest
    near = [min((abs(d - m) for m in measured), default=1.0) for d in DEFAULT_SLOPES_RAD]
    plain = [d for d, gap in zip(DEFAULT_SLOPES_RAD, near, strict=True) if gap > _SAME_SLOPE_RAD]
    return tuple(sorted([*plain, *measured]))


def run_slope_rig(
    spec: SlopeSpec,
    folder: Path,
    workers: int = 2,
    progress: Progress = silent,
    keep: bool = False,
) -> SlopeReport:
    """Drive every slope and heading of a spec.

    Each point is kept in the folder as it ends, so that a run that was killed goes on where it
    was; they are removed when all are there, unless they are to be kept.

    Args:
        spec: What to run.
        folder: Where to keep the points.
        workers: How many processes share the work; 1 for this one alone.
        progress: Called with the fraction done.
        keep: Whether to leave the points, so that the same run again is done at once.

    Raises:
        UnknownNameError: There is no such rover.
        OutputError: The folder cannot be written.
    """
    kept = output_folder(folder) / ".slope_points" / _key(spec)
    wanted = [(slope, heading) for heading in spec.headings for slope in sorted(spec.slopes_rad)]
    found = {key: point for key in wanted if (point := _read(kept, key)) is not None}
    missing = [key for key in wanted if key not in found]
    for key, point in track(_drive_all(spec, missing, workers), max(len(missing), 1), progress):
        found[key] = point
        _keep(kept, point)
    if not keep:
        _forget(kept)
    return SlopeReport(spec, tuple(found[key] for key in wanted))


def drive_point(spec: SlopeSpec, slope_rad: float, heading: Heading) -> SlopePoint:
    """Drive one point of a slope rig."""
    soils = (SoilClass(name=spec.soil.name, soil=spec.soil),)
    bed = TiltBed(TerrainSpec(name="tilt bed", soils=soils), slope_rad)
    return drive_on_bed(bed, _rover_of(spec), heading, spec.speed_mps)


def _rover_of(spec: SlopeSpec) -> RoverSpec:
    """Let the rover's wheels follow the law of the tested wheel, if there is one."""
    wheel = spec.wheel
    if wheel is None:
        return spec.rover
    law = {
        "wheel": wheel.bare(),
        "law_load_n": wheel.load_n,
        "law_gravity_mps2": wheel.gravity_mps2,
    }
    wheel_soil = spec.rover.wheel_soil.model_copy(update=law)
    return spec.rover.model_copy(update={"wheel_soil": wheel_soil})


def _drive_all(
    spec: SlopeSpec, keys: list[_Key], workers: int
) -> Iterator[tuple[_Key, SlopePoint]]:
    """Give the points as they end."""
    if workers < 2 or len(keys) < 2:
        yield from ((key, drive_point(spec, *key)) for key in keys)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(drive_point, spec, *key): key for key in keys}
        try:
            yield from ((futures[future], future.result()) for future in as_completed(futures))
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _file(kept: Path, key: _Key) -> Path:
    slope_rad, heading = key
    return kept / f"{heading}_{math.degrees(slope_rad):.4f}.json"


def _keep(kept: Path, point: SlopePoint) -> None:
    with whole_file(_file(kept, (point.slope_rad, point.heading))) as temporary:
        temporary.write_bytes(_POINT.dump_json(point))


def _read(kept: Path, key: _Key) -> SlopePoint | None:
    """Give a kept point; one that is damaged is as good as missing, and is driven again."""
    try:
        return _POINT.validate_json(_file(kept, key).read_bytes())
    except (OSError, ValidationError):
        return None


def _forget(kept: Path) -> None:
    """Remove the points of this run; those of others in the same folder stay."""
    rmtree(kept, ignore_errors=True)
    with suppress(OSError):  # it holds the points of others
        kept.parent.rmdir()


def _key(spec: SlopeSpec) -> str:
    """Give what a kept point hangs on: the spec but for its list of points, and all code."""
    said = spec.to_mapping()
    del said["slopes_rad"], said["headings"]
    digest = hashlib.sha256(json.dumps(said).encode())
    package = Path(lpet_sim.__file__).parent
    digest.update(json.dumps(identity_of(spec.rover.model)).encode())
    models = sorted(path for path in models_folder().iterdir() if path.suffix in _MODELS)
    for path in (*sorted(package.rglob("*.py")), *models):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]
