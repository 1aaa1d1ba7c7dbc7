"""Planar paths of limited curvature through waypoints: straights, arcs, and turns on the spot."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lpet_sim.recording.arrays import Array

_SPACING_M = 0.02
_STRAIGHT_RAD = 1e-6
_SHARPEST_HALF_RAD = math.radians(85.0)  # beyond it tan runs off to infinity

Point = tuple[float, float]


@dataclass(frozen=True)
class Leg:
    """A piece of path that is driven in one go; between legs the rover turns on the spot.

    Attributes:
        start_m: Distance along the whole path at which the leg begins [m].
        s_m: Distance along the leg [m], Shape (n,).
        xy: Positions in the world [m], Shape (n, 2).
        heading_rad: Headings, continuous along the leg [rad], Shape (n,).
        curvature: Curvature, left positive [1/m], Shape (n,).
    """

    start_m: float
    s_m: Array
    xy: Array
    heading_rad: Array
    curvature: Array

    @property
    def length_m(self) -> float:
        """Length of the leg [m]."""
        return float(self.s_m[-1])


@dataclass(frozen=True)
class _Piece:
    """A straight (curvature 0) or an arc."""

    start: Point
    heading: float
    curvature: float
    length: float


def plan_legs(waypoints_m: Sequence[Point], min_radius_m: float, cut_m: float) -> tuple[Leg, ...]:
    """Round the corners of a polyline, and split it where a corner is too sharp to round.

    A corner of angle a takes an arc of radius R from its sides over ``R tan(a/2)`` and passes it
    at ``R (1/cos(a/2) - 1)``. R is the largest that leaves half of each side to the next corner
    and passes within ``cut_m``; below ``min_radius_m`` the corner becomes a point turn.

    Args:
        waypoints_m: Corners, from the start to the goal [m].
        min_radius_m: Tightest arc [m].
        cut_m: Largest distance of the path from a rounded corner [m].

    Returns:
        The legs, in order.
    """
    radii = _corner_radii(waypoints_m, min_radius_m, cut_m)
    groups: list[list[_Piece]] = [[]]
    here = waypoints_m[0]
    for i, corner in enumerate(waypoints_m[1:]):
        heading = _heading(waypoints_m[i], corner)
        radius = radii[i]
        turn = _turn(waypoints_m, i + 1) if radius > 0 else 0.0
        reach = math.dist(here, corner) - radius * math.tan(abs(turn) / 2)
        groups[-1].append(_Piece(here, heading, 0.0, max(reach, 0.0)))
        if radius > 0:
            at = _ahead(here, heading, reach)
            arc = _Piece(at, heading, math.copysign(1 / radius, turn), radius * abs(turn))
            groups[-1].append(arc)
            here = _ahead(corner, heading + turn, radius * math.tan(abs(turn) / 2))
        else:
            here = corner
            groups.append([])
    return _sample_all([group for group in groups if group])


def _corner_radii(points: Sequence[Point], min_radius_m: float, cut_m: float) -> list[float]:
    """Give the radius at the end of each side; 0 where the rover stops there."""
    sides = np.array([math.dist(a, b) for a, b in pairwise(points)])
    share = np.full(len(sides), 0.5)
    share[[0, -1]] = 1.0
    room = np.minimum((sides * share)[:-1], (sides * share)[1:])
    half = np.abs([_turn(points, i) for i in range(1, len(sides))]) / 2
    # On a straight corner tan and 1/cos - 1 vanish together, and any radius rounds it.
    widest = room / np.maximum(np.tan(half), _STRAIGHT_RAD)
    within_cut = cut_m / np.maximum(1 / np.cos(half) - 1, _STRAIGHT_RAD)
    radius = np.minimum(widest, np.maximum(within_cut, min_radius_m))
    sharp = (radius < min_radius_m) | (half > _SHARPEST_HALF_RAD)
    return [*np.where(sharp, 0.0, radius).tolist(), 0.0]


def _heading(a: Point, b: Point) -> float:
    return math.atan2(b[1] - a[1], b[0] - a[0])


def _turn(points: Sequence[Point], i: int) -> float:
    change = _heading(points[i], points[i + 1]) - _heading(points[i - 1], points[i])
    return wrap_angle(change)


def _ahead(point: Point, heading: float, distance: float) -> Point:
    return point[0] + distance * math.cos(heading), point[1] + distance * math.sin(heading)


def wrap_angle(angle_rad: float) -> float:
    """Give the angle's equal in -pi..pi [rad]."""
    return math.remainder(angle_rad, 2 * math.pi)


def _sample_all(groups: list[list[_Piece]]) -> tuple[Leg, ...]:
    legs: list[Leg] = []
    for group in groups:
        start = legs[-1].start_m + legs[-1].length_m if legs else 0.0
        legs.append(_sample(group, start))
    return tuple(legs)


def _sample(pieces: list[_Piece], start_m: float) -> Leg:
    """Lay points along the pieces; the heading runs on without wrapping."""
    ends = np.cumsum([0.0, *(piece.length for piece in pieces)])
    s = np.linspace(0.0, ends[-1], max(2, math.ceil(ends[-1] / _SPACING_M) + 1))
    which = np.clip(np.searchsorted(ends, s, side="right") - 1, 0, len(pieces) - 1)
    along = s - ends[which]
    curvature = np.array([piece.curvature for piece in pieces])[which]
    heading_start = np.unwrap([piece.heading for piece in pieces])[which]
    heading = heading_start + curvature * along
    # The chord of an arc of angle a has the length l sinc(a/2) and the arc's mean heading.
    middle = (heading_start + heading) / 2
    chord = along * np.sinc(curvature * along / 2 / np.pi)
    origin = np.array([piece.start for piece in pieces])[which]
    xy = origin + chord[:, None] * np.stack([np.cos(middle), np.sin(middle)], axis=1)
    return Leg(start_m, s, xy, heading, curvature)
