"""How the views are arranged when a recording is opened, built from what the recording holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun.blueprint as rrb

from lpet_sim.recording import layout
from lpet_sim.recording.overview import Overview

_SKY = (38, 32, 30, 255)
_UP = (0.0, 0.0, 1.0)
_BACKDROP = (layout.TERRAIN, layout.LANDMARKS, layout.PATHS)
_COUNTS = ("inliers", "matches", "bridged")

Part = rrb.Container | rrb.View
Vector = tuple[float, float, float]


def build_blueprint(overview: Overview) -> rrb.Blueprint:
    """Arrange the views: the world large, what it saw beside it, errors and slip below."""
    columns = [column for column in (_left(overview), _right(overview)) if column is not None]
    return rrb.Blueprint(
        rrb.Horizontal(*columns, column_shares=[3, 2][: len(columns)]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="following"),
        auto_views=False,
    )


def _left(overview: Overview) -> rrb.Container:
    rows: list[Part] = [rrb.Tabs(_world(overview), _map(overview), _chase(overview))]
    for parts in (
        [*_errors(overview), *_attitude(overview)],
        [*_slip(overview), *_counts(overview)],
    ):
        if parts:
            rows.append(rrb.Horizontal(*parts))
    return rrb.Vertical(*rows, row_shares=[6, 2, 2][: len(rows)])


def _right(overview: Overview) -> rrb.Container:
    rows: list[Part] = []
    if overview.has_cameras and (overview.images or overview.sightings):
        rows.append(_eye("left", "Left eye: landmarks and tracks"))
        rows.append(_eye("right", "Right eye"))
    text = rrb.TextDocumentView(origin=layout.SUMMARY, name="Summary")
    log = rrb.TextLogView(origin=layout.EVENT_LOG, name="Events")
    rows.append(rrb.Tabs(text, log) if overview.has_events else text)
    return rrb.Vertical(*rows, row_shares=[3, 3, 2][-len(rows) :])


def _world(overview: Overview) -> rrb.View:
    # Seen across its longer side, a long path fills the width of the view.
    along = np.subtract(overview.high_m, overview.low_m)[:2] if overview.low_m else (1.0, 0.0)
    direction = (-0.25, -0.75, 0.55) if along[0] >= along[1] else (-0.75, -0.25, 0.55)
    return _view_3d("Traverse: true path white, estimates in colour", overview, direction, _UP)


def _map(overview: Overview) -> rrb.View:
    return _view_3d("From above", overview, (0.0, -0.01, 1.1), (0.0, 1.0, 0.0))


def _chase(overview: Overview) -> rrb.View:
    start = np.array(overview.low_m or (0.0, 0.0, 0.0))
    position = start + np.array([-4.0, -4.0, 3.0])
    eye = rrb.EyeControls3D(
        position=position, look_target=start, tracking_entity=layout.ROVER, eye_up=_UP
    )
    return _spatial("With the rover", eye)


def _view_3d(name: str, overview: Overview, direction: Vector, up: Vector) -> rrb.View:
    """Look at the middle of the traverse from a direction, so far away that all of it is seen."""
    if not overview.low_m:
        return _spatial(name, None)
    low, high = np.array(overview.low_m), np.array(overview.high_m)
    centre, size = (low + high) / 2, max(float(np.linalg.norm(high - low)), 4.0)
    position = centre + 0.9 * size * np.array(direction)
    return _spatial(name, rrb.EyeControls3D(position=position, look_target=centre, eye_up=up))


def _spatial(name: str, eye: rrb.EyeControls3D | None) -> rrb.View:
    return rrb.Spatial3DView(
        origin="/world",
        name=name,
        background=_SKY,
        line_grid=False,
        eye_controls=eye,
        overrides=_still(),
    )


def _still() -> dict[Any, Any]:
    """Let the backdrop take no pointer, which would cover the view with its numbers."""
    return dict.fromkeys(_BACKDROP, rrb.EntityBehavior(interactive=False))


def _eye(eye: str, name: str) -> rrb.View:
    return rrb.Spatial2DView(origin=layout.CAMERAS[eye], name=name, background=(0, 0, 0, 255))


def _errors(overview: Overview) -> list[Part]:
    entities = [f"{layout.ERRORS}/{e.slug}/position_m" for e in overview.estimates if e.distance_m]
    return _curves("Position error [m]", entities, overview)


def _attitude(overview: Overview) -> list[Part]:
    known = [e for e in overview.estimates if e.distance_m]
    percent = [f"{layout.ERRORS}/{e.slug}/percent" for e in known]
    views = _curves("Position error [% of distance]", percent, overview)
    for e in known:
        entity = f"{layout.ERRORS}/{e.slug}/attitude_deg"
        views += _curves(f"Attitude error [deg]: {e.name}", [entity], overview)
    return [rrb.Tabs(*views)] if views else []


def _slip(overview: Overview) -> list[Part]:
    if not overview.has_wheel_truth:
        return []
    slip = _curves("True wheel slip", [f"{layout.TRUTH_WHEELS}/slip"], overview)
    load = _curves("Wheel load [N]", [f"{layout.TRUTH_WHEELS}/load_n"], overview)
    return [rrb.Tabs(*slip, *load)]


def _counts(overview: Overview) -> list[Part]:
    entities = [
        f"{layout.ESTIMATES}/{e.slug}/diagnostics/{layout.slug(name)}"
        for e in overview.estimates
        for name in e.diagnostics
        if name in _COUNTS
    ]
    return _curves("Inliers", entities, overview)


def _curves(name: str, entities: list[str], overview: Overview) -> list[Part]:
    """Plot curves over the whole traverse."""
    if not entities:
        return []
    whole = rrb.TimeRange(
        start=rrb.TimeRangeBoundary.absolute(seconds=0.0),
        end=rrb.TimeRangeBoundary.absolute(seconds=max(overview.duration_s, 1.0)),
    )
    view = rrb.TimeSeriesView(
        origin="/",
        contents=entities,
        name=name,
        plot_legend=rrb.PlotLegend("LeftTop"),
        axis_x=rrb.TimeAxis(view_range=whole),
    )
    return [view]
