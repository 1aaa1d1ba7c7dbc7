"""The commands of the rigs, and of the library of soils."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lpet_sim.errors import LpetError, SpecError, UnknownNameError
from lpet_sim.terminal import bar, print_tables, say, wrote

if TYPE_CHECKING:
    from lpet_sim.soil.published import ReferenceWheelSpec
    from lpet_sim.soil.spec import SoilSpec

rig_app = typer.Typer(
    help="Measure soils and wheels on a test rig.",
    no_args_is_help=True,
    rich_markup_mode=None,  # Rich would take units in brackets for its own marks.
)

SoilOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="A soil of the library, or its YAML file.")
]
WheelOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME", help="'rover', a wheel of the library, or its YAML; else the soil's own."
    ),
]
RoverOption = Annotated[str, typer.Option(metavar="NAME", help="The rover model.")]
OutOption = Annotated[Path, typer.Option(metavar="DIR", help="Folder to write into.")]
_ROVER_WHEEL = "rover"


@rig_app.command("slope")
def rig_slope(
    soil: SoilOption = None,
    out: OutOption = Path("out/rig"),
    rover: RoverOption = "exomars",
    wheel: WheelOption = None,
    speed: Annotated[float, typer.Option(help="Speed of the wheels' rims [m/s].")] = 0.05,
    dt: Annotated[float, typer.Option(help="Physics step [s].")] = 0.005,
    slopes: Annotated[
        str | None, typer.Option(metavar="DEG,DEG,...", help="Tilts of the bed [deg].")
    ] = None,
    workers: Annotated[int, typer.Option(min=1, max=64, help="Processes.")] = 2,
) -> None:
    """Drive a rover up, down and across a tilt bed: slope.csv and slope.png."""
    from lpet_sim.rig.results import write_slope
    from lpet_sim.rig.slope import run_slope_rig, slope_spec
    from lpet_sim.rig.tables import slope_tables

    chosen = _soil(soil)
    of = _tested_wheel(chosen, wheel)
    spec = slope_spec(chosen, of, rover, speed, dt, _slopes_rad(slopes))
    _announce(chosen, of, rover)
    with bar(f"driving on {chosen.name}") as progress:
        report = run_slope_rig(spec, out, workers, progress)
    print_tables(slope_tables(report))
    wrote(*write_slope(report, out))


@rig_app.command("wheel")
def rig_wheel(
    soil: SoilOption = None,
    out: OutOption = Path("out/rig"),
    wheel: WheelOption = None,
    rover: RoverOption = "exomars",
    load: Annotated[float | None, typer.Option(help="Load; else the wheel's own [N].")] = None,
    gravity: Annotated[
        float | None, typer.Option(help="Gravity; else that of the wheel's test [m/s2].")
    ] = None,
    slip_angle: Annotated[float, typer.Option(help="Slip angle of the side force [deg].")] = 15.0,
) -> None:
    """Hold one wheel at every slip: wheel.csv and wheel.png."""
    from lpet_sim.outputs import output_folder
    from lpet_sim.rig.measured import measured_beside
    from lpet_sim.rig.results import write_wheel
    from lpet_sim.rig.tables import wheel_tables
    from lpet_sim.rig.wheel import run_wheel_rig, wheel_rig_spec

    chosen = _soil(soil)
    of = _tested_wheel(chosen, wheel)
    spec = wheel_rig_spec(chosen, of, rover, load, gravity, _slip_angle_rad(slip_angle))
    output_folder(out)
    _announce(chosen, of, rover)
    curve, measured = run_wheel_rig(spec), measured_beside(spec)
    print_tables(wheel_tables(curve, measured))
    wrote(*write_wheel(curve, measured, out))


@rig_app.command("soils")
def list_soils() -> None:
    """List the soils of the library: their kind, how well they are known, and their source."""
    from lpet_sim.rig.tables import soil_table

    print_tables([soil_table()])


def _soil(name: str | None) -> SoilSpec:
    """Load the soil that was asked for; without a name the sentence lists what there is."""
    from lpet_sim.soil.load import load_soil, soil_names

    if name is None:
        raise SpecError(f"--soil is missing: choose one of {', '.join(soil_names())}")
    return load_soil(name)


def _tested_wheel(soil: SoilSpec, name: str | None) -> ReferenceWheelSpec | None:
    """Load the wheel that was asked for, else the soil's own; None is the rover's."""
    from lpet_sim.soil.load import load_wheel, wheel_names

    if name is None:
        return _own_wheel(soil)
    if name == _ROVER_WHEEL:
        return None
    try:
        return load_wheel(name)
    except UnknownNameError:
        raise UnknownNameError("wheel", name, [_ROVER_WHEEL, *wheel_names()]) from None


def _own_wheel(soil: SoilSpec) -> ReferenceWheelSpec | None:
    """Load the wheel that the soil names, if it names one; the fault is the soil's if it cannot."""
    from lpet_sim.soil.load import load_wheel

    if soil.measured_with in (None, _ROVER_WHEEL):
        return None
    try:
        return load_wheel(soil.measured_with)
    except LpetError as error:
        raise SpecError(f"measured_with of the soil {soil.name}: {error}") from None


def _announce(soil: SoilSpec, wheel: ReferenceWheelSpec | None, rover: str) -> None:
    say(f"soil:  {soil.name} ({soil.kind}, {soil.evidence}): {soil.source}")
    if wheel is None:
        say(f"wheel: that of {rover}")
    else:
        ours = " (the soil's own; --wheel rover takes the rover's)"
        say(f"wheel: {wheel.name}{ours if wheel.name == soil.measured_with else ''}")


def _slip_angle_rad(degrees: float) -> float:
    """Check a slip angle in the unit in which it was typed."""
    from lpet_sim.rig.wheel import SLIP_ANGLE_END_DEG

    if not 0 <= degrees < SLIP_ANGLE_END_DEG:
        valid = f"0 or more and below {SLIP_ANGLE_END_DEG:g} degrees"
        raise SpecError(f"--slip-angle {degrees:g}: give an angle of {valid}")
    return math.radians(degrees)


def _slopes_rad(typed: str | None) -> tuple[float, ...] | None:
    """Read slopes as in ``0,10,20``, and check them in the unit in which they were typed."""
    from lpet_sim.rig.slope import SLOPE_MAX_DEG

    if typed is None:
        return None
    try:
        degrees = [float(text) for text in typed.split(",")]
    except ValueError:
        raise SpecError(f"--slopes {typed}: give degrees with commas, as in 0,10,20") from None
    if not all(0 <= slope <= SLOPE_MAX_DEG for slope in degrees):
        raise SpecError(f"--slopes {typed}: give slopes from 0 to {SLOPE_MAX_DEG:g} degrees")
    return tuple(math.radians(slope) for slope in degrees)
