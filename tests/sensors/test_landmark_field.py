"""Where landmarks are: as many as asked for, on the surfaces, the same for whoever asks."""

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from lpet_sim.sensors.landmark_far import FarField, pick_highest
from lpet_sim.sensors.landmark_field import GROUND, ROCK, LandmarkField, Landmarks
from lpet_sim.sensors.landmark_kernels import draw_sightings
from lpet_sim.sensors.landmark_spec import LandmarkFieldSpec
from lpet_sim.terrain.box import Box
from lpet_sim.terrain.load import load_terrain_spec
from lpet_sim.terrain.terrain import Terrain, build_terrain

SEED = 2
BOX = Box(-12.0, -9.0, 20.0, 15.0)


@pytest.fixture(scope="module")
def terrain() -> Terrain:
    """Build ground with rocks and hills."""
    return build_terrain(load_terrain_spec("exomars"), SEED)


@pytest.fixture(scope="module")
def strewn(terrain: Terrain) -> Landmarks:
    """Strew landmarks over a box."""
    return LandmarkField(terrain, LandmarkFieldSpec(), SEED).near(BOX)


def test_there_are_as_many_as_asked_for(terrain: Terrain, strewn: Landmarks) -> None:
    """Poisson counts on ground and rocks, to four sigma."""
    spec = LandmarkFieldSpec()
    rocks = len(terrain.rocks(BOX, spec.rock_min_diameter_m))
    expected = {GROUND: spec.ground_per_m2 * BOX.area_m2, ROCK: spec.per_rock * rocks}
    for kind, mean in expected.items():
        # Under a hundredth of those on rocks find no place above ground.
        slack = 4 * math.sqrt(mean) + (0.01 * mean if kind == ROCK else 0.0)
        assert np.sum(strewn.kind == kind) == pytest.approx(mean, abs=slack)
    assert len(np.unique(strewn.id)) == len(strewn)


def test_ground_landmarks_lie_on_the_ground_evenly(terrain: Terrain, strewn: Landmarks) -> None:
    """At its height, with its normal, and uniform over the box."""
    ground = strewn.select(strewn.kind == GROUND)
    xy = ground.p_world[:, :2]
    assert np.array_equal(ground.p_world[:, 2], terrain.height(xy))
    assert np.array_equal(ground.normal, terrain.normal(xy))
    assert BOX.contains(xy).all()
    counts = np.histogram2d(*xy.T, bins=(4, 3), range=((-12, 20), (-9, 15)))[0]
    mean = counts.mean()
    assert np.sum((counts - mean) ** 2) / mean < 31.3  # chi-square, 11 degrees, 0.1 %


def test_rock_landmarks_lie_on_facets_above_the_ground(terrain: Terrain, strewn: Landmarks) -> None:
    """Each on the hull of one rock, the normal that of its facet, outwards."""
    on_rocks = strewn.select(strewn.kind == ROCK)
    p = on_rocks.p_world
    assert np.all(p[:, 2] > terrain.height(p[:, :2]))
    assert np.linalg.norm(on_rocks.normal, axis=1) == pytest.approx(np.ones(len(p)))
    rocks = terrain.rocks(BOX, 0.1)
    best = np.full(len(p), np.inf)
    agree = np.zeros(len(p))
    for k in range(len(rocks)):
        near = np.flatnonzero(
            np.linalg.norm(p[:, :2] - rocks.p_world_rock[k, :2], axis=1) <= rocks.reach_m[k] + 1e-9
        )
        if len(near):
            hull = ConvexHull(rocks.mesh(k)[0] + rocks.p_world_rock[k])
            gap = p[near] @ hull.equations[:, :3].T + hull.equations[:, 3]
            facet = gap.argmax(axis=1)
            off = np.abs(gap.max(axis=1))
            closer = off < best[near]
            best[near] = np.minimum(best[near], off)
            same = np.sum(hull.equations[facet, :3] * on_rocks.normal[near], axis=1)
            agree[near] = np.where(closer, same, agree[near])
    assert best.max() < 1e-9
    assert np.mean(agree > 1 - 1e-6) > 0.99


