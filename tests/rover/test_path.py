"""Planned paths: continuous, of limited curvature, near their waypoints."""

import math
from itertools import pairwise

import numpy as np
import pytest

from lpet_sim.rover.path import plan_legs

ZIGZAG = [(0.0, 0.0), (6.0, 0.0), (9.0, 4.0), (15.0, 4.0), (15.0, 12.0)]


def test_a_straight_line_stays_a_straight_line() -> None:
    """Waypoints along a line give one leg of curvature 0 and the line's length."""
    (leg,) = plan_legs([(0, 0), (1, 1), (2, 2), (5, 5)], 1.5, 0.3)
    assert leg.length_m == pytest.approx(5 * math.sqrt(2))
    np.testing.assert_allclose(leg.xy[:, 0], leg.xy[:, 1], atol=1e-12)
    np.testing.assert_allclose(leg.curvature, 0.0, atol=1e-5)


def test_rounded_corners_are_smooth_and_pass_near_their_waypoints() -> None:
    """Chords follow the heading, the heading follows the curvature, and corners are cut little."""
    (leg,) = plan_legs(ZIGZAG, 1.5, 0.3)
    assert np.abs(leg.curvature).max() <= 1 / 1.5 + 1e-12
    step = np.diff(leg.xy, axis=0)
    np.testing.assert_allclose(np.hypot(*step.T), np.diff(leg.s_m), rtol=1e-4)
    along = np.unwrap(np.arctan2(step[:, 1], step[:, 0]))
    np.testing.assert_allclose(along, (leg.heading_rad[1:] + leg.heading_rad[:-1]) / 2, atol=1e-2)
    for waypoint in ZIGZAG[1:-1]:
        assert np.hypot(*(leg.xy - waypoint).T).min() < 0.65
    np.testing.assert_allclose(leg.xy[[0, -1]], [ZIGZAG[0], ZIGZAG[-1]], atol=1e-9)


def test_an_arc_has_the_closed_form_of_its_corner() -> None:
    """A right angle rounded by R is shorter than its sides by ``(2 - pi/2) R``."""
    (leg,) = plan_legs([(0, 0), (10, 0), (10, 10)], 1.5, 0.3)
    radius = 1 / leg.curvature.max()
    assert radius == pytest.approx(1.5)
    assert leg.length_m == pytest.approx(20 - (2 - math.pi / 2) * radius)


def test_a_corner_too_sharp_to_round_splits_the_path() -> None:
    """A hairpin and a short side become turns on the spot; the distance runs on."""
    legs = plan_legs([(0, 0), (5, 0), (0.2, 0.1), (0.2, 0.8), (3, 0.8)], 1.5, 0.3)
    assert len(legs) == 4
    for before, after in pairwise(legs):
        assert after.start_m == pytest.approx(before.start_m + before.length_m)
        np.testing.assert_allclose(before.xy[-1], after.xy[0], atol=1e-9)


def test_a_dense_polyline_is_followed_closely() -> None:
    """A circle given as 5 deg chords is driven at about its own curvature."""
    angle = np.radians(np.arange(0, 181, 5))
    points = [(4 * math.sin(a), 4 - 4 * math.cos(a)) for a in angle]
    (leg,) = plan_legs(points, 1.5, 0.3)
    radius = np.hypot(leg.xy[:, 0], leg.xy[:, 1] - 4)
    assert np.abs(radius - 4).max() < 0.01
    assert np.median(leg.curvature) == pytest.approx(0.25, rel=0.02)
