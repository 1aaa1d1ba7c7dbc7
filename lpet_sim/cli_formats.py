"""The commands that take recordings to the formats of others, and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lpet_sim.terminal import bar, wrote

if TYPE_CHECKING:
    from lpet_sim.recording.calibration import Calibration
    from lpet_sim.recording.recording import Recording

import_app = typer.Typer(
    help="Make a recording of the data of others.", no_args_is_help=True, rich_markup_mode=None
)
export_app = typer.Typer(
    help="Write a recording in a format of others; docs/formats.md says what each carries.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

FolderArgument = Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the data.")]
RecordingOut = Annotated[Path, typer.Argument(metavar="OUT.rrd", help="The recording to write.")]
RecordingIn = Annotated[Path, typer.Argument(metavar="RUN.rrd", help="A recording.")]
FolderOut = Annotated[Path, typer.Argument(metavar="OUT", help="A new folder to write.")]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(help="YAML of a calibration: what it sets replaces what the data declare."),
]


@import_app.command("euroc")
def import_euroc(
    folder: FolderArgument, out: RecordingOut, calibration: CalibrationOption = None
) -> None:
    """Import an ASL folder, the form of EuRoC; images are rectified if they are not."""
    from lpet_sim.sweep.importing import import_euroc as run

    with bar(f"importing {folder.name}") as progress:
        run(folder, out, _declared(calibration), progress)
    wrote(out)


@import_app.command("kitti")
def import_kitti(
    folder: FolderArgument,
    out: RecordingOut,
    calibration: CalibrationOption = None,
    baseline_m: Annotated[
        float | None,
        typer.Option(min=1e-3, help="Distance between the eyes [m]; needed where K.txt is."),
    ] = None,
) -> None:
    """Import a KITTI odometry sequence."""
    from lpet_sim.sweep.importing import import_kitti as run

    with bar(f"importing {folder.name}") as progress:
        run(folder, out, progress, _declared(calibration), baseline_m)
    wrote(out)


@import_app.command("tum")
def import_tum(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A trajectory.")], out: RecordingOut
) -> None:
    """Import a true trajectory in TUM format; the recording has no measurements."""
    from lpet_sim.sweep.importing import import_tum as run

    run(file, out)
    wrote(out)


@import_app.command("starry-night")
def import_starry_night(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of its MATLAB file.")],
    out: RecordingOut,
) -> None:
    """Import the Starry Night data set: stereo sightings, gyro and velocity."""
    from lpet_sim.sweep.importing import import_starry_night as run

    run(folder, out)
    wrote(out)


@import_app.command("mcap")
def import_mcap(
    bag: Annotated[Path, typer.Argument(metavar="BAG", help="An MCAP file, or a bag's folder.")],
    out: RecordingOut,
    topics: Annotated[
        Path | None, typer.Option(help="YAML that names the topics; ours if absent.")
    ] = None,
    calibration: CalibrationOption = None,
) -> None:
    """Import a ROS 2 bag in MCAP: rectified grey images, Imu, JointState, Odometry."""
    from lpet_sim.formats.topics import TopicsSpec
    from lpet_sim.sweep.importing import import_mcap as run

    where = None if topics is None else TopicsSpec.from_yaml(topics)
    with bar(f"importing {bag.name}") as progress:
        run(bag, out, where, _declared(calibration), progress)
    wrote(out)


@import_app.command("parquet")
def import_parquet(folder: FolderArgument, out: RecordingOut) -> None:
    """Import Parquet files that were exported before."""
    from lpet_sim.sweep.importing import import_parquet as run

    with bar(f"importing {folder.name}") as progress:
        run(folder, out, progress)
    wrote(out)


@export_app.command("euroc")
def export_euroc(run: RecordingIn, out: FolderOut) -> None:
    """Export as an ASL folder, with Kalibr's files: images, IMU, truth, sensor YAML."""
    from lpet_sim.formats.euroc import export_euroc as write

    with bar(f"exporting {run.name}") as progress:
        write(_read(run), out, progress)
    wrote(out)


@export_app.command("kitti")
def export_kitti(run: RecordingIn, out: FolderOut) -> None:
    """Export as a KITTI odometry sequence: images and the camera's true poses."""
    from lpet_sim.formats.kitti import export_kitti as write

    with bar(f"exporting {run.name}") as progress:
        write(_read(run), out, progress)
    wrote(out)


@export_app.command("tum")
def export_tum(run: RecordingIn, out: FolderOut) -> None:
    """Export the truth and every estimate as TUM trajectories."""
    from lpet_sim.formats.tum import export_tum as write
    from lpet_sim.recording.reader import read_estimates

    with bar(f"exporting {run.name}") as progress:
        write(_read(run), read_estimates(run), out, progress)
    wrote(*sorted(out.iterdir()))


@export_app.command("mcap")
def export_mcap(run: RecordingIn, out: FolderOut) -> None:
    """Export as a ROS 2 bag in MCAP; ROS need not be installed."""
    from lpet_sim.formats.mcap_write import export_mcap as write

    with bar(f"exporting {run.name}") as progress:
        write(_read(run), out, progress)
    wrote(out)


@export_app.command("parquet")
def export_parquet(run: RecordingIn, out: FolderOut) -> None:
    """Export as Parquet files, for keeping: nothing but drawings and estimates is lost."""
    from lpet_sim.formats.parquet import export_parquet as write

    with bar(f"exporting {run.name}") as progress:
        write(_read(run), out, progress)
    wrote(out)


@export_app.command("kalibr")
def export_kalibr(run: RecordingIn, out: FolderOut) -> None:
    """Export the declared calibration as Kalibr's YAML files."""
    from lpet_sim.formats.kalibr import export_kalibr as write

    write(_read(run).measurements.calibration, out)
    wrote(*sorted(out.iterdir()))


def _read(run: Path) -> Recording:
    from lpet_sim.recording.reader import read_recording

    return read_recording(run)


def _declared(path: Path | None) -> Calibration | None:
    from lpet_sim.recording.calibration import Calibration

    return None if path is None else Calibration.from_yaml(path)
