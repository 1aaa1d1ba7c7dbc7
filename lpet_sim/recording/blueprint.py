"""How the views are arranged when a recording is opened, built from what the recording holds."""

from __future__ import annotations

from typing import Any

import numpy as np
import rerun.blueprint as rrb

from lpet_sim.recording import layout
from lpet_sim.recording.overview import EstimateFacts, Overview
from lpet_sim.recording.wheel_curves import TITLES

_SKY = (38, 32, 30, 255)
_UP = (0.0, 0.0, 1.0)
_BACKDROP = (
    layout.TERRAIN,
    layout.LANDMARKS,
    layout.PATHS,
    layout.EVENT_PLACES,
    *layout.CAMERAS.values(),
)
_COUNTS = ("inliers", "matches", "bridged")

# Of the window's height: the width of the right column, and the title of a view.
_COLUMN_SHARE, _TITLE_SHARE = 0.75, 0.03
_WIDE = 2.0
# Room for the labels over the ends of the paths [m].
_ABOVE = (0.0, 0.0, 3.0)
_RANGES = {
    "slip": rrb.ScalarAxis(range=(-0.4, 1.1)),
    "slip_angle_deg": rrb.ScalarAxis(range=(-45.0, 45.0)),
    "traction_over_load": rrb.ScalarAxis(range=(-1.0, 1.0)),
}

_WITHOUT_KEY = ("slip", "slip_angle_deg")

Part = rrb.Container | rrb.View
Vector = tuple[float, float, float]


def build_blueprint(overview: Overview) -> rrb.Blueprint:
    """Arrange the views: the world large, what it saw beside it, errors and slip below."""
    return rrb.Blueprint(
        rrb.Horizontal(_left(overview), _right(overview), column_shares=[5, 4]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="following"),
        auto_views=False,
    )


def _left(overview: Overview) -> rrb.Container:
    rows: list[Part] = [rrb.Tabs(_world(overview), _map(overview), _ride())]
    for parts in (
        [*_errors(overview), *_percent(overview)],
        _wheels(overview),
    ):
        if parts:
            rows.append(rrb.Horizontal(*parts))
    return rrb.Vertical(*rows, row_shares=[5, 2, 3][: len(rows)])


def _right(overview: Overview) -> rrb.Container:
    rows = _eyes(overview)
    attitude = [view for e in overview.estimates for view in _attitude(e, overview)]
    curves = [*attitude, *_counts(overview)]
    if curves:
        rows.append((rrb.Tabs(*curves, active_tab=max(len(attitude) - 1, 0)), 0.2))
    text = rrb.TextDocumentView(origin=layout.SUMMARY, name="Summary")
    log = rrb.TextLogView(origin=layout.EVENT_LOG, name="Events")
    left_over = max(0.2, 1.0 - sum(share for _, share in rows))
    rows.append((rrb.Tabs(text, log) if overview.has_events else text, left_over))
    return rrb.Vertical(*(part for part, _ in rows), row_shares=[share for _, share in rows])


def _eyes(overview: Overview) -> list[tuple[Part, float]]:
    """Put the eyes side by side, or wide ones one above the other, each with its share of rows."""
    if overview.aspect is None or not (overview.images or overview.sightings):
        return []
    left, right = _eye("left", "Left eye: landmarks and tracks"), _eye("right", "Right eye")
    if overview.aspect < _WIDE:
        return [(rrb.Horizontal(left, right), _TITLE_SHARE + _COLUMN_SHARE / (2 * overview.aspect))]
    share = _TITLE_SHARE + _COLUMN_SHARE / overview.aspect
    return [(left, share), (right, share)]


def _world(overview: Overview) -> rrb.View:
    # Seen across its longer side, a long path fills the width of the view.
    along = np.subtract(overview.high_m, overview.low_m)[:2] if overview.low_m else (1.0, 0.0)
    direction = (-0.25, -0.75, 0.55) if along[0] >= along[1] else (-0.75, -0.25, 0.55)
    return _view_3d("Traverse: true path white, estimates in colour", overview, direction, _UP)


def _map(overview: Overview) -> rrb.View:
    return _view_3d("From above", overview, (0.0, -0.01, 1.1), (0.0, 1.0, 0.0))


def _ride() -> rrb.View:
    # In the rover's own frame an eye that stands still goes along with it.
    eye = rrb.EyeControls3D(position=(-3.0, -3.5, 2.2), look_target=(0.5, 0.0, 0.3), eye_up=_UP)
    return _spatial("With the rover", eye, layout.ROVER)


def _view_3d(name: str, overview: Overview, direction: Vector, up: Vector) -> rrb.View:
    """Look at the middle of the traverse from a direction, so far away that all of it is seen."""
    if not overview.low_m:
        return _spatial(name, None)
    low, high = np.array(overview.low_m), np.array(overview.high_m) + _ABOVE
    centre, size = (low + high) / 2, max(float(np.linalg.norm(high - low)), 4.0)
    position = centre + 1.05 * size * np.array(direction)
    return _spatial(name, rrb.EyeControls3D(position=position, look_target=centre, eye_up=up))


def _spatial(name: str, eye: rrb.EyeControls3D | None, origin: str = layout.WORLD) -> rrb.View:
    return rrb.Spatial3DView(
        origin=origin,
        contents=f"{layout.WORLD}/**",
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


def _percent(overview: Overview) -> list[Part]:
    entities = [f"{layout.ERRORS}/{e.slug}/percent" for e in overview.estimates if e.distance_m]
    return _curves("Position error [% of distance]", entities, overview)


def _attitude(estimate: EstimateFacts, overview: Overview) -> list[Part]:
    if not estimate.distance_m:
        return []
    entity = f"{layout.ERRORS}/{estimate.slug}/attitude_deg"
    return _curves(f"Attitude [deg]: {estimate.name}", [entity], overview)


def _wheels(overview: Overview) -> list[Part]:
    """Show how the wheels slip, and beside it what they stand in and carry."""
    views = {quantity: _wheel_view(quantity, overview) for quantity in TITLES}
    moving = [*views.pop("slip"), *views.pop("slip_angle_deg")]
    standing = [view for found in views.values() for view in found]
    return [rrb.Tabs(*tabs, active_tab=0) for tabs in (moving, standing) if tabs]


def _wheel_view(quantity: str, overview: Overview) -> list[Part]:
    entities = [layout.wheel_curve(quantity)] if overview.has_wheel_truth else []
    title = TITLES[quantity]
    if quantity == "slip" and overview.has_seen_slip:
        entities.append(layout.SEEN_SLIP)
        title = f"{title}, and as vision sees it (white)" if overview.has_wheel_truth else "Slip"
    # A wheel that hardly turns has a slip of any size; what matters lies between these.
    # The legend would cover the curves; the views beside have it in the same colours.
    key = quantity not in _WITHOUT_KEY
    return _curves(title, entities, overview, _RANGES.get(quantity), key)


def _counts(overview: Overview) -> list[Part]:
    entities = [
        f"{layout.ESTIMATES}/{e.slug}/diagnostics/{layout.slug(name)}"
        for e in overview.estimates
        for name in e.diagnostics
        if name in _COUNTS
    ]
    return _curves("Inliers", entities, overview)


def _curves(
    name: str,
    entities: list[str],
    overview: Overview,
    axis_y: rrb.ScalarAxis | None = None,
    key: bool = True,
) -> list[Part]:
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
        plot_legend=rrb.PlotLegend("LeftTop", visible=key),
        axis_x=rrb.TimeAxis(view_range=whole),
        axis_y=axis_y,
    )
    return [view]
