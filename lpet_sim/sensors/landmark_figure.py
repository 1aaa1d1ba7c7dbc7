"""Picture of a traverse's landmarks: where they are, near and far, and what one image shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lpet_sim.recording.arrays import Array
from lpet_sim.recording.calibration import StereoCalibration
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.sensors.landmark_field import FAR, GROUND, ROCK
from lpet_sim.sensors.landmark_sensor import ShownLandmarks
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.figure_ground import colour_scale, lit_colours, sample_ground, save_figure
from lpet_sim.terrain.terrain import Terrain

COLOURS = {GROUND: "#0b6e4f", ROCK: "#1f3fbf", FAR: "#c2185b"}
"""Colours of the kinds of landmarks."""

_NAMES = {GROUND: "on the ground", ROCK: "on rocks", FAR: "on far relief"}
_NODES = 500
_MARGIN_M = 3.0
_STRETCH = 1.5


def landmark_map(
    shown: ShownLandmarks,
    truth: BodyTruth,
    terrain: Terrain,
    calibration: StereoCalibration,
    path: Path | str,
    image: int = 0,
    picture: NDArray[Any] | None = None,
) -> None:
    """Draw the landmarks of a traverse over the shaded relief, and those of one image.

    Args:
        shown: What the images of the traverse show.
        truth: Motion of the body.
        terrain: The ground.
        calibration: The declared pair.
        path: The picture to write; its ending says PNG, PDF or SVG.
        image: Which image is drawn.
        picture: What the left eye sees there, Shape (h, w); None: an empty sheet.

    Raises:
        OutputError: The picture cannot be written.

    Reference: Bakambu et al., figure 3.
    """
    figure = Figure(figsize=(13.0, 7.6), dpi=150)
    FigureCanvasAgg(figure)
    figure.set_layout_engine("constrained")
    parts = figure.subplot_mosaic([["near", "far"], ["near", "image"]], width_ratios=(1.7, 1.0))
    _, first = np.unique(shown.landmark_id, return_index=True)
    kind, p_world = shown.kind[first], shown.p_world[first]
    driven = truth.T_world_body.translation[:, :2]
    near = kind != FAR
    ground = _draw_plan(parts["near"], terrain, driven, p_world[near], kind[near], 7.0)
    bar = figure.colorbar(colour_scale(ground), ax=parts["near"], fraction=0.035, pad=0.015)
    bar.set_label("elevation [m]")
    parts["near"].set_title(f"{near.sum():,} landmarks of {len(shown.t_ns):,} images", loc="left")
    parts["near"].legend(loc="upper left", fontsize=8)
    if not near.all():
        _draw_plan(parts["far"], terrain, driven, p_world[~near], kind[~near], 12.0)
        parts["far"].set_title(f"{np.sum(~near)} far landmarks", loc="left")
    _draw_image(parts["image"], shown, calibration, image, picture)
    save_figure(figure, path)


def _draw_plan(
    axes: Axes, terrain: Terrain, driven: Array, p_world: Array, kind: NDArray[Any], size: float
) -> Any:
    """Draw some landmarks and the way driven from above."""
    every = np.concatenate([driven, p_world[:, :2]])
    margin = max(_MARGIN_M, 0.03 * float(np.ptp(every, axis=0).max()))
    low, high = every.min(axis=0) - margin, every.max(axis=0) + margin
    box = Box(*(float(value) for value in (*low, *high)))
    ground = sample_ground(terrain, box, _NODES)
    lit = lit_colours(terrain, ground, _STRETCH)
    axes.imshow(lit, origin="lower", extent=ground.extent, interpolation="bilinear")
    axes.plot(*driven.T, color="white", linewidth=2.5)
    axes.plot(*driven.T, color="black", linewidth=1.0, label="driven")
    for which in np.unique(kind):
        x, y = p_world[kind == which, :2].T
        name = f"{len(x):,} {_NAMES[int(which)]}"
        axes.scatter(x, y, s=size, c=COLOURS[int(which)], linewidths=0.0, label=name, zorder=3)
    axes.set(xlim=(box.x_min, box.x_max), ylim=(box.y_min, box.y_max), aspect="equal")
    axes.set(xlabel="x, east [m]", ylabel="y, north [m]")
    return ground


def _draw_image(
    axes: Axes,
    shown: ShownLandmarks,
    calibration: StereoCalibration,
    image: int,
    picture: NDArray[Any] | None,
) -> None:
    """Draw what one image shows: dots in the left eye, lines to their places in the right."""
    rows = slice(int(shown.offsets[image]), int(shown.offsets[image + 1]))
    left, right, v = shown.stereo_px[rows].T
    if picture is not None:
        axes.imshow(picture, cmap="gray", interpolation="bilinear")
    colours = [COLOURS[int(kind)] for kind in shown.kind[rows]]
    ends = np.stack([np.column_stack([left, v]), np.column_stack([right, v])], axis=1)
    axes.add_collection(LineCollection(list(ends), colors=colours, linewidths=0.9))
    axes.scatter(left, v, s=14, c=colours, edgecolors="white", linewidths=0.5, zorder=3)
    axes.set(xlim=(-0.5, calibration.width_px - 0.5), ylim=(calibration.height_px - 0.5, -0.5))
    axes.set(xlabel="u [px]", ylabel="v [px]", aspect="equal")
    seconds = (shown.t_ns[image] - shown.t_ns[0]) / 1e9
    axes.set_title(f"{len(v)} shown after {seconds:.0f} s; lines: disparity", loc="left")
