"""Adding to a recording what is made of it later: sightings and estimates.

The file is written anew beside the old one, all that was in it copied as it is, and takes its place
when it is complete. The recording keeps its identity, so a viewer sees one and the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lpet_sim.recording import layout
from lpet_sim.recording.buffers import ColumnBuffers
from lpet_sim.recording.calibration import Calibration
from lpet_sim.recording.columns import Column, take_apart
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.overview import (
    ErrorsOverTime,
    EstimateFacts,
    Overview,
    SlipOverTime,
    estimate_facts,
)
from lpet_sim.recording.publish import publish
from lpet_sim.recording.reader import open_store, read_body_truth, read_manifest
from lpet_sim.recording.sketch import Sketch
from lpet_sim.recording.store import StoreReader, StoreWriter
from lpet_sim.recording.streams import SightingStream
from lpet_sim.recording.visuals import ESTIMATE_COLOURS, TRUTH_COLOUR, Pen

# Before, the percentage of a distance near zero says nothing.
FIRST_METRES_M = 5.0
_LOWEST_LABEL_M = 2.5


def add_sightings(
    path: Path | str, sightings: SightingStream, path_out: Path | str | None = None
) -> None:
    """Add sightings to a recording, in place of any it has.

    Args:
        path: The recording.
        sightings: What was seen.
        path_out: Where the result goes; over the recording itself where None.

    Raises:
        RecordingError: The file is missing, truncated, or not a recording of this schema.
        OutputError: The result cannot be written.
    """
    with _rewriting(path, path_out, _SIGHTING_ENTITIES) as copy:
        for name, column in take_apart(sightings):
            copy.columns.add(f"{layout.SIGHTINGS}/{name}", column)
        copy.overview = _draw_sightings(copy, sightings)


def add_estimate(
    path: Path | str,
    estimate: Estimate,
    errors: ErrorsOverTime | None = None,
    path_out: Path | str | None = None,
) -> None:
    """Overlay an estimate on a recording, in place of any of the same name.

    Args:
        path: The recording.
        estimate: The estimate.
        errors: Its errors, as `lpet_sim.evaluation.errors.error_series` gives them, for the curves.
        path_out: Where the result goes; over the recording itself where None.

    Raises:
        RecordingError: The file is missing, truncated, or not a recording of this schema.
        OutputError: The result cannot be written.
    """
    add_estimates(path, [(estimate, errors)], path_out)


def add_estimates(
    path: Path | str,
    estimates: Sequence[tuple[Estimate, ErrorsOverTime | None]],
    path_out: Path | str | None = None,
    slip: SlipOverTime | None = None,
) -> None:
    """Overlay several estimates at once, as `add_estimate` does.

    Args:
        path: The recording.
        estimates: The estimates, each with its errors or None.
        path_out: Where the result goes; over the recording itself where None.
        slip: Slip as the estimates show it, in place of any before; None leaves that as it is.

    Raises:
        RecordingError: The file is missing, truncated, or not a recording of this schema.
        OutputError: The result cannot be written.
    """
    slugs = [layout.slug(estimate.name) for estimate, _ in estimates]
    roots = (layout.ESTIMATES, layout.ERRORS, layout.PATHS)
    replaced = [f"{root}/{slug}/**" for root in roots for slug in slugs]
    if slip is not None:
        replaced.append(layout.SEEN_SLIP)
    with _rewriting(path, path_out, replaced) as copy:
        for estimate, errors in estimates:
            _overlay(copy, estimate, errors)
        if slip is not None:
            _draw_slip(copy, slip)


_SIGHTING_ENTITIES = [
    f"{layout.SIGHTINGS}/**",
    layout.LANDMARKS,
    *(f"{camera}/{what}" for camera in layout.CAMERAS.values() for what in ("sightings", "tracks")),
]


@dataclass
class _Copy:
    """A recording being written anew."""

    source: StoreReader
    store: StoreWriter
    columns: ColumnBuffers
    pen: Pen
    overview: Overview


@contextmanager
def _rewriting(
    path: Path | str, path_out: Path | str | None, drop: Sequence[str]
) -> Iterator[_Copy]:
    """Copy a recording but for some entities, let more be added, and put it in place."""
    source = open_store(path)
    store = StoreWriter(Path(path_out or path), source.recording_id)
    try:
        store.send_chunks(source.chunks(drop=[*drop, layout.SUMMARY]))
        overview = Overview.from_json(source.json(layout.SUMMARY))
        columns = ColumnBuffers(store.send)
        copy = _Copy(source, store, columns, Pen(store.stream), overview)
        yield copy
        columns.flush()
        publish(store, copy.overview, read_manifest(source))
        store.commit()
    except BaseException:
        store.discard()
        raise


def _draw_sightings(copy: _Copy, sightings: SightingStream) -> Overview:
    calibration = Calibration.from_mapping(copy.source.json(layout.CALIBRATION), "calibration")
    # As many images as were kept are drawn on; all of them where none were.
    every = max(1, round(len(sightings) / copy.overview.images)) if copy.overview.images else 1
    start = replace(copy.overview, sightings=0)
    sketch = Sketch(copy.pen, calibration, every, start)
    body = read_body_truth(copy.source)
    if body is not None:
        sketch.poses(body.t_ns, body.T_world_body)
    sketch.sightings(sightings)
    sketch.landmarks()
    return sketch.overview


def _overlay(copy: _Copy, estimate: Estimate, errors: ErrorsOverTime | None) -> None:
    slug = layout.slug(estimate.name)
    _store_estimate(copy, f"{layout.ESTIMATES}/{slug}", estimate)
    colour = copy.overview.colour_for(estimate.name)
    names = tuple(estimate.diagnostics)
    facts = estimate_facts(estimate.name, slug, colour, names, errors)
    trajectory = estimate.trajectory
    overview = copy.overview.with_estimate(facts).covering(trajectory.T_world_body.translation)
    copy.overview = replace(overview.lasting(trajectory.t_ns), has_rover=True)
    if not overview.has_rover:
        copy.pen.poses(layout.ROVER, trajectory.t_ns, trajectory.T_world_body)
    _draw_estimate(copy.pen, estimate, facts, overview.extent_m)
    if errors is not None:
        _draw_errors(copy.pen, facts, errors)


def _store_estimate(copy: _Copy, prefix: str, estimate: Estimate) -> None:
    rows = [(name, f"diagnostics/{layout.slug(name)}") for name in estimate.diagnostics]
    copy.store.send_json(prefix, {"name": estimate.name, "rows": rows})
    for name, column in take_apart(estimate.trajectory):
        copy.columns.add(f"{prefix}/trajectory/{name}", column)
    t_ns = estimate.trajectory.t_ns
    if estimate.covariance is not None:
        copy.columns.add(f"{prefix}/covariance", Column(t_ns, np.asarray(estimate.covariance)))
    for name, entity in rows:
        copy.columns.add(f"{prefix}/{entity}", Column(t_ns, np.asarray(estimate.diagnostics[name])))


def _draw_estimate(pen: Pen, estimate: Estimate, facts: EstimateFacts, extent_m: float) -> None:
    rgba = ESTIMATE_COLOURS[facts.colour % len(ESTIMATE_COLOURS)]
    places = estimate.trajectory.T_world_body.translation
    entity = f"{layout.PATHS}/{facts.slug}"
    pen.path(f"{entity}/line", places, rgba, 2.0)
    pen.marker(f"{entity}/now", estimate.trajectory.t_ns, places, rgba)
    # Ends lie close together; each label hangs on a pole of its own height, above the rover.
    height_m = _LOWEST_LABEL_M + max(0.06 * extent_m, 0.9) * facts.colour
    pole = places[-1] + np.outer([0.0, 1.0], [0.0, 0.0, height_m])
    pen.path(f"{entity}/pole", pole, rgba, 1.0)
    pen.labels(f"{entity}/end", pole[1:], [facts.label], rgba)
    for name in facts.diagnostics:
        curve = f"{layout.ESTIMATES}/{facts.slug}/diagnostics/{layout.slug(name)}"
        pen.curve_style(curve, [f"{name} ({facts.name})"], [rgba])


def _draw_errors(pen: Pen, facts: EstimateFacts, errors: ErrorsOverTime) -> None:
    rgba = ESTIMATE_COLOURS[facts.colour % len(ESTIMATE_COLOURS)]
    entity = f"{layout.ERRORS}/{facts.slug}"
    length_m = np.linalg.norm(errors.position_error_m, axis=-1)
    far = errors.distance_m >= FIRST_METRES_M
    percent = 100.0 * length_m[far] / errors.distance_m[far]
    pen.curve(f"{entity}/position_m", errors.t_ns, length_m)
    pen.curve_style(f"{entity}/position_m", [facts.name], [rgba])
    if far.any():
        pen.curve(f"{entity}/percent", errors.t_ns[far], percent)
        pen.curve_style(f"{entity}/percent", [facts.name], [rgba])
    pen.curve(f"{entity}/attitude_deg", errors.t_ns, np.degrees(errors.attitude_error_rad))
    pen.axis_curve_style(f"{entity}/attitude_deg", ["roll", "pitch", "yaw"])


def _draw_slip(copy: _Copy, slip: SlipOverTime) -> None:
    """Draw the slip that vision sees; where it sees none, NaN, the curve has a gap."""
    if len(slip.t_ns):
        copy.pen.curve(layout.SEEN_SLIP, slip.t_ns, slip.slip)
        copy.pen.curve_style(layout.SEEN_SLIP, ["seen by vision"], [TRUTH_COLOUR], 2.5)
        copy.overview = replace(copy.overview, has_seen_slip=True)
