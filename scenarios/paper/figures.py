"""The figures of the paper's experiment, from the rows of its sweeps and from one data set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from matplotlib.figure import Figure
from PIL import Image

from estimators import build_estimator
from lpet_sim.errors import RowsError
from lpet_sim.evaluation import charts, evaluate
from lpet_sim.evaluation.figures import plot_errors, plot_plan_view, save
from lpet_sim.evaluation.rows import CURVE, Rows
from lpet_sim.outputs import whole_file
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.reader import read_recording
from lpet_sim.sensors.landmark_figure import landmark_map
from lpet_sim.sensors.landmark_sensor import show_landmarks
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sweep.sensing import terrain_of
from lpet_sim.sweep.sweep_job import prepare
from lpet_sim.sweep.sweep_once import Scene
from lpet_sim.sweep.sweep_spec import ArmSpec
from scenarios.paper.map_figure import plot_relative_map, watch_map
from scenarios.paper.variants import ANCHORS, N, bounded, multiframe

OBSERVED: Final = multiframe(10, formulation="standard", anchors=ANCHORS)["spec"]
UNOBSERVED: Final = bounded(N, formulation="standard")["spec"]
_KINDS = ("decoupled", "coupled")


def write_figures(rows: Rows, recording: Path, folder: Path) -> list[Path]:
    """Write all figures that the rows allow, and those of one data set.

    Args:
        rows: Rows of all sweeps of the experiment.
        recording: The data set of the figures of one run.
        folder: Where they go.
    """
    scene = prepare(recording, ArmSpec(sensor=LandmarkSensorSpec()), "fused")
    return [
        *_of_rows(_comparable(rows), folder),
        *_of_one(scene, folder),
        *_of_map(scene, recording, folder),
    ]


def _comparable(rows: Rows) -> Rows:
    """Give the three kinds of the paper in the ideal arm, with queues first in, first out."""
    three = (rows["formulation"] == "standard") & (rows["arm"] == "ideal")
    three &= [c in _KINDS for c in rows["coupling"]]
    return rows.where(three & ["-ttl-" not in v and "-conf-" not in v for v in rows["variant"]])


def _of_rows(rows: Rows, folder: Path) -> list[Path]:
    drawn: dict[str, Callable[[], Figure]] = {
        "paper_growth.png": lambda: _growth(rows, "m10-n9999"),
        "paper_growth_bounded.png": lambda: _growth(rows, "m9999-n40-fifo"),
        "paper_error_over_memory.png": lambda: charts.plot_error_over_memory(rows),
        "paper_error_over_size.png": lambda: charts.plot_error_over_size(rows),
    }
    return [path for name, draw in drawn.items() if (path := _write(draw, folder / name))]


def _growth(rows: Rows, memory: str) -> Figure:
    """Draw the growth of the three kinds of one memory, in centimetres as the errors are small."""
    kinds = ("decoupled-unobservable", "coupled-unobservable", "coupled-observable")
    labels = [f"{memory}-{kind}-standard" for kind in kinds]
    there = [label for label in labels if label in rows.values("variant")]
    if not there:
        raise RowsError(f"no variant has the memory {memory}: there is no growth to draw")
    figure = charts.plot_error_growth(rows.with_columns(**{CURVE: 100 * rows[CURVE]}), there)
    figure.axes[0].set_ylabel("position error [cm]")
    return figure


def _write(draw: Callable[[], Figure], path: Path) -> Path | None:
    """Draw and write a figure; None where the rows are too few for it."""
    try:
        with whole_file(path) as temporary, charts.chart_style():
            save(draw(), temporary)
    except RowsError:
        return None
    return path


def _of_one(scene: Scene, folder: Path) -> list[Path]:
    """Draw one run from above and its errors: odometry, two views, and the paper's best."""
    estimates = [
        _named("odometry", "odometry (wheels and gyros)", scene),
        _named("frame_to_frame", "VME, two views", scene),
        _named("slam", "VME, multiframe observable", scene, OBSERVED),
    ]
    results = [evaluate(estimate, scene.truth) for estimate in estimates]
    plan, errors = folder / "paper_plan_view.png", folder / "paper_errors.png"
    with whole_file(plan) as temporary:
        save(plot_plan_view(scene.truth.trajectory, estimates), temporary)
    with whole_file(errors) as temporary:
        save(plot_errors(results), temporary)
    return [plan, errors]


def _named(name: str, title: str, scene: Scene, spec: object = None) -> Estimate:
    estimator = build_estimator(name, spec if isinstance(spec, dict) else None)
    return replace(estimator.estimate(scene.measurements), name=title)


def _of_map(scene: Scene, recording: Path, folder: Path) -> list[Path]:
    """Draw the map of a filter without anchors, and the landmarks that there are."""
    held = read_recording(recording)
    stereo, truth = held.measurements.calibration.stereo, held.truth
    assert stereo is not None and truth is not None
    terrain, seed = terrain_of(held.manifest), held.manifest.seed or 0
    shown = show_landmarks(truth.body, terrain, stereo, LandmarkSensorSpec(), seed)
    places = dict(zip(shown.landmark_id.tolist(), shown.p_world.tolist(), strict=True))
    relative, dots = folder / "paper_relative_map.png", folder / "paper_landmarks.jpg"
    with whole_file(relative) as temporary, charts.chart_style():
        save(plot_relative_map(watch_map(scene, places, UNOBSERVED)), temporary)
    with TemporaryDirectory() as other, whole_file(dots) as temporary:
        large = Path(other) / "landmarks.png"
        landmark_map(shown, truth.body, terrain, stereo, large, len(shown.t_ns) // 2)
        with Image.open(large) as image:
            image.convert("RGB").save(temporary, quality=85)
    return [relative, dots]