def test_strength_fading_and_bias_are_independent_numbers(strewn: Landmarks) -> None:
    """Uniform and standard normal, to four sigma, and not correlated."""
    n = len(strewn)
    for uniform in (strewn.strength, strewn.fading):
        assert uniform.mean() == pytest.approx(0.5, abs=4 / math.sqrt(12 * n))
        assert uniform.var() == pytest.approx(1 / 12, abs=4 / math.sqrt(180 * n))
    assert np.abs(strewn.bias.mean(axis=0)).max() < 4 / math.sqrt(n)
    assert np.abs(strewn.bias.var(axis=0) - 1).max() < 4 * math.sqrt(2 / n)
    columns = np.vstack([strewn.strength, strewn.fading, strewn.bias.T, strewn.p_world[:, :2].T])
    # Places on rocks are clustered, so only what is drawn beside them is held to chance.
    correlation = np.corrcoef(columns)[:5, :5][np.triu_indices(5, 1)]
    assert np.abs(correlation).max() < 4.5 / math.sqrt(n)


def test_boxes_that_overlap_hold_the_same_landmarks(terrain: Terrain, strewn: Landmarks) -> None:
    """To the bit, whichever box asks, on terrain that nobody asked before."""
    fresh = build_terrain(load_terrain_spec("exomars"), SEED)
    inner = LandmarkField(fresh, LandmarkFieldSpec(), SEED).near(Box(3.0, -2.0, 9.0, 6.0))
    rows = {name: row for row, name in enumerate(strewn.id)}
    same = strewn.select(np.array([rows[name] for name in inner.id]))
    assert len(inner) > 100
    for name, array in inner.arrays().items():
        assert np.array_equal(array, same.arrays()[name])


def test_each_place_has_one_far_landmark_for_each_slot(terrain: Terrain) -> None:
    """At any place, none nearer than the far, at bearings all around."""
    spec = LandmarkFieldSpec()
    field = FarField(terrain, spec, SEED)
    box = Box(-30.0, -30.0, 50.0, 40.0)
    far = field.near(box)
    slots = round(2 * math.pi * spec.far_per_rad)
    rng = np.linspace(0.05, 0.95, 7)
    for x, y in zip(-30 + 80 * rng, 40 - 70 * rng, strict=True):
        eye = np.array([x, y, 2.0])
        allowed = np.ones(len(far.landmarks), np.bool_)
        rows = np.arange(len(allowed))
        p = far.landmarks.p_world
        pick_highest(p, rows, far.station, far.lattice, far.first_cell_m, eye, allowed)
        flat = p[allowed, :2] - eye[:2]
        assert allowed.sum() == slots
        assert np.linalg.norm(flat, axis=1).min() >= spec.far_from_m
        assert np.linalg.norm(flat, axis=1).max() <= field.reach_m
        bearings = np.histogram(np.arctan2(flat[:, 1], flat[:, 0]), bins=6)[0]
        assert bearings.min() > 0.3 * slots / 6


def test_what_is_drawn_for_a_sighting_depends_on_image_and_landmark_alone() -> None:
    """Any order, any company."""
    t_ns, name = np.array([5, 5, 9, 9]) * 720_000_000, np.array([31, 7, 31, 2**52])
    uniforms, normals = draw_sightings(17, t_ns, name)
    order = np.array([2, 0])
    again = draw_sightings(17, t_ns[order], name[order])
    assert np.array_equal(again[0], uniforms[order])
    assert np.array_equal(again[1], normals[order])
    assert len(np.unique(uniforms)) == uniforms.size
    assert not np.array_equal(draw_sightings(18, t_ns, name)[0], uniforms)
