"""The ``lpet`` command."""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from lpet_sim.cli_estimator import check_estimator
from lpet_sim.cli_formats import export_app, import_app
from lpet_sim.cli_reach import reach
from lpet_sim.cli_report import report
from lpet_sim.cli_rig import rig_app
from lpet_sim.cli_rover import check_rover
from lpet_sim.cli_study import study
from lpet_sim.cli_sweep import sweep
from lpet_sim.cli_tradeoff import tradeoff
from lpet_sim.errors import LpetError
from lpet_sim.spec import read_fields
from lpet_sim.terminal import bar, print_tables, show_prints, wrote

app = typer.Typer(
    name="lpet",
    help="Localization performance evaluation for planetary rovers.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # Rich would take units in brackets for its own marks.
)
app.add_typer(import_app, name="import")
app.add_typer(export_app, name="export")
app.add_typer(rig_app, name="rig")
app.command()(reach)
app.command("check-rover")(check_rover)
app.command()(study)
app.command()(report)
app.command()(sweep)
app.command()(tradeoff)
app.command("check-estimator")(check_estimator)

RecordingArgument = Annotated[Path, typer.Argument(metavar="RUN.rrd", help="A recording.")]
SeedOption = Annotated[int, typer.Option(help="Seed of everything random.")]
RequirementOption = Annotated[
    Path | None, typer.Option(help="YAML of the requirement; 1 % and 1 deg throughout if absent.")
]


def main() -> None:
    """Run the command; bad input ends in one sentence and exit code 2."""
    logging.basicConfig(level=logging.WARNING, format="lpet: %(message)s")
    try:
        app()
    except LpetError as error:
        Console(stderr=True, soft_wrap=True, highlight=False).print(f"lpet: {error}", markup=False)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)


@app.command()
def simulate(
    spec: Annotated[Path, typer.Argument(metavar="SPEC.yaml", help="The traverse.")],
    seed: SeedOption = 0,
    out: Annotated[Path, typer.Option(help="The recording to write.")] = Path("run.rrd"),
) -> None:
    """Drive a traverse in simulation and record it."""
    from lpet_sim.evaluation.tables import event_table
    from lpet_sim.sweep.simulate import simulate as run
    from lpet_sim.sweep.traverse import TraverseSpec

    traverse = TraverseSpec.from_yaml(spec)
    with bar(f"driving {traverse.name}") as progress:
        result = run(traverse, seed, out, progress)
    print_tables([event_table(result.events)])
    wrote(result.path)


@app.command()
def sight(
    run: RecordingArgument,
    spec: Annotated[Path | None, typer.Option(help="YAML of the front end.")] = None,
    out: Annotated[Path | None, typer.Option(help="Write here, not in place.")] = None,
) -> None:
    """Find and track landmarks in a recording's images."""
    from lpet_sim.sweep.sighting import sight_recording
    from lpet_sim.vision.spec import FrontEndSpec

    front_end = FrontEndSpec() if spec is None else FrontEndSpec.from_yaml(spec)
    with bar(f"sighting {run.name}") as progress:
        summary = sight_recording(run, out or run, front_end, progress)
    typer.echo(str(summary))
    wrote(out or run)


@app.command()
def sense(
    run: RecordingArgument,
    spec: Annotated[Path | None, typer.Option(help="YAML of the landmark sensor.")] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of landmarks and noise; the traverse's if absent.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write here, not in place.")] = None,
) -> None:
    """Sense landmarks along a simulated traverse, without images."""
    from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
    from lpet_sim.sweep.sensing import sense_file

    sensor = LandmarkSensorSpec() if spec is None else LandmarkSensorSpec.from_yaml(spec)
    with bar(f"sensing {run.name}") as progress:
        summary = sense_file(run, out or run, sensor, seed, progress)
    typer.echo(str(summary))
    wrote(out or run)


@app.command("calibrate-sensor")
def calibrate_sensor(
    run: RecordingArgument,
    out: Annotated[Path, typer.Option(help="The YAML to write.")] = Path("sensor.yaml"),
    from_image: Annotated[
        int, typer.Option(min=0, help="Leave out the images before this one.")
    ] = 0,
) -> None:
    """Measure a recording's sightings at true poses: a landmark sensor that stands for them."""
    from lpet_sim.evaluation.sensor_report import sensor_tables
    from lpet_sim.sweep.calibrate import calibrate_file

    with bar(f"measuring {run.name}") as progress:
        found, paths = calibrate_file(run, out, from_image, progress)
    print_tables(sensor_tables(found.fit, found.sensed))
    wrote(*paths)


@app.command()
def estimate(
    run: RecordingArgument,
    estimator: Annotated[
        list[str] | None,
        typer.Option(help="Which one; may be given again. If absent, all that have their streams."),
    ] = None,
    spec: Annotated[
        Path | None, typer.Option(help="YAML of the spec of the one estimator that is named.")
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="What the estimate of the one that is named is called.")
    ] = None,
) -> None:
    """Run estimators on a recording and lay their estimates over it."""
    from lpet_sim.sweep.score import estimate_recording

    show_prints()
    fields = None if spec is None else read_fields(spec)
    with bar(f"estimating {run.name}") as progress:
        estimates = estimate_recording(run, estimator or None, progress, fields=fields, called=name)
    typer.echo(f"added {', '.join(estimate.name for estimate in estimates)}")
    wrote(run)


@app.command()
def evaluate(
    run: RecordingArgument,
    requirement: RequirementOption = None,
    check: Annotated[bool, typer.Option(help="Exit with 1 if any verdict is FAIL.")] = False,
    from_s: Annotated[
        float | None,
        typer.Option(min=0, help="Score from this time on, moved onto the truth there [s]."),
    ] = None,
) -> None:
    """Score a recording's estimates against its truth, and hold them to a requirement."""
    from lpet_sim.evaluation import Requirement
    from lpet_sim.sweep.report import score_tables
    from lpet_sim.sweep.score import score_recording

    held_to = Requirement() if requirement is None else Requirement.from_yaml(requirement)
    score = score_recording(run, from_s)
    print_tables(score_tables(score, held_to))
    if check and not all(held_to.check(result).passed for result in score.results):
        raise typer.Exit(1)


@app.command()
def view(run: RecordingArgument) -> None:
    """Open a recording in the Rerun viewer."""
    from lpet_sim.recording.view import view as open_viewer

    open_viewer(run)


@app.command()
def terrain(
    spec: Annotated[str, typer.Argument(metavar="SPEC.yaml", help="A terrain, or a preset.")],
    seed: SeedOption = 0,
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path("out/terrain"),
    size: Annotated[float, typer.Option(min=5, max=2000, help="Side of the map [m].")] = 50.0,
) -> None:
    """Draw a terrain: the map with its rocks, and the relief in 3D."""
    from lpet_sim.sweep.report import terrain_tables
    from lpet_sim.sweep.scenery import draw_terrain

    summary, paths = draw_terrain(spec, seed, size, out)
    print_tables(terrain_tables(summary))
    wrote(*paths)


@app.command()
def demo(
    out: Annotated[Path, typer.Option(help="Folder to write into.")] = Path("out/demo"),
    seed: SeedOption = 1,
) -> None:
    """Drive among rocks, localize, and score: the whole chain in minutes."""
    from lpet_sim.study.one_traverse import run_demo
    from lpet_sim.sweep.report import score_tables

    with bar("drive, localize, score") as progress:
        study = run_demo(out, seed, progress)
    print_tables(score_tables(study.score, study.requirement))
    wrote(*study.written)
